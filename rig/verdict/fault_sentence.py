"""One fault in a sentence: what it did, when and why it was failed or was not, what that did to vote and aircraft."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from rig.core.frame import INDEX
from rig.core.units.quantities import duration, quantity, seconds
from rig.verdict.context import Agreement, Context, agreement_of, channels, longest_run, place
from rig.verdict.counting import COMPARISON, Climb, another, climb
from rig.verdict.lane_tally import lane_result, on_lanes
from rig.verdict.law_tally import law_result
from rig.verdict.monitored_places import references_of
from rig.verdict.score_records import FaultScore
from rig.verdict.servo_sentence import actuator_result, on_servos
from rig.world.faults import KINDS
from rig.world.faults.fault_settings import Triggered, in_thresholds
from rig.world.faults.places import site

_OTHER: Final = Triggered.sentence  # of a kind that says nothing of its own
_NO_ERROR: Final = "{where} had a fault ({kind}) from {at} on"
_TIE_BREAKS: Final = {
    "ilm": "by the in-line monitors",
    "extremes": "as one of the extremes",
    "middle": "for not being the middle one",
    "box": "with its whole box",
    "common": "with all channels: two references agreed against them",
    "slow": "by the sum of its small deviations",
    "lane": "because its computer is failed",
    "given_up": "with all channels: no rule had answered the split",
}


def fault_sentences(context: Context) -> list[str]:
    """Return what a person would say of each fault: one sentence for all its channels that fared alike."""
    alike: dict[tuple[int, str, str, str], list[FaultScore]] = {}
    for fault in context.score.faults:
        value = _sample(fault, context) if "{value}" in KINDS[fault.kind].sentence else ""
        alike.setdefault((fault.index, fault.signal, value, _result(fault, context)), []).append(fault)
    return [_sentence(faults, context, result) for (*_, result), faults in alike.items()]


def _sentence(faults: Sequence[FaultScore], context: Context, result: str) -> str:
    first, numbers = faults[0], [fault.channel for fault in faults if fault.channel is not None]
    where = f"{place(first.signal)} {channels(numbers)}" if numbers else place(first.signal)
    if first.outcome == "not executed":
        return f"{first.id} on {where} was not executed: {result}"
    return f"{_did(faults, where, context)}; {'it' if len(faults) == 1 else 'each'} {result}"


def _result(fault: FaultScore, context: Context) -> str:
    """Return how the monitor took it, what that did to aircraft and vote."""
    if fault.outcome == "not executed":
        return "its trigger never fired" if fault.onset_frame is None else "the channel had been failed before"
    if on_servos(fault):
        return "; ".join(part for part in (actuator_result(fault, context), transient(fault, context)) if part)
    if on_lanes(fault):
        return "; ".join(part for part in (lane_result(fault, context), transient(fault, context)) if part)
    decided = {"detected": _detected, "missed": _missed, "undetectable": _undetectable}[fault.outcome]
    by_law = fault.law_frame is not None and fault.failed_frame is not None
    also = f"the fault-tolerant law found it too, {law_result(fault, context)}" if by_law else ""
    parts = (decided(fault, context), also, transient(fault, context), _vote(fault, context))
    return "; ".join(part for part in parts if part)


def _did(faults: Sequence[FaultScore], where: str, context: Context) -> str:
    fault, errors = faults[0], [fault.peak_error for fault in faults if fault.peak_error is not None]
    onset, value, unit = seconds(fault.onset_frame or 0, context.rate_hz), _sample(fault, context), context.unit(fault)
    available = {"{value}": bool(value), "{error}": bool(errors and unit)}
    sentence = next(
        (
            text
            for text in (KINDS[fault.kind].sentence, _OTHER)
            if all(available[part] for part in available if part in text)
        ),
        _NO_ERROR,
    )
    error = quantity(max(errors, default=0.0), unit)
    told = sentence.format(where=where, kind=fault.kind, at=onset, value=value, error=error)
    return f"{told}{_by_setting(fault, context)}"


def _by_setting(fault: FaultScore, context: Context) -> str:
    """Return the size of a fault of servos or lanes, whose error no row shows: `` (offset 5.73 deg)``; "" for none."""
    of = context.scenario.faults[fault.index]
    keys = of.sizes if on_servos(fault) or on_lanes(fault) else ()
    for name in (form for key in keys for form in (key, in_thresholds(key))):
        setting, value = type(of).model_fields.get(name), getattr(of, name, None)
        if setting is None or value is None or value == setting.default:
            continue
        declared: Any = setting.json_schema_extra
        unit = "1" if getattr(of, "surface", "") == "throttle" else declared["unit"]
        return f" ({name.partition('_')[0]} {quantity(value, unit)})"
    return ""


def _sample(fault: FaultScore, context: Context) -> str:
    """Return the sample of the channel when it was failed, else at the onset; in rad too."""
    if fault.sample is None or not np.isfinite(fault.sample):
        return ""
    unit = context.unit(fault)
    in_si = f" ({fault.sample:+#.3g} {unit})" if unit.startswith("rad") else ""
    return quantity(fault.sample, unit, signed=True) + in_si


def _detected(fault: FaultScore, context: Context) -> str:
    after = duration(fault.delay_from_onset_frames, context.rate_hz)
    if fault.failed_frame is None:
        return f"was found by the fault-tolerant law {after} later, {law_result(fault, context)}"
    if fault.channel is None:
        return f"was found {after} later: the manager declared the reference unusable"
    if (cause := another(fault, context)) is not None:
        failed, began = (seconds(frame or 0, context.rate_hz) for frame in (fault.failed_frame, cause.onset_frame))
        return f"was not found: the channel was failed at {failed} for another fault, {cause.kind} from {began} on"
    if fault.decided_by != COMPARISON:
        return f"was failed {after} later {_TIE_BREAKS.get(fault.decided_by or '', f'by the {fault.decided_by}')}"
    if not context.compares(fault):
        return f"was failed {after} later"
    found = climb(fault, context)
    late = "" if fault.exceeded_frame is None else _late(fault, context, found.first)
    failed = f"at {seconds(fault.failed_frame or 0, context.rate_hz)}" if late else f"{after} later"
    return f"{late}{_miscompared(found)}was failed {failed}"


def _miscompared(found: Climb) -> str:
    """Return in how many of its frames the channel miscompared: ``miscompared in 12 of 16 frames and ``."""
    frames, alone, counted = len(found.alone), int(found.alone.sum()), int(found.counted.sum())
    if not alone:
        return ""
    if alone < frames:
        text = f"miscompared in {alone} of {frames} frames"
    else:
        text = f"miscompared for {frames} frame{'s' if frames > 1 else ''}"
    return f"{text} and " if counted == alone else f"{text}, {counted} of them counted, and "


def _late(fault: FaultScore, context: Context, from_frame: int) -> str:
    """Return why a channel miscompared, from ``from_frame`` on, only well after its error had left the threshold."""
    exceeded = fault.exceeded_frame or 0
    if from_frame - exceeded <= int(_params(fault, context)["persistence"]):
        return ""
    return (
        f"left its {_threshold(fault, context)} at {seconds(exceeded, context.rate_hz)}, but "
        f"{_fared(agreement_of(fault, context, exceeded, from_frame), context.unit(fault))} until "
        f"{seconds(from_frame, context.rate_hz)}, then "
    )


def _fared(near: Agreement, unit: str) -> str:
    """Return how the faulty channel fared among the others: in how many frames it miscompared, near which it stayed."""
    agreed = ~near.alone
    if not agreed.any():
        return "the monitor's counts stood still or began again"
    times = np.bincount(near.nearest[agreed])
    partner = f"channel {int(times.argmax()) + 1}"
    if times.max() < agreed.sum():
        partner = f"another (mostly {partner})"
    stayed = f"stayed within {quantity(near.distance[agreed].max(), unit)} of {partner}"
    if agreed.all():
        return stayed
    count = f"miscompared in {near.alone.sum()} of {len(agreed)} frames, {longest_run(near.alone)} in a row at most"
    return f"{count}, and else {stayed}"


def _missed(fault: FaultScore, context: Context) -> str:
    if fault.channel is None or fault.exceeded_frame is None:
        read = "its reference was" if site(fault.signal) == "reference" else "the references that read it were"
        return f"was not found: {read} used on"
    longest = duration(fault.exceeded_run_frames, context.rate_hz)
    text = f"was not found: its error was above the {_threshold(fault, context)} for {longest} at most"
    if fault.tolerated:
        return f"{text}, shorter than the persistence"
    if context.silent(fault.signal):
        return f"{text}, and {context.decider} says nothing of channels"
    if not context.compares(fault):
        return f"{text}, and {context.decider} did not fail the channel"
    return f"{text}, and {_fared(_while_missed(fault, context), context.unit(fault))}"


def _while_missed(fault: FaultScore, context: Context) -> Agreement:
    """Return how the channel agreed while in use: for its longest run, and up to where it last miscompared."""
    first = fault.exceeded_frame or 0
    near = agreement_of(fault, context, first, context.score.flight.frames)
    in_use = int(np.flatnonzero([*near.out, True])[0])
    last = int(np.flatnonzero([True, *near.alone[:in_use]])[-1])
    return near.of(slice(max(1, min(in_use, max(fault.exceeded_run_frames, last)))))


def _undetectable(fault: FaultScore, context: Context) -> str:
    if not KINDS[fault.kind].changes_samples:
        return "changed no sample, so there was nothing to fail"
    where = site(fault.signal)
    if where == "surface":
        return "could not be found: no monitor watches surfaces"
    if where == "reference":
        return "could not be found: its reference stayed within its threshold"
    if where == "inertial":
        read = references_of(context.scenario.faults[fault.index], context.scenario.redundancy)
        within = "every reference that reads it stayed within its threshold" if read else "no reference reads it"
        return f"could not be found: {within}"
    return f"could not be found: its error stayed below the {_threshold(fault, context)}"


def transient(fault: FaultScore, context: Context) -> str:
    """Return how far the load factor was from that of the fault-free flight after the onset.

    "" where that flight was not flown: what the load factor did alone is the manoeuvre's, not the fault's.
    """
    measured = context.score.flight.transients
    window = (
        next((each for each in measured.windows if each.onset_frame == fault.onset_frame), None) if measured else None
    )
    if window is None or window.frames < 2:
        return ""
    looked_at_s = (window.frames - 1) / context.rate_hz
    end = window.onset_frame + window.frames
    begun = {each.index for each in context.score.faults if each.onset_frame is not None and each.onset_frame < end}
    others = " (other faults included)" if begun - {fault.index} else ""
    off = quantity(window.peaks.load_factor, "g")
    return f"the load factor stayed within {off} of the fault-free flight's for {looked_at_s:g} s{others}"


def _vote(fault: FaultScore, context: Context) -> str:
    window = fault.window
    if window is None or context.silent(fault.signal):
        return ""
    if window.lost_s > 0:
        return f"{fault.signal} was lost: no channel left"
    off = quantity(window.error_max, context.unit(fault))
    ends = window.end_frame < context.score.flight.frames
    until = f" until the next fault at {seconds(window.end_frame, context.rate_hz)}" if ends else ""
    if window.above_threshold_s == 0:
        return f"the vote stayed within {off} of the truth{until}"
    limit = ""
    if fault.signal in INDEX:
        limit = f" of {quantity(float(_params(fault, context)['threshold']), context.unit(fault))}"
    return f"the vote was wrong by up to {off}, above the threshold{limit} for {window.above_threshold_s:g} s{until}"


def _threshold(fault: FaultScore, context: Context) -> str:
    """Return what the monitor allows, by name and figure: ``isolation threshold of 0.63 deg/s``."""
    value = context.threshold(fault)
    if value is None:
        return "threshold"
    outlier = value != _params(fault, context)["threshold"]
    return f"{'outlier ' if outlier else ''}threshold of {quantity(value, context.unit(fault))}"


def _params(fault: FaultScore, context: Context) -> Any:
    return context.params[INDEX[fault.signal]]
