"""Open-loop trials of a campaign's combinations: every manager gets the same fault draws; each outcome is recorded.

The trials are those of reliability/cell_trials.py, with three differences.  Each begins at the start of the flight, so
that a manager that learns has learned.  Each ends AFTER frames after the last onset, whichever channels are isolated,
so that all managers get the same samples.  A combination needs no groups of that name.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray

from rig.bench.one_signal_trials import RESULT, Trials
from rig.bench.vote_rows import settings_of
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, INDEX
from rig.core.units.angles import differences
from rig.studies.benchmark.calibration import Calibrated
from rig.studies.benchmark.entrants import Entrant, OfSignal, manager
from rig.studies.benchmark.fault_places import kind_of, place_of
from rig.studies.benchmark.own_class import voted
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.cell_trials import CHUNK, Batch, Recordings, combinations, fly_trials, recorded_trials
from rig.studies.reliability.drawn import ROWS, Cell, cell, draw, refill
from rig.verdict.signal_kernels import NEVER, first_failed, trial_words
from rig.world.faults import KINDS
from rig.world.sensors import data_sheets

AFTER: Final = 1000  # frames from the last onset on
STATES: Final = ("as flown", "absent", "off", "jumping")  # of the reference
JUMP: Final = 3.0  # thresholds
BEFORE: Final = 200  # frames before the onset in which the reference jumps, for good
SCHEMA: Final[dict[str, Any]] = {
    "combination": pl.Int64,
    "trial": pl.Int64,  # of the combination
    "signal": pl.String,
    "place": pl.String,  # of the tested fault in the history, fault_places.py
    "kind": pl.String,
    "faults": pl.Int64,  # on the signal, the tested one counted
    "size": pl.Float64,  # thresholds, or a second of them; null for a kind without one
    "reference": pl.String,
    "budget_per_h": pl.Float64,
    "manager": pl.String,
    "outcome": pl.String,
    "delay_s": pl.Float64,  # from the onset to the last isolation, of the isolated
    "peak": pl.Float64,  # largest vote error from the last onset on, thresholds
}


class Told(NamedTuple):
    """The results of the calibration that a worker needs."""

    entrants: list[Entrant]
    calibrated: dict[tuple[str, str], Calibrated]  # by entrant and signal
    budget_per_h: float = 0.0
    worst: dict[str, float] = {}  # error of a healthy reference by signal, in its unit


def of_signals(plan: Plan) -> tuple[str, list[OfSignal]]:
    """Return the aircraft and the tested signals of a campaign.  BadInput: no detectable fault, or several aircraft."""
    found: dict[str, OfSignal] = {}
    aircraft: set[str] = set()
    for number in combinations(plan):
        made = cell(plan, number, named=False)
        aircraft.add(made.scenario.aircraft)
        fault = made.scenario.faults[made.tested]
        found.setdefault(fault.signal, of_cell(made))
    if len(aircraft) > 1:
        raise BadInput(f"{plan.source}: flies several aircraft ({', '.join(sorted(aircraft))}); a benchmark needs one")
    return aircraft.pop(), list(found.values())


def of_cell(made: Cell) -> OfSignal:
    """Return the signal of a combination whose faults are tested."""
    scenario, name = made.scenario, made.scenario.faults[made.tested].signal
    settings, _ = settings_of(scenario)
    redundancy = scenario.redundancy
    sheet = data_sheets(scenario.sensors, scenario.rate_hz)[INDEX[name]]
    sensor = SlowTests(**sheet._asdict()) if sheet.noise_std > 0.0 else None
    return OfSignal(name, made.one.manager.params, settings[name], redundancy.baselines, scenario.rate_hz, sensor)


def shared_out(plan: Plan, trials: int, seed: int) -> list[Batch]:
    """Return the units of work: ``trials`` of each combination, in chunks."""
    return [
        Batch(number, chunk, min(CHUNK, trials - chunk * CHUNK), seed)
        for number in combinations(plan)
        for chunk in range(-(-trials // CHUNK))
    ]


class Runner:
    """Run units of work in a worker process."""

    def __init__(self, plan: Plan, told: Told) -> None:
        self._plan, self._told, self._recordings = plan, told, Recordings(plan)

    def __call__(self, unit: Batch) -> pl.DataFrame:
        """Return a row for each trial, state of the reference and manager; as flown, also for other rates."""
        made = cell(self._plan, unit.number, named=False)
        signal = of_cell(made)
        condition = str(self._plan.choices[unit.number].get("condition", ""))
        streams = streams_of(unit)
        drawn = draw(made, unit.trials, self._recordings(unit, made, condition), Generator(SFC64(streams[0])))
        trials, frames = _whole(drawn), list[pl.DataFrame]()
        for state in STATES:
            seen = with_reference(made, trials, state, self._told.worst.get(signal.name, 0.0))
            for entrant in self._told.entrants:
                mine = self._told.calibrated[entrant.name, signal.name]
                others = mine.others if state == STATES[0] else []
                for budget, values in [(self._told.budget_per_h, mine.values), *others]:
                    results = _fly(entrant, signal, values, made, seen, streams)
                    columns = {"reference": state, "budget_per_h": budget, "manager": entrant.name}
                    frames.append(
                        _frame(self._plan, made, unit, trials, {**columns, **became(made, trials.onset, results)})
                    )
        return pl.concat(frames)


def streams_of(unit: Batch) -> list[SeedSequence]:
    """Return the seeds of a unit's draws: varied values, sensor noise, fault noise."""
    return SeedSequence(unit.seed, spawn_key=(unit.number, unit.chunk)).spawn(3)


