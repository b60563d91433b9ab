"""FMUs of others: which of their variables the unit file says each element of the records is.

    [fmu.inputs]
    "channels.pitch_rate.*" = "q[*]"     # a * on the left is any name or channel; it stands for the same on the right
    [fmu.outputs]
    "voted.*" = "median_*"

An address is field.item.channel, of the tables of docs/unit-records.md, channels from 1.  Units are compared with those
that the FMU declares, and converted.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from itertools import accumulate
from math import prod
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree

from rig.errors import BadInput
from rig.frame import INDEX, SIGNALS, Law
from rig.frame.fields import FIELD
from rig.text import choices
from rig.unit.fmu_description import Base, Place, Version, of_record
from rig.unit.layout import ANSWERS, OUTPUT, REFERENCES, Said, place
from rig.unit.settings import Unit
from rig.units.conversion import conversion
from rig.units.quantities import unit_of_name

_REAL: Final = ("Real", "Float64", "Float32")
_WHOLE: Final = ("Integer", "Boolean", "Enumeration", *(f"{sign}Int{n}" for sign in ("", "U") for n in (8, 16, 32, 64)))
_CAUSALITIES: Final = {"inputs": ("input",), "outputs": ("output", "local")}
_OF_SIGNALS: Final = ("channels", "voted", *REFERENCES)
_NEEDED: Final = {"redundancy": Said.VOTED, "flight-computer": Said.SURFACE}
_ELEMENT: Final = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


class Element(NamedTuple):
    """An element of INPUT or OUTPUT."""

    field: str
    first: int  # byte in its record
    base: Base
    unit: str  # SI


class Described(NamedTuple):
    """A variable as modelDescription.xml has it."""

    reference: int
    type: str
    causality: str
    unit: str  # empty: not said
    shape: tuple[int, ...]
    start: list[float]  # of all elements


class Pair(NamedTuple):
    """An element of a record and the element of a variable that it is."""

    element: Element
    variable: str
    at: int  # in the variable
    factor: float  # SI units of one unit of the variable


# What the description says -----------------------------------------------------------------------------------


def described(description: ElementTree.Element, version: Version, named: str) -> dict[str, Described]:
    """Return the variables of an FMU by name.  BadInput: one that is none."""
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
    """Return one variable; ValueError: what should be a number is none."""
    kind = next((inner for inner in node if inner.tag in _REAL + _WHOLE or inner.tag == "String"), node)
    kind = kind if version == "2" else node
    shape = tuple(_extent(inner, nodes) for inner in node.findall("Dimension"))
    unit = kind.get("unit", declared.get(kind.get("declaredType", ""), ""))
    numbers = kind.tag in _REAL + _WHOLE
    texts = kind.get("start", "").replace("true", "1").replace("false", "0").split() if numbers else []
    start = [float(text) for text in texts] or [0.0]
    start = start if len(start) == prod(shape) else start[:1] * prod(shape)
    return Described(int(node.get("valueReference", "")), kind.tag, node.get("causality", "local"), unit, shape, start)


def _extent(dimension: ElementTree.Element, nodes: dict[str, ElementTree.Element]) -> int:
    """Return the elements of a dimension: a number, or the start of a structural parameter."""
    given = dimension.get("start")
    if given is None:
        node = nodes.get(dimension.get("valueReference", ""))
        given = "" if node is None else node.get("start", "")
    return int(given)


# What the unit file says -------------------------------------------------------------------------------------


def mapped(unit: Unit, known: dict[str, Described], named: str) -> dict[str, Any]:
    """Return what the child needs of a mapping.  BadInput.  known : variables of the FMU; named : it, for messages"""
    assert unit.fmu is not None
    inputs = _pairs("inputs", unit.fmu.inputs, Place.INPUT, known, unit, named)
    outputs = _pairs("outputs", unit.fmu.outputs, Place.OUTPUT, known, unit, named)
    twice = Counter((pair.variable, pair.at) for pair in inputs.values()).most_common(1)
    if twice and twice[0][1] > 1:
        raise BadInput(f"{named}: fmu.inputs: {twice[0][0][0]} is mapped {twice[0][1]} times")
    said = _said(set(outputs), unit)
    constants = [] if "law" in outputs else [(place(OUTPUT, "law")[1], int(Law.EXTERNAL))]
    return {
        "inputs": _calls(inputs, known),
        "outputs": _calls(outputs, known),
        "constants": [*constants, (place(OUTPUT, "said")[1], int(said))],
    }


def _pairs(
    table: str, given: dict[str, str], record: Place, known: dict[str, Described], unit: Unit, named: str
) -> dict[str, Pair]:
    """Return the pairs by address: of two keys that fit one the key with fewer * counts, then the first.  BadInput."""
    found: dict[str, Pair] = {}
    for key, variable in sorted(given.items(), key=lambda one: one[0].count("*")):
        where = f"{unit.source}: fmu.{table}: {key}"
        for address, name in _expanded(key, variable, _elements(record), where):
            if address not in found:
                said = f"{named}: fmu.{table}: {address}"
                found[address] = _pair(_elements(record)[address], name, _CAUSALITIES[table], known, said)
    return found


def _expanded(key: str, variable: str, elements: dict[str, Element], where: str) -> list[tuple[str, str]]:
    """Return addresses that fit ``key`` with their variables.  BadInput."""
    if key.count("*") != variable.count("*"):
        raise BadInput(f"{where}: {variable!r} must have as many * as its key, {key.count('*')}")
    shape = re.compile(re.escape(key).replace(r"\*", r"([^.]+)"))
    fits = [(address, match) for address in elements if (match := shape.fullmatch(address))]
    if not fits:
        raise BadInput(f"{where}: no such element; {choices(key, elements, 'docs/unit-records.md')}")
    parts = variable.split("*")
    return [(address, "".join(map("".join, zip(parts, (*match.groups(), ""), strict=True)))) for address, match in fits]


@cache
def _elements(record: Place) -> dict[str, Element]:
    """Return all elements of a record by address; not ``stepped`` and ``said``, which are the rig's to count."""
    elements = {}
    for variable in of_record(record):
        for scalar in variable.scalars():
            items = scalar.about.split(", channel ") if scalar.about else []
            if variable.name not in ("stepped", "said"):
                found = Element(variable.name, scalar.first, variable.base, _unit(variable.name, items))
                elements[".".join([variable.name, *items])] = found
    return elements


