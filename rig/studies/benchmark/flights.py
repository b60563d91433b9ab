"""The first draws of the trials in closed loop: each manager at its level in the same JSBSim flights.

A flight has the onset, the size and the other varied values of an open-loop trial.  Its sensors and its seed are new,
and the same for all managers.  Only the faulty signal is calibrated; other signals have the scenario's settings or the
defaults of the baseline manager.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.random import SFC64, Generator
from numpy.typing import NDArray

from rig.bench.one_signal_trials import RESULT
from rig.core.frame import INDEX, SIGNALS, State, to_frame
from rig.core.settings import build
from rig.core.units.angles import differences
from rig.scenario import aircraft
from rig.scenario.overrides import set_key
from rig.scenario.scenario import Scenario
from rig.studies.benchmark.benchmark_trials import SCHEMA, STATES, Told, about, became, of_cell, streams_of, typed
from rig.studies.benchmark.calibration import Calibrated
from rig.studies.benchmark.entrants import Entrant, OfSignal, flown_by
from rig.studies.benchmark.own_class import with_values
from rig.studies.campaign.flying import fly
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.cell_trials import Batch
from rig.studies.reliability.drawn import Cell, cell, drawn_values
from rig.verdict.signal_kernels import first_failed
from rig.world.faults import Fault
from rig.world.faults.fault_settings import in_thresholds

FLOWN: Final[dict[str, Any]] = {**SCHEMA, "lost": pl.Boolean}
_SEED: Final = 4  # spawn key of the flights' seeds


class Flier:
    """Fly units of work in a worker process."""

    def __init__(self, plan: Plan, told: Told) -> None:
        self._plan, self._told = plan, told

    def __call__(self, unit: Batch) -> pl.DataFrame:
        """Return a row for each flight and manager."""
        made = cell(self._plan, unit.number, named=False)
        signal, rows = of_cell(made), list[dict[str, Any]]()
        values = drawn_values(made, unit.trials, Generator(SFC64(streams_of(unit)[0])))
        for trial in range(unit.trials):
            scenario = flight_scenario(self._plan, unit, trial, values)
            for entrant in self._told.entrants:
                mine = self._told.calibrated[entrant.name, signal.name]
                rows.append({"trial": trial, "manager": entrant.name, **_flown(scenario, entrant, signal, mine, made)})
        common = {"combination": unit.number, **about(self._plan, unit.number, made), "size": None}
        told = {"reference": STATES[0], "budget_per_h": self._told.budget_per_h}
        return typed([{**common, **told, **row} for row in rows], FLOWN)


def shared_out(units: Sequence[Batch], flights: int) -> list[Batch]:
    """Return the units of flights: the first trials of each combination, ``flights`` or more in all."""
    firsts = [unit for unit in units if unit.chunk == 0] if flights else []
    if not firsts:
        return []
    each = -(-flights // len(firsts))
    return [Batch(unit.number, 0, each, unit.seed) for unit in firsts]


def flight_scenario(
    plan: Plan, unit: Batch, trial: int, values: dict[tuple[int, str], NDArray[np.float64]]
) -> Scenario:
    """Return the scenario of one flight before a manager is set."""
    run = plan[unit.number]
    state = np.random.SeedSequence(unit.seed, spawn_key=(_SEED, unit.number, trial)).generate_state(1, np.uint64)
    data = {**run.data, "seed": int(state[0]) >> 1}
    for (place, key), drawn in values.items():
        data = set_key(data, f"faults.{place}.{key}", float(drawn[trial]), plan.source)
    made = build(Scenario, aircraft.merge(aircraft.tables(run.aircraft), data), plan.source)
    faults = [_absolute(fault, made) for fault in made.faults]
    return made.model_copy(update={"faults": faults}).trusted(plan.trust)


def _absolute(fault: Fault, scenario: Scenario) -> Fault:
    """Return a fault with its magnitude in the unit of the signal: a manager may have another threshold."""
    for key in fault.sizes:
        name = in_thresholds(key)
        value = getattr(fault, name, None)
        if value is not None:
            threshold = getattr(scenario.redundancy.signals, fault.signal).threshold
            return fault.model_copy(update={key: value * threshold, name: None})
    return fault


def _flown(scenario: Scenario, entrant: Entrant, signal: OfSignal, mine: Calibrated, made: Cell) -> dict[str, Any]:
    """Fly one flight with one manager and return its outcome."""
    told = flown_by(scenario, entrant, signal, mine.values, mine.keys)
    with with_values(entrant.manager, mine.values) if entrant.is_own else nullcontext():
        flight = fly(told)
    s, fault = INDEX[signal.name], scenario.faults[made.tested]
    onset = to_frame(float(fault.start_s or 0.0), scenario.rate_hz)
    failed = flight.table["state"][:, s] == State.FAILED
    result = np.zeros(1, RESULT)
    result["failed_at"] = first_failed(failed)
    rows = flight.table.rows[onset:]
    errors = np.abs(differences(rows["voted"][:, s], rows["truth"][:, s], SIGNALS[s].wraps))
    result["peak"] = np.nan_to_num(errors, nan=np.inf).max(initial=0.0)
    found = became(made, np.array([onset]), result)
    return {**{name: column[0] for name, column in found.items()}, "lost": not flight.verdict.survived}
