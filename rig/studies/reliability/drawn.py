"""Draw the trials of one combination of a campaign's cases: onset, size, other varied values, and sensor errors.

The fault stage makes the records of the faults from the scenario; each trial overwrites the varied values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.bench.one_signal_trials import Trials
from rig.computer.redundancy.managers import manager_kind
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, to_frames
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario
from rig.studies.campaign.campaign_file import Distribution, Levels, Vary
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.sampling import valuer
from rig.studies.reliability.one_signal import OneSignal, Recording, faults_of, one_signal, setting_key
from rig.studies.reliability.tally import SECOND, TESTED
from rig.verdict.monitored_places import allowed_frames, lingers
from rig.world.faults import KINDS, Faults
from rig.world.faults.effects import RANDOM, Act
from rig.world.faults.fault_records import Trigger
from rig.world.faults.fault_settings import in_thresholds
from rig.world.faults.trigger import DutyCycle
from rig.world.sensors.params import calibrate

RUN_IN: Final = 10  # frames of healthy sensors before the first fault
SETTLING: Final = 30  # frames from an earlier fault that is isolated at once to the tested one
ROWS: Final = 8192  # of the streams, at least: what the core's cache holds
AFTER: Final = 800  # frames from the last onset on, at most; a drift continues to the end of the flight
_SIZES: Final = tuple(dict.fromkeys(key for model in KINDS.values() if model.trials_draw for key in model.sizes))
_CONSTANTS: Final = ("frequency_hz", "time_constant_s")
Values = NDArray[np.float64]


_tables = cache(aircraft.tables)  # of an aircraft, read once by each worker


class Drawn(NamedTuple):
    """The drawn values by the number of a fault and its key, each (T,)."""

    values: dict[tuple[int, str], Values]
    up: NDArray[np.bool_]  # (T, F) for faults whose direction is drawn


class Cell(NamedTuple):
    """The common part of the trials of one combination."""

    scenario: Scenario
    one: OneSignal
    faults: Faults
    varied: dict[tuple[int, str], Vary]
    tested: int
    second: int | None
    earlier: list[int]


def cell(plan: Plan, number: int, named: bool = True) -> Cell:
    """Return the common part of the combination of run ``number``.  BadInput: open-loop trials cannot do it.

    named : the tested fault must have the id; if not ``named`` and no fault has it, the first fault is tested
    """
    run = plan[number]
    scenario = run.scenario(_tables(run.aircraft))
    labels = [fault.label for fault in scenario.faults]
    if TESTED not in labels and (named or not labels):
        wanted = f" with id = {TESTED!r}" if named else " to detect"
        raise BadInput(f"{plan.source}: run {number}: has no fault{wanted}")
    tested = labels.index(TESTED) if TESTED in labels else 0
    second = labels.index(SECOND) if SECOND in labels else None
    name = scenario.faults[tested].signal
    made = faults_of(scenario, name)
    if np.isin(made.schedule["duty_cycle"], (DutyCycle.RANDOM, DutyCycle.TELEGRAPH)).any():
        raise BadInput(f"{plan.source}: run {number}: open-loop trials do not support pulses at random times")
    earlier = [i for i in range(len(labels)) if i not in (tested, second)]
    alone = one_signal(scenario, name, setting_key(run.data))
    return Cell(scenario, alone, made, _varied(plan, number), tested, second, earlier)


def _varied(plan: Plan, number: int) -> dict[tuple[int, str], Vary]:
    """Return the varied settings in the combination of a run, by fault and key."""
    campaign, choice = plan.campaign, plan.choices[number]
    cases = [case for group, all_of in campaign.cases.items() for case in all_of if case.name == choice[group]]
    found: dict[tuple[int, str], Vary] = {}
    for key, vary in [*campaign.vary.items(), *(item for case in cases for item in case.vary.items())]:
        head, _, rest = key.partition(".")
        place, _, name = rest.partition(".")
        if head != "faults" or not place.isdigit() or isinstance(vary, Levels | Distribution) or name not in KEYS:
            raise BadInput(f"{plan.source}: vary: {key!r}: open-loop trials can vary only {', '.join(KEYS)} of a fault")
        found[int(place), name] = vary
    return found


def draw(made: Cell, trials: int, recording: Recording, rng: Generator) -> Trials:
    """Hold some trials of a cell; ``refill`` draws the rows of their streams."""
    s = made.one.signal
    values = drawn_values(made, trials, rng)
    drawn = Drawn(values, rng.random((trials, len(made.faults.schedule))) < 0.5)
    schedule, targets = records(made, drawn)
    onset = schedule["first"][:, made.tested].copy()  # contiguous, as all others: one kernel for all cells
    at_once = all(made.scenario.faults[i].found_at_once for i in made.earlier)
    # What is integrated has a long memory.
    if at_once and not manager_kind(made.scenario.redundancy.manager).takes_back:
        schedule["first"][:, made.earlier] = onset[:, None] - SETTLING
    begins = np.where(schedule["trigger"] == Trigger.TIME, schedule["first"], onset[:, None])
    first = np.maximum(begins.min(axis=1) - RUN_IN, 0)
    counted_from = onset if made.second is None else onset + schedule["delay"][:, made.second]
    drifts = made.scenario.faults[made.tested].effect.act == Act.DRIFT
    last = np.minimum(counted_from + (len(recording.truth) if drifts else AFTER), len(recording.truth))
    rows = max(ROWS, int((last - first).max()))
    sensors = np.repeat(made.one.params, trials)
    sensor = getattr(made.scenario.sensors, made.scenario.faults[made.tested].signal)
    calibrate(sensors, sensor, rng.uniform(-1.0, 1.0, (3, trials, CHANNELS)))
    noisy = int(np.isin(targets["act"], RANDOM).sum(axis=1).max())
    return Trials(
        first=first,
        onset=onset,
        counted_from=counted_from,
        tested=made.tested,
        last=last,
        early=int(made.one.latches),
        linger=int(lingers(made.one.manager.params)[0]),
        threshold=made.one.threshold,
        allowed=allowed_frames(made.one.manager.params[0]),
        truth=np.ascontiguousarray(recording.truth[:, s]),
        reference=np.ascontiguousarray(recording.reference[:, s]),
        second=np.ascontiguousarray(recording.second_reference[:, s]),
        reference_step=np.zeros(trials),
        reference_from=np.zeros(trials, np.int64),
        sensors=sensors[:, None],
        noise=np.empty((rows, 1, CHANNELS), np.float32),
        schedule=schedule,
        targets=targets,
        normal=np.empty((rows, noisy)),
    )


def drawn_values(made: Cell, trials: int, rng: Generator) -> dict[tuple[int, str], Values]:
    """Return the varied values of the trials, (T,) each, from the first random numbers that ``draw`` takes."""
    values: dict[tuple[int, str], Values] = {}
    for place, vary in made.varied.items():
        value = valuer(vary)
        values[place] = np.array([value(share) for share in rng.random(trials).tolist()])
    return values


def refill(trials: Trials, noise: Generator, normal: Generator) -> None:
    """Draw the next rows of the streams, in place."""
    noise.standard_normal(out=trials.noise, dtype=np.float32)
    normal.standard_normal(out=trials.normal)


def records(made: Cell, drawn: Drawn) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the records (T, F) SCHEDULE and (T, K) TARGET with the drawn values."""
    trials = len(drawn.up)
    schedule = np.repeat(made.faults.schedule[None, :], trials, axis=0)
    targets = np.repeat(made.faults.targets[None, :], trials, axis=0)
    for (i, key), values in drawn.values.items():
        mine = made.faults.targets["fault"] == i
        KEYS[key](_Patch(made, i, key, values, drawn.values, schedule[:, i], targets, mine))
    for i, fault in enumerate(made.scenario.faults):
        if fault.effect.act == Act.RANGE_END and fault.effect.value == 0.0:
            mine, up = made.faults.targets["fault"] == i, drawn.up[:, i, None]
            first = targets[0, mine][0]
            ends = (np.pi, -np.pi) if first["act"] == Act.ADD_ANGLE else (first["high"], first["low"])
            targets["value"][:, mine] = np.where(up, *ends)
    return schedule, targets