def _unit(field: str, items: list[str]) -> str:
    """Return the SI unit of an element."""
    if field in _OF_SIGNALS:
        return SIGNALS[INDEX[items[0]]].unit
    return (unit_of_name(items[0]) if items and field in FIELD and FIELD[field].elements else "") or "1"


def _pair(element: Element, name: str, allowed: tuple[str, ...], known: dict[str, Described], where: str) -> Pair:
    """Return what an element is paired with.  BadInput: no such variable, or one that does not fit."""
    base, index = _found(name, known, where)
    variable = known[base]
    if variable.causality not in allowed:
        raise BadInput(f"{where}: {name} is of causality {variable.causality}, must be {' or '.join(allowed)}")
    types = _REAL if element.base is Base.REAL else _REAL + _WHOLE
    if variable.type not in types:
        raise BadInput(f"{where}: {name} is of type {variable.type}, must be {', '.join(types)}")
    if not variable.unit:
        return Pair(element, base, index, 1.0)
    try:
        return Pair(element, base, index, conversion(_usual(variable.unit), _usual(element.unit)).factor)
    except ValueError as error:
        raise BadInput(f"{where}: {name} is in {variable.unit}: {error}") from None


def _found(name: str, known: dict[str, Described], where: str) -> tuple[str, int]:
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


def _usual(unit: str) -> str:
    """Return a unit as of Modelica, ``m/s2``, as the rig writes it: ``m/s^2``."""
    return re.sub(r"(?<=[^\W\d])(-?\d)", r"^\1", unit.replace(".", "*"))


def _said(addresses: set[str], unit: Unit) -> Said:
    """Return the groups that are filled.  BadInput: a group in parts, or one missing that the form needs."""
    said = Said(0)
    for group in Said:
        fields = {name for name, of in ANSWERS.items() if of == group and name != "law"}
        every = [address for address, element in _elements(Place.OUTPUT).items() if element.field in fields]
        missing = [address for address in every if address not in addresses]
        if not missing:
            said |= group
        elif len(missing) < len(every) or group == _NEEDED[unit.form]:
            why = f"form {unit.form} needs it" if group == _NEEDED[unit.form] else "others of its group are"
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            raise BadInput(f"{unit.source}: fmu.outputs: {missing[0]}{more} not mapped: {why}")
    return said


def _calls(pairs: dict[str, Pair], known: dict[str, Described]) -> list[dict[str, Any]]:
    """Return a call of FMI for each type: variables whole, and which of their elements are which of the record."""
    calls = []
    for kind in dict.fromkeys(known[pair.variable].type for pair in pairs.values()):
        own = [pair for pair in pairs.values() if known[pair.variable].type == kind]
        names = list(dict.fromkeys(pair.variable for pair in own))
        begins = dict(zip(names, accumulate((len(known[name].start) for name in names), initial=0), strict=False))
        at = [[begins[one.variable] + one.at, one.element.first, one.factor, one.element.base.name] for one in own]
        call = {"type": kind, "references": [known[name].reference for name in names]}
        calls.append({**call, "start": [number for name in names for number in known[name].start], "pairs": at})
    return calls
