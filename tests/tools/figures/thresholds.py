"""Thresholds from a budget: on real flights that did not design them, on noise of known kinds, and their time.

Real flights: no channel is faulty, so a failed channel is a false isolation.  Then one channel of each flight and
axis is made faulty, after 20 to 60 % of the flight, by each of eleven faults in turn: right when the faulty channel is
the first to be failed after that, wrong when another is, prior when one had been failed before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import poisson

from figures import table
from figures.quadrotor import AXES, SELECTION, TRIADS, config
from rig.bench.vote_rows import vote
from rig.log.recordings.alignment import AlignOptions
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.data import Data, load
from rig.studies.thresholds.design import DataBlock, Design, Grid, designs
from rig.studies.thresholds.design_signals import STRETCHES, design
from rig.studies.thresholds.holdout import OVER, Count, count
from rig.studies.thresholds.pieces import outcomes
from rig.studies.thresholds.slow_fault_limits import RULES
from rig.studies.thresholds.tradeoff import Pieces, faulty
from rig.verdict.signal_kernels import NEVER

Floats = NDArray[np.float64]
Signals = dict[str, list[DataBlock]]
BUDGETS: Final = (30.0, 10.0, 3.0, 1.0)
FIXED: Final = ((10.0, 8), (5.0, 24))  # deg/s, frames
FOLDS: Final = 5
RATE_HZ: Final = 120.0
EARLIEST: Final = 800  # frames: after the stretch of the alignment
GIVEN: Final = RecordedSignal(threshold=1.0)
FAULTS: Final[dict[str, Callable[[Pieces], Floats]]] = {
    **{f"offset {size}": partial(faulty, kind="offset", size=float(size)) for size in (10, 20, 30, 60, 100)},
    "ramp 5/s": partial(faulty, kind="ramp", size=5.0),
    "stuck": partial(faulty, kind="stuck", size=0.0),
    "hardover 250": lambda cut: np.where(_frames(cut) < 0, faulty(cut, "gain", 1.0), 250.0),
    "nan 0.5 s": lambda cut: np.where(np.abs(_frames(cut) - 30) < 30, np.nan, faulty(cut, "gain", 1.0)),
    "noise x10": partial(faulty, kind="noise", size=10.0),
    "gain 0.5": partial(faulty, kind="gain", size=0.5),
}


def _frames(cut: Pieces) -> NDArray[np.int64]:
    return np.arange(cut.samples.shape[1]) - cut.onset


def faulted(flight: DataBlock, axis: int) -> tuple[Floats, int, int]:
    """Return the samples (fault, n, 4) with each fault in one channel from the onset on; the channel, the onset."""
    rng = np.random.default_rng([0, axis, *Path(flight.name).name.encode()])
    samples = np.ascontiguousarray(flight.samples.T)[None]
    n = samples.shape[1]
    onset = max(EARLIEST, int(n * rng.uniform(0.2, 0.6)))
    channel = rng.integers(4, size=1)
    every = np.repeat(samples, len(FAULTS), axis=0)
    for row, fault in enumerate(FAULTS.values()):
        every[row, :, channel[0]] = fault(Pieces(samples, channel, onset, RATE_HZ))[0]
    return every, int(channel[0]), onset


def monitored(flight: DataBlock, axis: int, settings: RecordedSignal) -> dict[str, str]:
    """Return what becomes of each fault: right, wrong, missed or prior; ``+`` when a healthy channel is lost later."""
    every, channel, onset = faulted(flight, axis)
    failed_at = outcomes(every, np.repeat(channel, len(every)), onset, settings, flight.rate_hz)["failed_at"]
    return {name: _outcome(first, channel, onset) for name, first in zip(FAULTS, failed_at, strict=True)}


def selected(unit: Sequence[DataBlock], axis: int) -> dict[str, str]:
    """Return the same by PX4's rule, to which the three axes of ``unit`` are one sensor each."""
    every, channel, onset = faulted(unit[axis], axis)
    first = [_distrusted(unit, axis, samples) for samples in every]
    return {name: _outcome(frames, channel, onset) for name, frames in zip(FAULTS, first, strict=True)}


def _distrusted(unit: Sequence[DataBlock], axis: int, samples: Floats) -> NDArray[np.int64]:
    """Return (4,) the first row in which each sensor is distrusted, with ``samples`` (n, 4) on one of its axes."""
    n = min(len(samples), *(flight.samples.shape[1] for flight in unit))
    columns = [samples.T if k == axis else flight.samples for k, flight in enumerate(unit)]
    signals = {name: Samples([np.ascontiguousarray(c[:n]) for c in of]) for name, of in zip(AXES, columns, strict=True)}
    settings = SELECTION.signals(signals, "")
    voted = vote(Recording(np.arange(n) / RATE_HZ, signals), settings, [], triads=TRIADS)[list(AXES)[axis]]
    first = np.full(4, NEVER)
    for failure in reversed(voted.failures):
        first[failure.channel - 1] = round(failure.time_s * RATE_HZ)
    return first


