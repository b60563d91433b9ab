"""The carrier ``fmu``: an FMU is unpacked, its description looked into, and a child process started that steps it.

FMI 2.0 and 3.0, co-simulation.  The child is fmu_host.py; it hears and answers what the host of a library does.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, get_args
from xml.etree import ElementTree

from rig.errors import BadInput
from rig.unit import links
from rig.unit.fmu_description import IDENTIFIER, TOKEN, Version, variables
from rig.unit.layout import CONFIG, INPUT, OUTPUT, place
from rig.unit.links import SocketLink
from rig.unit.settings import Unit

PLAN: Final = "rig-unit.json"  # beside what was in the FMU: what the child sets and gets
_DAMAGED: Final = (zipfile.BadZipFile, OSError, RuntimeError, ValueError, EOFError, zlib.error)


class FmuLink(SocketLink):
    """The child in which an FMU is stepped, and the folder that the FMU was unpacked into."""

    def __init__(self, unit: Unit, folder: TemporaryDirectory[str], looks: int) -> None:
        """Start the child.  BadInput."""
        super().__init__(*links.hosted("fmu", Path(folder.name), unit.file.parent, looks))
        self._folder = folder

    def close(self) -> None:
        """End the child and remove the folder."""
        super().close()
        self._folder.cleanup()


def child(unit: Unit, looks: int) -> FmuLink:
    """An FMU in a child process; BadInput when it is none that can be flown.  looks : as of processes.Started"""
    if find_spec("fmpy") is None:
        raise BadInput(f"{unit.source}: carrier fmu needs FMPy: pip install 'jsbsim-rig[fmi]'")
    folder = TemporaryDirectory(prefix="rig-fmu-")
    try:
        plan = _plan(_unpacked(unit, Path(folder.name)), f"{unit.source}: {unit.path}")
        Path(folder.name, PLAN).write_text(json.dumps(plan))
        return FmuLink(unit, folder, looks)
    except BaseException:
        folder.cleanup()
        raise


def _unpacked(unit: Unit, folder: Path) -> ElementTree.Element:
    """The FMU's description; what else is in it is in ``folder``."""
    named = f"{unit.source}: {unit.path}"
    try:
        with zipfile.ZipFile(unit.file) as archive:
            archive.extractall(folder)
        return ElementTree.parse(folder / "modelDescription.xml").getroot()
    except ElementTree.ParseError as error:
        raise BadInput(f"{named}: its modelDescription.xml cannot be read: {error}") from None
    except FileNotFoundError:
        raise BadInput(f"{named} is no FMU: it has no modelDescription.xml") from None
    except _DAMAGED as error:
        raise BadInput(f"{named} is no FMU: {error}") from None


def _plan(description: ElementTree.Element, named: str) -> dict[str, Any]:
    """What the child needs to know.  BadInput: the FMU was not made for these records."""
    version = _version(description, named)
    token = description.get("guid" if version == "2" else "instantiationToken", "")
    how = description.find("CoSimulation")
    if how is None:
        raise BadInput(f"{named} has no co-simulation")
    if token != TOKEN:
        again = f"write its modelDescription.xml again ('rig unit header --fmu {version}') and rebuild"
        raise BadInput(f"{named} was built for layout {token!r}, this rig has {TOKEN!r}: {again}")
    return {
        "version": version,
        "token": token,
        "identifier": how.get("modelIdentifier", IDENTIFIER),
        "rate_hz": place(CONFIG, "rate_hz")[1],
        "time_s": place(INPUT, "time_s")[1],
        "said": place(OUTPUT, "said")[1],
        "runs": _runs(version, _declared(description, version), named),
    }


def _version(description: ElementTree.Element, named: str) -> Version:
    said = description.get("fmiVersion", "unknown")
    for version in get_args(Version):
        if said.startswith(f"{version}."):
            return version
    raise BadInput(f"{named} is of FMI version {said}; 2.0 and 3.0 can be flown")


def _declared(description: ElementTree.Element, version: Version) -> dict[tuple[str, str], int]:
    """Value references by name and type."""
    found = {}
    for one in description.findall("ModelVariables/*"):
        tag, reference = one[0].tag if version == "2" and len(one) else one.tag, one.get("valueReference", "")
        if reference.isdecimal():
            found[one.get("name", ""), tag] = int(reference)
    return found


def _runs(version: Version, declared: dict[tuple[str, str], int], named: str) -> list[dict[str, Any]]:
    """Variables of one type that lie side by side in a record: each run is one call of FMI."""
    runs: list[dict[str, Any]] = []
    for variable in variables(version):
        known = variable.name, variable.type(version)
        if known not in declared:
            raise BadInput(f"{named} has no variable {variable.name} of type {known[1]}")
        if variable.name == "stepped":  # the child counts itself
            continue
        kind = "text" if variable.text else variable.base.name
        last = runs[-1] if runs else None
        if last is None or (last["record"], last["kind"]) != (variable.record, kind) or last["end"] != variable.first:
            last = {"record": variable.record, "kind": kind, "first": variable.first, "references": []}
            runs.append(last)
        last["references"].append(declared[known])
        last["end"] = variable.first + variable.count * variable.width
    return runs
