"""Scenarios of one aircraft that share the settings that no run of a campaign changes.

A run changes some faults, a flight point, a seed.  The settings of the airframe, the sensors and the monitor are the
same tables as before; they are checked once, and what follows from them is worked out once (rig.core.kept).
"""

from __future__ import annotations

import json
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.settings import build
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario

# Each part of a scenario, with the parts that its checks change it by: sensors are fitted to the computers.
PARTS: Final[dict[str, tuple[str, ...]]] = {
    **{name: (name,) for name in ("airframe", "gains", "references", "redundancy", "inertial", "control")},
    "sensors": ("sensors", "computers"),
}
_MOST: Final = 64  # kept; a campaign that varies a part in steps has no use for all of its values
_kept: dict[tuple[Any, ...], tuple[list[Any], Any]] = {}


def build_shared(below: dict[str, Any], data: dict[str, Any], source: str) -> Scenario:
    """Return the scenario of ``data`` over the tables ``below``; parts that an earlier one had from both are the same.

    below : of an aircraft, the same objects for all runs, and never changed
    BadInput names ``source``, or the file of the aircraft if that is wrong by itself, and the first wrong key.
    """
    merged = aircraft.merge(below, data)
    keys = {name: _key(name, below, data) for name in PARTS if name in merged}
    known = {name: _kept[key][1] for name, key in keys.items() if key in _kept}
    try:
        made = build(Scenario, {**merged, **known}, source)
    except BadInput:
        aircraft.refuse_bad(data.get("aircraft", aircraft.DEFAULT), Scenario)  # what is wrong may be in its file
        raise
    for name in keys.keys() - known.keys():
        if len(_kept) >= _MOST:
            _kept.clear()
        # Its tables are held with it, so that no others can have their identities.
        _kept[keys[name]] = [below.get(part) for part in PARTS[name]], getattr(made, name)
    return made


def _key(name: str, below: dict[str, Any], data: dict[str, Any]) -> tuple[Any, ...]:
    """Return what a part follows from: tables of the aircraft, which are the same objects, and those of the run."""
    given = [data.get(part) for part in PARTS[name]]
    return name, *(id(below.get(part)) for part in PARTS[name]), json.dumps(given, default=repr)
