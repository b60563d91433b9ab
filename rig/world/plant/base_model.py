"""Properties of a model of the installed JSBSim: surfaces, stops, engines, inputs of its equations.

Read from the wheel at run time, for ``rig aircraft new`` and ``rig aircraft check``; nothing of it is kept here.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from rig.core.errors import BadInput
from rig.world.plant import actuated
from rig.world.plant.imperial import METRES_PER_FOOT
from rig.world.plant.model_root import model_root

Kind = Literal["light", "fighter", "transport"]
LIGHTEST_TRANSPORT_KG: Final = 8618.0  # 19 000 lb, 14 CFR 23
HEAVIEST_FIGHTER_KG: Final = 40_000.0  # afterburners on more than that push a bomber or an airliner
SURFACES: Final = ("elevator", "aileron", "rudder")
_ALSO: Final = {"elevator": ("elevon", "stabilator", "stab"), "aileron": ("elevon", "flaperon"), "rudder": ()}
_ENGINES: Final = ("piston", "turbine", "turboprop", "electric", "brushless_dc_motor", "rocket")


@dataclass(frozen=True)
class BaseModel:
    """One aircraft of JSBSim; positions and stops by the name of the surface."""

    name: str
    reads: list[str]  # properties of fcs/ that the equations read
    positions: dict[str, str]
    stops: dict[str, tuple[float, float]]  # rad (or 1 for a normalised position), only where the model gives them
    engines: int
    engine: str  # piston, turbine, turboprop, electric, rocket
    augmented: bool
    blade_angles_deg: tuple[float, float] | None  # of a propeller, the same twice when it is fixed
    wing_area_m2: float

    @property
    def propeller(self) -> bool:
        """True if propellers pull it."""
        return self.blade_angles_deg is not None

    def kind(self, mass_kg: float) -> Kind:
        """Return whose assumed figures fit it: an afterburner makes a fighter, unless it pushes a bomber's mass."""
        if self.augmented and mass_kg <= HEAVIEST_FIGHTER_KG:
            return "fighter"
        return "light" if mass_kg <= LIGHTEST_TRANSPORT_KG else "transport"

    def normalised(self, surface: str) -> bool:
        """Return True if the equations read a surface's position as a share of full deflection, not in rad."""
        return unit_of(self.positions[surface]) == "norm"


def unit_of(position: str) -> str:
    """Return the unit in which the equations read a surface's position: rad, or norm, 1 of which is all of it."""
    return "norm" if position.endswith("-norm") else "rad"


def names() -> list[str]:
    """Return the aircraft of the installed JSBSim."""
    return actuated.base_models(model_root())


def read(name: str) -> BaseModel:
    """Return the model of that name; BadInput: none, without an engine, or a surface is not to be found."""
    root = model_root()
    model = actuated.model_file(name, root)
    tree = actuated.parsed(model)
    control = [child for child in tree if child.tag in ("flight_control", "autopilot", "system")]
    reads = [read for read in actuated.read_by_equations(tree, root, model.parent) if read.startswith("fcs/")]
    engines = len(tree.findall("propulsion/engine"))
    if not engines:
        raise BadInput(f"airframe.base_model: {name} has no engine; the rig flies aircraft with engines")
    positions = {surface: position(name, surface, reads) for surface in SURFACES}
    stops = {surface: limits for surface in SURFACES if (limits := _stops(control, surface, positions[surface]))}
    parts = list(actuated.part_files(tree, root, model.parent))
    engine = next((kind for part in parts for kind in _ENGINES if part.tag.startswith(kind)), "turbine")
    augmented = any(_number(part, "augmented") == 1.0 for part in parts)
    area = _wing_area(tree, name)
    return BaseModel(name, reads, positions, stops, engines, engine, augmented, _blade_angles(parts), area)


def position(model: str, surface: str, reads: list[str]) -> str:
    """Return the property of ``reads`` that is a surface's position, in rad first; BadInput: none."""
    ranked = [
        (rank, words, not read.endswith("-rad"), "left" not in read, read)
        for words, word in enumerate((surface, *_ALSO[surface]))
        for read in reads
        if word in read and "mag-" not in read and (rank := _rank(read)) is not None
    ]
    if not ranked:
        listed = ", ".join(reads) or "none"
        raise BadInput(f"airframe.{surface}: {model} reads no {surface} position; of fcs/ it reads: {listed}")
    return min(ranked)[-1]


def _rank(read: str) -> int | None:
    """Rank a property as a position: rad, of no given unit, normalised; None when it is none."""
    if "pos" not in read or read.endswith("-deg"):
        return None
    return 0 if read.endswith("-rad") else 2 if read.endswith("-norm") else 1


def _stops(control: Iterable[ET.Element], surface: str, position: str) -> tuple[float, float] | None:
    """Return the range of the component that moves ``position``, else of one side of the surface, symmetric."""
    components = [part for group in control for part in group.iter() if part.find("output") is not None]
    for part in components:
        if position in _texts(part, "output") and (limits := _range(part)) is not None:
            return limits
    for part in components:
        if any(f"left-{surface}-pos-rad" in text for text in _texts(part, "output")) and (limits := _range(part)):
            reach = 0.5 * (limits[1] - limits[0])
            return -reach, reach
    return None


def _range(part: ET.Element) -> tuple[float, float] | None:
    """Return what a scaling or an actuator can put out, within JSBSim's trim of -1 to 1; None: not given."""
    limits = part.find("range") if part.find("range") is not None else part.find("clipto")
    if limits is None:
        return None
    low, high = _number(limits, "min"), _number(limits, "max")
    if low is None or high is None:
        return None
    gain = (_number(part, "gain") or 1.0) if limits.tag == "range" else 1.0
    low, high = max(low * gain, -1.0), min(high * gain, 1.0)
    return (low, high) if low < 0.0 < high else None


def _wing_area(tree: ET.Element, name: str) -> float:
    element = tree.find("metrics/wingarea")
    area = None if element is None else _number(tree, "metrics/wingarea")
    if element is None or area is None or area <= 0.0:
        raise BadInput(f"airframe.base_model: {name} gives no wing area")
    return area * (1.0 if element.get("unit", "FT2") == "M2" else METRES_PER_FOOT**2)


def _blade_angles(parts: Iterable[ET.Element]) -> tuple[float, float] | None:
    for part in parts:
        if part.tag == "propeller":
            low = _number(part, "minpitch") or 0.0
            return low, _number(part, "maxpitch") or low
    return None


def _texts(part: ET.Element, tag: str) -> Iterator[str]:
    for child in part.findall(tag):
        yield (child.text or "").strip()


def _number(part: ET.Element, tag: str) -> float | None:
    """Return the number in a child, None when there is none or it is a property's name."""
    text = (part.findtext(tag) or "").strip()
    try:
        return float(text)
    except ValueError:
        return None
