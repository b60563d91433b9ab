"""The flight's manager over the rows of a recording, one signal after the other.

The rows are frames of the flight (rig.frame.FLAT) with one signal in them, so the very kernels of flight run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.baselines import select_unit
from rig.computer.redundancy.config import PARAMS, fill
from rig.computer.redundancy.managers import MANAGERS, Manager, manager_kind, vote_signals
from rig.computer.redundancy.own import load_manager
from rig.frame import Block, Ilm, Resolver, State, nested, new_block
from rig.kernels import kernel
from rig.recordings.clock import Floats
from rig.recordings.recording import Bytes, Recording, Samples
from rig.recordings.settings import RecordedSignal, Reset, commands
from rig.units.angles import difference
from rig.util.trust import Trust

ROWS: Final = 256  # of a block: half a megabyte, which stays in the cache
FIELDS: Final = ("voted", "level", "pattern", "resolver", "trend_high", "trend_low", "reference_usable")
_NO_CODE: Final = Trust("the configuration")


class Failure(NamedTuple):
    """A channel that was failed: in which row, counted from 1, and by whom."""

    channel: int
    frame: int
    time_s: float
    why: str  # comparison, or a resolver


@dataclass(frozen=True, slots=True)
class Voted:
    """What the manager said of one signal; every array (n,), ``state`` one for each channel."""

    settings: RecordedSignal
    voted: Floats
    level: Bytes
    pattern: Bytes
    resolver: Bytes
    trend_high: Bytes
    trend_low: Bytes
    reference_usable: Bytes
    state: list[Bytes]
    spread: Floats  # largest less smallest of the samples in use, NaN where there are none
    invalid: list[int]  # samples of each channel that were no number, flagged, or out of range
    failures: list[Failure]


def vote(
    recording: Recording,
    settings: dict[str, RecordedSignal],
    resets: list[Reset],
    trust: Trust = _NO_CODE,
    triads: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, Voted]:
    """Vote the signals that have settings; BadInput: a manager class that ``trust`` does not permit.

    triads : by name, signals that are the axes of one unit: such a manager chooses one channel for all three
    """
    for chosen in settings.values():
        trust.require(chosen.manager)
    units = [
        tuple(axes)
        for axes in (triads or {}).values()
        if all(manager_kind(settings[a].manager).chooses_units for a in axes)
    ]
    alone = [(name,) for name in settings if not any(name in axes for axes in units)]
    found: dict[str, Voted] = {}
    for names in (*units, *alone):
        found |= _vote_unit(recording, names, settings, resets, trust)
    return {name: found[name] for name in settings}


def _vote_unit(
    recording: Recording,
    names: tuple[str, ...],
    settings: dict[str, RecordedSignal],
    resets: list[Reset],
    trust: Trust,
) -> dict[str, Voted]:
    """The signals ``names``, one or the axes of a unit, through their manager."""
    n, params = len(recording.time_s), np.zeros(len(names), PARAMS)
    samples = [recording.signals[name] for name in names]
    commanded = [commands(resets, name, recording.time_s) for name in names]
    for i, name in enumerate(names):
        chosen, fitted = settings[name], len(samples[i].channels)
        fill(params[i], chosen, chosen.limits, fitted, chosen.wraps, recording.rate_hz)
    run = _manager(settings[names[0]].manager, params, trust)
    outs = [_Columns.of(n, len(one.channels)) for one in samples]
    block = _first_block()
    for start in range(0, n, ROWS):
        part = slice(start, min(start + ROWS, n))
        rows = block[: part.stop - start]
        for i, one in enumerate(samples):
            _put(rows, i, one, part)
            rows["reset"][:, i] = commanded[i][part]
        run(rows)
        for i, out in enumerate(outs):
            spreads(rows, i, params[i], out.spread[part])
            out.take(rows, i, part)
    return {name: _voted(recording, samples[i], settings[name], outs[i]) for i, name in enumerate(names)}


class _Columns(NamedTuple):
    """What comes out of the rows for one signal, (n,) each."""

    fields: dict[str, Any]
    states: list[Bytes]
    spread: Floats

    @classmethod
    def of(cls, n: int, fitted: int) -> _Columns:
        fields: dict[str, Any] = {name: np.empty(n, np.float64 if name == "voted" else np.uint8) for name in FIELDS}
        return cls(fields, [np.empty(n, np.uint8) for _ in range(fitted)], np.empty(n))

    def take(self, rows: NDArray[Any], i: int, part: slice) -> None:
        for name, column in self.fields.items():
            column[part] = rows[name][:, i]
        for c, column in enumerate(self.states):
            column[part] = rows["state"][:, i, c]


def _voted(recording: Recording, samples: Samples, settings: RecordedSignal, out: _Columns) -> Voted:
    wrong = [~_usable(samples, settings, c) for c in range(len(samples.channels))]
    failures = _failures(recording, out.fields, out.states, wrong)
    invalid = [int(w.sum()) for w in wrong]
    return Voted(settings, **out.fields, state=out.states, spread=out.spread, invalid=invalid, failures=failures)


def _first_block() -> NDArray[Any]:
    block = new_block(ROWS)
    block["channels"] = block["reference"] = block["second_reference"] = np.nan
    block["valid"] = 1
    block["ilm"] = Ilm.ABSENT
    return block


def _put(rows: NDArray[Any], i: int, samples: Samples, part: slice) -> None:
    """The samples of ``part`` as signal i of frames."""
    rows["frame"] = np.arange(part.start, part.stop)
    for c, column in enumerate(samples.channels):
        rows["channels"][:, i, c] = column[part]
    for c, flags in enumerate(samples.ilm or ()):
        rows["ilm"][:, i, c] = flags[part]
    for c, flags in enumerate(samples.valid or ()):
        rows["valid"][:, i, c] = flags[part]
    if samples.reference is not None:
        rows["reference"][:, i] = samples.reference[part]


def _manager(name: str, params: NDArray[np.void], trust: Trust) -> Callable[[Block], None]:
    """What votes all rows of a block: a manager of the house, or the user's own ``module:name``."""
    if name in MANAGERS:
        data = Manager(name, params).data
        if len(params) > 1:  # the axes of one unit
            return lambda rows: select_rows(nested(rows), data)
        return lambda rows: vote_rows(nested(rows), data)
    own = load_manager(name, params, trust)

    def step_by_step(rows: Block) -> None:
        bus, fcc = (nested(rows)[part] for part in ("bus", "fcc"))
        for k in range(len(rows)):
            own.step(rows, bus, fcc, k)

    return step_by_step


