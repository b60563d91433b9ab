"""Words about a fault of servo actuators: which monitor detected it when, and whether a surface was lost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rig.core.units.quantities import duration, seconds
from rig.flight.conclusion_rows import Row
from rig.verdict.context import Context, after, channels, listed
from rig.verdict.score_records import ActuatorScore, FaultScore
from rig.world.faults import KINDS
from rig.world.faults.places import OF_SERVOS, site

MONITORS: Final = {
    "current": "current monitor",
    "continuity": "coil-continuity monitor",
    "spool": "spool monitor",
    "position": "position monitor",
    "ram": "ram monitor",
    "valve": "switch of the valve",
}


def monitor_words(name: str) -> str:
    """Return a monitor of a servo as it is written: ``current monitor``."""
    return MONITORS.get(name, f"{name} monitor")


def on_servos(fault: FaultScore) -> bool:
    """Return True if a fault sits on a servo actuator or its hydraulics."""
    return site(fault.signal) in OF_SERVOS


def servo_result(fault: FaultScore, context: Context) -> str:
    """Return the outcome of a fault on servos: ``isolated after 50 ms by the current monitor``."""
    if not context.score.actuators:
        return "not scored: the log has no rows of the servos"
    result = {"detected": _found, "missed": _missed, "undetectable": _silent}[fault.outcome]
    told = result(fault, context)
    if fault.bypassed_frame is None:
        return told
    frames = fault.bypassed_frame - (fault.onset_frame or 0)
    return f"{told}, {listed(fault.bypassed)} bypassed {after(frames, context.rate_hz)}"


def _found(fault: FaultScore, context: Context) -> str:
    by = f"{after(fault.delay_from_onset_frames, context.rate_hz)} by the {monitor_words(fault.decided_by or '')}"
    if fault.decided_by == "valve":
        return f"detected {by}"  # which isolates no channel
    on = "" if fault.channel is not None else f"{_failed_for(fault, context)} "
    return f"{on}isolated {by}"


def _failed_for(fault: FaultScore, context: Context) -> str:
    """Return the channels of a surface that were isolated in the frame in which what they share was detected."""
    return listed(
        [
            f"{name} {channels(numbers)}"
            for name, score in context.score.actuators.items()
            if (numbers := [failure.channel for failure in score.failures if failure.frame == fault.failed_frame])
        ]
    )


def _missed(fault: FaultScore, context: Context) -> str:
    if not context.scenario.actuators.monitors:
        return "not isolated: the monitors are switched off"
    if fault.exceeded_frame is None:  # it cost a surface
        return _silent(fault, context)
    longest = duration(fault.exceeded_run_frames, context.rate_hz)
    if fault.tolerated:
        return f"not isolated: a monitor threshold was exceeded for {longest}, shorter than the persistence"
    return f"not isolated, although a monitor threshold was exceeded for {longest}"


def _silent(fault: FaultScore, context: Context) -> str:
    return f"not isolated: {KINDS[fault.kind].unseen or 'no monitor threshold was exceeded'}"


def bypass_rows(context: Context) -> Iterator[Row]:
    """Yield a row for each surface that was bypassed, if the row of its fault does not tell it."""
    frames, rate_hz = context.score.flight.frames, context.rate_hz
    told = {name for fault in context.score.faults for name in fault.bypassed}
    for name, score in context.score.actuators.items():
        text = bypass_text(score, frames, rate_hz)
        if text and (name not in told or not text.endswith(" on")):
            yield Row(name, (text,))


def bypass_text(score: ActuatorScore, frames: int, rate_hz: float) -> str:
    """Return when no channel moved a surface in a flight of ``frames``; "" if it was moved at all times."""
    first = score.bypassed_frame
    if first is None:
        return ""
    if first + score.bypassed_frames == frames:
        return f"bypassed from {seconds(first, rate_hz)} on"
    return f"bypassed at {seconds(first, rate_hz)}, for {duration(score.bypassed_frames, rate_hz)} in all"
