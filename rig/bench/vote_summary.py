"""Summary of a vote, as one JSON object."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from rig.bench.told_beside import first_row_lines, from_first_row, shown_beside
from rig.bench.vote_rows import Result, Voted, VotedDiscrete
from rig.core.frame import DecidedBy, Pattern, State
from rig.flight.suspects import Suspect, is_many, share_text
from rig.log.recordings.alignment import Alignment
from rig.log.recordings.recording import Recording
from rig.log.recordings.stamps import Floats, of_rows

_NEVER = ", never given up"
_OFFSETS = ("offset", "offset_move", "spread")  # of an alignment, in the unit of the signal
_SPLITS = [int(pattern) for pattern in Pattern if pattern.is_split]


def summary(recording: Recording, voted: Result, alignment: Alignment | None = None) -> dict[str, Any]:
    """Return the summary per signal and channel; rows are counted from 1 as in the input."""
    data = {
        "rows": len(recording.time_s),
        "first_row": recording.row(0),
        "rate_hz": recording.rate_hz,
        "time_s": [float(recording.time_s[0]), float(recording.time_s[-1])],
        "duration_s": float(recording.time_s[-1] - recording.time_s[0]),
        "repaired": [asdict(repair) for repair in recording.repairs],
        "remarks": list(recording.remarks),
        "warnings": list(recording.warnings),
        "not_voted": [name for name in recording.signals if name not in voted.signals],
        "signals": {name: _signal(signal) for name, signal in voted.signals.items()},
        "discretes": {name: _discrete(discrete) for name, discrete in voted.discretes.items()},
    }
    _since_first_row(data)
    for name, signal in voted.signals.items():
        data["signals"][name] |= shown_beside(recording.signals[name], signal)
    data["suspects"], data["undecided"] = _slow_faults(data), _undecided(data)
    data["from_first_row"] = [
        line for name, signal in data["signals"].items() for line in first_row_lines(name, signal)
    ]
    if alignment is not None:
        first_s = data["time_s"][0]
        since = [at_s - first_s for at_s in (alignment.from_s, alignment.to_s)]
        data["alignment"] = {**alignment.as_dict(), "since_first_row_s": since}
        for name, signal in data["signals"].items():
            for channel, took, move in zip(
                signal["channels"], alignment.corrections[name], alignment.moves[name], strict=True
            ):
                shown = voted.signals[name].settings.shown
                both = {**asdict(took), **asdict(move)}
                channel["alignment"] = {**both, **{key: shown(both[key]) for key in _OFFSETS}}
    return data


def _signal(signal: Voted) -> dict[str, Any]:
    shown, unresolved = signal.settings.shown, signal.decided_by == DecidedBy.UNRESOLVED
    return {
        "manager": signal.settings.manager,
        "unit": signal.settings.unit,
        "threshold": shown(signal.settings.threshold),
        "level": int(signal.level[-1]),
        "split_share": float(np.isin(signal.pattern, _SPLITS).mean()),
        "unresolved_rows": int(unresolved.sum()),
        "unresolved_share": float(unresolved.mean()),
        "spread": _spread(shown(signal.spread)),
        "voted": _extremes(shown(signal.voted)),
        "channels": [_channel(signal, c) for c in range(len(signal.state))],
    }


def _since_first_row(data: dict[str, Any]) -> None:
    """Add to each isolation its time since the first row."""
    for group in (*data["signals"].values(), *data["discretes"].values()):
        for failed in (failed for channel in group["channels"] for failed in channel["failed"]):
            failed["since_first_row_s"] = failed["time_s"] - data["time_s"][0]


def _discrete(discrete: VotedDiscrete) -> dict[str, Any]:
    return {
        "fail_safe": discrete.settings.fail_safe,
        "level": int(discrete.level[-1]),
        "ones_share": float(discrete.voted.mean()),
        "changes": int((discrete.voted[1:] != discrete.voted[:-1]).sum()),
        "channels": [_channel(discrete, c) for c in range(len(discrete.state))],
    }


def _extremes(voted: Floats) -> dict[str, float | None]:
    finite = voted[np.isfinite(voted)]
    return {"min": float(finite.min()), "max": float(finite.max())} if len(finite) else {"min": None, "max": None}


def _spread(spread: Floats) -> dict[str, float | None]:
    finite = spread[np.isfinite(spread)]
    if len(finite) == 0:
        return {"median": None, "p95": None, "max": None}
    median, p95 = np.quantile(finite, [0.5, 0.95])
    return {"median": float(median), "p95": float(p95), "max": float(finite.max())}


def _channel(signal: Voted | VotedDiscrete, c: int) -> dict[str, Any]:
    rows, suspect = len(signal.state[c]), signal.suspect[c]
    return {
        "channel": c + 1,
        "state": State(signal.state[c][-1]).name.lower(),
        "failed": [
            {"frame": failure.frame, "time_s": failure.time_s, "why": failure.why}
            for failure in signal.failures
            if failure.channel == c + 1
        ],
        "invalid_samples": signal.invalid[c],
        "suspect_rows": suspect,
        "suspect_share": suspect / rows,
        "from_first_row": from_first_row(signal.state[c], signal.settings.bad_from_start, c)
        if isinstance(signal, Voted)
        else False,
    }


def _slow_faults(data: dict[str, Any]) -> list[str]:
    """Return a line for each channel of a summary that was suspect in many rows and never isolated."""
    suspects = (
        Suspect(name, channel["channel"], channel["suspect_rows"], data["rows"], bool(channel["failed"]))
        for name, group in {**data["signals"], **data["discretes"]}.items()
        for channel in group["channels"]
    )
    return [f"{one.signal}.{one.channel}: suspect {one.text('rows')}" for one in suspects if one.slow_faults]


def _undecided(data: dict[str, Any]) -> list[str]:
    """Return a line for each signal with many rows of an unresolved split, and the time of giving up."""
    lines: list[str] = []
    for name, signal in data["signals"].items():
        rows = signal["unresolved_rows"]
        failures = [failure for channel in signal["channels"] for failure in channel["failed"]]
        given_up = [failure["time_s"] for failure in failures if failure["why"] == DecidedBy.GIVEN_UP.name.lower()]
        if is_many(rows, data["rows"]):
            end = "".join(f", given up at {of_rows(at_s, data['time_s'][0])}" for at_s in dict.fromkeys(given_up))
            lines.append(f"{name}: split that no rule decided, {share_text(rows, data['rows'])}{end or _NEVER}")
    return lines
