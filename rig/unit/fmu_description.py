"""The records of unit_records.py as the variables of an FMU, FMI 2.0 or 3.0, co-simulation: ``rig unit header --fmu``.

CONFIG becomes fixed parameters, INPUT inputs, OUTPUT outputs; LAW_INPUT, which a control law reads in place of INPUT,
inputs whose names begin with ``law_input.``.  FMI 2.0 has a scalar for each element, FMI 3.0 arrays.
A value reference encodes the place of the variable, so that a unit needs no table: from the lowest bit 14 bits first
byte, 10 bits elements, 2 bits type (Base), 2 bits record (Place), 1 more bit of the type.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product
from math import prod
from typing import Any, Final, Literal
from xml.sax.saxutils import quoteattr

import numpy as np

from rig.core.frame import DISCRETES, SIGNALS, SURFACES, D, S
from rig.core.frame.fields import FIELD
from rig.unit.fmu_moves import NAMES, TYPES
from rig.unit.unit_records import CONFIG, HELLO, INPUT, INTERFACES, LAW_INPUT, OUTPUT, RECORDS, Interface, place, walk

Version = Literal["2", "3"]  # of FMI
IDENTIFIER: Final = "rig_unit"  # how the library in an FMU is called
# By guid or instantiationToken: other records, another one.
TOKENS: Final[dict[str, Interface]] = {
    f"rig-unit-{interface.layout:016x}": interface for interface in INTERFACES.values()
}
TOKEN: Final = next(iter(TOKENS))


class Place(IntEnum):
    """The record of a variable."""

    CONFIG = 0
    INPUT = 1
    OUTPUT = 2
    LAW_INPUT = 3


class Base(IntEnum):
    """The type of an element; a text is an array of BYTE."""

    BYTE = 0
    SIGNED = 1
    UNSIGNED = 2
    REAL = 3
    SHORT = 4
    WORD = 5


PLACED: Final = {Place.CONFIG: CONFIG, Place.INPUT: INPUT, Place.OUTPUT: OUTPUT, Place.LAW_INPUT: LAW_INPUT}
_CAUSALITY: Final = {
    **{Place.CONFIG: "parameter", Place.INPUT: "input"},
    **{Place.OUTPUT: "output", Place.LAW_INPUT: "input"},
}
_OF_LAW: Final = "law_input."
ASKED: Final = (Place.INPUT, Place.LAW_INPUT)  # in every frame: the second by a control law
_BASES: Final = {np.dtype(kind).str[1:]: Base[name] for name, kind in TYPES.items()}  # by the type in a record


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the FMU: a field of a record, or an element of one."""

    name: str
    record: Place
    base: Base
    first: int  # byte in its record
    shape: tuple[int, ...]
    text: bool = False
    about: str = ""  # which signal or surface it is of

    @property
    def count(self) -> int:
        """Elements."""
        return prod(self.shape)

    @property
    def reference(self) -> int:
        """Its value reference."""
        return self.base >> 2 << 28 | self.record << 26 | (self.base & 3) << 24 | self.count << 14 | self.first

    @property
    def width(self) -> int:
        """Bytes of an element."""
        return ctypes.sizeof(TYPES[self.base.name])

    def type(self, version: Version) -> str:
        """Return the element of the description."""
        if self.text:
            return "String"
        return NAMES[self.base.name] if version == "3" else "Real" if self.base is Base.REAL else "Integer"

    def scalars(self) -> Iterator[Variable]:
        """Yield its elements, by indices that count from 1; a text is one."""
        if self.text or not self.shape:
            yield self
            return
        for i, index in enumerate(product(*map(range, self.shape))):
            name = f"{self.name}[{','.join(str(n + 1) for n in index)}]"
            about = self.about or _about(self.name, self.shape, index)
            yield replace(self, name=name, first=self.first + i * self.width, shape=(), about=about)


def variables(version: Version) -> list[Variable]:
    """Return the variables of all records, in the order of their bytes."""
    fields = [
        replace(variable, name=_OF_LAW + variable.name) if record is Place.LAW_INPUT else variable
        for record in Place
        for variable in of_record(record)
    ]
    return fields if version == "3" else [scalar for variable in fields for scalar in variable.scalars()]


def of_record(record: Place) -> list[Variable]:
    """Return the variables of one record, arrays whole, by the names of its fields."""
    return list(_fields(record, PLACED[record]))


