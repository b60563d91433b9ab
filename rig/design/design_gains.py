"""Design the gains of an aircraft, its gains.toml, from its linear models.

The crossover of each plane starts at a share of the actuator's bandwidth.  The attitude loop is a factor below it.
Both decrease until every gain and phase margin holds (loop_requirements.py).  If none does, the integral of the rate
loops is made stronger: light aircraft damp faster than their actuators allow a loop to cross, and a slow rate loop
leaves a lightly damped short period almost unchanged.  point_gains.py computes the gains from the crossovers.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final

from rig.computer.control.gains_file import Gains, Point
from rig.core.errors import PointFault
from rig.core.progress import tell
from rig.design import backup_design as backup
from rig.design.backup_design import Sensor
from rig.design.loop_requirements import LAWS, Case, Requirements, met, missed, nearness, whole, with_margins
from rig.design.loops import ACTUATORS, Plane
from rig.design.point_gains import Shares, backup_gains, gains_at
from rig.world.plant.airframe import Airframe
from rig.world.plant.linearise import linearise

MOST_SAID: Final = 3  # loops below the requirement that an error names
_RATE_SHARES: Final = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)  # of the highest crossover
_QUICK: Final = 3  # this many of them count as quick
_ALPHA_SHARES: Final = (1.0, 0.7, 0.4)  # of the regulator's gain on alpha, in the longitudinal plane
_ALTITUDE_SHARES: Final = (0.5, 0.35)  # altitude loop's crossover over the attitude loop's
_ATTITUDE_SHARES: Final = (0.26, 0.22, 0.18, 0.15)  # attitude loop's crossover over the rate loop's
# Tried after all others, so that no design that succeeds without them depends on them.
_DAMPED_RATES: Final = (1.0, 0.7, 0.5, 0.4)
_DAMPED_ATTITUDES: Final = (0.26, 0.18, 0.12)
_DAMPED_ALTITUDES: Final = (0.5, 0.35, 0.25)
_INTEGRALS: Final = (0.6, 0.3, 1.0)  # crossover of the integral alone over the rate loop's
_AIRSPEEDS: Final = (1.0, 0.6)
_EVERY: Final = 12  # of the candidates, if none keeps the margins: neighbours differ little
_NEARNESS: Final = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.4, 0.2)


def design(airframe: Airframe, wanted: Requirements | None = None, *, accept: bool = False) -> Gains:
    """Return gains for every flight point of ``airframe``.  PointFault: the stability margins cannot be reached.

    accept : take the nearest gains if none keeps the stability margins; ``Gains.below`` lists them
    Pure: the same aircraft and requirements give the same numbers.
    """
    designed = design_points(airframe, wanted)
    below = [f"{item.point.name}: {line}" for item in designed for line in item.below]
    if below and not accept:
        lines = f"{airframe.base_model} {'; '.join(below[:MOST_SAID])}; rig aircraft check has all numbers"
        raise PointFault(lines, next(item.point.name for item in designed if item.below))
    return whole(airframe, wanted or Requirements(), [item.point for item in designed], below)


@dataclass(frozen=True)
class Designed:
    """One flight point: the gains, and a line for each loop that misses its stability margins."""

    case: Case
    point: Point
    below: list[str]


def design_points(airframe: Airframe, wanted: Requirements | None = None) -> list[Designed]:
    """Return the best gains of every flight point, in the order of dynamic pressure, all margins kept or not."""
    wanted = wanted or Requirements()
    cases = [Case(airframe, point, linearise(airframe, point), wanted) for point in airframe.flight_points]
    cases.sort(key=lambda case: case.linear.trim.dynamic_pressure_pa)
    designed: list[Designed] = []
    for case in cases:
        tell(f"designing the gains of {case.point.name}", len(designed), len(cases) if len(cases) > 1 else 0)
        designed.append(_design_point(case))
    return designed


def _design_point(case: Case) -> Designed:
    """Return for each plane the first candidate whose stability margins hold; the planes are independent."""
    first = _candidates()[0]
    chosen = dict.fromkeys(ACTUATORS, first)
    for plane in case.planes:
        for candidate in _candidates():
            chosen[plane] = candidate
            if met(case, gains_at(case, chosen), plane):
                break
        else:
            chosen[plane] = _nearest(case, chosen, plane)
    point = gains_at(case, chosen)
    for sensor in backup.SENSORS:
        point = _backed_up(case, point, sensor)
    point = with_margins(case, point)
    return Designed(case, point, missed(case, point))


def _nearest(case: Case, chosen: dict[Plane, Shares], plane: Plane) -> Shares:
    """Return the candidate of one plane, out of every few, that keeps the largest share of the stability margins."""
    return max(
        _candidates()[::_EVERY], key=lambda tried: nearness(case, gains_at(case, {**chosen, plane: tried}), plane)
    )


def _candidates() -> list[Shares]:
    """Return the candidates, fast first: the attitude loop slows down before the rate loop loses over a quarter."""
    quick, slow = _RATE_SHARES[:_QUICK], _RATE_SHARES[_QUICK:]
    tried = [Shares(*x) for x in product(quick, _ATTITUDE_SHARES, _ALPHA_SHARES, _ALTITUDE_SHARES)]
    tried.sort(key=lambda x: (-x.altitude, -x.attitude, -x.alpha, -x.rate))
    tried += [Shares(rate, _ATTITUDE_SHARES[-1], 1.0, _ALTITUDE_SHARES[-1]) for rate in slow]
    return tried + [
        Shares(*x) for x in product(_DAMPED_RATES, _DAMPED_ATTITUDES, (1.0,), _DAMPED_ALTITUDES, _INTEGRALS, _AIRSPEEDS)
    ]


def _backed_up(case: Case, point: Point, sensor: Sensor) -> Point:
    """Return ``point`` with the first compensator of ``sensor`` that keeps the stability margins, or the nearest."""
    best, nearest = 0.0, point
    for candidate in backup.candidates():
        tried = point.model_copy(update=backup_gains(case, sensor, candidate))
        loops = [case.loop(tried, law, "longitudinal", backup.LOST[sensor]) for law in LAWS]
        for share in _NEARNESS:
            if share <= best:
                break
            if all(case.keeps(loop, 0, share) for loop in loops):
                best, nearest = share, tried
        if best == 1.0:
            break
    return nearest
