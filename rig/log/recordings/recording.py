"""A recording: time and, for each signal, two to four channels with what is known of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, Ilm
from rig.core.text import shorten
from rig.log.recordings.stamps import TIME, Clock, Floats, Repair, clock, gaps, rows_a_second

Bytes = NDArray[np.uint8]
WAY_OUT: Final = "name other columns by time_column and [mapping] in CONFIG: docs/reference/recordings.md"
_COLUMN: Final = re.compile(r"(?P<signal>.+?)(?P<ilm>\.ilm)?\.(?P<channel>0|[1-9][0-9]{0,3})|(?P<referred>.+)\.ref")


@dataclass(frozen=True, slots=True)
class Samples:
    """One signal, an array (n,) for each channel; NaN is an invalid sample."""

    channels: list[Floats]
    ilm: list[Bytes] | None = None  # Ilm codes; None when no channel has a monitor
    reference: Floats | None = None
    valid: list[Bytes] | None = None  # 0 where the sensor itself flags a sample that is a number
    second_reference: Floats | None = None  # of a flight
    numbers: tuple[int, ...] = ()  # recorded number of each channel, if CONFIG names those that vote; (): 1, 2, ...
    others: dict[int, Floats] = field(default_factory=dict)  # channels that do not vote, by recorded number

    def number(self, c: int) -> int:
        """Return the recorded number of channel ``c``, counted from 0."""
        return self.numbers[c] if self.numbers else c + 1

    def times(self, factor: float) -> Samples:
        """Return the samples in another unit, ``factor`` of which are one of this."""
        reference, second = (None if of is None else of * factor for of in (self.reference, self.second_reference))
        channels = [column * factor for column in self.channels]
        others = {number: column * factor for number, column in self.others.items()}
        return replace(self, channels=channels, reference=reference, second_reference=second, others=others)

    def of(self, rows: slice | NDArray[np.int64]) -> Samples:
        """Return the samples of these rows."""

        def those(columns: list[Bytes] | None) -> list[Bytes] | None:
            return None if columns is None else [column[rows] for column in columns]

        reference, second = (None if of is None else of[rows] for of in (self.reference, self.second_reference))
        channels = [column[rows] for column in self.channels]
        others = {number: column[rows] for number, column in self.others.items()}
        ilm, valid = those(self.ilm), those(self.valid)
        return Samples(channels, ilm, reference, valid, second, self.numbers, others)


@dataclass(frozen=True, slots=True)
class Recording:
    """``time_s`` (n,), strictly rising; ``first_row`` is the number of rows before it that alignment cut off."""

    time_s: Floats
    signals: dict[str, Samples]
    first_row: int = 0
    kept: NDArray[np.int64] | None = None  # rows of the input, from 0, before alignment cut any; None: all
    repairs: tuple[Repair, ...] = ()
    discretes: dict[str, Samples] = field(default_factory=dict)  # 0, 1 or NaN
    remarks: tuple[str, ...] = ()  # how the input was read, where that is not plain
    warnings: tuple[str, ...] = ()  # what makes it doubtful
    in_si: bool = False  # a file of the rig, whatever unit CONFIG names
    units: Mapping[str, str] = field(default_factory=dict)  # of columns, by a row of units

    def row(self, k: int) -> int:
        """Return the row of the input, counted from 1, that became row ``k``, counted from 0."""
        k += self.first_row
        return (k if self.kept is None else int(self.kept[k])) + 1

    @property
    def rows(self) -> NDArray[np.int64]:
        """(n,) rows of the input, as of ``row``."""
        there = slice(self.first_row, self.first_row + len(self.time_s))
        return (np.arange(there.start, there.stop) if self.kept is None else self.kept[there]) + 1

    @property
    def rate_hz(self) -> float:
        """Rows a second; 1 when there is but one row."""
        return rows_a_second(self.time_s)


def assemble(
    source: str,
    names: Iterable[str],
    column: Callable[[str], Floats],
    repair: bool = False,
    voting: Mapping[str, Sequence[int]] | None = None,
) -> Recording:
    """Return a recording of the columns ``<signal>.1``, ``<signal>.ilm.1``, ``<signal>.ref`` and ``time_s``.

    ``column`` gives an array (n,), NaN where a cell is empty; ``repair`` drops rows as in stamps.py.
    voting : recorded channels that vote, by signal, under "" for all others; the first four when not given
    BadInput names ``source``.
    """
    names = list(names)
    if TIME not in names:
        raise BadInput(f"{source}: no column {TIME!r}; there are: {shorten(', '.join(names)) or 'none'}; {WAY_OUT}")
    chosen = voting or {}
    parsed = {name: _parse(source, name, chosen) for name in names if name != TIME}
    there: dict[str, list[int]] = {}
    for signal, kind, channel in parsed.values():
        if kind == "channel":
            there.setdefault(signal, []).append(channel)
    for name, (signal, kind, channel) in parsed.items():
        if signal not in there or (kind == "ilm" and channel > max(there[signal])):
            raise BadInput(f"{source}: unknown column {name!r}: no channel of that name")
    numbers = {signal: _voting(source, signal, sorted(of), chosen) for signal, of in there.items()}
    if not there:
        raise BadInput(f"{source}: no signal; columns must be {TIME}, <signal>.1 to <signal>.{CHANNELS}")
    accepted = clock(source, column(TIME), repair)
    samples = {
        signal: _samples(source, signal, of, sorted(there[signal]), names, column) for signal, of in numbers.items()
    }
    return on_clock(accepted, samples)


def on_clock(accepted: Clock, signals: dict[str, Samples], discretes: dict[str, Samples] | None = None) -> Recording:
    """Return the recording of samples of all rows of the input, in the rows that were accepted."""
    all_of = [signals, discretes or {}]
    if (kept := accepted.kept) is not None:
        all_of = [{name: samples.of(kept) for name, samples in some.items()} for some in all_of]
    repairs = () if accepted.repair is None else (accepted.repair,)
    return Recording(
        accepted.time_s,
        all_of[0],
        kept=accepted.kept,
        repairs=repairs,
        discretes=all_of[1],
        warnings=tuple(gaps(accepted.source, accepted.time_s)),
    )


def with_discretes(source: str, recording: Recording, names: Collection[str]) -> Recording:
    """Return the recording with the signals ``names`` as discretes; BadInput names ``source`` and the row."""
    mine = {name: samples for name, samples in recording.signals.items() if name in names}
    for name, samples in mine.items():
        if samples.reference is not None:
            raise BadInput(f"{source}: column '{name}.ref': a discrete has no reference")
    discretes = {**recording.discretes, **mine}
    for name, samples in discretes.items():
        _check_discrete(source, recording, name, samples)
    signals = {name: samples for name, samples in recording.signals.items() if name not in names}
    return replace(recording, signals=signals, discretes=discretes)


def _check_discrete(source: str, recording: Recording, name: str, samples: Samples) -> None:
    for c, values in enumerate(samples.channels, 1):
        wrong = np.flatnonzero(~((values == 0) | (values == 1) | np.isnan(values)))
        if len(wrong):
            row, got = recording.row(int(wrong[0])), values[wrong[0]]
            raise BadInput(f"{source}: row {row}: {name}.{c} is a discrete: 0, 1 or empty, got {got:g}")


def _parse(source: str, name: str, voting: Mapping[str, Sequence[int]]) -> tuple[str, str, int]:
    match = _COLUMN.fullmatch(name)
    if match is None:
        raise BadInput(
            f"{source}: unknown column {name!r}; allowed: {TIME}, <signal>.1 to .{CHANNELS}, "
            f"<signal>.ref, <signal>.ilm.1 to .{CHANNELS}; {WAY_OUT}"
        )
    if match["referred"]:
        return match["referred"], "reference", 0
    channel, chosen = int(match["channel"]), "" in voting or match["signal"] in voting
    if channel < 1 or (channel > CHANNELS and not chosen):
        of = f"channels = [1, 2, 3, {channel}] in [signal.{match['signal']}] names those that vote"
        hint = f"; of more, {of}" if channel > CHANNELS else ""
        raise BadInput(f"{source}: column {name!r}: a signal has channels 1 to {CHANNELS}{hint}")
    return match["signal"], "ilm" if match["ilm"] else "channel", channel


def _voting(source: str, signal: str, there: list[int], voting: Mapping[str, Sequence[int]]) -> list[int]:
    """Return the recorded channels of a signal that vote, of those that are ``there``.  BadInput."""
    count = there[-1]
    if len(there) < 2:
        raise BadInput(f"{source}: signal {signal!r} has one channel; two to {CHANNELS} are needed")
    chosen = voting.get(signal, voting.get(""))
    if chosen is not None:
        if missing := [c for c in chosen if c not in there]:
            raise BadInput(
                f"{source}: signal.{signal}.channels: no channel {missing[0]}; there are {', '.join(map(str, there))}"
            )
        return list(chosen)
    for c in range(1, count):
        if c not in there:
            raise BadInput(f"{source}: signal {signal!r} has a channel {count} but no channel {c}")
    return there


def _samples(
    source: str, signal: str, voting: list[int], there: list[int], names: list[str], column: Callable[[str], Floats]
) -> Samples:
    monitored = any(f"{signal}.ilm.{c}" in names for c in voting)
    ilm = [_flags(source, f"{signal}.ilm.{c}", names, column) for c in voting] if monitored else None
    reference = column(f"{signal}.ref") if f"{signal}.ref" in names else None
    others = {c: column(f"{signal}.{c}") for c in there if c not in voting}
    numbers = () if voting == list(range(1, len(voting) + 1)) else tuple(voting)
    channels = [column(f"{signal}.{c}") for c in voting]
    return Samples(channels, ilm, reference, numbers=numbers, others=others)


def _flags(source: str, name: str, names: list[str], column: Callable[[str], Floats]) -> Bytes:
    """In-line monitor flags: 0 bad, 1 good, empty absent."""
    if name not in names:
        return np.full(len(column(TIME)), Ilm.ABSENT, np.uint8)
    values = column(name)
    wrong = np.flatnonzero(~((values == 0) | (values == 1) | np.isnan(values)))
    if len(wrong):
        raise BadInput(f"{source}: row {wrong[0] + 1}: {name} must be 0, 1 or empty, got {values[wrong[0]]:g}")
    return np.where(np.isnan(values), int(Ilm.ABSENT), np.nan_to_num(values)).astype(np.uint8)
