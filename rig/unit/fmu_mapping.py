"""FMUs with other variables: the unit file maps each element of the records to a variable.

    [fmu.inputs]
    "channels.pitch_rate.*" = "q[*]"     # a * on the left is any name or channel, and the same on the right
    [fmu.outputs]
    "voted.*" = "median_*"
    [fmu.parameters]
    "signal.*.threshold" = "limit_*"     # of CONFIG, set once per session
    [fmu.constants]
    gain = 2.5                           # a variable of the FMU, in its unit

An address is field.item.channel, of the tables of docs/reference/icd.md, channels from 1.  Units are compared with
those that the FMU declares, and converted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import accumulate
from typing import Any, Final, NamedTuple

from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS, Law
from rig.core.frame.fields import FIELD
from rig.core.renamed import is_gone, of_layout
from rig.core.text import choices
from rig.core.units.conversion import conversion
from rig.core.units.quantities import unit_of_name
from rig.unit.fmu_description import ASKED, Base, Place, of_record
from rig.unit.fmu_moves import REAL, range_of
from rig.unit.fmu_variables import WHOLE, Described, find
from rig.unit.unit_file import Unit
from rig.unit.unit_records import ANSWERS, OUTPUT, REFERENCES, Said, place

_SET: Final = ("parameter", "input")
_CAUSALITIES: Final = {"inputs": ("input",), "outputs": ("output", "local"), "parameters": _SET, "constants": _SET}
_OF_SIGNALS: Final = ("channels", "voted", *REFERENCES)
_OF_SURFACES: Final = ("trim_surface", "surface_low", "surface_high")
OF_ITS_SIGNAL: Final = (  # fields of a signal's CONFIG that have its unit
    *("threshold", "threshold_triplex", "threshold_duplex"),
    *("reference_threshold", "second_threshold", "low", "high", "deviation", "deviation_frames"),
    *("slow_allowance", "slow_limit", "trend_small"),
)
_NEEDED: Final = {"redundancy": Said.VOTED, "flight-computer": Said.SURFACE, "control-law": Said.SURFACE}
UNSAID: Final = "unsaid"  # key of a plan: fields without a variable in a group that is filled
_OF_CONFIG: Final = re.compile(r"(signal|slow_faults|rules|discrete)\[\d+\]\.(\w+)(?:\[(\d+)\])?")


class Element(NamedTuple):
    """An element of CONFIG, INPUT or OUTPUT."""

    address: str
    field: str
    first: int  # byte in its record
    base: Base
    unit: str  # SI


class Pair(NamedTuple):
    """An element of a record and its element of a variable."""

    element: Element
    variable: str
    at: int  # in the variable
    factor: float  # SI units of one unit of the variable


def mapped(unit: Unit, known: dict[str, Described], named: str) -> dict[str, Any]:
    """Return the calls of a mapping.  BadInput.  known : variables of the FMU; named : its name in errors"""
    assert unit.fmu is not None
    inputs = _pairs("inputs", unit.fmu.inputs, ASKED[unit.replaces_law], known, unit, named)
    outputs = _pairs("outputs", unit.fmu.outputs, Place.OUTPUT, known, unit, named)
    parameters = _pairs("parameters", unit.fmu.parameters, Place.CONFIG, known, unit, named)
    constants = _constants(unit.fmu.constants, known, named)
    counts = Counter([*((pair.variable, pair.at) for pair in (*inputs.values(), *parameters.values())), *constants])
    for (variable, _), times in counts.most_common(1):
        if times > 1:
            raise BadInput(f"{named}: fmu: {variable} is mapped {times} times")
    _require_apart(inputs.values(), parameters.values(), named)
    known = _with(constants, known)
    names = [*(pair.variable for pair in parameters.values()), *(name for name, _ in constants)]
    said, unsaid = _said(set(outputs), unit)
    law = [] if "law" in outputs else [(place(OUTPUT, "law")[1], int(Law.EXTERNAL))]
    return {
        **{f"{causality}s once": _once(causality, names, parameters.values(), known) for causality in _SET},
        "inputs": _calls([pair.variable for pair in inputs.values()], inputs.values(), known),
        "outputs": _calls([pair.variable for pair in outputs.values()], outputs.values(), known),
        "filled in": [*law, (place(OUTPUT, "said")[1], int(said))],
        UNSAID: unsaid,
    }


def _once(
    causality: str, names: Iterable[str], pairs: Iterable[Pair], known: dict[str, Described]
) -> list[dict[str, Any]]:
    """Return the calls for those variables of a ``causality`` that are set once: FMI has a time for each."""
    of = [name for name in names if known[name].causality == causality]
    return _calls(of, [pair for pair in pairs if pair.variable in of], known)


def _constants(given: Mapping[str, float], known: dict[str, Described], named: str) -> dict[tuple[str, int], float]:
    """Return constants by variable and index in it.  BadInput: no such variable, or one that cannot have the value."""
    found: dict[tuple[str, int], float] = {}
    for name, value in given.items():
        where = f"{named}: fmu.constants"
        base, at = find(name, known, where)
        _require_causality(name, known[base], "constants", where)
        if known[base].type not in REAL + WHOLE:
            raise BadInput(f"{where}: {name} has type {known[base].type}, which holds no number")
        low, high = range_of(known[base].type)
        if not low <= value <= high or (known[base].type in WHOLE and value != int(value)):
            raise BadInput(f"{where}: {name} has type {known[base].type}, which cannot hold {value:g}")
        found[base, at] = float(value)
    return found


def _require_apart(inputs: Iterable[Pair], parameters: Iterable[Pair], named: str) -> None:
    """Raise BadInput for a variable that is set once and, as part of an array, in each frame again."""
    both = {pair.variable for pair in inputs} & {pair.variable for pair in parameters}
    if both:
        raise BadInput(f"{named}: fmu.parameters: {min(both)} is in fmu.inputs, which sets it in each frame")


def _with(constants: Mapping[tuple[str, int], float], known: dict[str, Described]) -> dict[str, Described]:
    """Return the variables with ``constants`` as start values."""
    starts = {name: list(known[name].start) for name, _ in constants}
    for (name, at), value in constants.items():
        starts[name][at] = value
    return {name: one._replace(start=starts.get(name, one.start)) for name, one in known.items()}


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
                found[address] = _pair(_elements(record)[address], name, table, known, said)
    return found


def _expanded(key: str, variable: str, elements: dict[str, Element], where: str) -> list[tuple[str, str]]:
    """Return addresses that fit ``key`` with their variables.  BadInput."""
    if key.count("*") != variable.count("*"):
        raise BadInput(f"{where}: {variable!r} must have as many * as its key, {key.count('*')}")
    shape = re.compile(re.escape(key).replace(r"\*", r"([^.]+)"))
    fits = [(address, match) for address in elements if (match := shape.fullmatch(address))]
    if not fits:
        if gone := is_gone(key.rpartition(".")[2]):
            raise BadInput(f"{where}: {gone}")
        if (new := of_layout(key)) != key:
            raise BadInput(f"{where}: is now called {new}")
        raise BadInput(f"{where}: no such element; {choices(key, elements, 'docs/reference/icd.md')}")
    parts = variable.split("*")
    return [(address, "".join(map("".join, zip(parts, (*match.groups(), ""), strict=True)))) for address, match in fits]


@cache
def _elements(record: Place) -> dict[str, Element]:
    """Return all elements of a record by address; not reserved ones, nor ``stepped`` and ``said``, which it counts."""
    elements = {}
    for variable in of_record(record):
        for scalar in variable.scalars():
            field, address, unit = _named(scalar.name, variable.name, scalar.about)
            if variable.name not in ("stepped", "said") and not variable.text and not field.startswith("reserved_"):
                elements[address] = Element(address, field, scalar.first, variable.base, unit)
    return elements


def _named(name: str, variable: str, about: str) -> tuple[str, str, str]:
    """Return field, address and SI unit of an element ``name`` of a ``variable``."""
    of = _OF_CONFIG.fullmatch(name)
    if of is not None:  # of a signal or discrete in CONFIG
        unit = SIGNALS[INDEX[about]].unit if of[1] != "discrete" and of[2] in OF_ITS_SIGNAL else unit_of_name(of[2])
        return of[2], ".".join([of[1], about, *filter(None, of.groups()[1:])]), unit or "1"
    items = about.split(", channel ") if about else []
    return variable, ".".join([variable, *items]), _unit(variable, items)


def _unit(field: str, items: list[str]) -> str:
    """Return the SI unit of an element."""
    if field in _OF_SIGNALS:
        return SIGNALS[INDEX[items[0]]].unit
    if field == "rate_hz":
        return "Hz"
    named = field in _OF_SURFACES or (field in FIELD and FIELD[field].elements)
    return (unit_of_name(items[0]) if items and named else "") or "1"


def _pair(element: Element, name: str, table: str, known: dict[str, Described], where: str) -> Pair:
    """Return the pair of an element.  BadInput: no such variable, or one that does not fit."""
    base, index = find(name, known, where)
    variable = known[base]
    _require_causality(name, variable, table, where)
    types = REAL if element.base is Base.REAL else REAL + WHOLE
    if variable.type not in types:
        raise BadInput(f"{where}: {name} has type {variable.type}, must be {', '.join(types)}")
    if not variable.unit:
        return Pair(element, base, index, 1.0)
    try:
        return Pair(element, base, index, conversion(_usual(variable.unit), _usual(element.unit)).factor)
    except ValueError as error:
        raise BadInput(f"{where}: {name} is in {variable.unit}: {error}") from None


def _require_causality(name: str, variable: Described, table: str, where: str) -> None:
    if variable.causality not in _CAUSALITIES[table]:
        allowed = " or ".join(_CAUSALITIES[table])
        raise BadInput(f"{where}: {name} has causality {variable.causality}, must be {allowed}")


def _usual(unit: str) -> str:
    """Return a unit as of Modelica, ``m/s2``, as the rig writes it: ``m/s^2``."""
    return re.sub(r"(?<=[^\W\d])(-?\d)", r"^\1", unit.replace(".", "*"))


def _said(addresses: set[str], unit: Unit) -> tuple[Said, list[str]]:
    """Return the groups that are filled, and the field that is left out of one.

    BadInput: an incomplete group (states or levels alone are allowed), or a missing group that the role needs.
    """
    said, unsaid = Said(0), _left_out(addresses)
    for group in Said:
        every = _of_output({name for name, of in ANSWERS.items() if of == group} - {"law", *unsaid})
        missing = [address for address in every if address not in addresses]
        if not missing:
            said |= group
        elif len(missing) < len(every) or group == _NEEDED[unit.role]:
            why = (
                f"role {unit.role} needs it" if group == _NEEDED[unit.role] else "other fields of its group are mapped"
            )
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            raise BadInput(f"{unit.source}: fmu.outputs: {missing[0]}{more} not mapped: {why}")
    return said, unsaid


def _left_out(addresses: set[str]) -> list[str]:
    """Return which of states and levels is not mapped if the other one is complete."""
    return [
        field
        for field, other in (("state", "level"), ("level", "state"))
        if addresses.issuperset(_of_output({other})) and addresses.isdisjoint(_of_output({field}))
    ]


def _of_output(fields: set[str]) -> list[str]:
    """Return the addresses of these fields of OUTPUT, in their order."""
    return [address for address, element in _elements(Place.OUTPUT).items() if element.field in fields]


def _calls(variables: Iterable[str], pairs: Iterable[Pair], known: dict[str, Described]) -> list[dict[str, Any]]:
    """Return a call of FMI for each type: whole variables, and the places of their elements in the record."""
    calls, every, pairs = [], list(dict.fromkeys(variables)), list(pairs)
    for kind in dict.fromkeys(known[name].type for name in every):
        names = [name for name in every if known[name].type == kind]
        begins = dict(zip(names, accumulate((len(known[name].start) for name in names), initial=0), strict=False))
        own = [pair for pair in pairs if pair.variable in begins]
        at = [
            [begins[one.variable] + one.at, one.element.first, one.factor, one.element.base.name, one.element.address]
            for one in own
        ]
        call = {"type": kind, "references": [known[name].reference for name in names]}
        calls.append({**call, "start": [number for name in names for number in known[name].start], "pairs": at})
    return calls
