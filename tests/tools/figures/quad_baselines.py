"""Ours and baseline managers at one budget of false isolations on four IMUs of a quadrotor: a half designs, the other
is flown.

One fault at a time in one of three channels of each flight and axis, after 20 to 60 % of the flight: right when the
faulty channel is the first to be failed after that and none is failed before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from figures import table
from figures.quadrotor import AXES, config
from figures.thresholds import EARLIEST, GIVEN, RATE_HZ, Signals
from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines, Cusum
from rig.computer.redundancy.managers import Manager
from rig.core.runs import cluster_starts
from rig.log.recordings.alignment import AlignOptions
from rig.studies.benchmark.calibration import calibrate
from rig.studies.benchmark.calibration_data import Flight, Healthy
from rig.studies.benchmark.entrants import Entrant, OfSignal, manager
from rig.studies.thresholds.data import Data, load
from rig.studies.thresholds.design import DataBlock, Grid
from rig.studies.thresholds.design_signals import design
from rig.studies.thresholds.pieces import failures, outcomes_of, parameters
from rig.studies.thresholds.residual_series import residuals
from rig.studies.thresholds.slow_fault_limits import RULES, Rule
from rig.studies.thresholds.tail import GAP_S
from rig.studies.thresholds.tradeoff import Pieces, faulty
from rig.verdict.signal_kernels import NEVER

Floats = NDArray[np.float64]
Make = Callable[[str, list[DataBlock], float], Manager]  # of an axis, its flights and a budget an hour
OFFSETS: Final = (5, 10, 15, 20, 30, 60)  # deg/s
FAULTS: Final[dict[str, Callable[[Pieces], Floats]]] = {
    **{f"offset {size}": partial(faulty, kind="offset", size=float(size)) for size in OFFSETS},
    **{f"ramp {size}/s": partial(faulty, kind="ramp", size=float(size)) for size in (1, 5)},
    **{f"noise x{size}": partial(faulty, kind="noise", size=float(size)) for size in (3, 10)},
    **{f"gain {size:g}": partial(faulty, kind="gain", size=size) for size in (0.8, 0.5)},
    "stuck": partial(faulty, kind="stuck", size=0.0),
}
CHANNELS: Final = 3  # of four that are faulty in turn


def of_signal(name: str, flights: Sequence[DataBlock], limit: float) -> OfSignal:
    """Return the axis as a benchmark has it, in deg/s; ``limit`` of the sums of ``cusum``, spreads times frames."""
    spread = residuals([(flight.samples, None) for flight in flights], GIVEN, RATE_HZ).spread
    baselines = Baselines(cusum=Cusum(spread=spread, limit=limit))
    return OfSignal(name, parameters(GIVEN, 4, RATE_HZ), GIVEN, baselines, RATE_HZ)


def calibrated(name: str, axis: str, flights: list[DataBlock], budget_per_h: float, limit: float = 120.0) -> Manager:
    """Return a baseline manager with its level for the budget on ``flights``."""
    signal, entrant = of_signal(axis, flights, limit), Entrant(name, name)
    rows = [
        Flight(f.name, np.ascontiguousarray(f.samples.T), np.full((f.samples.shape[1], 2), np.nan)) for f in flights
    ]
    found = calibrate(entrant, signal, Healthy({axis: rows}, sum(f.hours for f in flights), ""), budget_per_h)
    return manager(entrant, signal, found.values)


def designed(rules: Sequence[Rule], axis: str, flights: list[DataBlock], budget_per_h: float) -> Manager:
    """Return ours as ``rig thresholds`` chooses it with ``rules`` of slow faults."""
    hours = sum(flight.hours for flight in flights)
    data = Data([flight.name for flight in flights], RATE_HZ, hours, {axis: flights}, {axis: GIVEN})
    made = design(data, Grid(budget_per_h, slow_faults=rules), keep=True)[axis].design
    assert made is not None
    return Manager("cross-channel", parameters(made.settings(GIVEN), 4, RATE_HZ))


ENTRANTS: Final[dict[str, Make]] = {
    "built-in, no slow-fault rule": partial(designed, ()),
    "built-in, all slow-fault rules": partial(designed, RULES),
    "selection, calibrated": partial(calibrated, "selection"),
    "cusum, 120 spreads": partial(calibrated, "cusum"),
}


def became(of: Manager, axis: int, flight: DataBlock) -> Iterator[tuple[str, str]]:
    """Yield each fault and what became of it: right, wrong, missed or prior."""
    rng = np.random.default_rng([1, axis, *Path(flight.name).name.encode()])
    samples = np.ascontiguousarray(flight.samples.T)[None]
    for fault, channel in product(FAULTS, rng.permutation(4)[:CHANNELS]):
        onset = max(EARLIEST, int(samples.shape[1] * rng.uniform(0.2, 0.6)))
        rows = samples.copy()
        rows[0, :, channel] = FAULTS[fault](Pieces(samples, np.array([channel]), onset, RATE_HZ))[0]
        failed = outcomes_of(rows, np.array([channel]), onset, of)["failed_at"][0]
        when = np.where(failed == NEVER, np.iinfo(np.int64).max, failed)
        first = int(when.argmin())
        outcome = "right" if first == channel else "wrong"
        outcome = "missed" if failed[first] == NEVER else "prior" if when[first] < onset else outcome
        yield fault, outcome


def row(title: str, make: Make, signals: Signals, budget_per_h: float) -> list[str]:
    """Return one entrant's row: false isolations in the other half, outcomes in all, right by kind."""
    runs: list[tuple[str, str]] = []
    isolated = 0
    for (axis, (name, flights)), first in product(enumerate(signals.items()), (0, 1)):
        made = make(name, flights[first::2], budget_per_h)
        for flight in flights[1 - first :: 2]:
            at = failures(np.ascontiguousarray(flight.samples.T), None, made)
            isolated += len(cluster_starts(at, round(GAP_S * RATE_HZ)))
            runs += became(made, axis, flight)
    counts = [sum(outcome == kind for _, outcome in runs) for kind in ("right", "wrong", "missed", "prior")]
    kinds = (f"{100 * np.mean([o == 'right' for f, o in runs if f == fault]):.0f}" for fault in FAULTS)
    shares = f"{100 * counts[0] / len(runs):.1f}", "/".join(map(str, counts))
    return [title, f"{budget_per_h:g}", str(isolated), *shares, *kinds]


def quad_baselines(folder: str, budgets: str = "10,3,1", names: str = "") -> None:
    """Print every entrant at every budget."""
    data = load([Path(folder)], config(1.0, 8), "", repair=True, aligned=AlignOptions(to_s=6.0))
    signals: dict[str, Any] = {name: data.signals[name] for name in AXES}
    wanted = [name for name in ENTRANTS if not names or any(each in name for each in names.split(";"))]
    chosen = product(wanted, map(float, budgets.split(",")))
    print(f"{len(data.names)} flights, {data.hours:.3f} h\n")
    header = ("manager", "budget, 1/h", "false isolations", "right, %", "right/wrong/missed/prior")
    table((*header, *FAULTS), (row(name, ENTRANTS[name], signals, budget) for name, budget in chosen))
