"""The FMU of an aircraft as a file: its description, its scenario, and the library of pythonfmu or pythonfmu3.

The same scenario and packages give the same bytes.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, distribution
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any, Final

import tomli_w

from rig.core.errors import BadInput
from rig.core.files import bundled, is_file, read_bytes, replaced, require_place
from rig.core.outputs import require_ending
from rig.flight.aircraft_fmu.aircraft_description import IDENTIFIER, description
from rig.flight.aircraft_fmu.aircraft_slave import BUILT, NOISE, SCENARIO
from rig.flight.aircraft_fmu.aircraft_variables import MOST_INTEGER, digest, variables
from rig.flight.aircraft_fmu.computer_outside import without_computer
from rig.flight.aircraft_fmu.stepped import SteppedAircraft
from rig.scenario.overrides import Overrides
from rig.scenario.scenario import Scenario, find, load
from rig.unit.fmu_description import Version
from rig.world.sensors.noise_file import LARGEST_NOISE

PACKAGES: Final[dict[Version, str]] = {"2": "pythonfmu", "3": "pythonfmu3"}
_LIBRARIES: Final = (".so", ".dll", ".dylib")
_SAME: Final = ("jsbsim-rig", "jsbsim")  # whose versions an FMU needs again: other ones fly other numbers
_FRAMES: Final = 2  # flown at the build, so that what a step needs is compiled
_BEGINNING: Final = (1980, 1, 1, 0, 0, 0)  # of the time of a ZIP archive
# In the FMU.  The library looks for the class by its text, and does not survive an error of the import.
_MODULE: Final = '''"""An aircraft of jsbsim-rig; it needs the version of the package with which it was built."""

import json
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from {package} import {base}

try:
    from rig.flight.aircraft_fmu.aircraft_slave import {slave} as Slave
except ImportError:

    class Slave:
        do_step = None

        def begin(self, resources):
            raise RuntimeError("this FMU was built with another state of jsbsim-rig: build it again")


class {identifier}(Slave, {base}):
    def __init__(self, **kwargs):
        for name, built in json.loads((Path(kwargs["resources"]) / "{built}").read_text())["packages"].items():
            try:
                present = version(name)
            except PackageNotFoundError:
                present = "none"
            if present != built:
                what = f"this FMU was built with {{name}} {{built}}, Python in {{sys.prefix}} has {{present}}"
                raise RuntimeError(f"{{what}}: build it again (rig fmu build)")
        {base}.__init__(self, **kwargs)
        self.begin(kwargs["resources"])
'''


@dataclass(frozen=True)
class Built:
    """The file that ``build`` has written."""

    file: Path
    version: Version
    scalars: dict[str, int]  # number of scalar variables by causality
    parameters: dict[str, float]  # start values by name


def given(name: str, overrides: Overrides = (), seed: int | None = None) -> tuple[str, Scenario]:
    """Return name and scenario of a scenario's file or bundled name, or of an aircraft: without faults.  BadInput."""
    if any(is_file(home / name / "aircraft.toml") for home in (bundled("aircraft"), Path())):
        return Path(name).name, load({"aircraft": name}, overrides, seed)
    try:
        path = find(name)
    except BadInput as error:
        raise BadInput(f"{error}; aircraft: rig aircraft list") from None
    return path.stem, load(path, overrides, seed)


