"""jsbsim-rig: a test rig for redundant flight control, flown by JSBSim.

import rig
flight = rig.fly("faults/f16_pitch_rate_hardover.toml", seed=2)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.bench.api import diagnose, score, vote
    from rig.scenario.make_fault import fault
    from rig.scenario.scenario import Scenario, load
    from rig.show.notebook.flight import Flight, fly
    from rig.show.notebook.log import Log, read_log
    from rig.show.pages.flight_page import write_report
    from rig.show.pages.flight_page import write_report as report
    from rig.studies.search.plants.plant_api import search

_HOME = {
    **dict.fromkeys(("Flight", "fly"), "rig.show.notebook.flight"),
    **dict.fromkeys(("Log", "read_log"), "rig.show.notebook.log"),
    **dict.fromkeys(("Scenario", "load"), "rig.scenario.scenario"),
    **dict.fromkeys(("diagnose", "score", "vote"), "rig.bench.api"),
    "fault": "rig.scenario.make_fault",
    **dict.fromkeys(("report", "write_report"), "rig.show.pages.flight_page"),
    "search": "rig.studies.search.plants.plant_api",
}
__all__ = [
    "Flight",
    "Log",
    "Scenario",
    "diagnose",
    "fault",
    "fly",
    "load",
    "read_log",
    "report",
    "score",
    "search",
    "vote",
    "write_report",
]


def __getattr__(name: str) -> Any:
    """Import on first use: ``rig --help`` must not load numba and JSBSim."""
    if name not in _HOME:
        raise AttributeError(f"module 'rig' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), "write_report" if name == "report" else name)


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return sorted({*globals(), *__all__})
