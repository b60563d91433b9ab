"""What a vote came to: as one JSON object, and as tables for people."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from rig.console import Screen
from rig.frame import Pattern, State
from rig.offline.align import Corrections
from rig.offline.clock import Floats
from rig.offline.discrete_vote import VotedDiscrete
from rig.offline.recording import Recording
from rig.offline.vote import Voted
from rig.offline.write_votes import Result

_SINGULAR = [int(pattern) for pattern in Pattern if pattern.is_singular]


def summary(recording: Recording, voted: Result, corrections: Corrections | None) -> dict[str, Any]:
    """Per signal and channel; rows are counted from 1 as in the input."""
    return {
        "rows": len(recording.time_s),
        "first_row": recording.row(0),
        "rate_hz": recording.rate_hz,
        "time_s": [float(recording.time_s[0]), float(recording.time_s[-1])],
        "repaired": [asdict(repair) for repair in recording.repairs],
        "not_voted": [name for name in recording.signals if name not in voted.signals],
        "signals": {name: _signal(signal, (corrections or {}).get(name)) for name, signal in voted.signals.items()},
        "discretes": {name: _discrete(discrete) for name, discrete in voted.discretes.items()},
    }


def _signal(signal: Voted, corrections: list[Any] | None) -> dict[str, Any]:
    return {
        "manager": signal.settings.manager,
        "threshold": signal.settings.threshold,
        "level": int(signal.level[-1]),
        "singular_share": float(np.isin(signal.pattern, _SINGULAR).mean()),
        "spread": _spread(signal.spread),
        "voted": _extremes(signal.voted),
        "channels": [_channel(signal, c, corrections) for c in range(len(signal.state))],
    }


def _discrete(discrete: VotedDiscrete) -> dict[str, Any]:
    return {
        "fail_safe": discrete.settings.fail_safe,
        "level": int(discrete.level[-1]),
        "ones_share": float(discrete.voted.mean()),
        "changes": int((discrete.voted[1:] != discrete.voted[:-1]).sum()),
        "channels": [_channel(discrete, c, None) for c in range(len(discrete.state))],
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


def _channel(signal: Voted | VotedDiscrete, c: int, corrections: list[Any] | None) -> dict[str, Any]:
    said: dict[str, Any] = {
        "channel": c + 1,
        "state": State(signal.state[c][-1]).name.lower(),
        "failed": [
            {"frame": failure.frame, "time_s": failure.time_s, "why": failure.why}
            for failure in signal.failures
            if failure.channel == c + 1
        ],
        "invalid_samples": signal.invalid[c],
    }
    if corrections is not None:
        found = corrections[c]
        said["alignment"] = {name: getattr(found, name) for name in found.__slots__}
    return said


def show(screen: Screen, found: dict[str, Any]) -> None:
    """The summary as tables, how long each step took, and where the votes are."""
    first, last = found["time_s"]
    screen.print(f"{found['rows']} rows from {first:g} to {last:g} s, {found['rate_hz']:g} a second")
    for repair in found["repaired"]:
        screen.print(_repaired(repair), soft_wrap=True)
    aligned = any("alignment" in channel for signal in found["signals"].values() for channel in signal["channels"])
    if aligned:
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
    rows = []
    for name, signal in found["signals"].items():
        for channel in signal["channels"]:
            a = channel["alignment"]
            note = "" if a["aligned"] else "left alone: like no other channel"
            delay = (f"{a['delay_frames']:.2f}", f"{1e3 * a['delay_s']:.2f}")
            rows.append((f"{name}.{channel['channel']}", *delay, _number(a["offset"]), f"{a['correlation']:.2f}", note))
    screen.table(("channel", "delay in frames", "in ms", "offset", "correlation", ""), rows)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
