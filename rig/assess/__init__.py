"""What became of each fault, of the vote and of the flight, measured by the truth.

outcome.py         kernels over one signal's fields: who is healthy, who was failed and when, how far the vote is off
outcome_rows.py    the one kernel over rows: with outcome_faults.py it fills the records of outcome_records.py
outcome_actuators.py  the same over the rows of servo actuators; actuator_outcome.py, actuator_sentence.py
flight_outcome.py  adds blocks of a flight, while it is flown or afterwards; its clean channels: unfaulted.py
words.py           the vocabulary, and the public names of each word
scoring.py         the score (record.py): tables over the records; patterns.py, transients.py against the twin
of_log.py          the score of a log, and the conclusion of a flight; its sentences: conclusion.py, fault_sentence.py

docs/score.md defines every number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.assess.of_log import Scored, score_log
    from rig.assess.record import FaultScore, Score, Yardstick
    from rig.assess.scoring import score
    from rig.assess.transients import fly_twin
    from rig.loop import fly_rows

__all__ = ["FaultScore", "Score", "Scored", "Yardstick", "fly_rows", "fly_twin", "score", "score_log"]
_HOME = {
    "FaultScore": "rig.assess.record",
    "Score": "rig.assess.record",
    "Yardstick": "rig.assess.record",
    "fly_rows": "rig.loop",
    "fly_twin": "rig.assess.transients",
    "score": "rig.assess.scoring",
    "Scored": "rig.assess.of_log",
    "score_log": "rig.assess.of_log",
}


def __getattr__(name: str) -> Any:
    """Import on first use: the commands must not load numba before they need it."""
    if name not in _HOME:
        raise AttributeError(f"module 'rig.assess' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOME[name]), name)
