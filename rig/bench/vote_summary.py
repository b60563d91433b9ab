"""What a vote came to: as one JSON object, and as tables for people."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from rig.bench.vote import Result, Voted, VotedDiscrete
from rig.frame import Pattern, State
from rig.recordings.alignment import Alignment
from rig.recordings.clock import Floats
from rig.recordings.recording import Recording
from rig.util.console import Screen

_SINGULAR = [int(pattern) for pattern in Pattern if pattern.is_singular]


def summary(recording: Recording, voted: Result, alignment: Alignment | None = None) -> dict[str, Any]:
    """Per signal and channel; rows are counted from 1 as in the input."""
    found = {
        "rows": len(recording.time_s),
        "first_row": recording.row(0),
        "rate_hz": recording.rate_hz,
        "time_s": [float(recording.time_s[0]), float(recording.time_s[-1])],
        "repaired": [asdict(repair) for repair in recording.repairs],
        "not_voted": [name for name in recording.signals if name not in voted.signals],
        "signals": {name: _signal(signal) for name, signal in voted.signals.items()},
        "discretes": {name: _discrete(discrete) for name, discrete in voted.discretes.items()},
    }
    if alignment is not None:
        found["alignment"] = alignment.as_dict()
        for name, signal in found["signals"].items():
            for channel, took, move in zip(
                signal["channels"], alignment.corrections[name], alignment.moves[name], strict=True
            ):
                channel["alignment"] = {**asdict(took), **asdict(move)}
    return found


def _signal(signal: Voted) -> dict[str, Any]:
    return {
        "manager": signal.settings.manager,
        "threshold": signal.settings.threshold,
        "level": int(signal.level[-1]),
        "singular_share": float(np.isin(signal.pattern, _SINGULAR).mean()),
        "spread": _spread(signal.spread),
        "voted": _extremes(signal.voted),
        "channels": [_channel(signal, c) for c in range(len(signal.state))],
    }


def _discrete(discrete: VotedDiscrete) -> dict[str, Any]:
    return {
        "fail_safe": discrete.settings.fail_safe,
        "level": int(discrete.level[-1]),
        "ones_share": float(discrete.voted.mean()),
        "changes": int((discrete.voted[1:] != discrete.voted[:-1]).sum()),
        "channels": [_channel(discrete, c) for c in range(len(discrete.state))],
    }


def _extremes(voted: Floats) -> dict[str, float | None]:
    known = voted[np.isfinite(voted)]
    return {"min": float(known.min()), "max": float(known.max())} if len(known) else {"min": None, "max": None}


def _spread(spread: Floats) -> dict[str, float | None]:
    known = spread[np.isfinite(spread)]
    if len(known) == 0:
        return {"median": None, "p95": None, "max": None}
    median, p95 = np.quantile(known, [0.5, 0.95])
    return {"median": float(median), "p95": float(p95), "max": float(known.max())}


def _channel(signal: Voted | VotedDiscrete, c: int) -> dict[str, Any]:
    return {
        "channel": c + 1,
        "state": State(signal.state[c][-1]).name.lower(),
        "failed": [
            {"frame": failure.frame, "time_s": failure.time_s, "why": failure.why}
            for failure in signal.failures
            if failure.channel == c + 1
        ],
        "invalid_samples": signal.invalid[c],
    }


def show(screen: Screen, found: dict[str, Any]) -> None:
    """Print the summary as tables, how long each step took, and where the votes are."""
    first, last = found["time_s"]
    screen.print(f"{found['rows']} rows from {first:g} to {last:g} s, {found['rate_hz']:g} a second")
    for repair in found["repaired"]:
        screen.print(_repaired(repair), soft_wrap=True)
    if "alignment" in found:
        _alignments(screen, found)
    if found["signals"]:
        _signals(screen, found)
    if found["discretes"]:
        _discretes(screen, found)
    _failures(screen, found)
    if "injected" in found:
        _injected(screen, found["injected"])
    if found["not_voted"]:
        screen.print(f"not voted, as CONFIG does not name them: {', '.join(found['not_voted'])}")
    screen.print(", ".join(f"{stage} {taken:.2f} s" for stage, taken in found["seconds"].items()))
    screen.print(f"written  {found['out']}", soft_wrap=True)


def _repaired(repair: dict[str, Any]) -> str:
    rows = ", ".join(map(str, repair["first"])) + (", ..." if repair["dropped"] > len(repair["first"]) else "")
    of = f"{repair['rows']} rows of {repair['source']}"
    return f"dropped {repair['dropped']} of {of}, where time repeats or steps back: {rows}"


def _signals(screen: Screen, found: dict[str, Any]) -> None:
    rows = []
    for name, signal in found["signals"].items():
        spread = [_number(value) for value in signal["spread"].values()]
        voted = [_number(value) for value in signal["voted"].values()]
        rows.append((name, str(signal["level"]), f"{100 * signal['singular_share']:.3g} %", *spread, *voted))
    screen.table(("signal", "level", "singular frames", "spread median", "95 %", "worst", "voted from", "to"), rows)


def _discretes(screen: Screen, found: dict[str, Any]) -> None:
    rows = []
    for name, discrete in found["discretes"].items():
        share = f"{100 * discrete['ones_share']:.3g} %"
        rows.append((name, str(discrete["level"]), str(discrete["fail_safe"]), share, str(discrete["changes"])))
    screen.table(("discrete", "level", "fail-safe", "voted 1", "changes"), rows)


def _failures(screen: Screen, found: dict[str, Any]) -> None:
    rows = []
    for name, signal in {**found["signals"], **found["discretes"]}.items():
        for channel in signal["channels"]:
            times = [(str(f["frame"]), f"{f['time_s']:.6g} s", f["why"]) for f in channel["failed"]]
            first, *again = times or [("never", "", "")]
            rows.append((f"{name}.{channel['channel']}", channel["state"], *first, str(channel["invalid_samples"])))
            rows += [("", "", *later, "") for later in again]
    screen.table(("channel", "at the end", "failed in frame", "at", "by", "invalid samples"), rows)


def _injected(screen: Screen, injected: dict[str, Any]) -> None:
    rows = []
    for one in injected["faults"]:
        onset = "" if one["onset_s"] is None else f"{one['onset_s']:.6g} s"
        failed = "" if one["failed_channel"] is None else f"{one['signal']}.{one['failed_channel']}"
        delay = "" if one["delay_s"] is None else f"{one['delay_s']:.3f} s"
        channel = f"{one['signal']}.{one['channel']}"
        rows.append((one["fault"], channel, onset, one["outcome"], failed, delay, one["by"] or ""))
    screen.table(("injected", "channel", "onset", "outcome", "failed", "delay", "by"), rows)


def _alignments(screen: Screen, found: dict[str, Any]) -> None:
    about = found["alignment"]
    chosen = ", as no --align-to is given" if about["by_default"] else ""
    screen.print(f"aligned by {about['rows']} rows from {about['from_s']:g} to {about['to_s']:g} s{chosen}")
    rows = []
    for name, signal in found["signals"].items():
        for channel in signal["channels"]:
            a = channel["alignment"]
            note = "" if a["aligned"] else "left alone: like no other channel"
            delay = (f"{a['delay_frames']:.2f}", f"{1e3 * a['delay_s']:.2f}")
            rows.append((f"{name}.{channel['channel']}", *delay, _number(a["offset"]), f"{a['correlation']:.2f}", note))
    screen.table(("channel", "delay in frames", "in ms", "offset", "correlation", ""), rows)
    if about["matrices"]:
        _matrices(screen, about["matrices"])
    for warning in about["warnings"]:
        screen.print(f"warning: {warning}", soft_wrap=True)


def _matrices(screen: Screen, matrices: list[dict[str, Any]]) -> None:
    rows = []
    for one in matrices:
        note = "" if one["applied"] else "left alone: no misalignment that can be believed"
        gains = f"{one['gains'][-1]:.3f} to {one['gains'][0]:.3f}"
        rms = (_number(one["rms_before"]), _number(one["rms_after"]))
        rows.append((f"{one['triad']}, channel {one['channel']}", f"{one['rotation_deg']:.2f}", gains, *rms, note))
    screen.table(("triad", "turned by, deg", "gains", "off before, rms", "after", ""), rows)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
