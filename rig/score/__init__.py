"""The score of a flight against the truth: what was detected, missed and wrong, and how the flight went."""

from rig.score.flown import fly_rows, fly_twin
from rig.score.record import FaultScore, Score, Yardstick
from rig.score.scoring import score

__all__ = ["FaultScore", "Score", "Yardstick", "fly_rows", "fly_twin", "score"]
