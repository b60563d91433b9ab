"""The records of layout.py as the variables of an FMU, and its ``modelDescription.xml``: ``rig unit header --fmu``.

CONFIG becomes fixed parameters, INPUT inputs, OUTPUT outputs.  FMI 2.0 has a scalar for each element, FMI 3.0 arrays.
A value reference says where the variable is, so that a unit needs no table of them: from the lowest bit 14 bits first
byte, 10 bits elements, 2 bits type (Base), 2 bits record (Place).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product
from math import prod
from typing import Any, Final, Literal
from xml.sax.saxutils import quoteattr

import numpy as np

from rig.frame import DISCRETES, SIGNALS, SURFACES, S
from rig.frame.fields import FIELD
from rig.unit.layout import CONFIG, HELLO, INPUT, LAYOUT, OUTPUT, SIGNAL_CONFIG, place

Version = Literal["2", "3"]  # of FMI
IDENTIFIER: Final = "rig_unit"  # how the library in an FMU is called
TOKEN: Final = f"rig-unit-{LAYOUT:016x}"  # guid or instantiationToken: other records, another one


class Place(IntEnum):
    """The record that a variable is in."""

    CONFIG = 0
    INPUT = 1
    OUTPUT = 2


class Base(IntEnum):
    """What an element is; a text is an array of BYTE."""

    BYTE = 0
    SIGNED = 1
    UNSIGNED = 2
    REAL = 3


_RECORDS: Final = {Place.CONFIG: CONFIG, Place.INPUT: INPUT, Place.OUTPUT: OUTPUT}
_CAUSALITY: Final = {Place.CONFIG: "parameter", Place.INPUT: "input", Place.OUTPUT: "output"}
_BASES: Final = {"f8": Base.REAL, "u1": Base.BYTE, "i8": Base.SIGNED, "u8": Base.UNSIGNED}
_TYPES_3: Final = {Base.REAL: "Float64", Base.BYTE: "UInt8", Base.SIGNED: "Int64", Base.UNSIGNED: "UInt64"}


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
        return self.record << 26 | self.base << 24 | self.count << 14 | self.first

    @property
    def width(self) -> int:
        """Bytes of an element."""
        return 1 if self.base is Base.BYTE else 8

    def type(self, version: Version) -> str:
        """The element of the description."""
        if self.text:
            return "String"
        return _TYPES_3[self.base] if version == "3" else "Real" if self.base is Base.REAL else "Integer"

    def scalars(self) -> Iterator[Variable]:
        """Its elements, by indices that count from 1; a text is one."""
        if self.text or not self.shape:
            yield self
            return
        for i, index in enumerate(product(*map(range, self.shape))):
            name = f"{self.name}[{','.join(str(n + 1) for n in index)}]"
            about = self.about or _about(self.name, self.shape, index)
            yield replace(self, name=name, first=self.first + i * self.width, shape=(), about=about)


def variables(version: Version) -> list[Variable]:
    """Of all records, in the order of their bytes."""
    found = [variable for record in Place for variable in _fields(record, _RECORDS[record])]
    return found if version == "3" else [scalar for variable in found for scalar in variable.scalars()]


def _fields(record: Place, dtype: np.dtype[Any], prefix: str = "", at: int = 0, about: str = "") -> Iterator[Variable]:
    """All fields but head, gaps and tail."""
    for name in dtype.names or ():
        if name.startswith("pad_") or name in (HELLO.names or ()):
            continue
        of, first = place(dtype, name)
        base, shape = of.base, of.shape
        if base.names is not None:
            known = SIGNALS if base == SIGNAL_CONFIG else DISCRETES
            for i in range(shape[0]):
                yield from _fields(record, base, f"{name}[{i + 1}].", at + first + i * base.itemsize, known[i].name)
        elif base.kind == "S":
            yield Variable(prefix + name, record, Base.BYTE, at + first, (base.itemsize,), True)
        else:
            yield Variable(prefix + name, record, _BASES[base.str[1:]], at + first, shape, about=about)


def _about(name: str, shape: tuple[int, ...], index: tuple[int, ...]) -> str:
    """Which signal, discrete or surface an element is of."""
    field = FIELD.get(name)
    if field is not None and field.elements:
        return field.elements[index[0]]
    if name in ("trim_surface", "surface_low", "surface_high"):
        return SURFACES[index[0]]
    of = (SIGNALS if shape[0] == S else DISCRETES)[index[0]].name
    return of if len(index) == 1 else f"{of}, channel {index[1] + 1}"


def description(version: Version) -> str:
    """The text of ``modelDescription.xml``."""
    known = variables(version)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', *_opening(version), "  <ModelVariables>"]
    if version == "3":  # the independent variable: time_s in the head of INPUT
        time = Variable("time", Place.INPUT, Base.REAL, place(INPUT, "time_s")[1], ())
        lines.append(f'    <Float64 name="time" valueReference="{time.reference}" causality="independent"/>')
    lines += [f"    {_variable(variable, version)}" for variable in known]
    lines += ["  </ModelVariables>", "  <ModelStructure>", *_outputs(known, version), "  </ModelStructure>"]
    return "\n".join([*lines, "</fmiModelDescription>", ""])


def _opening(version: Version) -> list[str]:
    token = "guid" if version == "2" else "instantiationToken"
    flags = 'canHandleVariableCommunicationStepSize="false" canBeInstantiatedOnlyOncePerProcess="true"'
    memory = ' canNotUseMemoryManagementFunctions="true"' if version == "2" else ""
    return [
        f'<fmiModelDescription fmiVersion="{version}.0" modelName="unit under test" {token}="{TOKEN}"'
        ' generationTool="rig unit header" variableNamingConvention="structured">',
        f'  <CoSimulation modelIdentifier="{IDENTIFIER}" {flags}{memory}/>',
        '  <LogCategories><Category name="logStatusError"/></LogCategories>',
        '  <DefaultExperiment startTime="0"/>',
    ]


def _variable(variable: Variable, version: Version) -> str:
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


def _outputs(known: list[Variable], version: Version) -> list[str]:
    answers = [(i, variable) for i, variable in enumerate(known, 1) if variable.record is Place.OUTPUT]
    if version == "3":
        return [f'    <Output valueReference="{variable.reference}"/>' for _, variable in answers]
    return ["    <Outputs>", *(f'      <Unknown index="{i}"/>' for i, _ in answers), "    </Outputs>"]
