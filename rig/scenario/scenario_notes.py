"""Notes on a valid scenario that is probably not as intended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rig.computer.gain_schedule import Point
from rig.core.units import atmosphere
from rig.core.units.constants import HEAT_RATIO
from rig.scenario.scenario import Scenario
from rig.world.faults.reach import never_holding
from rig.world.plant.airframe import FlightPoint

_SAME: Final = 0.02  # of a dynamic pressure: within it, a point is where it was designed


def notes(scenario: Scenario) -> list[str]:
    """Return a line for each flight point without a design, and for each trigger whose condition can never hold."""
    never = [
        f"faults.{i}.when: {comparison}; numbers are in SI units"
        for i, fault in enumerate(scenario.faults)
        if fault.when is not None
        for comparison in never_holding(fault.when)
    ]
    return [*_undesigned(scenario), *never]


def _undesigned(scenario: Scenario) -> Iterator[str]:
    """Yield a line if the control law or the references use the values of other flight points."""
    point = scenario.airframe.point(scenario.flight_point)
    here = f"flight point {point.name}"
    remedy = f"rig aircraft design {scenario.aircraft}"
    files = (("gains.toml", scenario.gains.points), ("references.toml", scenario.references.points))
    missing = [(file, points) for file, points in files if point.name not in [each.name for each in points]]
    if missing:
        names = " and ".join(file for file, _ in missing)
        flown = " and ".join(file.removesuffix(".toml") for file, _ in missing)
        yield f"{here} was not designed (not in {names}): {flown} {_beyond(point, missing[0][1])}; {remedy}"
        return
    moved = [
        f"at {_kilo(each.dynamic_pressure_pa)} in {file}"
        for file, points in files
        for each in points
        if each.name == point.name and abs(_pressure(point) / each.dynamic_pressure_pa - 1.0) > _SAME
    ]
    if moved:
        yield f"{here}, at {_kilo(_pressure(point))}, was designed {' and '.join(moved)}; {remedy}"


def _beyond(point: FlightPoint, points: Sequence[Point]) -> str:
    """Return the source of the values at a point, by its dynamic pressure."""
    low, high = points[0].dynamic_pressure_pa, points[-1].dynamic_pressure_pa
    at = _pressure(point)
    if low <= at <= high:
        return f"between those of {_kilo(low)} and {_kilo(high)}"
    end = high if at > high else low
    return f"held at those of {_kilo(end)}, and it is at {_kilo(at)}"


def _pressure(point: FlightPoint) -> float:
    """Return the dynamic pressure [Pa] at a flight point."""
    return 0.5 * HEAT_RATIO * float(atmosphere.pressure(point.altitude_m)) * point.mach**2


def _kilo(pressure_pa: float) -> str:
    return f"{pressure_pa / 1e3:.3g} kPa"