@kernel
def vote_rows(rows, data):
    """All rows through the chosen manager; see managers.vote_signals."""
    for k in range(len(rows)):
        vote_signals(rows[k]["bus"], rows[k]["fcc"], data)


@kernel
def select_rows(rows, data):
    """All rows of one unit; see baselines.select_unit."""
    for k in range(len(rows)):
        select_unit(rows[k]["bus"], rows[k]["fcc"], 0, len(data.params), data)


@kernel
def spreads(rows, i, p, out):
    """Largest less smallest sample of the channels in use of signal i, each as seen from the vote.

    A sample that is not valid or out of range is not in use; NaN when none is.
    p : one config.PARAMS record; out : (rows,)
    """
    for k in range(len(rows)):
        row = rows[k]
        low, high = np.inf, -np.inf
        for c in range(p["fitted"]):
            sample = row["channels"][i, c]
            if row["state"][i, c] != State.FAILED and row["valid"][i, c] != 0 and p["low"] <= sample <= p["high"]:
                off = difference(sample, row["voted"][i], p["wraps"])
                low, high = min(low, off), max(high, off)
        out[k] = high - low if high >= low else np.nan


def _usable(samples: Samples, settings: RecordedSignal, c: int) -> NDArray[np.bool_]:
    low, high = settings.limits
    column = samples.channels[c]
    usable = (column >= low) & (column <= high)
    return usable if samples.valid is None else usable & (samples.valid[c] != 0)


def _failures(
    recording: Recording, out: dict[str, Any], states: list[Bytes], invalid: list[NDArray[np.bool_]]
) -> list[Failure]:
    """Every change to failed: by the resolver of its row if the sample is valid and one decided, else by comparison."""
    found: list[Failure] = []
    for c, state in enumerate(states):
        failed = state == State.FAILED
        for k in np.flatnonzero(failed & ~np.concatenate([[False], failed[:-1]])):
            resolver = Resolver(out["resolver"][k])
            resolved = resolver not in (Resolver.NONE, Resolver.UNRESOLVED) and not invalid[c][k]
            why = resolver.name.lower() if resolved else "comparison"
            found.append(Failure(c + 1, recording.row(int(k)), float(recording.time_s[k]), why))
    return sorted(found, key=lambda failure: (failure.frame, failure.channel))
