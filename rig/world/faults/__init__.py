"""Faults as entries of ``[[faults]]``: kinds, places and triggers; see docs/reference/faults-and-signals.md.

A fault sits on channels of a signal or a discrete, on the inertial unit, a reference or a surface, on several
sensors at once (ice), on parts of servo actuators, on computers or on the link between them.  A trigger begins it.
Several faults on one value act in the order of the scenario.
A kind is a class that declares all of itself (settings.Triggered); fault.KINDS has them all.
"""

from rig.world.faults.corrupt import (
    actuate,
    break_computers,
    break_links,
    break_parts,
    corrupt,
    corrupt_commands,
    corrupt_reference,
)
from rig.world.faults.executed import Execution
from rig.world.faults.fault_records import CLEAN, FaultData
from rig.world.faults.fault_stage import Coils, Faults
from rig.world.faults.places import Places, Point
from rig.world.faults.scenario_faults import KINDS, Fault, check