class _Patch(NamedTuple):
    """One varied key of one fault, and the records that hold it."""

    cell: Cell
    fault: int
    key: str
    values: Values
    others: Mapping[tuple[int, str], Values]
    schedule: NDArray[Any]  # (T,) of the fault
    targets: NDArray[Any]  # (T, K), and which are the fault's
    mine: NDArray[np.bool_]

    def frames(self, seconds: Values) -> NDArray[np.int64]:
        """Return whole frames."""
        return to_frames(seconds, self.cell.scenario.rate_hz)

    def other(self, key: str) -> Values:
        """Return another key of the fault, drawn or from the scenario."""
        stands = getattr(self.cell.scenario.faults[self.fault], key)
        return self.others.get((self.fault, key), np.full(len(self.values), stands))


def _start(patch: _Patch) -> None:
    patch.schedule["first"] = patch.frames(patch.values)


def _delay(patch: _Patch) -> None:
    patch.schedule["delay"] = patch.frames(patch.values)


def _size(patch: _Patch) -> None:
    scale = patch.cell.one.threshold if patch.key not in _SIZES else 1.0
    patch.targets["value"][:, patch.mine] = (patch.values * scale)[:, None]


def _constant(patch: _Patch) -> None:
    patch.targets[patch.key][:, patch.mine] = patch.values[:, None]


def _pulses(patch: _Patch) -> None:
    gap, contact = patch.other("gap_s"), patch.other("contact_s")
    on = np.maximum(1, patch.frames(gap))
    patch.schedule["on"], patch.schedule["cycle"] = on, np.maximum(on + 1, patch.frames(gap + contact))


KEYS: Final[dict[str, Callable[[_Patch], None]]] = {
    "start_s": _start,
    "delay_s": _delay,
    **dict.fromkeys((*_SIZES, *map(in_thresholds, _SIZES)), _size),
    **dict.fromkeys(_CONSTANTS, _constant),
    **dict.fromkeys(("gap_s", "contact_s"), _pulses),
}
