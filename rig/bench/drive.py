"""The driver of the computer over given rows.

It runs the stages of a frame in the order of ``rig/flight/loop.py``, with the given rows in place of the plant:

    sensors     the channels, computed again from the truth
    faults      on channels; on references, if these are computed again
    references  computed again from the channels
    manager     votes, states and levels of the continuous signals: built-in, a user's class, or a unit under test
    discretes   votes, states and levels of the discretes

A stage that is None does not run and is not compiled: its fields stay unchanged in the rows.
The kernels are those of the flight.  Row types: ``frame.rows``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rig.computer.analytic.references import ReferenceData, remember
from rig.computer.control.source import source_of
from rig.computer.lanes.think import give_references
from rig.computer.redundancy import vote_signals
from rig.computer.redundancy.discrete import DiscreteData, vote_discretes
from rig.computer.redundancy.state import ManagerData
from rig.core.frame import Nested
from rig.core.kernels import kernel, long_kernel
from rig.unit.port import ON_DISCRETES, ON_PATTERNS
from rig.world.faults import FaultData, actuate, corrupt
from rig.world.sensors import SensorData, measure

ROWS: Final = 256  # of a block of flight rows: half a megabyte, which stays in the cache
# Votes the signals of a row, in the place of the manager; a unit returns the groups that it has filled, of layout.Said.
Decide = Callable[[Nested, int], int | None]


@dataclass(frozen=True, slots=True)
class Stages:
    """Data of the stages; None for a stage that does not run."""

    sensors: SensorData | None = None
    faults: FaultData | None = None
    references: ReferenceData | None = None
    manager: ManagerData | None = None
    discretes: DiscreteData | None = None


def run(rows: Nested, stages: Stages, flown: Nested | None = None, decide: Decide | None = None) -> None:
    """Run the stages over all ``rows`` (n,), in place.

    flown : (n,) rows that faults corrupt, and whose truth and votes trigger them; ``rows`` if not given
    decide : function that votes instead of the manager, row by row
    """
    s, flown = stages, rows if flown is None else flown
    if decide is None:
        run_rows(rows, flown, s.sensors, s.faults, s.references, s.manager, s.discretes)
        return
    for k in range(len(rows)):
        begin_row(rows, flown, k, s.sensors, s.faults, s.references)
        said = decide(rows, k)
        has_discretes = said is not None and said & ON_DISCRETES
        end_row(rows, flown, k, s.faults, s.references, None if has_discretes else s.discretes)
        if said is not None and not said & ON_PATTERNS:  # as port.conclude
            rows["fcc"]["reference_usable"][k] = 0


@long_kernel
def run_rows(rows, flown, sensors, faults, references, manager, discretes):
    """Run all rows through the stages that are not None."""
    for k in range(len(rows)):
        step(rows[k], flown[k], k, sensors, faults, references, manager, discretes)


@kernel
def begin_row(rows, flown, k, sensors, faults, references):
    """Run row k up to the input of the manager."""
    before(rows[k], flown[k], k, sensors, faults, references)


@kernel
def end_row(rows, flown, k, faults, references, discretes):
    """Run row k from the output of the manager on."""
    after(rows[k], flown[k], faults, references, discretes)


@kernel
def step(row, flown, k, sensors, faults, references, manager, discretes):
    """Run one row; k : its place in the draws of sensors and faults."""
    before(row, flown, k, sensors, faults, references)
    if manager is not None:
        vote_signals(row["bus"], row["fcc"], manager)
    after(row, flown, faults, references, discretes)


@kernel
def before(row, flown, k, sensors, faults, references):
    """Fill the input of the manager: channels and references, with their faults."""
    if sensors is not None:
        measure(row["truth"], row["bus"], k, sensors)
    if faults is not None:
        corrupt(flown, k, faults)
    if references is not None:
        give_references(row, row["bus"], row["fcc"], k, references, faults)


@kernel
def after(row, flown, faults, references, discretes):
    """Process the votes: store them for the next references, vote the discretes, pass the surfaces to faults."""
    if references is not None:
        remember(row["bus"], row["fcc"], references)
    if discretes is not None:
        vote_discretes(row["bus"], row["fcc"], discretes)
    if faults is not None:
        actuate(flown, faults)


@long_kernel
def write_sources(rows):
    """Write ``source`` of all rows: the source of each signal in the control law, by the manager's output."""
    for k in range(len(rows)):
        fcc = rows[k]["fcc"]
        level, usable, reference, source = fcc["level"], fcc["reference_usable"], fcc["reference"], fcc["source"]
        for s in range(level.shape[0]):
            source[s] = source_of(level[s], usable[s], reference[s])
