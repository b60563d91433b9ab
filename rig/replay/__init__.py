"""What is done with a log afterwards: replay it, ask what if, compare two.

again.recorded        a log with the scenario that it was flown by
again.vote_again      the recorded channels through the redundancy stage of a scenario
again.fly_again       the recorded scenario once more, JSBSim and all
compare.compare       two flights, number by number
decisions.moved       which decisions differ, where, old and new
what_if.what_if       another redundancy over the same channels, as a log of its own
"""

from rig.replay.again import Recorded, fly_again, recorded, vote_again
from rig.replay.compare import Comparison, compare
from rig.replay.decisions import Decisions, decisions, moved
from rig.replay.what_if import WhatIf, what_if

__all__ = [
    "Comparison",
    "Decisions",
    "Recorded",
    "WhatIf",
    "compare",
    "decisions",
    "fly_again",
    "moved",
    "recorded",
    "vote_again",
    "what_if",
]
