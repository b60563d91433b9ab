"""One frame of one computer, from its BUS record to its FCC record: references, votes, control law.

It reads nothing else of the row; faults on references mark there that they act.  A voter in the place of the manager,
a class of the user or a unit under test, stands between ``give_references`` and ``follow_votes``.
"""

from __future__ import annotations

from typing import NamedTuple

from rig.computer.control.law import control_law
from rig.computer.control.law_state import ControlData
from rig.computer.redundancy import RedundancyData, conclude, refer, vote_signals
from rig.computer.redundancy.discrete import vote_discretes
from rig.core.kernels import inlined, kernel
from rig.world.faults import FaultData, corrupt_reference


class ComputerData(NamedTuple):
    """Data of one computer besides its records."""

    redundancy: RedundancyData
    control: ControlData
    faults: FaultData  # those on references, with the computer's own memory of them


@inlined
def think_lane(row, bus, fcc, k, data):
    """Fill the FCC record of one computer in row k from its BUS record; row : FRAME record, data : ComputerData."""
    give_references(row, bus, fcc, k, data.redundancy.references, data.faults)
    vote(bus, fcc, data)
    follow_votes(bus, fcc, data)


@inlined
def vote(bus, fcc, data):
    """Vote the continuous signals of one computer."""
    vote_signals(bus, fcc, data.redundancy.manager)


@kernel
def give_references(row, bus, fcc, k, references, faults):
    """Write the references of a computer, with the faults on them; faults : FaultData, None for none."""
    refer(bus, fcc, references)
    if faults is not None:
        corrupt_reference(row, fcc["reference"], k, faults)


@kernel
def follow_votes(bus, fcc, data):
    """Write all that follows from a computer's votes: what it keeps of them, discretes, surfaces."""
    conclude(bus, fcc, data.redundancy)
    control_law(bus, fcc, data.control)


@kernel
def think_shadow(row, discretes, law, data):
    """Keep up the state that another takes over from a computer outside, whose own memory is not known.

    It is what our own manager and law have after the same samples, and changes nothing that is flown.
    row : FRAME with BUS and references of its lane, workspace;  discretes, law : True if the computer has its own
    """
    vote(row["bus"], row["fcc"], data)
    if discretes:
        vote_discretes(row["bus"], row["fcc"], data.redundancy.discretes)
    if law:
        control_law(row["bus"], row["fcc"], data.control)
