"""The transport ``fmu``: an FMU unpacked, its description compared, and the process started that steps it
(fmu_host.py).

An FMU made with our description (fmu_description.py) has the records of unit_records.py as its variables; of any other
the
unit file maps them (fmu_mapping.py).
"""

from __future__ import annotations

import json
import re
import stat
import zipfile
import zlib
from importlib.util import find_spec
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, get_args
from xml.etree import ElementTree

from rig.core.errors import BadInput
from rig.core.renamed import names_of_variable
from rig.core.text import quoted
from rig.unit import transport as links
from rig.unit.fmu_description import ASKED, IDENTIFIER, PLACED, TOKEN, TOKENS, Place, Version, variables
from rig.unit.fmu_mapping import UNSAID, mapped
from rig.unit.fmu_variables import Described, described
from rig.unit.transport import SocketLink
from rig.unit.unit_file import Unit
from rig.unit.unit_records import CONFIG, INPUT, OUTPUT, SINCE, place

PLAN: Final = "rig-unit.json"  # beside what was in the FMU: what the child sets and gets
_MOST_BYTES, _MOST_FILES = 500 << 20, 10_000  # of an FMU unpacked
_LEAST_STEP_S: Final = 1e-9
_IDENTIFIER: Final = re.compile(r"[\w-][\w.-]{0,199}")  # of one file in the archive
_DAMAGED: Final = (zipfile.BadZipFile, OSError, RuntimeError, ValueError, EOFError, zlib.error)


class FmuLink(SocketLink):
    """The child process that steps an FMU, and the folder of the unpacked FMU."""

    def __init__(self, unit: Unit, folder: TemporaryDirectory[str], looks: int, unsaid: tuple[str, ...]) -> None:
        """Start the child.  BadInput."""
        unpacked = Path(folder.name)
        super().__init__(*links.hosted("fmu", unit, unpacked, looks, beside=(unpacked,)))
        self._folder, self.unsaid = folder, unsaid

    def close(self) -> str:
        """End the child and remove the folder."""
        wrong = super().close()
        self._folder.cleanup()
        return wrong


def child(unit: Unit, looks: int) -> FmuLink:
    """Start an FMU in a child process.  BadInput: the file is no FMU that can be flown.  looks : as in UnitProcess"""
    if find_spec("fmpy") is None:
        raise BadInput(f"{unit.source}: transport fmu needs FMPy: pip install 'jsbsim-rig[fmi]'")
    folder = TemporaryDirectory(prefix="rig-fmu-")
    try:
        named = f"{unit.source}: {unit.path}"
        plan = _plan(_unpacked(unit.file, Path(folder.name), named), unit, named)
        Path(folder.name, PLAN).write_text(json.dumps(plan))
        return FmuLink(unit, folder, looks, tuple(plan.get(UNSAID, ())))
    except BaseException:
        folder.cleanup()
        raise


