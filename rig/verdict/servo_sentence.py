"""What became of a fault of servo actuators, in words: who found it when, and whether it cost a surface."""

from __future__ import annotations

from typing import Final

from rig.core.units.quantities import duration, seconds
from rig.verdict.context import Context, channels
from rig.verdict.score_records import ActuatorScore, FaultScore
from rig.world.faults import KINDS
from rig.world.faults.places import OF_SERVOS, site

_NAMES: Final = {"valve": "the valve's switch"}


def on_servos(fault: FaultScore) -> bool:
    """Return True if a fault sits on a servo actuator or its hydraulics."""
    return site(fault.signal) in OF_SERVOS


def actuator_result(fault: FaultScore, context: Context) -> str:
    """Return what became of a fault on servos: ``was found by current after 50 ms; elevator bypassed at once``."""
    if not context.score.actuators:
        return "was not looked at: the rows of the servos are missing"
    sentence = {"detected": _found, "missed": _missed, "undetectable": _silent}[fault.outcome]
    told = sentence(fault, context)
    if fault.bypassed_frame is None:
        return told
    frames = fault.bypassed_frame - (fault.onset_frame or 0)
    when = f"{duration(frames, context.rate_hz)} after it" if frames else "at once"
    return f"{told}; {listed(fault.bypassed)} bypassed {when}"


def _found(fault: FaultScore, context: Context) -> str:
    after = duration(fault.delay_from_onset_frames, context.rate_hz)
    on = "" if fault.channel is not None else f" on {_failed_for(fault, context)}"
    return f"was found by {_NAMES.get(fault.decided_by or '', fault.decided_by)} after {after}{on}"


def _failed_for(fault: FaultScore, context: Context) -> str:
    """Return the channels of a surface, failed in the frame in which what they share was found to be broken."""
    named = [
        f"{name} {channels(numbers)}"
        for name, score in context.score.actuators.items()
        if (numbers := [failure.channel for failure in score.failures if failure.frame == fault.failed_frame])
    ]
    return " and ".join(named)


def _missed(fault: FaultScore, context: Context) -> str:
    if not context.scenario.actuators.monitors:
        return "was not found: the monitors are switched off"
    if fault.exceeded_frame is None:  # it cost a surface
        return _silent(fault, context)
    longest = duration(fault.exceeded_run_frames, context.rate_hz)
    why = ", shorter than the persistence" if fault.tolerated else ""
    return f"was not found: a threshold of its monitors was left for {longest} at most{why}"


def _silent(fault: FaultScore, context: Context) -> str:
    return f"was not found: {KINDS[fault.kind].unseen or 'no monitor left its threshold'}"


def bypassed(context: Context) -> str:
    """Return the surfaces that nobody moved at some time, with the time: ``elevator bypassed from 5.30 s on``."""
    frames, rate_hz = context.score.flight.frames, context.rate_hz
    texts = ((name, bypass_text(score, frames, rate_hz)) for name, score in context.score.actuators.items())
    return ", ".join(f"{name} {text}" for name, text in texts if text)


def bypass_text(score: ActuatorScore, frames: int, rate_hz: float) -> str:
    """Return when nobody moved a surface, of a flight of so many ``frames``; "" if it was moved at all times."""
    first = score.bypassed_frame
    if first is None:
        return ""
    if first + score.bypassed_frames == frames:
        return f"bypassed from {seconds(first, rate_hz)} on"
    return f"bypassed at {seconds(first, rate_hz)}, for {duration(score.bypassed_frames, rate_hz)} in all"


def listed(names: tuple[str, ...]) -> str:
    """Return names as people list them: ``elevator, aileron and rudder``."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last
