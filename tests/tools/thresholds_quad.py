"""Thresholds from a budget on real flights: designed on four fifths, flown on the rest; not a test, run it by hand:

    python tests/tools/thresholds_quad.py FOLDER [seed]

FOLDER holds the flights of four IMUs on one quadrotor (docs/vote.md), as ``quad_imu_horizontal``; alignment is found in
the first six seconds of each.  Nobody is faulty, so a channel that is failed is a false isolation.  Then one channel of
each flight and axis is made faulty, after 20 to 60 % of the flight, by each of eleven faults in turn, and the flight
goes on to its end: right when the faulty channel is the first to be failed after that, wrong when another is, prior
when one had been failed before.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from quad_isolations import AXES, TRIADS, config
from quad_selection import CONFIG as SELECTION
from scipy.stats import poisson

from rig.bench.vote import vote
from rig.recordings.alignment import AlignOptions
from rig.recordings.recording import Recording, Samples
from rig.recordings.settings import RecordedSignal
from rig.thresholds import faults
from rig.thresholds.data import load
from rig.thresholds.design import Design, Flight, Grid, designs
from rig.thresholds.healthy import envelope
from rig.thresholds.holdout import OVER, Count, count
from rig.thresholds.monitored import NEVER, failures
from rig.thresholds.tradeoff import best, pieces, tradeoff

Floats = NDArray[np.float64]
Signals = dict[str, list[Flight]]
Chosen = dict[str, RecordedSignal]
BUDGETS: Final = (30.0, 10.0, 3.0, 1.0)
FOLDS: Final = 5
RATE_HZ: Final = 120.0
EARLIEST: Final = 800  # frames: after the stretch of the alignment
GIVEN: Final = RecordedSignal(threshold=1.0)
FAULTS: Final[dict[str, Callable[[Floats, NDArray[np.int64], int], Floats]]] = {
    **{f"offset {size}": faults.offset(float(size)) for size in (10, 20, 30, 60, 100)},
    "ramp 5/s": faults.ramp(5.0, RATE_HZ),
    "stuck": faults.stuck(),
    "hardover 250": lambda p, c, k: np.where(np.arange(p.shape[1]) < k, faults.own(p, c), 250.0),
    "nan 0.5 s": lambda p, c, k: np.where(np.abs(np.arange(p.shape[1]) - k - 30) < 30, np.nan, faults.own(p, c)),
    "noise x10": faults.noise(10.0),
    "gain 0.5": faults.gain(0.5),
}


def faulted(flight: Flight, axis: int, seed: int) -> tuple[Floats, int, int]:
    """The samples (fault, n, 4) with each fault in one channel from the onset on; the channel, the onset."""
    rng = np.random.default_rng([seed, axis, *flight.name.encode()])
    samples = np.ascontiguousarray(flight.samples.T)[None]
    n = samples.shape[1]
    onset = max(EARLIEST, int(n * rng.uniform(0.2, 0.6)))
    channel = rng.integers(4, size=1)
    every = np.repeat(samples, len(FAULTS), axis=0)
    for row, fault in enumerate(FAULTS.values()):
        every[row, :, channel[0]] = fault(samples, channel, onset)[0]
    return every, int(channel[0]), onset


def flown(flight: Flight, axis: int, settings: RecordedSignal, seed: int) -> dict[str, str]:
    """What becomes of each fault: right, wrong, missed or prior; ``+`` when a healthy channel is lost later."""
    every, channel, onset = faulted(flight, axis, seed)
    at = failures(every, settings, flight.rate_hz)
    return {name: _outcome(first, channel, onset) for name, first in zip(FAULTS, at, strict=True)}


def selected(unit: Sequence[Flight], axis: int, seed: int) -> dict[str, str]:
    """The same by PX4's rule, to which the three axes of ``unit`` are one sensor each."""
    every, channel, onset = faulted(unit[axis], axis, seed)
    return {
        name: _outcome(_distrusted(unit, axis, one), channel, onset) for name, one in zip(FAULTS, every, strict=True)
    }


