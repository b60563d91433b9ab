"""Rows of a conclusion about channels and computers that were isolated without a fault of theirs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rig.core.frame import COMPUTERS
from rig.core.units.quantities import duration, seconds
from rig.flight.conclusion_rows import Row
from rig.verdict.context import Context, after, channels, listed, place_label, signals_label
from rig.verdict.fault_words import by_rule
from rig.verdict.lane_tally import columns_of
from rig.verdict.lane_words import test_words
from rig.verdict.score_records import FaultScore, Isolation
from rig.verdict.servo_words import monitor_words
from rig.world.faults.places import OF_SERVOS, site

_BY_DESIGN: Final = {
    "failed with its box": "with its LRU, which was faulty on other signals",
    "failed by rule": "with all channels: two references disagreed with them",
}


def wrong_isolations(context: Context) -> Iterator[Row]:
    """Yield a row for the healthy channels of one signal, or the computer, that were isolated by mistake."""
    groups: dict[tuple[str, str], list[Isolation]] = {}
    for each in (*context.score.false_alarms, *context.score.wrong_isolations):
        groups.setdefault((each.signal, _mistake(each, context)), []).append(each)
    for (signal, text), several in groups.items():
        numbers = [] if site(signal) == "computer" else [each.channel for each in several]
        yield Row(place_label(signal, numbers), (text,))


def _mistake(isolation: Isolation, context: Context) -> str:
    at, faulty = seconds(isolation.frame, context.rate_hz), isolation.faulty
    if site(isolation.signal) == "computer":
        lanes = listed([f"computer {COMPUTERS[number - 1]}" for number in faulty]) or "no computer"
        return f"healthy, isolated by mistake at {at} by {test_words(isolation.decided_by)} (faulty: {lanes})"
    which = ", ".join(map(str, faulty)) or "no channel"
    on_servo = site(isolation.signal) in OF_SERVOS
    by = f"by the {monitor_words(isolation.decided_by)}" if on_servo else by_rule(isolation.decided_by)
    return f"healthy, isolated by mistake at {at} {by} (faulty: {which})"


def by_design(context: Context) -> Iterator[Row]:
    """Yield a row for each channel number and frame in which a rule isolated it for faults elsewhere."""
    groups: dict[tuple[str, int, int], list[str]] = {}
    for kind, each in context.score.isolations:
        if kind in _BY_DESIGN:
            groups.setdefault((_BY_DESIGN[kind], each.channel, each.frame), []).append(each.signal)
    for (why, number, frame), names in groups.items():
        yield Row(signals_label(names, [number]), (f"isolated at {seconds(frame, context.rate_hz)} {why}",))


def lost_with_lane(context: Context) -> Iterator[Row]:
    """Yield a row for each channel number that the fault of its computer, or of a link, isolated on several signals."""
    told = {(fault.signal, fault.channel, fault.failed_frame) for fault in context.score.faults}
    groups: dict[tuple[int, int], list[Isolation]] = {}
    for each in context.score.evidence.isolated:
        fault = _cause(each, context)
        if fault is not None and (each.signal, each.channel, each.frame) not in told:
            groups.setdefault((fault.index, each.channel), []).append(each)
    by_text: dict[tuple[str, str], list[int]] = {}
    for (index, number), several in groups.items():
        onset = next(f.onset_frame for f in context.score.faults if f.index == index)
        names = list(dict.fromkeys(each.signal for each in several))
        by_text.setdefault((signals_label(names, []), _spread(several, onset or 0, context)), []).append(number)
    for (names, text), numbers in by_text.items():
        yield Row(channels(numbers), (f"isolated on {names} {text}",))


def _spread(several: Sequence[Isolation], onset: int, context: Context) -> str:
    """Return after how long channels were isolated: ``after 80 ms``, ``after 80 to 120 ms``."""
    delays = sorted({each.frame - onset for each in several})
    first, last = (duration(delay, context.rate_hz) for delay in (delays[0], delays[-1]))
    return after(delays[0], context.rate_hz) if first == last else f"after {first} to {last}"


def _cause(isolation: Isolation, context: Context) -> FaultScore | None:
    """Return the latest fault before an isolation that takes its channel away from the other computers."""
    bit = 1 << (isolation.channel - 1)
    begun = [
        fault
        for fault in context.score.faults
        if fault.onset_frame is not None
        and fault.onset_frame <= isolation.frame
        and columns_of(context.scenario.faults[fault.index]) & bit
    ]
    return max(begun, key=lambda fault: fault.onset_frame or 0, default=None)
