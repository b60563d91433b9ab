"""Stages of a scenario that take settings of several tables, each at its first frame; replays build them too."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.lanes.health import NO_LANE, coverage
from rig.computer.lanes.lanes_stage import Lanes
from rig.computer.lanes.think import ComputerData
from rig.computer.redundancy import Redundancy
from rig.computer.redundancy.own import OwnManager
from rig.computer.servo_monitors import MonitorData, monitors
from rig.core.errors import BadInput
from rig.core.frame import COMPUTERS, MOVED, SIGNALS
from rig.scenario.scenario import Scenario
from rig.world import sensors
from rig.world.actuators.servo import LONGEST_SUBSTEP_S
from rig.world.actuators.servo_stage import Actuators, as_designed, stops_of
from rig.world.faults import Coils, Faults
from rig.world.plant.airframe import Actuator
from rig.world.plant.jsbsim import Plant
from rig.world.sensors import Sensors, inertial

if TYPE_CHECKING:
    from rig.world.plant.linear_plant import LinearPlant


def servos(scenario: Scenario, plant: Plant | LinearPlant) -> Actuators | None:
    """Return the servos that move the surfaces of ``plant``; None where its own lag does."""
    if not scenario.has_servos or not isinstance(plant, Plant):
        return None
    surfaces = _surfaces(scenario)
    made = Actuators(
        scenario.actuators,
        surfaces,
        plant.trim[: len(MOVED)],
        scenario.rate_hz,
        scenario.steps_per_frame,
        scenario.streams()["actuators"],
        monitors(scenario.actuators, stops_of(surfaces), scenario.rate_hz),
    )
    plant.moved_by(made.data.positions)
    return made


UNIT: Final = "a unit under test"  # that computes


def computers(
    scenario: Scenario,
    alone: ComputerData,
    sensors: Sensors,
    own: OwnManager | str | None,
    lane: str | None = None,
) -> Lanes | None:
    """Return the lanes of several computers, None for one.  BadInput: a computer or manager that is not built in.

    alone : what one computer has at its first frame;  own : a manager of the user, or the unit in its place, of all
    lanes or of one ``lane``
    """
    count, whose = scenario.computers.count, own
    fitted = COMPUTERS[:count] if count > 1 else ()
    if lane is not None and lane not in fitted:
        have = f"there are {', '.join(fitted)}" if fitted else "there is one computer; set computers.count"
        raise BadInput(f"lane {lane} cannot be {own}: {have}")
    if count == 1:
        return None
    if lane is not None:
        whose = None
    if isinstance(own, OwnManager):
        whose = f"the manager {scenario.redundancy.manager!r}"
    if whose is not None:
        why = f"{count} computers need a built-in manager; with {whose} allowed: 1"
        raise BadInput(f"computers.count: {why}{'; --lane replaces one of them' if whose == UNIT else ''}")
    seeds, outside = scenario.streams()["computers"], NO_LANE if lane is None else COMPUTERS.index(lane)
    return Lanes(scenario.computers, alone, sensors.params["skew"], scenario.rate_hz, seeds, outside)


def actuator_monitors(scenario: Scenario) -> tuple[NDArray[Any], MonitorData]:
    """Return the servos as their monitors hold them to be, (3,) SERVO, and the monitors at the first frame.

    They need no plant: a monitor asks a servo for its gain alone, whatever the sub-step.
    """
    surfaces = _surfaces(scenario)
    designed = as_designed(scenario.actuators, surfaces, LONGEST_SUBSTEP_S)
    return designed, monitors(scenario.actuators, stops_of(surfaces), scenario.rate_hz)


def _surfaces(scenario: Scenario) -> dict[str, Actuator]:
    return {name: getattr(scenario.airframe, name) for name in MOVED}


def faults(scenario: Scenario, keep_clean: int = 0) -> Faults:
    """Return the faults of a scenario, at their first frame; a replay runs those on references again."""
    ranges = sensors.ranges(scenario.sensors)
    places = np.vstack([ranges, inertial.ranges(), ranges, scenario.airframe.surface_limits])  # as in faults.Places
    seeds, monitored = scenario.streams()["faults"], scenario.redundancy.signals
    thresholds = np.array([getattr(monitored, signal.name).threshold for signal in SIGNALS])
    monitors = {signal.name: getattr(scenario.sensors, signal.name).monitor for signal in SIGNALS}
    coils = {name: Coils(m.coverage, m.tolerance, m.frames) for name, m in monitors.items() if m is not None}
    return Faults(
        scenario.faults,
        places,
        scenario.rate_hz,
        seeds,
        thresholds=thresholds,
        coils=coils,
        keep_clean=keep_clean,
        wire_coverage=scenario.actuators.continuity.coverage,
        test_coverage=coverage(scenario.computers),
        voltage_tolerance=scenario.computers.reference_voltage.tolerance,
    )


def redundancy(scenario: Scenario) -> Redundancy:
    """Return the redundancy stage of a scenario, at its first frame.  BadInput: the user's manager."""
    suite = scenario.sensors
    ranges, channels, discretes = sensors.ranges(suite), sensors.channels(suite), sensors.discrete_channels(suite)
    settings, references, rate_hz = scenario.redundancy, scenario.references, scenario.rate_hz
    tested = scenario.control.tested
    noise = sensors.noise_std(suite, rate_hz)
    return Redundancy(
        settings,
        ranges,
        channels,
        references,
        rate_hz,
        discretes,
        scenario.trust,
        tested,
        noise,
        scenario.computers.count,
        sensors.data_sheets(suite, rate_hz, scenario.computers.apart_frames),
    )
