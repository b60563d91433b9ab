"""Findings of the fault-tolerant law: when it corrected the pitch angle or declared a rate biased, and why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import INDEX, SIGNALS, SensorFault, Table, Trust
from rig.core.units.angles import differences
from rig.core.units.quantities import seconds
from rig.flight.conclusion_rows import Row
from rig.verdict.context import Context
from rig.verdict.score_records import FaultScore, LawFinding
from rig.verdict.words import fault_word

LAW: Final = "law"  # who found a fault: the fault-tolerant law
CORRECTED: Final = "pitch angle corrected"
BIASED: Final = "rate biased"
NAMES: Final = {
    SensorFault.EFFECTIVENESS: "effectiveness",
    SensorFault.OFFSET: "offset",
    SensorFault.BOTH: "effectiveness and offset",
}
_TESTED: Final = {CORRECTED: ("pitch_angle",), BIASED: ("pitch_rate", "yaw_rate", "roll_angle", "heading")}
_INNOVATION: Final = 5  # of frame.ESTIMATES
_SHARE: Final = 0.5  # of an innovation that faults must have caused, and of the largest effect on a rate
_NOTHING: Final = 1e-9


def news(table: Table, before: Table | None) -> Table:
    """Return the frames in which the law's trust in the pitch angle, or what it calls faulty, is another than before.

    before : earlier frames, of which the last that was news counts; None: none was
    """
    last = (Trust.NONE, SensorFault.NONE) if before is None else (before["trust"][-1], before["sensor_fault"][-1])
    changed = [
        np.diff(table[name], prepend=was) != 0 for name, was in zip(("trust", "sensor_fault"), last, strict=True)
    ]
    return table[np.logical_or(*changed)]


def findings(frames: Table, params: NDArray[np.void]) -> list[LawFinding]:
    """Return what the law found in a flight: ``frames`` are its news, with their clean channels.

    params : (S,) config.PARAMS
    """
    found: list[LawFinding] = []
    trusted, called = int(Trust.NONE), int(SensorFault.NONE)
    for row, clean in zip(frames.rows, frames.clean, strict=True):
        trust, sensor_fault = int(row["trust"]), int(row["sensor_fault"])
        if trust != trusted and trust == Trust.CORRECTED:
            found.append(_found(CORRECTED, row, clean, params))
        if sensor_fault != called and sensor_fault == SensorFault.RATE_BIAS:
            found.append(_found(BIASED, row, clean, params))
        elif sensor_fault in NAMES and found and found[-1].finding == CORRECTED and found[-1].named_frame is None:
            found[-1] = replace(found[-1], named=NAMES[SensorFault(sensor_fault)], named_frame=int(row["frame"]))
        trusted, called = trust, sensor_fault
    return found


def _found(finding: str, row: Any, clean: Any, params: NDArray[np.void]) -> LawFinding:
    """Return a finding with the signals whose votes faults had moved enough to be its cause."""
    moved = {name: _moved(INDEX[name], row, clean, params) for name in _TESTED[finding]}
    least = _SHARE * max(moved.values()) if finding == BIASED else _SHARE * abs(float(row["estimate"][_INNOVATION]))
    for_signals = tuple(name for name, size in moved.items() if size > _NOTHING and size >= least)
    return LawFinding(finding, int(row["frame"]), for_signals)


def _moved(s: int, row: Any, clean: Any, params: NDArray[np.void]) -> float:
    """Return how far faults have moved a vote from that of the clean channels, in thresholds; of pitch in rad."""
    fitted, wraps, truth = int(params["fitted"][s]), SIGNALS[s].wraps, row["truth"][s]
    channels = clean["channels"][s][:fitted]
    of_clean = float(np.median(differences(channels, np.full(fitted, truth), wraps)))
    off = abs(float(differences(row["voted"][s], truth, wraps)) - of_clean)
    return off if s == INDEX["pitch_angle"] else off / float(params["threshold"][s])


def completed(fault: FaultScore, acted_until: int, found: Sequence[LawFinding]) -> FaultScore:
    """Return the outcome of a fault on a channel: found, if the law found it; as it is otherwise.

    acted_until : the last frame in which it can be the cause of a finding
    """
    onset = fault.onset_frame
    if fault.channel is None or onset is None or fault.outcome == "not executed":
        return fault
    frames = [each.frame for each in found if fault.signal in each.signals]
    first = next((frame for frame in frames if onset <= frame <= acted_until), None)
    if first is None or fault.failed_frame is not None:
        return replace(fault, law_frame=first)
    exceeded = fault.exceeded_frame
    return replace(
        fault,
        outcome="detected",
        word=fault_word(True, True, True, fault.word == "wrong channel"),
        law_frame=first,
        delay_from_onset_frames=first - onset,
        delay_from_exceeded_frames=None if exceeded is None else first - exceeded,
        decided_by=LAW,
        tolerated=False,
    )


def law_result(fault: FaultScore, context: Context) -> str:
    """Return what the law did about a fault that it detected: ``it used its estimate from 30.86 s on``."""
    finding = next(each for each in context.score.law if each.frame == fault.law_frame and fault.signal in each.signals)
    at = seconds(finding.frame, context.rate_hz)
    if finding.finding != CORRECTED:
        return f"it declared a rate biased at {at} and used the pitch-angle sensor"
    named = ""
    if finding.named_frame is not None:
        named = f"; at {seconds(finding.named_frame, context.rate_hz)} it identified the fault: {finding.named}"
    return f"it used its estimate of the pitch angle from {at} on{named}"


def false_findings(context: Context) -> Iterator[Row]:
    """Yield a row for each finding that no fault caused."""
    for finding in context.score.law:
        if not finding.signals:
            what = "corrected the pitch angle" if finding.finding == CORRECTED else "declared a rate biased"
            at = seconds(finding.frame, context.rate_hz)
            yield Row(
                "fault-tolerant law", (f"{what} by mistake at {at}: no fault had moved the signals that it tests",)
            )
