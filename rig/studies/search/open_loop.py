"""Open-loop trials instead of flights: the faults and the manager of one signal over the truth of a healthy flight.

The truth does not react to the vote, so a requirement that needs the plant is refused.  All trials of an arm use the
same healthy flight; sensor noise and errors come from each trial's seed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator

from rig.bench.drive import Stages, run
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, INDEX, Block, rows
from rig.studies.campaign.campaign_file import Levels
from rig.studies.campaign.plan import Plan, Run
from rig.studies.campaign.tables import TABLES, Rows, measured
from rig.studies.campaign.worker import Orders, check_rig
from rig.studies.reliability.drawn import KEYS, Cell, Drawn, records
from rig.studies.reliability.one_signal import Recording, faults_of, one_signal, recording
from rig.verdict.requirements.measure import check_rows
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder
from rig.verdict.requirements.subject import WITH_TRUTH, Subject, of_flight
from rig.world.faults import FaultData
from rig.world.faults.effects import RANDOM
from rig.world.faults.fault_records import FOREVER, KEPT, Trigger
from rig.world.sensors import SensorData
from rig.world.sensors.params import calibrate

OUTCOME: Final = "bench"  # of a run of the table
_TRUTH_SEED: Final = 0  # of the healthy flight
_MOST_PLACES: Final = 32
_OFFERS: Final = WITH_TRUTH | {"healthy"}


class Place(NamedTuple):
    """The common part of trials whose faults differ only in numbers."""

    cell: Cell
    recording: Recording
    subject: Subject


_places: dict[str, Place] = {}  # of this worker, the last few


def run_batch(runs: Sequence[Run], orders: Orders) -> Rows:
    """Run trials one after the other, as ``campaign.worker.fly_batch`` flies.  RigError: another version of rig."""
    check_rig(orders)
    return {**{table: [] for table in TABLES}, "runs": [trial_row(each, orders.requirements) for each in runs]}


def check(plan: Plan) -> None:
    """Raise BadInput for a setting that open-loop trials cannot run, or a requirement that needs more signals."""
    for key, vary in plan.campaign.varied():
        head, _, rest = key.partition(".")
        if not isinstance(vary, Levels) and (head != "faults" or rest.partition(".")[2] not in KEYS):
            raise BadInput(f"{plan.source}: vary: {key!r}: --bench can vary only {', '.join(KEYS)} of a fault")
    keys = {_common(plan[i].data): i for i in range(len(plan.choices))}
    for i in keys.values():
        try:
            RequirementsRecorder(plan.requirements, _cell(plan[i])[1])
        except BadInput as error:
            raise BadInput(f"--bench: {error}") from None


def trial_row(each: Run, requirements: Sequence[Requirement]) -> dict[str, Any]:
    """Return the row of one trial in ``runs``."""
    key = _common(each.data)
    if key not in _places:
        for old in list(_places)[: max(0, len(_places) - _MOST_PLACES)]:
            del _places[old]
        cell, subject = _cell(each)
        _places[key] = Place(cell, recording(cell.scenario, _TRUTH_SEED), subject)
    place = _places[key]
    row = {"run": each.number, "seed": each.data["seed"], "outcome": OUTCOME}
    return row | measured(check_rows(_trial(place, each.data), place.subject, requirements))


def _common(data: dict[str, Any]) -> str:
    """Return the key of a Place: the scenario's table without its seed and the faults' numbers."""
    faults = [
        {key: None if _is_number(key, value) else value for key, value in each.items()} for each in data["faults"]
    ]
    return json.dumps({**data, "seed": None, "faults": faults}, sort_keys=True)


def _is_number(key: str, value: Any) -> bool:
    return key in KEYS and isinstance(value, float)


def _cell(each: Run) -> tuple[Cell, Subject]:
    scenario = each.scenario()
    names = {fault.signal for fault in scenario.faults}
    if len(names) != 1 or next(iter(names)) not in INDEX:
        raise BadInput("open-loop trials need all faults on channels of one signal")
    name = names.pop()
    cell = Cell(scenario, one_signal(scenario, name), faults_of(scenario, name), {}, 0, None, [])
    flight = of_flight(scenario)
    subject = Subject(
        rate_hz=scenario.rate_hz,
        frames=scenario.frames,
        signals=(flight.signals[INDEX[name]],),
        faults=flight.faults,
        offers=_OFFERS,
        called="an open-loop trial",
        faulted=(name,),
    )
    return cell, subject


def _trial(place: Place, data: dict[str, Any]) -> Block:
    """Return the rows of one trial, for the one signal."""
    cell, flown = place.cell, place.recording
    n, one = len(flown.truth), cell.one
    block = rows(1).block(n)
    block.view(np.uint8)[:] = 0
    block["frame"] = np.arange(n)
    block["truth"][:, 0] = flown.truth[:, one.signal]
    block["reference"][:, 0] = flown.reference[:, one.signal]
    block["second_reference"][:, 0] = flown.second_reference[:, one.signal]
    rng, manager = Generator(SFC64(data["seed"])), one.manager
    sensors, faults = _sensors(cell, rng, n), _faults(cell, data["faults"], rng, n)
    run(rows(1).nested(block), Stages(sensors, faults, manager=manager.data._replace(state=manager.new_state())))
    return block


def _sensors(cell: Cell, rng: Generator, n: int) -> SensorData:
    params = cell.one.params.copy()
    sensor = getattr(cell.scenario.sensors, cell.scenario.faults[0].signal)
    calibrate(params[0], sensor, rng.uniform(-1.0, 1.0, (3, CHANNELS)))
    noise = rng.standard_normal((n, 1, CHANNELS), np.float32)
    none = np.zeros((0, 0, 0))
    memory, line = np.zeros_like(cell.one.memory), np.zeros_like(cell.one.line)
    return SensorData(params, noise, none, memory, line, np.zeros(0, np.int64), none.astype(np.uint8))


def _faults(cell: Cell, tables: Sequence[dict[str, Any]], rng: Generator, n: int) -> FaultData:
    values = {
        (i, key): np.array([value])
        for i, table in enumerate(tables)
        for key, value in table.items()
        if _is_number(key, value)
    }
    schedule, targets = records(cell, Drawn(values, np.zeros((1, len(tables)), bool)))
    data: FaultData = cell.faults.data
    state = np.zeros_like(data.state)
    state["onset"] = np.where(schedule[0]["trigger"] == Trigger.TIME, schedule[0]["first"], FOREVER)
    noisy = int(np.isin(targets["act"], RANDOM).sum())
    return data._replace(
        schedule=schedule[0],
        targets=targets[0],
        state=state,
        kept=np.zeros(targets.shape[1], KEPT),
        memory=np.zeros_like(data.memory),
        seen=np.zeros_like(data.seen),
        normal=rng.standard_normal((n, noisy)),
        clean=data.clean[:0],
    )