def _outcome(first: NDArray[np.int64], channel: int, onset: int) -> str:
    when = np.where(first == NEVER, np.iinfo(np.int64).max, first)
    if when.min() < onset:
        return "prior"
    if when.min() == np.iinfo(np.int64).max:
        return "missed"
    if when[channel] > when.min():
        return "wrong"
    return "right+" if np.sum(when < np.iinfo(np.int64).max) > 1 else "right"


def chosen(train: Signals, grid: Grid) -> dict[str, Design]:
    """Return the design of each signal that ``rig thresholds`` would choose."""
    names, rate_hz = [flight.name for flight in next(iter(train.values()))], RATE_HZ
    hours = sum(flight.hours for flight in next(iter(train.values())))
    made = design(Data(names, rate_hz, hours, train, dict.fromkeys(train, GIVEN)), grid, keep=True)
    return {name: of.design for name, of in made.items() if of.design is not None}


def splits(number: int) -> list[tuple[list[int], list[int]]]:
    """Return FOLDS times the flights that design and those that are flown."""
    order = np.random.default_rng(0).permutation(number)
    tests = [sorted(order[fold::FOLDS].tolist()) for fold in range(FOLDS)]
    return [([k for k in range(number) if k not in test], test) for test in tests]


def row(title: str, isolations: str, runs: list[dict[str, str]]) -> list[str]:
    """Return one setting's outcomes: all, then right by kind."""
    every = [outcome for run in runs for outcome in run.values()]
    counts = [sum(o.startswith(kind) for o in every) for kind in ("right", "wrong", "missed", "prior")]
    later = sum(o.endswith("+") for o in every)
    kinds = (sum(run[name].startswith("right") for run in runs) for name in FAULTS)
    return [title, isolations, "/".join(map(str, counts)), str(later), *map(str, kinds)]


def fixed(signals: Signals, threshold: float, frames: int) -> list[str]:
    """Return the row of one setting for all flights."""
    settings = RecordedSignal(threshold=threshold, persistence=frames)
    places = [(axis, flight) for axis, of in enumerate(signals.values()) for flight in of]
    healthy = (np.ascontiguousarray(flight.samples.T)[None] for _, flight in places)
    none, rate_hz = np.zeros(1, np.int64), places[0][1].rate_hz
    watched = [outcomes(rows, none, rows.shape[1], settings, rate_hz) for rows in healthy]
    hit = sum(bool((of["failed_at"] != NEVER).any()) for of in watched)
    runs = [monitored(flight, axis, settings) for axis, flight in places]
    return row(f"{threshold:g} deg/s, {frames} frames", f"in {hit} of {len(places)}", runs)


def designed(signals: Signals, grid: Grid) -> list[str]:
    """Return the row of what the budget of a grid comes to in flights that did not design it."""
    runs, counts, over = [], [], 0
    for train, test in splits(len(next(iter(signals.values())))):
        made = chosen({name: [of[k] for k in train] for name, of in signals.items()}, grid)
        healthy = {name: [of[k] for k in test] for name, of in signals.items()}
        fold = [count(healthy[name], GIVEN, made[name], grid.budget_per_h)[4] for name in signals]
        counts += fold
        over += poisson.sf(sum(c.counted for c in fold) - 1, sum(c.expected for c in fold)) < OVER
        for axis, name in enumerate(signals):
            runs += [monitored(flight, axis, made[name].settings(GIVEN)) for flight in healthy[name]]
    hours, counted = sum(c.hours for c in counts), sum(c.counted for c in counts)
    allowed = Count(counted, hours, grid.budget_per_h).expected
    said = f"{counted} in {hours:.3f} h, allowed {allowed:.1f}; folds over {over} of {FOLDS}"
    slow_faults = ", slow faults" if grid.slow_faults else ""
    return row(f"budget {grid.budget_per_h:g}/h{slow_faults}", said, runs)