def _fly(
    entrant: Entrant,
    signal: OfSignal,
    values: dict[str, float],
    made: Cell,
    trials: Trials,
    streams: Sequence[SeedSequence],
) -> NDArray[Any]:
    """Return (T,) RESULT of a manager; for the user's manager only ``failed_at`` and ``peak``."""
    noise, normal = (Generator(SFC64(child)) for child in streams[1:])  # again from their beginning
    if not entrant.is_own:
        told = made._replace(one=made.one._replace(manager=manager(entrant, signal, values)))
        return fly_trials(told, trials, lambda: refill(trials, noise, normal))[0]
    results = np.zeros(len(trials.first), RESULT)
    for part, read in recorded_trials(made, trials, lambda: refill(trials, noise, normal)):
        failed, votes = voted(entrant.manager, values, signal.params, read)
        here = results[part]
        here["failed_at"] = first_failed(failed)
        for trial, vote, from_, last in zip(here, votes, trials.counted_from[part], trials.last[part], strict=True):
            counted = slice(from_, last)
            error = np.abs(differences(vote[counted], trials.truth[counted], signal.given.wraps))
            trial["peak"] = np.nan_to_num(error, nan=np.inf).max()
            trial["failed_at"][trial["failed_at"] >= last] = NEVER
    return results


def _whole(trials: Trials) -> Trials:
    """Return trials that begin with the flight and have one length for all managers."""
    first = np.zeros_like(trials.first)
    last = np.minimum(trials.counted_from + AFTER, len(trials.truth))
    rows = max(ROWS, int(last.max()))
    noise, normal = (np.empty((rows, *old.shape[1:]), old.dtype) for old in (trials.noise, trials.normal))
    return trials._replace(first=first, last=last, early=0, noise=noise, normal=normal)


def with_reference(made: Cell, trials: Trials, state: str, worst: float) -> Trials:
    """Return the trials with the reference in one of STATES.

    off : in error by ``worst``, its largest error in healthy flights, towards the fault
    jumping : in error by JUMP thresholds from BEFORE frames before the onset on, while all channels are healthy
    A fault without a direction counts as upwards.
    """
    if state == "absent":
        absent = np.full_like(trials.reference, np.nan)
        return trials._replace(reference=absent, second=absent)
    if state == STATES[0]:
        return trials
    mine = int(np.flatnonzero(made.faults.targets["fault"] == made.tested)[0])
    up = trials.targets["value"][:, mine] >= 0.0
    step, begins = (worst, trials.first) if state == "off" else (JUMP * made.one.threshold, trials.onset - BEFORE)
    return trials._replace(reference_step=np.where(up, step, -step), reference_from=begins)


def became(made: Cell, onsets: NDArray[np.int64], results: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return outcome, delay_s and peak of (T,) bench.trials.RESULT with ``onsets`` (T,) of the tested fault."""
    targets, channels = made.faults.targets, np.arange(CHANNELS)
    of_test = np.isin(targets["fault"], [i for i in (made.tested, made.second) if i is not None])
    tested = np.isin(channels, targets["column"][of_test])
    healthy = (channels < made.one.manager.params["fitted"][0]) & ~np.isin(channels, targets["column"])
    outcome, frames = trial_words(results["failed_at"], onsets, tested, healthy)
    return {
        "outcome": outcome,
        "delay_s": frames / made.scenario.rate_hz,
        "peak": results["peak"] / made.one.threshold,
    }


def about(plan: Plan, number: int, made: Cell) -> dict[str, Any]:
    """Return the columns that all trials of a combination share."""
    fault = made.scenario.faults[made.tested]
    place, kind = place_of(plan, number, made), kind_of(plan, number, fault.kind)
    return {"signal": fault.signal, "place": place, "kind": kind, "faults": len(made.scenario.faults)}


def _frame(plan: Plan, made: Cell, unit: Batch, trials: Trials, columns: dict[str, Any]) -> pl.DataFrame:
    common = {
        "combination": unit.number,
        "trial": unit.chunk * CHUNK + np.arange(len(trials.onset)),
        **about(plan, unit.number, made),
        "size": _sizes(made, trials),
    }
    return typed({**common, **columns})


def typed(rows: Any, schema: dict[str, Any] = SCHEMA) -> pl.DataFrame:
    """Return rows, or columns by name, as a table of ``schema``; what is no number is empty."""
    made = pl.DataFrame(rows).cast(pl.Schema(schema)).select(list(schema))
    return made.with_columns(pl.col("size", "delay_s").fill_nan(None))


def _sizes(made: Cell, trials: Trials) -> NDArray[np.float64]:
    """Return the size of the tested fault in thresholds, without its sign; NaN for a kind without one."""
    fault = made.scenario.faults[made.tested]
    if not KINDS[fault.kind].sizes:
        return np.full(len(trials.onset), np.nan)
    mine = int(np.flatnonzero(made.faults.targets["fault"] == made.tested)[0])
    return np.abs(trials.targets["value"][:, mine]) / made.one.threshold


def joined(frames: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """Return all units as one table."""
    return pl.concat(frames) if frames else pl.DataFrame(schema=SCHEMA)
