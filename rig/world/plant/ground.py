"""JSBSim's ground reactions, off while the aircraft flies high: they are a quarter of its step, and change nothing.

In the air JSBSim computes where each wheel and contact point is, finds no contact, and adds no force.  All that a
flight reads is the same, bit for bit, unless the model's own equations read the height of a point or are evaluated with
the ground reactions.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

import jsbsim

from rig.world.plant import actuated
from rig.world.plant.airframe import Config

ENABLED: Final = "simulation/models/FGGroundReactions/enabled"
HIGH_FT: Final = 3_000.0  # of the aircraft above ground: farther than it falls in a frame
HEIGHT_OF_POINT: Final = "/AGL-ft"  # of a wheel or contact point: all that changes in the air


def idles_in_air(fdm: jsbsim.FGFDMExec, airframe: Config) -> bool:
    """Return whether the ground reactions of a model that ``load`` has loaded change nothing high above ground."""
    return ENABLED not in airframe.held and _idle(Path(fdm.get_full_aircraft_path()))


@cache
def _idle(folder: Path) -> bool:
    if any(name.endswith(HEIGHT_OF_POINT) for name in actuated.reads(folder.parent)):
        return False
    parts = actuated.parsed(folder / f"{folder.name}.xml").iter("ground_reactions")
    return all("file" not in part.attrib and part.find(".//function") is None for part in parts)