def _unpacked(file: Path, folder: Path, named: str) -> ElementTree.Element:
    """Unpack the FMU into ``folder``; return its description.

    fmpy.read_model_description is not used: it raises plain Exceptions, which do not name the cause in one line.
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
        raise BadInput(f"{named} is not an FMU: it has no modelDescription.xml") from None
    except _DAMAGED as error:
        raise BadInput(f"{named} is not an FMU: {error}") from None


def _beyond(entries: list[zipfile.ZipInfo]) -> str:
    """Return the limit that an archive exceeds, if any; a file is unpacked only up to the size in its entry."""
    if len(entries) > _MOST_FILES:
        return f"it has {len(entries)} files, at most {_MOST_FILES} are allowed"
    size = sum(entry.file_size for entry in entries)
    if size > _MOST_BYTES:
        return f"it unpacks to {size >> 20} MiB, at most {_MOST_BYTES >> 20} are allowed"
    for entry in entries:
        name = entry.filename.replace("\\", "/")
        if name.startswith("/") or ".." in name.split("/") or re.match("[A-Za-z]:", name):
            return f"{entry.filename!r} is a path outside the archive"
        if stat.S_ISLNK(entry.external_attr >> 16):
            return f"{entry.filename!r} is a link"
    return ""


def _plan(description: ElementTree.Element, unit: Unit, named: str) -> dict[str, Any]:
    """Return the plan of the child.  BadInput: the FMU was not made for these records, and has no mapping."""
    fmi_version = description.get("fmiVersion", "unknown")
    version = next((version for version in get_args(Version) if fmi_version.startswith(f"{version}.")), None)
    if version is None:
        raise BadInput(f"{named} has FMI version {fmi_version}; must be 2.0 or 3.0")
    token = description.get("guid" if version == "2" else "instantiationToken", "")
    co_simulation = description.find("CoSimulation")
    if co_simulation is None:
        raise BadInput(f"{named} has no co-simulation")
    if unit.fmu is None and token not in TOKENS:
        raise BadInput(
            f"{named} was built for layout {token!r}, this rig has {TOKEN!r}: write its modelDescription.xml again"
            f" ('rig unit header --fmu {version}') and rebuild, or map its variables in [fmu.inputs] and [fmu.outputs]"
        )
    identifier = co_simulation.get("modelIdentifier", IDENTIFIER)
    if not _IDENTIFIER.fullmatch(identifier):
        raise BadInput(f"{named}: modelIdentifier {quoted(identifier)} is not the name of a library")
    known, asked = described(description, version, named), ASKED[unit.replaces_law]
    return {
        "version": version,
        "token": token,
        "identifier": identifier,
        "rate_hz": place(CONFIG, "rate_hz")[1],
        "time_s": place(INPUT, "time_s")[1],
        "said": place(OUTPUT, "said")[1],
        "bytes": {record: dtype.itemsize for record, dtype in PLACED.items()},
        "asked": asked,
        **_steps(description, co_simulation, named),
        **(
            {"runs": _runs(version, known, TOKENS[token].version, asked, named)}
            if unit.fmu is None
            else mapped(unit, known, named)
        ),
    }


def _steps(description: ElementTree.Element, co_simulation: ElementTree.Element, named: str) -> dict[str, str]:
    """Return the internal step of the FMU, and the only step that it accepts, s; 0: any.  BadInput.

    Both as written: their digits show the rounding.
    """
    experiment = description.find("DefaultExperiment")
    usual = "0" if experiment is None else experiment.get("stepSize", "0")
    varies = co_simulation.get("canHandleVariableCommunicationStepSize") in ("true", "1")
    given = {"inner_step_s": co_simulation.get("fixedInternalStepSize", "0"), "only_step_s": "0" if varies else usual}
    try:
        steps = [float(text) for text in given.values()]
    except ValueError as error:
        raise BadInput(f"{named}: its step size is not a number: {error}") from None
    for step_s in steps:
        if not (step_s == 0.0 or _LEAST_STEP_S <= step_s < inf):
            raise BadInput(f"{named}: its step size is {step_s:g} s, must be {_LEAST_STEP_S:g} or more")
    return given


def _runs(
    version: Version, known: dict[str, Described], records: int, asked: Place, named: str
) -> list[dict[str, Any]]:
    """Return runs of adjacent variables of one type in a record: each is one call of FMI.

    records : the version of the records for which the FMU was made; asked : the record that its role reads
    """
    runs: list[dict[str, Any]] = []
    for variable in variables(version):
        if SINCE.get(re.split(r"[\[.]", variable.name)[0], 1) > records:
            continue
        if variable.record in ASKED and variable.record is not asked:
            continue
        found = next((known[name] for name in names_of_variable(variable.name) if name in known), None)
        if found is None or found.type != variable.type(version):
            raise BadInput(f"{named} has no variable {variable.name} of type {variable.type(version)}")
        if variable.name == "stepped":  # the child counts itself
            continue
        kind = "text" if variable.text else variable.base.name
        last = runs[-1] if runs else None
        if last is None or (last["record"], last["kind"], last["end"]) != (variable.record, kind, variable.first):
            last = {"record": variable.record, "kind": kind, "first": variable.first, "references": []}
            runs.append(last)
        last["references"].append(found.reference)
        last["end"] = variable.first + variable.count * variable.width
    return runs
