"""The carrier ``fmu``: the records of layout.py as the variables of an FMU, FMI 2.0 or 3.0, co-simulation.

CONFIG becomes fixed parameters, INPUT inputs, OUTPUT outputs.  FMI 2.0 has a scalar for each element, FMI 3.0 arrays.
A value reference says where the variable is, so that a unit needs no table of them: from the lowest bit 14 bits first
byte, 10 bits elements, 2 bits type (Base), 2 bits record (Place).

description  modelDescription.xml, ``rig unit header --fmu``
child        an FMU unpacked, its description compared, and the process started that steps it (fmu_host.py)
"""

from __future__ import annotations

import json
import re
import stat
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from importlib.util import find_spec
from itertools import product
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal, get_args
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from rig.errors import BadInput
from rig.frame import DISCRETES, SIGNALS, SURFACES, S
from rig.frame.fields import FIELD
from rig.unit import links
from rig.unit.layout import CONFIG, HELLO, INPUT, LAYOUT, OUTPUT, RECORDS, place, walk
from rig.unit.links import SocketLink
from rig.unit.settings import Unit

Version = Literal["2", "3"]  # of FMI
IDENTIFIER: Final = "rig_unit"  # how the library in an FMU is called
TOKEN: Final = f"rig-unit-{LAYOUT:016x}"  # guid or instantiationToken: other records, another one
PLAN: Final = "rig-unit.json"  # beside what was in the FMU: what the child sets and gets
_MOST_BYTES, _MOST_FILES = 500 << 20, 10_000  # of an FMU unpacked
_DAMAGED: Final = (zipfile.BadZipFile, OSError, RuntimeError, ValueError, EOFError, zlib.error)


class Place(IntEnum):
    """The record that a variable is in."""

    CONFIG = 0
    INPUT = 1
    OUTPUT = 2


class Base(IntEnum):
    """The type of an element; a text is an array of BYTE."""

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
        """Return the element of the description."""
        if self.text:
            return "String"
        return _TYPES_3[self.base] if version == "3" else "Real" if self.base is Base.REAL else "Integer"

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
    fields = [variable for record, dtype in _RECORDS.items() for variable in _fields(record, dtype)]
    return fields if version == "3" else [scalar for variable in fields for scalar in variable.scalars()]


def _fields(
    record: Place, dtype: np.dtype[Any], prefix: str = "", begin: int = 0, about: str = ""
) -> Iterator[Variable]:
    """Yield all fields but head, gaps and tail."""
    for field in walk(dtype):
        name, first = field.name, begin + field.offset
        if name.startswith("pad_") or name in (HELLO.names or ()):
            continue
        if field.record:
            items = SIGNALS if field.record == "signal_config" else DISCRETES
            for i, item in enumerate(items):
                inner = RECORDS[field.record]
                yield from _fields(record, inner, f"{name}[{i + 1}].", first + i * inner.itemsize, item.name)
        elif field.base.kind == "S":
            yield Variable(prefix + name, record, Base.BYTE, first, (field.base.itemsize,), True)
        else:
            yield Variable(prefix + name, record, _BASES[field.base.str[1:]], first, field.shape, about=about)


def _about(name: str, shape: tuple[int, ...], index: tuple[int, ...]) -> str:
    """Return which signal, discrete or surface an element is of."""
    field = FIELD.get(name)
    if field is not None and field.elements:
        return field.elements[index[0]]
    if name in ("trim_surface", "surface_low", "surface_high"):
        return SURFACES[index[0]]
    item = (SIGNALS if shape[0] == S else DISCRETES)[index[0]].name
    return item if len(index) == 1 else f"{item}, channel {index[1] + 1}"


# The description that a unit is built with -------------------------------------------------------------------


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


# An FMU that is flown ----------------------------------------------------------------------------------------


class FmuLink(SocketLink):
    """The child in which an FMU is stepped, and the folder that the FMU was unpacked into."""

    def __init__(self, unit: Unit, folder: TemporaryDirectory[str], looks: int) -> None:
        """Start the child.  BadInput."""
        super().__init__(*links.hosted("fmu", Path(folder.name), unit.file.parent, looks))
        self._folder = folder

    def close(self) -> str:
        """End the child and remove the folder."""
        wrong = super().close()
        self._folder.cleanup()
        return wrong


