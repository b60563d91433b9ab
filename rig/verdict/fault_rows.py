"""Rows of a conclusion about faults: what happened where and when, isolated after how long by what, or why not."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from rig.core.units.quantities import duration, quantity, seconds
from rig.flight.conclusion_rows import Row
from rig.verdict.context import Context, place_label, signals_label
from rig.verdict.fault_words import fault_result, reasons
from rig.verdict.lane_tally import on_lanes
from rig.verdict.score_records import FaultScore
from rig.verdict.servo_words import on_servos
from rig.verdict.split_rows import OfFaults
from rig.world.faults import KINDS
from rig.world.faults.fault_settings import Triggered, in_thresholds

_OTHER: Final = Triggered.sentence  # of a kind without a sentence of its own
_NO_ERROR: Final = "{kind} from {at} on"
_PLACES: Final = re.compile(r"\{\w+\}")
_MOST: Final = 3  # signals of one fault that have a row each
_WIDE: Final = 90  # characters of a line; a longer one is cut between the fault and its outcome
_RANK: Final = ("missed", "detected", "undetectable", "not executed")  # the most important first


Ranked = tuple[int, int, Row]  # rank, onset frame


class _Group(NamedTuple):
    """Channels of one signal on which a fault had the same effect."""

    faults: list[FaultScore]
    did: str
    result: str
    reasons: tuple[str, ...]

    @property
    def first(self) -> FaultScore:
        return self.faults[0]

    @property
    def numbers(self) -> list[int]:
        return sorted(fault.channel for fault in self.faults if fault.channel is not None)


def fault_rows(context: Context, of_splits: OfFaults) -> list[Row]:
    """Return a row for all channels of a fault that fared alike, missed faults first.

    of_splits : texts about splits that a fault began
    """
    groups = list(_groups(context))
    signals = Counter(group.first.index for group in groups)
    few = [group for group in groups if signals[group.first.index] <= _MOST]
    ranked = [*_each(few, of_splits)]
    for index in (index for index, count in signals.items() if count > _MOST):
        ranked += _many([group for group in groups if group.first.index == index], context)
    return [row for *_, row in sorted(ranked, key=lambda each: each[:2])]


def _each(groups: Sequence[_Group], of_splits: OfFaults) -> Iterator[Ranked]:
    """Yield a row for each group; signals on which the same happened to the same channels share one."""
    alike: dict[object, list[_Group]] = {}
    left = dict(of_splits)
    for group in groups:
        first = group.first
        split = left.pop((first.index, first.signal), ())
        key = tuple(group.numbers), group.did, group.result, group.reasons
        if split or not group.numbers:
            yield *_rank(first), _row(group, split, place_label(first.signal, group.numbers))
        else:
            alike.setdefault(key, []).append(group)
    for several in alike.values():
        first = several[0]
        names = list(dict.fromkeys(group.first.signal for group in several))
        label = signals_label(names, first.numbers) if len(names) > 1 else place_label(names[0], first.numbers)
        yield *_rank(first.first), _row(first, (), label)


def _groups(context: Context) -> Iterator[_Group]:
    alike: dict[tuple[int, str, str, str, tuple[str, ...]], list[FaultScore]] = {}
    for fault in context.score.faults:
        value = _sample(fault, context) if "{value}" in KINDS[fault.kind].sentence else ""
        key = fault.index, fault.signal, value, fault_result(fault, context), reasons(fault, context)
        alike.setdefault(key, []).append(fault)
    for (*_, result, why), faults in alike.items():
        yield _Group(faults, _did(faults, context), result, why)


def _rank(fault: FaultScore) -> tuple[int, int]:
    """Return the place of a fault among the rows: missed ones first, then by time."""
    return _RANK.index(fault.outcome), fault.onset_frame or 0


def _row(group: _Group, split: Sequence[str], label: str) -> Row:
    """Return the row of one group; with a split, its line stands between the fault and the isolation."""
    first = group.first
    if first.outcome == "not executed":
        return Row(label, (f"{first.kind.replace('_', ' ')} not executed: {group.result}",))
    if split:
        pair = len(group.faults) == 2 and group.result.startswith("isolated after")
        result = f"both {group.result}" if pair else group.result
        return Row(label, (group.did, *split, result), group.reasons)
    told = f"{group.did}, {group.result}"
    return Row(label, (told,) if len(told) <= _WIDE else (group.did, group.result), group.reasons)


def _many(groups: Sequence[_Group], context: Context) -> Iterator[Ranked]:
    """Yield one row for each outcome of a fault on many signals."""
    onset = seconds(min(group.first.onset_frame or 0 for group in groups), context.rate_hz)
    sentence = KINDS[groups[0].first.kind].sentence
    did = (_NO_ERROR if {"{value}", "{error}"} & {*_PLACES.findall(sentence)} else sentence).format(
        kind=groups[0].first.kind.replace("_", " "), at=onset
    )
    for outcome in _RANK:
        some = [group for group in groups if group.first.outcome == outcome]
        if not some:
            continue
        names = list(dict.fromkeys(group.first.signal for group in some))
        numbers = sorted({number for group in some for number in group.numbers})
        yield *_rank(some[0].first), Row(signals_label(names, numbers), (f"{did}, {_fared(some, context)}",))


def _fared(groups: Sequence[_Group], context: Context) -> str:
    """Return the outcome of a fault on several signals with one outcome."""
    results = {group.result for group in groups}
    if len(results) == 1:
        return results.pop()
    outcome = groups[0].first.outcome
    if outcome == "detected":
        delays = sorted({f.delay_from_onset_frames or 0 for group in groups for f in group.faults})
        first, last = (duration(delay, context.rate_hz) for delay in (delays[0], delays[-1]))
        return f"isolated after {first}" if first == last else f"isolated after {first} to {last}"
    return {"missed": "not isolated", "undetectable": f"not detectable: errors below the {context.limit}s"}.get(
        outcome, outcome
    )


def _did(faults: Sequence[FaultScore], context: Context) -> str:
    """Return what happened and when: ``offset of 8.59 deg/s at 10.00 s``."""
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
    error, kind = quantity(max(errors, default=0.0), unit), fault.kind.replace("_", " ")
    told = sentence.format(kind=kind, at=onset, value=value, error=error)
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
    """Return the sample of the channel when it was isolated, else at the onset."""
    if fault.sample is None or not np.isfinite(fault.sample):
        return ""
    return quantity(fault.sample, context.unit(fault), signed=True)
