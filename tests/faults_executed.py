"""Which faults of a flight did something, told from all of its rows at once."""

from collections.abc import Sequence

from rig.faults import Execution, Fault
from rig.frame import Block


def executed(faults: Sequence[Fault], rows: Block) -> list[bool]:
    """For each fault, whether it did something."""
    found = Execution(faults)
    found.add(rows)
    return found.executed
