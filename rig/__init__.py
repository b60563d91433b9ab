"""jsbsim-rig: a test rig for redundant flight control, flown by JSBSim.

import rig
flight = rig.fly("faults/f16_pitch_rate_hardover.toml", seed=2)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.flight.assembly import Flight, fly
    from rig.log import Log, read_log
    from rig.scenario import Scenario, load

__all__ = ["Flight", "Log", "Scenario", "fly", "load", "read_log"]
_HOME = {
    "Flight": "rig.flight.assembly",
    "fly": "rig.flight.assembly",
    "Log": "rig.log",
    "read_log": "rig.log",
    "Scenario": "rig.scenario",
    "load": "rig.scenario",
}

_SHOWN = ("Flight", "fly", "Log", "read_log")  # give what a notebook shows as a table


def __getattr__(name: str) -> Any:
    """Import on first use: ``rig --help`` must not load numba and JSBSim."""
    if name not in _HOME:
        raise AttributeError(f"module 'rig' has no attribute {name!r}")
    from importlib import import_module

    if name in _SHOWN:
        from rig.log.shown import conclude_with

        conclude_with(_conclude)
    return getattr(import_module(_HOME[name]), name)


def _conclude(log: Log) -> list[str]:
    """The conclusion in the table that a notebook shows of a log or flight; scored when it is shown."""
    from rig.assess.of_log import conclude_read

    return conclude_read(log)


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return sorted({*globals(), *__all__})
