"""The variables of an FMU, as its modelDescription.xml has them."""

from __future__ import annotations

import re
from math import prod
from typing import Final, NamedTuple
from xml.etree import ElementTree

from rig.core.errors import BadInput
from rig.core.text import choices
from rig.unit.fmu_description import Version
from rig.unit.fmu_moves import REAL

WHOLE: Final = ("Integer", "Boolean", "Enumeration", *(f"{sign}Int{n}" for sign in ("", "U") for n in (8, 16, 32, 64)))
_MOST_ELEMENTS: Final = 1 << 20  # of an array
_ELEMENT: Final = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


class Described(NamedTuple):
    """A variable as modelDescription.xml has it."""

    reference: int
    type: str
    causality: str
    unit: str  # empty: not said
    shape: tuple[int, ...]
    start: list[float]  # of all elements


def described(description: ElementTree.Element, version: Version, named: str) -> dict[str, Described]:
    """Return the variables of an FMU by name.  BadInput: an invalid variable."""
    declared = {
        one.get("name", ""): inner.get("unit", "")
        for one in description.findall("TypeDefinitions/*")
        for inner in ([one, *one] if version == "2" else [one])
    }
    nodes = {node.get("valueReference", ""): node for node in description.findall("ModelVariables/*")}
    try:
        return {
            node.get("name", ""): _described(node, version, declared, nodes)
            for node in description.findall("ModelVariables/*")
        }
    except ValueError as error:
        raise BadInput(f"{named}: a variable of its modelDescription.xml cannot be read: {error}") from None


def _described(
    node: ElementTree.Element, version: Version, declared: dict[str, str], nodes: dict[str, ElementTree.Element]
) -> Described:
    """Return one variable.  ValueError: a value is not a number."""
    kind = next((inner for inner in node if inner.tag in REAL + WHOLE or inner.tag == "String"), node)
    kind = kind if version == "2" else node
    shape = tuple(_extent(inner, nodes) for inner in node.findall("Dimension"))
    unit = kind.get("unit", declared.get(kind.get("declaredType", ""), ""))
    numbers = kind.tag in REAL + WHOLE
    texts = kind.get("start", "").replace("true", "1").replace("false", "0").split() if numbers else []
    start, reference = [float(text) for text in texts] or [0.0], int(node.get("valueReference", ""))
    if not 0 <= reference < 1 << 32:
        raise ValueError(f"valueReference {reference} does not fit in 32 bits")
    if min((0, *shape)) < 0 or prod(shape) > _MOST_ELEMENTS:
        raise ValueError(f"an array has at most {_MOST_ELEMENTS} elements, {node.get('name')} has {shape}")
    start = start if len(start) == prod(shape) else start[:1] * prod(shape)
    return Described(reference, kind.tag, node.get("causality", "local"), unit, shape, start)


def _extent(dimension: ElementTree.Element, nodes: dict[str, ElementTree.Element]) -> int:
    """Return the elements of a dimension: a number, or the start of a structural parameter."""
    given = dimension.get("start")
    if given is None:
        node = nodes.get(dimension.get("valueReference", ""))
        given = "" if node is None else node.get("start", "")
    return int(given)


def find(name: str, known: dict[str, Described], where: str) -> tuple[str, int]:
    """Return a variable and the index of its element, which ``name`` may end with: from 1, of FMI 3.0.  BadInput."""
    if name in known and not known[name].shape:
        return name, 0
    parts = _ELEMENT.fullmatch(name)
    base = name if parts is None else parts[1]
    shape = known[base].shape if base in known else ()
    indices = [] if parts is None else [int(text) - 1 for text in parts[2].split(",")]
    if len(indices) == len(shape) > 0 and all(0 <= i < n for i, n in zip(indices, shape, strict=True)):
        return base, sum(i * prod(shape[n + 1 :]) for n, i in enumerate(indices))
    raise BadInput(f"{where}: the FMU has no variable {name}; {choices(name, _names(known))}")


def _names(known: dict[str, Described]) -> list[str]:
    """Return the names of variables, of an array with its extent."""
    return [name + (f"[{','.join(map(str, one.shape))}]" if one.shape else "") for name, one in known.items()]
