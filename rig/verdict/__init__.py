"""What became of each fault, of the vote and of the flight, measured by the truth.

signal_kernels.py  kernels over one signal's fields: who is healthy, who was failed and when, how far the vote is off
row_kernel.py      the one kernel over rows: with fault_kernels.py it fills the records of tally_records.py
servo_kernels.py      the same over the rows of servo actuators; servo_tally.py, servo_sentence.py
flight_tally.py    adds blocks of a flight, while it is flown or afterwards; its clean channels: unfaulted.py
words.py           the vocabulary, and the public names of each word
scoring.py         the score (score_records.py): tables over the records; patterns.py, transients.py against the twin
of_log.py          the score of a log, and the conclusion of a flight; its sentences: conclusion.py, fault_sentence.py

docs/score.md defines every number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.flight.loop import fly_rows
    from rig.verdict.of_log import Scored, score_log
    from rig.verdict.score_records import FaultScore, Score, Yardstick
    from rig.verdict.scoring import score
    from rig.verdict.transients import fly_twin

__all__ = ["FaultScore", "Score", "Scored", "Yardstick", "fly_rows", "fly_twin", "score", "score_log"]
_HOME = {
    "FaultScore": "rig.verdict.score_records",
    "Score": "rig.verdict.score_records",
    "Yardstick": "rig.verdict.score_records",
    "fly_rows": "rig.flight.loop",
    "fly_twin": "rig.verdict.transients",
    "score": "rig.verdict.scoring",
    "Scored": "rig.verdict.of_log",
    "score_log": "rig.verdict.of_log",
}


def __getattr__(name: str) -> Any:
    """Import on first use: the commands must not load numba before they need it."""
    if name not in _HOME:
        raise AttributeError(f"module 'rig.verdict' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOME[name]), name)
