"""The score of a flight against the truth: what was detected, missed and wrong, and how the flight went.

    clean -> outcomes, isolations -> episodes; votes; flown (against the twin); coverage  ->  scoring.score

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
