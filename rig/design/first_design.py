"""The first design of a proposed aircraft: flight points that turn out to be unsuitable are replaced."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Final

from rig.computer.analytic.designed import Designed
from rig.computer.control.gains_file import Gains, Point
from rig.core.errors import BadInput, PointFault
from rig.core.progress import tell
from rig.design import design_references as references
from rig.design.assumed_figures import limits
from rig.design.design_gains import design
from rig.design.loop_requirements import Requirements, whole
from rig.design.new_aircraft import NewAircraft, at_points, rewrite
from rig.design.propose import flight_points
from rig.world.plant.airframe import FlightPoint

_MOST_LEFT_OUT: Final = 3  # flight points of a proposal, until the suitable ones must be enough


def designed(new: NewAircraft, folder: Path) -> tuple[NewAircraft, Gains, Designed]:
    """Write a proposal, design it and fly it; replace unsuitable flight points.

    Return the proposal as written, its gains and its references.  BadInput: no flight point is suitable.
    """
    serve: dict[str, Point] = {}
    while True:
        rewrite(new, folder)
        try:
            for found in new.found:
                if found.point.name not in serve:
                    serve[found.point.name] = _served(new, folder, found.point)
            points = sorted((serve[each.point.name] for each in new.found), key=lambda each: each.dynamic_pressure_pa)
            gains = whole(new.airframe, Requirements(), points)
            return new, gains, references.design(str(folder), gains)
        except PointFault as fault:
            tell(f"{fault.point} left out: {fault}")
            serve.pop(fault.point, None)
            new = _without(new, fault, set(serve))


def _served(new: NewAircraft, folder: Path, point: FlightPoint) -> Point:
    """Return the gains of one flight point that was flown without a fault.  PointFault: the design or flight fails."""
    gains = design(new.airframe.model_copy(update={"flight_points": [point]}))
    references.try_out(str(folder), gains, point)
    return gains.points[0]


def _without(new: NewAircraft, fault: PointFault, serve: set[str]) -> NewAircraft:
    """Propose other flight points in place of an unsuitable one.  BadInput, with all reasons: none is suitable."""
    left_out = (*new.left_out, fault)
    if not new.given and len(left_out) <= _MOST_LEFT_OUT:
        table = {**new.table, "limits": limits(new.kind)}
        with suppress(BadInput):  # no other trims: the suitable ones must be enough
            return at_points(new, flight_points(table, new.base, new.most, [x.point for x in left_out]), left_out)
    found = [each for each in new.found if each.point.name in serve]
    if not found or new.given:
        faults = "; ".join(dict.fromkeys(str(each) for each in left_out))
        tail = "try --point ALTITUDE_M:MACH, or --no-design and then rig aircraft check"
        raise BadInput(f"aircraft new {new.name}: no flight point is suitable: {faults}; {tail}")
    return at_points(new, found, left_out)