def _fields(
    record: Place, dtype: np.dtype[Any], prefix: str = "", begin: int = 0, about: str = ""
) -> Iterator[Variable]:
    """Yield all fields but head, gaps and tail."""
    for field in walk(dtype):
        name, first = field.name, begin + field.offset
        if name.startswith("pad_") or name in (HELLO.names or ()):
            continue
        if field.record:
            items = DISCRETES if field.record == "discrete_config" else SIGNALS
            for i, item in enumerate(items):
                inner = RECORDS[field.record]
                yield from _fields(record, inner, f"{name}[{i + 1}].", first + i * inner.itemsize, item.name)
        elif field.base.kind == "S":
            yield Variable(prefix + name, record, Base.BYTE, first, (field.base.itemsize,), True)
        else:
            yield Variable(prefix + name, record, _BASES[field.base.str[1:]], first, field.shape, about=about)


def _about(name: str, shape: tuple[int, ...], index: tuple[int, ...]) -> str:
    """Return the signal, discrete or surface of an element."""
    field = FIELD.get(name.removeprefix(_OF_LAW))
    if field is not None and field.elements:
        return field.elements[index[0]]
    if name in ("trim_surface", "surface_low", "surface_high"):
        return SURFACES[index[0]]
    items = {S: SIGNALS, D: DISCRETES}.get(shape[0])
    item = str(index[0] + 1) if items is None else items[index[0]].name
    return item if len(index) == 1 else f"{item}, channel {index[1] + 1}"


def description(version: Version) -> str:
    """Return the text of ``modelDescription.xml``."""
    token = "guid" if version == "2" else "instantiationToken"
    flags = 'canHandleVariableCommunicationStepSize="false" canBeInstantiatedOnlyOncePerProcess="true"'
    memory = ' canNotUseMemoryManagementFunctions="true"' if version == "2" else ""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="{version}.0" modelName="unit under test" {token}="{TOKEN}"'
        ' generationTool="rig unit header" variableNamingConvention="structured">',
        f'  <CoSimulation modelIdentifier="{IDENTIFIER}" {flags}{memory}/>',
        '  <LogCategories><Category name="logStatusError"/></LogCategories>',
        '  <DefaultExperiment startTime="0"/>',
        "  <ModelVariables>",
    ]
    if version == "3":  # the independent variable: time_s in the head of INPUT
        time = Variable("time", Place.INPUT, Base.REAL, place(INPUT, "time_s")[1], ())
        lines.append(f'    <Float64 name="time" valueReference="{time.reference}" causality="independent"/>')
    every = variables(version)
    lines += [f"    {_element(variable, version)}" for variable in every]
    lines += ["  </ModelVariables>", "  <ModelStructure>", *_outputs(every, version), "  </ModelStructure>"]
    return "\n".join([*lines, "</fmiModelDescription>", ""])


def _element(variable: Variable, version: Version) -> str:
    kind, causality = variable.type(version), _CAUSALITY[variable.record]
    variability = "fixed" if causality == "parameter" else "discrete"
    initial = ' initial="exact"' if causality == "output" else ""
    about = f" description={quoteattr(variable.about)}" if variable.about else ""
    head = (
        f"name={quoteattr(variable.name)} valueReference={quoteattr(str(variable.reference))}{about}"
        f' causality="{causality}" variability="{variability}"{initial}'
    )
    if version == "2":
        return f'<ScalarVariable {head}><{kind} start="{"" if variable.text else "0"}"/></ScalarVariable>'
    if variable.text:
        return f'<String {head}><Start value=""/></String>'
    dimensions = "".join(f'<Dimension start="{n}"/>' for n in variable.shape)
    opening = f'<{kind} {head} start="{" ".join(["0"] * variable.count)}"'
    return f"{opening}>{dimensions}</{kind}>" if dimensions else f"{opening}/>"


def _outputs(every: list[Variable], version: Version) -> list[str]:
    outputs = [(i, variable) for i, variable in enumerate(every, 1) if variable.record is Place.OUTPUT]
    if version == "3":
        return [f'    <Output valueReference="{variable.reference}"/>' for _, variable in outputs]
    return ["    <Outputs>", *(f'      <Unknown index="{i}"/>' for i, _ in outputs), "    </Outputs>"]