def child(unit: Unit, looks: int) -> FmuLink:
    """Start an FMU in a child process; BadInput when it is none that can be flown.  looks : as of UnitProcess"""
    if find_spec("fmpy") is None:
        raise BadInput(f"{unit.source}: carrier fmu needs FMPy: pip install 'jsbsim-rig[fmi]'")
    folder = TemporaryDirectory(prefix="rig-fmu-")
    try:
        named = f"{unit.source}: {unit.path}"
        plan = _plan(_unpacked(unit.file, Path(folder.name), named), named)
        Path(folder.name, PLAN).write_text(json.dumps(plan))
        return FmuLink(unit, folder, looks)
    except BaseException:
        folder.cleanup()
        raise


def _unpacked(file: Path, folder: Path, named: str) -> ElementTree.Element:
    """Unpack the FMU into ``folder``; return its description.

    Not by fmpy.read_model_description: it raises plain Exceptions, and none of them names the cause in one line.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            wrong = _beyond(archive.infolist())
            if wrong:
                raise BadInput(f"{named} is not unpacked: {wrong}")
            archive.extractall(folder)
        return ElementTree.parse(folder / "modelDescription.xml").getroot()
    except ElementTree.ParseError as error:
        raise BadInput(f"{named}: its modelDescription.xml cannot be read: {error}") from None
    except FileNotFoundError:
        raise BadInput(f"{named} is no FMU: it has no modelDescription.xml") from None
    except _DAMAGED as error:
        raise BadInput(f"{named} is no FMU: {error}") from None


def _beyond(entries: list[zipfile.ZipInfo]) -> str:
    """Return what is beyond the limits of an archive; of a file no more is unpacked than its entry states."""
    if len(entries) > _MOST_FILES:
        return f"it has {len(entries)} files, at most {_MOST_FILES} are allowed"
    size = sum(entry.file_size for entry in entries)
    if size > _MOST_BYTES:
        return f"it unpacks to {size >> 20} MiB, at most {_MOST_BYTES >> 20} are allowed"
    for entry in entries:
        name = entry.filename.replace("\\", "/")
        if name.startswith("/") or ".." in name.split("/") or re.match("[A-Za-z]:", name):
            return f"{entry.filename!r} is a path outside of it"
        if stat.S_ISLNK(entry.external_attr >> 16):
            return f"{entry.filename!r} is a link"
    return ""


def _plan(description: ElementTree.Element, named: str) -> dict[str, Any]:
    """Return what the child needs.  BadInput: the FMU was not made for these records."""
    fmi_version = description.get("fmiVersion", "unknown")
    version = next((version for version in get_args(Version) if fmi_version.startswith(f"{version}.")), None)
    if version is None:
        raise BadInput(f"{named} is of FMI version {fmi_version}; 2.0 and 3.0 can be flown")
    token = description.get("guid" if version == "2" else "instantiationToken", "")
    co_simulation = description.find("CoSimulation")
    if co_simulation is None:
        raise BadInput(f"{named} has no co-simulation")
    if token != TOKEN:
        remedy = f"write its modelDescription.xml again ('rig unit header --fmu {version}') and rebuild"
        raise BadInput(f"{named} was built for layout {token!r}, this rig has {TOKEN!r}: {remedy}")
    return {
        "version": version,
        "token": token,
        "identifier": co_simulation.get("modelIdentifier", IDENTIFIER),
        "rate_hz": place(CONFIG, "rate_hz")[1],
        "time_s": place(INPUT, "time_s")[1],
        "said": place(OUTPUT, "said")[1],
        "runs": _runs(version, _declared(description, version), named),
    }


def _declared(description: ElementTree.Element, version: Version) -> dict[tuple[str, str], int]:
    """Return the value references by name and type."""
    references = {}
    for element in description.findall("ModelVariables/*"):
        kind = element[0].tag if version == "2" and len(element) else element.tag
        reference = element.get("valueReference", "")
        if reference.isdecimal():
            references[element.get("name", ""), kind] = int(reference)
    return references


def _runs(version: Version, declared: dict[tuple[str, str], int], named: str) -> list[dict[str, Any]]:
    """Return runs of variables of one type that lie side by side in a record: each is one call of FMI."""
    runs: list[dict[str, Any]] = []
    for variable in variables(version):
        key = variable.name, variable.type(version)
        if key not in declared:
            raise BadInput(f"{named} has no variable {variable.name} of type {key[1]}")
        if variable.name == "stepped":  # the child counts itself
            continue
        kind = "text" if variable.text else variable.base.name
        last = runs[-1] if runs else None
        if last is None or (last["record"], last["kind"], last["end"]) != (variable.record, kind, variable.first):
            last = {"record": variable.record, "kind": kind, "first": variable.first, "references": []}
            runs.append(last)
        last["references"].append(declared[key])
        last["end"] = variable.first + variable.count * variable.width
    return runs