def _distrusted(unit: Sequence[Flight], axis: int, samples: Floats) -> NDArray[np.int64]:
    """(4,) the first row in which each sensor is distrusted, with ``samples`` (n, 4) on one of its axes."""
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
    """The design of each signal that ``rig thresholds`` would choose."""
    found: dict[str, Design] = {}
    for name, flights in train.items():
        made, cut, motion = designs(flights, GIVEN, grid), pieces(flights), envelope(flights, False)
        assert cut is not None
        size = max(motion.value, motion.noise)
        found[name] = made[best(made, [tradeoff(cut, one, GIVEN, size) for one in made])]
    return found


def splits(count: int, seed: int) -> list[tuple[list[int], list[int]]]:
    """FOLDS times the flights that design and those that are flown."""
    order = np.random.default_rng(seed).permutation(count)
    tests = [sorted(order[fold::FOLDS].tolist()) for fold in range(FOLDS)]
    return [([k for k in range(count) if k not in test], test) for test in tests]


def part(signals: Signals, places: Sequence[int]) -> Signals:
    """Some of the flights of every signal."""
    return {name: [flights[k] for k in places] for name, flights in signals.items()}


def row(title: str, runs: list[dict[str, str]]) -> None:
    """One setting's outcomes: all, then right by kind."""
    every = [outcome for run in runs for outcome in run.values()]
    counts = [sum(o.startswith(kind) for o in every) for kind in ("right", "wrong", "missed", "prior")]
    later = sum(o.endswith("+") for o in every)
    kinds = "  ".join(f"{name} {sum(run[name].startswith('right') for run in runs)}" for name in FAULTS)
    print(f"{title:28} {'/'.join(map(str, counts))} of {len(every)}, then a healthy one {later}; {kinds}", flush=True)


def fixed(signals: Signals, settings: RecordedSignal, seed: int) -> tuple[int, list[dict[str, str]]]:
    """Flights and axes with a false isolation, and the runs, of one setting for all."""
    runs, hit = [], 0
    for axis, flights in enumerate(signals.values()):
        for flight in flights:
            hit += bool((failures(np.ascontiguousarray(flight.samples.T)[None], settings, flight.rate_hz) >= 0).any())
            runs.append(flown(flight, axis, settings, seed))
    return hit, runs


def designed(signals: Signals, grid: Grid, seed: int) -> None:
    """Print what the budget of a grid comes to in flights that did not design it."""
    runs, counts, over = [], [], []
    for train, test in splits(len(next(iter(signals.values()))), seed):
        made, flights = chosen(part(signals, train), grid), part(signals, test)
        fold = [count(flights[name], GIVEN, made[name], grid.budget_per_h)[4] for name in signals]
        counts += fold
        expected = sum(one.expected for one in fold)
        over.append(poisson.sf(sum(one.counted for one in fold) - 1, expected) < OVER)
        for axis, name in enumerate(signals):
            runs += [flown(flight, axis, made[name].settings(GIVEN), seed) for flight in flights[name]]
    hours, counted = sum(one.hours for one in counts), sum(one.counted for one in counts)
    whole = Count(counted, hours, grid.budget_per_h)
    title = f"{grid.budget_per_h:g}/h"
    print(
        f"budget {title}: {counted} false isolations in {hours:.3f} h, {counted / hours:.2f} an hour, "
        f"budget allows {whole.expected:.1f}; folds significantly over: {sum(over)} of {len(over)}"
    )
    row(title, runs)


def main() -> None:
    """Print the folds of every budget, and the same runs of fixed settings."""
    folder, seed = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    data = load([folder], config(1.0, 8), "", repair=True, aligned=AlignOptions(to_s=6.0))
    signals = {name: data.signals[name] for name in AXES}
    print(f"{len(data.names)} flights, {data.hours:.3f} h; right/wrong/missed/prior")
    for budget in BUDGETS:
        designed(signals, Grid(budget), seed)
    for threshold, frames in ((10.0, 8), (5.0, 24)):
        settings = RecordedSignal(threshold=threshold, persistence=frames)
        hit, runs = fixed(signals, settings, seed)
        print(f"{threshold:g} deg/s, {frames} frames: a false isolation in {hit} of {len(runs)} flights and axes")
        row(f"{threshold:g} deg/s, {frames} frames", runs)
    units = list(zip(*signals.values(), strict=True))
    row("PX4's rule, 7 deg/s, 15 deg", [selected(unit, k, seed) for k in range(len(AXES)) for unit in units])


if __name__ == "__main__":
    main()
