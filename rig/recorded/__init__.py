"""Recorded channels through the flight's own redundancy manager: no aircraft, no simulation.

    read.read  ->  align.align (on request)  ->  vote.vote  ->  write.write

The kernels are those of rig/redundancy, on rows of rig/frame.py: a recorded flight votes as it was voted in flight.
"""

from rig.recorded.align import align
from rig.recorded.config import VoteConfig, read_config
from rig.recorded.read import read
from rig.recorded.record import Recording, Samples
from rig.recorded.vote import Voted, vote
from rig.recorded.write import write

__all__ = ["Recording", "Samples", "VoteConfig", "Voted", "align", "read", "read_config", "vote", "write"]