def thresholds_quad(folder: str) -> None:
    """Print the folds of every budget, the same runs of fixed settings and of PX4's rule (7 deg/s, 15 deg)."""
    data = load([Path(folder)], config(1.0, 8), "", repair=True, aligned=AlignOptions(to_s=6.0))
    signals = {name: data.signals[name] for name in AXES}
    units = list(zip(*signals.values(), strict=True))

    def rows() -> Iterator[list[str]]:
        yield from (designed(signals, Grid(budget, slow_faults=rules)) for budget in BUDGETS for rules in ((), RULES))
        yield from (fixed(signals, *settings) for settings in FIXED)
        yield row("PX4's rule", "", [selected(unit, k) for k in range(len(AXES)) for unit in units])

    print(f"{len(data.names)} flights, {data.hours:.3f} h\n")
    outcomes = "right/wrong/missed/prior of 462", "then a healthy one"
    table(("setting", "false isolations", *outcomes, *FAULTS), rows())


# Noise of known kinds -------------------------------------------------------------------------------------------------

SYNTHETIC_HZ: Final = 100.0
DESIGN_H: Final = 2.0
NOISE_BUDGETS: Final = (10.0, 1.0, 0.1)


def first_order(rng: np.random.Generator, shape: tuple[int, int], time_s: float) -> Any:
    """Return noise of standard deviation 1 and a time constant."""
    a = float(np.exp(-1.0 / (SYNTHETIC_HZ * time_s)))
    start = a * rng.normal(size=(shape[0], 1))
    return lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], rng.normal(size=shape), axis=1, zi=start)[0]


KINDS: Final[dict[str, Callable[[np.random.Generator, int], Any]]] = {
    "white": lambda rng, n: rng.normal(size=(4, n)),
    "first order, 50 ms": lambda rng, n: first_order(rng, (4, n), 0.05),
    "slowly moving scale": lambda rng, n: np.exp(0.3 * first_order(rng, (1, n), 60.0)) * rng.normal(size=(4, n)),
}


def noise(kind: str, hours: float, seed: int) -> list[DataBlock]:
    """Return flights of a quarter of an hour."""
    rng = np.random.default_rng([seed, *kind.encode()])
    n = round(900 * SYNTHETIC_HZ)
    return [DataBlock(f"{kind} {k}", KINDS[kind](rng, n), SYNTHETIC_HZ) for k in range(round(4 * hours))]


def _counted(train: list[DataBlock], test: list[DataBlock], frames: int, budget: float) -> str:
    made = designs(train, GIVEN, Grid(budget, (frames,), (4,), (0.0,)))[0]
    events = count(test, GIVEN, made, budget)[4]
    rate = events.counted / events.hours
    return f"{made.threshold.upper:.3f}: {events.counted}, {rate:.3g}{' over' if events.over else ''}"


def thresholds_synthetic(hours: str = "40") -> None:
    """Print threshold: events, events an hour; designed on 2 h, counted in 40 h; the scale moves over 60 s."""

    def rows() -> Iterator[list[str]]:
        for kind in KINDS:
            parts = [
                (f.name, part)
                for f in noise(kind, DESIGN_H, 1)
                for part in np.array_split(f.samples, STRETCHES // 8, 1)
            ]
            train, test = [DataBlock(name, part, SYNTHETIC_HZ) for name, part in parts], noise(kind, float(hours), 2)
            for frames in (8, 24):
                yield [f"{kind}, {frames} frames", *(_counted(train, test, frames, b) for b in NOISE_BUDGETS)]

    table(("noise", *(f"budget {budget:g}/h" for budget in NOISE_BUDGETS)), rows())


def recorded(rows: int, signals: int) -> Data:
    """Return white noise on a common motion, in ten flights."""
    of_signals: dict[str, list[DataBlock]] = {}
    names = [f"flight {k}" for k in range(10)]
    for s in range(signals):
        motion = 5.0 * np.sin(np.arange(rows) / 300.0 + s)
        samples = motion + np.random.default_rng(s).normal(size=(4, rows))
        parts = zip(names, np.array_split(samples, 10, axis=1), strict=True)
        of_signals[f"signal_{s}"] = [DataBlock(name, np.ascontiguousarray(p), SYNTHETIC_HZ) for name, p in parts]
    settings = dict.fromkeys(of_signals, RecordedSignal(threshold=1.0))
    return Data(names, SYNTHETIC_HZ, rows / SYNTHETIC_HZ / 3600.0, of_signals, settings)


def thresholds_speed(rows: str = "1000000", signals: str = "16") -> None:
    """Print how long all filters, persistences and levels of the defaults take; the first design compiles."""
    design(recorded(20_000, 1), Grid(10.0))
    data = recorded(int(rows), int(signals))
    clock, used = perf_counter(), process_time()
    results = design(data, Grid(10.0))
    taken_s, used_s = perf_counter() - clock, process_time() - used
    made = sum(len(result.designs) for result in results.values())
    print(f"{rows} rows of {signals} signals: {made} designs in {taken_s:.1f} s, {used_s:.1f} s of processor time")
