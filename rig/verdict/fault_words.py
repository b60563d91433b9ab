"""Words about one fault on a channel: isolated after how long by what, or why not; and why it took long."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rig.core.frame import DISCRETE_INDEX, INDEX
from rig.core.units.quantities import duration, quantity, seconds
from rig.verdict.context import Agreement, Context, after, agreement_of, longest_run
from rig.verdict.counting import COMPARISON, Climb, another, climb
from rig.verdict.lane_tally import on_lanes
from rig.verdict.lane_words import lane_result
from rig.verdict.law_tally import law_result
from rig.verdict.monitored_places import references_of
from rig.verdict.score_records import FaultScore
from rig.verdict.servo_words import on_servos, servo_result
from rig.world.faults import KINDS
from rig.world.faults.places import site

_RULES: Final = {
    "ilm": "by the in-line monitors",
    "extremes": "as one of the two extremes",
    "middle": "because it was not the middle channel",
    "box": "with its whole LRU",
    "common": "with all channels: two references disagreed with them",
    "slow": "by a slow-fault rule",
    "slow_means": "by the slow-fault test of means",
    "slow_squares": "by the slow-fault test of mean squares",
    "slow_halves": "by the slow-fault test of halves against the reference",
    "lane": "because its computer was isolated",
    "given_up": "with all channels: no tie-break rule settled the split",
}


def fault_result(fault: FaultScore, context: Context) -> str:
    """Return the outcome of a fault: ``isolated after 70 ms by comparison``."""
    if fault.outcome == "not executed":
        return "its trigger never fired" if fault.onset_frame is None else "the channel was already isolated"
    if on_servos(fault):
        return servo_result(fault, context)
    if on_lanes(fault):
        return lane_result(fault, context)
    return {"detected": _detected, "missed": _missed, "undetectable": _undetectable}[fault.outcome](fault, context)


def by_rule(decided_by: str | None, given: str = "") -> str:
    """Return what isolated a channel: ``by comparison``, ``by the reference``; or what is ``given``."""
    if decided_by == COMPARISON:
        return given or "by comparison"
    return given or _RULES.get(decided_by or "", f"by the {decided_by}")


def reasons(fault: FaultScore, context: Context) -> tuple[str, ...]:
    """Return why a channel was isolated late or never, and what the fault-tolerant law did; a text of a line each."""
    reasons = []
    on_signal = fault.channel is not None and fault.signal in INDEX
    if fault.outcome == "missed" and on_signal and not fault.tolerated:
        reasons.append(_why_missed(fault, context))
    compared = fault.decided_by == COMPARISON and fault.signal in INDEX and context.compares(fault)
    if fault.outcome == "detected" and compared and another(fault, context) is None:
        found = climb(fault, context)
        reasons += filter(None, (_late(fault, context, found.first), _miscompared(found)))
    if fault.outcome == "detected" and fault.law_frame is not None:
        also = "" if fault.failed_frame is None else "also detected by the fault-tolerant law: "
        reasons.append(f"{also}{law_result(fault, context)}")
    return tuple(reasons)


def _detected(fault: FaultScore, context: Context) -> str:
    when = after(fault.delay_from_onset_frames, context.rate_hz)
    if fault.failed_frame is None:
        return f"detected {when} by the fault-tolerant law"
    if fault.channel is None:
        return f"detected {when}: the manager declared the reference unusable"
    if (cause := another(fault, context)) is not None:
        failed, began = (seconds(frame or 0, context.rate_hz) for frame in (fault.failed_frame, cause.onset_frame))
        kind = cause.kind.replace("_", " ")
        return f"not isolated for it: the channel was isolated at {failed} for its {kind} that began at {began}"
    by = ""
    if fault.decided_by == COMPARISON:
        by = "by comparison" if fault.signal in DISCRETE_INDEX or context.compares(fault) else f"by {context.decider}"
        by = f"by {context.decider}" if context.score.evidence.by_unit else by
    return f"isolated {when} {by_rule(fault.decided_by, by)}"


def _miscompared(found: Climb) -> str:
    """Return in how many frames the channel miscompared, where not all of them were counted; "" otherwise."""
    frames, alone, counted = len(found.alone), int(found.alone.sum()), int(found.counted.sum())
    if not alone or alone == frames == counted:
        return ""
    text = f"it miscompared in {alone} of {frames} frames before that"
    return text if counted == alone else f"{text}, {counted} of them counted"


def _late(fault: FaultScore, context: Context, from_frame: int) -> str:
    """Return why a channel miscompared, from ``from_frame`` on, only well after its error exceeded the threshold."""
    exceeded = fault.exceeded_frame
    if exceeded is None or from_frame - exceeded <= int(_params(fault, context)["persistence"]):
        return ""
    return (
        f"its error exceeded the {_threshold(fault, context)} from {seconds(exceeded, context.rate_hz)} on, but until "
        f"{seconds(from_frame, context.rate_hz)} "
        f"{_fared(agreement_of(fault, context, exceeded, from_frame), context.unit(fault))}"
    )


def _fared(near: Agreement, unit: str) -> str:
    """Return how the faulty channel fared among the others: in how many frames it miscompared, near which it stayed."""
    agreed = ~near.alone
    if not agreed.any():
        return "the miscompare counts were frozen or began again"
    times = np.bincount(near.nearest[agreed])
    partner = f"channel {int(times.argmax()) + 1}"
    if times.max() < agreed.sum():
        partner = f"another channel (mostly {partner})"
    if agreed.all():
        return f"it stayed within {quantity(near.distance[agreed].max(), unit)} of {partner}"
    return f"it miscompared in {near.alone.sum()} of {len(agreed)} frames, at most {longest_run(near.alone)} in a row"


def _missed(fault: FaultScore, context: Context) -> str:
    if fault.channel is None or fault.exceeded_frame is None:
        read = "its reference" if site(fault.signal) == "reference" else "the references that read it"
        return f"not detected: {read} stayed in use"
    longest = duration(fault.exceeded_run_frames, context.rate_hz)
    threshold = _threshold(fault, context)
    if fault.tolerated:
        return f"not isolated: its error exceeded the {threshold} for {longest}, shorter than the persistence"
    if fault.signal in DISCRETE_INDEX:
        return f"not isolated, although its samples were wrong for {longest}"
    return f"not isolated, although its error exceeded the {threshold} for {longest}"


def _why_missed(fault: FaultScore, context: Context) -> str:
    """Return why no channel was isolated for an error that exceeded the threshold for long enough."""
    if context.silent(fault.signal):
        return f"{context.decider} reports no channel states"
    if not context.isolates(fault.signal):
        return f"{context.decider} isolates no channel"
    if not context.compares(fault):
        return f"{context.decider} did not isolate the channel"
    return _fared(_while_missed(fault, context), context.unit(fault))


def _while_missed(fault: FaultScore, context: Context) -> Agreement:
    """Return how the channel agreed while in use: for its longest run, and up to where it last miscompared."""
    first = fault.exceeded_frame or 0
    near = agreement_of(fault, context, first, context.score.flight.frames)
    in_use = int(np.flatnonzero([*near.out, True])[0])
    last = int(np.flatnonzero([True, *near.alone[:in_use]])[-1])
    return near.of(slice(max(1, min(in_use, max(fault.exceeded_run_frames, last)))))


def _undetectable(fault: FaultScore, context: Context) -> str:
    if not KINDS[fault.kind].changes_samples:
        return "not detectable: it changed no sample"
    where = site(fault.signal)
    if where == "surface":
        return "not detectable: no monitor watches surfaces"
    if where == "reference":
        return "not detectable: its reference stayed within its threshold"
    if where == "inertial":
        read = references_of(context.scenario.faults[fault.index], context.scenario.redundancy)
        within = "every reference that reads it stayed within its threshold" if read else "no reference reads it"
        return f"not detectable: {within}"
    return f"not detectable: its error stayed below the {_threshold(fault, context)}"


def _threshold(fault: FaultScore, context: Context) -> str:
    """Return the threshold of the channel comparison: ``isolation threshold of 0.63 deg/s``."""
    value = context.threshold(fault)
    return context.limit if value is None else f"{context.limit} of {quantity(value, context.unit(fault))}"


def _params(fault: FaultScore, context: Context) -> Any:
    return context.params[INDEX[fault.signal]]
