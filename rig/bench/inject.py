"""Faults of the flight on recorded channels, by the kernel of the flight.

The rows have the signals and discretes of the recording.  A fault begins in the first row at or after its
``start_s``, a time of the recording; durations are counted in rows at the recording's rate.  A fault reads NaN for a
sample that is no number or out of range; the sample stays unchanged if the fault returns NaN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.bench.drive import Stages, run
from rig.bench.rows_of_recording import blocks, put, put_discrete
from rig.core import fault_names
from rig.core.errors import BadInput
from rig.core.frame import Block, rows
from rig.core.settings import LONGEST_S, Settings, build
from rig.log.recordings.injection_file import Fitted, Injected, Table, number
from rig.log.recordings.recording import Bytes, Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import ANY_NUMBER, RecordedDiscrete, RecordedSignal
from rig.world.faults import Fault, Faults, Places, Point, check
from rig.world.faults.effects import Act

_FIELDS: Final = ("channels", "valid", "ilm")  # of a row, as in After


class _Faults(Settings):
    faults: list[Fault]


class After(NamedTuple):
    """One channel after the faults, (n,) each; NaN for a sample that is not usable."""

    samples: Floats
    valid: Bytes
    ilm: Bytes


@dataclass(frozen=True, slots=True)
class Injection:
    """A recording with faults, their places, and the original recording."""

    recording: Recording
    injected: list[Injected]
    before: Recording
    faults: list[Fault]
    places: Places
    acting: NDArray[np.uint8]  # (n, bytes) by fault, as in a row


def inject(
    recording: Recording,
    faults: Sequence[Table],
    signals: Mapping[str, RecordedSignal],
    discretes: Mapping[str, RecordedDiscrete] | None = None,
    *,
    seed: int = 0,
    source: str = "inject",
) -> Injection:
    """Return a copy of the recording with ``faults``, tables as in ``[[faults]]``, on its channels.

    signals, discretes : settings of the voted ones, as ``VoteConfig.signals`` gives them: range, wraps, threshold
    seed : the draws of a random fault depend on it and on the fault's name only
    BadInput, one line, names ``source``, the fault and the key: not in a recording, or not fitting it.
    """
    places = Places({name: chosen.wraps for name, chosen in signals.items()}, discretes or {})
    settled = _checked(recording, faults, signals, places, source)
    stage = Faults(
        settled,
        np.array([chosen.limits for chosen in signals.values()]).reshape(-1, 2),
        float(f"{recording.rate_hz:.9g}"),  # k / 100 has differences of 0.01 but for a rounding
        SeedSequence(seed),
        thresholds=np.array([chosen.threshold for chosen in signals.values()]),
        places=places,
    )
    for i, table in enumerate(faults):  # each begins and ends in the first row at or after its time
        for key, happens in (("start_s", stage.arm), ("end_s", stage.end)):
            if (time_s := number(table, key)) is not None:
                happens(i, int(np.searchsorted(recording.time_s, time_s)))
    acting, after = _through(stage, settled, places, recording, signals)
    injected: list[Injected] = []
    for i, fault in enumerate(settled):
        acts = np.flatnonzero((acting[:, i >> 3] >> (i & 7)) & 1)
        span = (int(acts[0]), int(acts[-1])) if len(acts) else (None, None)
        injected += [Injected(i, fault.label, fault.kind, p.place, p.channel or 0, *span) for p in fault.points]
    faulty = {name: _changed(name, recording, after, signals) for name in {point.place for point in after}}
    with_faults = replace(
        recording,
        signals={name: faulty.get(name, samples) for name, samples in recording.signals.items()},
        discretes={name: faulty.get(name, samples) for name, samples in recording.discretes.items()},
    )
    return Injection(with_faults, injected, recording, settled, places, acting)


def _checked(
    recording: Recording,
    tables: Sequence[Table],
    signals: Mapping[str, RecordedSignal],
    places: Places,
    source: str,
) -> list[Fault]:
    """Return the tables as faults, times since the first row (which the rows then replace), each with a name."""
    channels = {
        name: len(of[name].channels)
        for name, of in (
            *((name, recording.signals) for name in places.names["channel"]),
            *((name, recording.discretes) for name in places.names["discrete"]),
        )
    }
    fitted = Fitted(*({name: channels[name] for name in places.names[site]} for site in ("channel", "discrete")))
    try:
        for i, table in enumerate(tables):
            fitted.check(i, table, recording)
        first_s = float(recording.time_s[0])
        settled = build(_Faults, {"faults": [_since(table, first_s) for table in tables]}, source, places).faults
        for i, fault in enumerate(settled):
            _check_range(i, fault, signals)
        settled = _named(settled)
        check(settled, channels, places)
    except BadInput:
        raise
    except ValueError as error:
        raise BadInput(f"{source}: {error}") from None
    return settled


def _since(table: Table, first_s: float) -> dict[str, Any]:
    """Return the table with its times since the first row."""
    given = {key: time_s for key in ("start_s", "end_s") if (time_s := number(table, key)) is not None}
    return {**table, **{key: min(max(time_s - first_s, 0.0), LONGEST_S) for key, time_s in given.items()}}


def _check_range(i: int, fault: Fault, signals: Mapping[str, RecordedSignal]) -> None:
    for name, _ in fault.points if fault.effect.act == Act.RANGE_END else ():
        if name in signals and signals[name].limits == ANY_NUMBER:
            raise ValueError(f"faults.{i}: {name} has no range in CONFIG, which this fault needs")


def _named(settled: Sequence[Fault]) -> list[Fault]:
    """Return the faults, each with a unique name as its id."""
    labels: dict[str, int] = {}
    named: list[Fault] = []
    for fault in settled:
        label = fault_names.label(dict(fault))
        labels[label] = count = labels.get(label, 0) + 1
        own = fault.id is not None or count == 1
        named.append(fault.model_copy(update={"id": label if own else f"{label} ({count})"}))
    return named


def _through(
    stage: Faults,
    settled: Sequence[Fault],
    places: Places,
    recording: Recording,
    signals: Mapping[str, RecordedSignal],
) -> tuple[NDArray[np.uint8], dict[Point, After]]:
    """Run all rows through the kernel; return the active faults of each row, and their channels."""
    n, kind = len(recording.time_s), rows(*(len(places.names[site]) for site in ("channel", "discrete")))
    after = {
        point: After(np.empty(n), np.empty(n, np.uint8), np.empty(n, np.uint8))
        for fault in settled
        for point in fault.points
    }
    read = {point.place for fault in settled for point in (*fault.points, *fault.targets)}
    read |= {fault.effect.source_place or fault.points[0].place for fault in settled}
    acting = np.zeros((n, kind.flat["acting"].itemsize), np.uint8)
    for part, block in blocks(kind, n):
        for name in read:
            _put(block, name, places, recording, signals, part)
        stage.prepare(block)
        run(kind.nested(block), Stages(faults=stage.data))
        acting[part] = block["acting"]
        for (name, channel), columns in after.items():
            fields = _FIELDS if places.site(name) == "channel" else tuple(f"discrete_{field}" for field in _FIELDS)
            for column, field in zip(columns, fields, strict=True):
                column[part] = block[field][:, places.number(name), (channel or 1) - 1]
    return acting, after


def _put(
    block: Block,
    name: str,
    places: Places,
    recording: Recording,
    signals: Mapping[str, RecordedSignal],
    part: slice,
) -> None:
    """Write the samples of a signal or discrete for the faults: NaN for a sample that is not usable."""
    i = places.number(name)
    if name not in signals:
        put_discrete(block, i, recording.discretes[name], part)
        return
    put(block, i, recording.signals[name], part, second=False)
    (low, high), samples = signals[name].limits, block["channels"][:, i]
    samples[~((samples >= low) & (samples <= high))] = np.nan


def _changed(
    name: str, recording: Recording, after: Mapping[Point, After], signals: Mapping[str, RecordedSignal]
) -> Samples:
    """Return a signal or discrete with the new samples of the channels that have faults."""
    before = recording.signals[name] if name in signals else recording.discretes[name]
    columns, flags, ilm = list(before.channels), list(before.valid or ()), list(before.ilm or ())
    for (place, channel), behind in after.items():
        if place != name or channel is None:
            continue
        c = channel - 1
        columns[c], own = _column(before.channels[c], behind, signals[name].limits if name in signals else None)
        if flags or not own.all():
            flags = flags or [np.ones(len(own), np.uint8) for _ in columns]
            flags[c] = own
        if ilm:
            ilm[c] = behind.ilm
    return replace(before, channels=columns, ilm=ilm or before.ilm, valid=flags or before.valid)


def _column(before: Floats, after: After, limits: tuple[float, float] | None) -> tuple[Floats, Bytes]:
    """Return a channel and its validity flags; a sample that is not usable stays unchanged unless the fault sets it.

    limits : of a signal; None: a discrete
    """
    if limits is None:
        empty = np.isnan(before)
        return np.where(empty & (after.valid == 0), before, after.samples), np.where(empty, 1, after.valid)
    usable = (before >= limits[0]) & (before <= limits[1])
    return np.where(np.isnan(after.samples) & ~usable, before, after.samples), after.valid