def build(name: str, out: Path, version: Version, overrides: Overrides = (), seed: int | None = None) -> Built:
    """Build the FMU of a scenario or an aircraft, and compile what it needs.

    BadInput: a missing package, a scenario that needs its flight computer inside, or a place that cannot be written.
    """
    package = _package(version)
    _require_new(out)
    title, scenario = given(name, overrides, seed)
    scenario = without_computer(scenario, title)
    if version == "2" and scenario.seed > MOST_INTEGER:
        raise BadInput(
            f"{title}: seed: {scenario.seed} is no Integer of FMI 2.0; at most {MOST_INTEGER}, or --version 3"
        )
    flight = SteppedAircraft(scenario)
    for _ in range(_FRAMES):
        flight.step(flight.trim)
    every = variables(scenario, flight.trim, version)
    text, noise = _resources(scenario)
    token = f"rig-aircraft-{sha256(f'{digest(every)}{text}{_versions()}'.encode()).hexdigest()[:16]}"
    built = {"packages": _versions(), "variables": digest(every), "trim": flight.trim}
    contents = {
        "modelDescription.xml": description(title, scenario, every, version, token).encode(),
        f"resources/{SCENARIO}": text.encode(),
        f"resources/{BUILT}": json.dumps(built, indent=1).encode(),
        **{f"resources/{NOISE}/{sensor}.csv": data for sensor, data in noise.items()},
        **dict(_of_package(package, version)),
    }
    _write(out, contents)
    counts: dict[str, int] = {}
    for variable in every:
        counts[variable.causality] = counts.get(variable.causality, 0) + max(variable.count, 1)
    parameters = {one.name: one.start for one in every if one.causality == "parameter" and one.start is not None}
    return Built(out, version, counts, parameters)


def _require_new(out: Path) -> None:
    require_ending("--out", out, "an FMU", ".fmu")
    if os.path.lexists(out):
        raise BadInput(f"--out {out}: exists already; choose another name, or delete it")
    require_place(out)


def _package(version: Version) -> Path:
    """Return the folder of the package that exports Python as an FMU.  BadInput: it is not installed."""
    name = PACKAGES[version]
    try:
        return Path(str(distribution(name).locate_file(name)))  # not the copy in an FMU that this process has flown
    except PackageNotFoundError:
        raise BadInput(f"--version {version}: needs {name}: pip install 'jsbsim-rig[fmu]'") from None


def _versions() -> dict[str, str]:
    return {name: installed(name) for name in _SAME}


def _resources(scenario: Scenario) -> tuple[str, dict[str, bytes]]:
    """Return the resolved scenario, and the noise files of its sensors, which go with it."""
    data = scenario.resolved()
    noise: dict[str, bytes] = {}
    for name, sensor in data["sensors"].items():
        if isinstance(sensor, dict) and (file := sensor.get("noise_file")) is not None:
            noise[name] = read_bytes(Path(file), LARGEST_NOISE, f"sensors.{name}.noise_file: {file}")
            sensor["noise_file"] = f"{NOISE}/{name}.csv"
    return tomli_w.dumps(data), noise


def _of_package(folder: Path, version: Version) -> Iterator[tuple[str, bytes]]:
    """Yield what the library in an FMU needs: itself, its Python files, the module that it loads; and its licence."""
    package = PACKAGES[version]
    module, base = f"rig_aircraft_fmi{version}", f"Fmi{version}Slave"
    names: dict[str, Any] = {"package": package, "base": base, "slave": f"Slave{version}", "built": BUILT}
    yield f"resources/{module}.py", _MODULE.format(identifier=IDENTIFIER, **names).encode()
    yield "resources/slavemodule.txt", module.encode()
    for file in folder.glob("*.py"):
        yield f"resources/{package}/{file.name}", file.read_bytes()
    libraries = folder / "resources" / "binaries"
    for file in (file for ending in _LIBRARIES for file in libraries.glob(f"*/*{ending}")):
        yield f"binaries/{file.parent.name}/{IDENTIFIER}{file.suffix}", file.read_bytes()
    for file in distribution(package).files or ():
        if file.name.upper().startswith("LICEN"):
            yield f"documentation/licenses/{package}.txt", file.read_binary()


def _write(out: Path, contents: dict[str, bytes]) -> None:
    """Write the archive, all of it or nothing."""
    with replaced(out) as made, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(contents):
            entry = zipfile.ZipInfo(name, _BEGINNING)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, contents[name])
