"""The transport of a unit file, reached: a process started, a library loaded, or a box connected to."""

from __future__ import annotations

from rig.core.errors import BadInput
from rig.unit import fmu, transport
from rig.unit.python_law import PythonLaw
from rig.unit.transport import LibraryLink, SocketLink
from rig.unit.unit_file import Unit


def connect(unit: Unit, looks: int) -> SocketLink | LibraryLink:
    """Start the unit, or connect to it.  BadInput: it has changed, cannot be started.  looks : as in UnitProcess"""
    unit.require_unchanged()
    if unit.law is not None:
        return PythonLaw(unit)
    if unit.transport == "library":
        return transport.child(unit, looks) if unit.isolate else LibraryLink(unit)
    if unit.transport == "udp":
        return transport.udp(unit, looks)
    if unit.transport == "fmu":
        return fmu.child(unit, looks)
    raise BadInput(f"{unit.source}: transport {unit.transport} cannot be flown here")
