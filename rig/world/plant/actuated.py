"""The base model with actuators in place of the flight control that it is shipped with.

A shipped flight control reads true states, which would go around the redundant sensors.  So the
aircraft's folder is copied from the installed JSBSim into the cache and there its
``<flight_control>`` is replaced by one that only moves the surfaces:

    command, rad  -> position limits -> lag -> rate limit -> position, rad
    throttle 0..1 -> limits          -> lag -> rate limit -> every engine

With servos (rig/world/actuators/) the command is the position: lag and rate limit of the three surfaces are left out.

JSBSim's normalised commands (``fcs/elevator-cmd-norm`` and so on) carry **radians** here, so that
trim, linearisation and flight share one input.  With the copy goes a list of the properties that
its equations read: JSBSim ends the whole process when one of them is missing.  And a SHA-256 of all
its files: a copy that was damaged is made again.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

from rig.core.errors import BadInput, RigError
from rig.core.files import is_installed, reported
from rig.core.kernel_cache import REMEDY
from rig.core.kernels import cache_root
from rig.core.text import choices, quoted
from rig.world.plant.airframe import Config, Surface
from rig.world.plant.imperial import METRES_PER_FOOT, METRES_PER_INCH

THROTTLE_POSITION = "rig/throttle-position"  # 0 to 1, after the actuator

_DROPPED = ("flight_control", "autopilot", "system", "external_reactions", "input", "output")
_SHAPING = {"base_model", "cg_x_shift_m", "elevator", "aileron", "rudder", "throttle", "properties"}
_METRES = {"M": 1.0, "FT": METRES_PER_FOOT, "IN": METRES_PER_INCH}
_READERS = ("property", "p", "independentVar")
_NOT_READ: Final = "a file of JSBSim's package, which is not installed as a whole, cannot be read"
_READS_FILE: Final = "reads.txt"
_DIGEST_FILE: Final = "sha256.txt"  # written last


def folder(airframe: Config, root: Path, servos: bool = False) -> Path:
    """Return the aircraft folder to give to JSBSim; make it when the cache has none.

    root : the installed JSBSim's data (aircraft, engine, systems);  servos : they move the surfaces
    Raises BadInput: no such base model, or one that our actuators do not fit.
    """
    model = model_file(airframe.base_model, root)
    source = model.parent
    key = hashlib.sha256(_sources(source) + airframe.model_dump_json(include=_SHAPING).encode() + b"servos" * servos)
    target = cache_root() / "airframes" / key.hexdigest()[:24]
    if not _is_whole(target):
        tree = _actuated(parsed(model), airframe, servos)
        reads = sorted(_reads(tree, root, source))
        _check_positions(airframe, reads)
        _publish(tree, reads, source, target)
    return target


def base_models(root: Path) -> list[str]:
    """Return the aircraft of the installed JSBSim, in alphabetical order."""
    with reported(root / "aircraft", what=_NOT_READ):
        folders = sorted((root / "aircraft").iterdir())
    return [path.name for path in folders if is_installed(path / f"{path.name}.xml")]


def model_file(base_model: str, root: Path) -> Path:
    """Return the file of an aircraft of the installed JSBSim; BadInput names the nearest when there is none."""
    model = root / "aircraft" / base_model / f"{base_model}.xml"
    if not is_installed(model):
        allowed = choices(base_model, base_models(root))
        raise BadInput(f"airframe.base_model: JSBSim has no aircraft {quoted(base_model)}; {allowed}")
    return model


def parsed(path: Path) -> ET.Element:
    """Return the root of a file of a model; BadInput: it is no XML."""
    try:
        return ET.parse(path).getroot()
    except (ET.ParseError, ValueError, LookupError) as error:  # of the text, of its encoding
        raise BadInput(f"airframe.base_model: {path} cannot be read: {error}") from None
    except OSError as error:
        raise RigError(f"{path}: {_NOT_READ}: {error.strerror}") from None


def read_by_equations(tree: ET.Element, root: Path, source: Path) -> list[str]:
    """Return the properties that a model's equations and engines read, without its own flight control."""
    for child in [child for child in tree if child.tag in _DROPPED]:
        tree.remove(child)
    return sorted(_reads(tree, root, source))


def reads(folder: Path) -> list[str]:
    """Return the properties that the equations of this folder's aircraft and engines read."""
    path = folder / _READS_FILE
    with reported(path, what=f"cannot be read; remove {folder}, it is made again"):
        return path.read_text(encoding="utf-8").split()


@cache
def _sources(source: Path) -> bytes:
    """Return what the copy is made by and from; neither changes while a process runs."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted(source.rglob("*")):
        if path.is_file():
            with reported(path, what=_NOT_READ):
                digest.update(path.read_bytes())
    return digest.digest()


_whole: set[Path] = set()  # copies that this process has found to be as they were written


def _is_whole(copy: Path) -> bool:
    """Return True if a copy is there, with the bytes that were written; they are read once in a process."""
    file = copy / _DIGEST_FILE
    if not is_installed(file):
        return False
    if copy not in _whole:
        try:
            if file.read_bytes() != _digest(copy):
                return False
        except OSError:
            return False
        _whole.add(copy)
    return True


def _digest(copy: Path) -> bytes:
    """Return what ``_DIGEST_FILE`` holds: a hash of the names and bytes of all other files."""
    digest = hashlib.sha256()
    for path in sorted(copy.rglob("*")):
        if path.name != _DIGEST_FILE and path.is_file():
            data = path.read_bytes()
            digest.update(f"{path.relative_to(copy).as_posix()}\0{len(data)}\0".encode() + data)
    return digest.hexdigest().encode()


def _publish(tree: ET.Element, reads: list[str], source: Path, target: Path) -> None:
    """Write beside, then rename: another process either sees all of it or nothing."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=".draft-", dir=target.parent))
        shutil.copytree(source, draft / source.name)
        ET.ElementTree(tree).write(draft / source.name / f"{source.name}.xml", encoding="utf-8")
        (draft / _READS_FILE).write_text("\n".join(reads), encoding="utf-8")
        (draft / _DIGEST_FILE).write_bytes(_digest(draft))
        try:
            if not _is_whole(target):
                _set_aside(target)
            draft.rename(target)
        except OSError:
            if not _is_whole(target):  # else another process was faster, with the same result
                raise
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    except OSError as error:
        reason = error.strerror or error
        raise RigError(f"{target.parent}: cannot be written: {reason}; {REMEDY}") from None


def _set_aside(target: Path) -> None:
    """Remove a copy that is damaged, or whatever else has its name."""
    if not os.path.lexists(target):
        return
    aside = target.with_name(f".draft-{secrets.token_hex(8)}")
    with suppress(FileNotFoundError):  # another process was faster
        target.rename(aside)
    if aside.is_dir() and not aside.is_symlink():
        shutil.rmtree(aside, ignore_errors=True)
    else:
        aside.unlink(missing_ok=True)


def _actuated(tree: ET.Element, airframe: Config, servos: bool) -> ET.Element:
    for child in [child for child in tree if child.tag in _DROPPED]:
        tree.remove(child)
    _shift_cg(tree, airframe.cg_x_shift_m)
    engines = len(tree.findall("propulsion/engine"))
    if not engines:
        raise BadInput(f"airframe.base_model: {airframe.base_model} has no engine")
    places = [i for i, child in enumerate(tree) if child.tag == "aerodynamics"]
    tree.insert(places[0] if places else len(tree), _flight_control(airframe, engines, servos))
    return tree


def _shift_cg(tree: ET.Element, shift_m: float) -> None:
    location = tree.find("mass_balance/location[@name='CG']")
    x = None if location is None else location.find("x")
    if location is None or x is None:
        raise BadInput("airframe.base_model: its mass balance names no CG location")
    try:
        x.text = repr(float(x.text or 0.0) + shift_m / _METRES[location.get("unit", "IN")])
    except (KeyError, ValueError) as error:  # another unit; no number
        raise BadInput(f"airframe.base_model: the CG location of its mass balance cannot be read: {error}") from None


def _flight_control(airframe: Config, engines: int, servos: bool) -> ET.Element:
    control = ET.Element("flight_control", name="rig actuators")
    for name, value in airframe.properties.items():
        ET.SubElement(control, "property", value=repr(value)).text = name
    channel = ET.SubElement(control, "channel", name="actuators")
    for name, axis in (("elevator", "pitch"), ("aileron", "roll"), ("rudder", "yaw")):
        surface: Surface = getattr(airframe, name)
        stops, lag = (surface.min_rad, surface.max_rad), (surface.lag_s, surface.rate_limit_rad_s)
        trim, moved_by = f"fcs/{axis}-trim-cmd-norm", None if servos else lag
        _actuator(channel, name, "-rad", stops, moved_by, surface.position, trim)
    throttle = airframe.throttle
    _actuator(channel, "throttle", "", (0.0, 1.0), (throttle.lag_s, throttle.rate_limit_1_s), THROTTLE_POSITION)
    for engine in range(engines):
        gain = ET.SubElement(channel, "pure_gain", name=f"rig/engine-{engine}-throttle")
        ET.SubElement(gain, "input").text = THROTTLE_POSITION
        ET.SubElement(gain, "gain").text = repr(throttle.full_position)
        ET.SubElement(gain, "output").text = f"fcs/throttle-pos-norm[{engine}]"
    return control


def _actuator(
    channel: ET.Element,
    name: str,
    unit: str,
    stops: tuple[float, float],
    lag: tuple[float, float] | None,
    output: str,
    *trims: str,
) -> None:
    """Add what moves one position; ``stops``: low and high, ``lag``: its time and the rate limit behind it, if any."""
    # The limits come before the lag: the actuator does not wind up beyond its stop.
    wanted = ET.SubElement(channel, "summer", name=f"rig/{name}-wanted{unit}")
    for source in (f"fcs/{name}-cmd-norm", *trims):
        ET.SubElement(wanted, "input").text = source
    limits = ET.SubElement(wanted, "clipto")
    for tag, stop in zip(("min", "max"), stops, strict=True):
        ET.SubElement(limits, tag).text = repr(stop)
    if lag is None:
        ET.SubElement(wanted, "output").text = output
        return
    actuator = ET.SubElement(channel, "actuator", name=f"rig/{name}-actuator")
    ET.SubElement(actuator, "input").text = f"rig/{name}-wanted{unit}"
    ET.SubElement(actuator, "lag").text = repr(1.0 / lag[0])
    ET.SubElement(actuator, "rate_limit").text = repr(lag[1])
    ET.SubElement(actuator, "output").text = output


def _check_positions(airframe: Config, reads: list[str]) -> None:
    for name in ("elevator", "aileron", "rudder"):
        position = getattr(airframe, name).position
        if position not in reads:
            allowed = choices(position, (read for read in reads if read.startswith("fcs/")))
            model = airframe.base_model
            raise BadInput(f"airframe.{name}.position: {model} does not read {quoted(position)}; {allowed}")


def _reads(tree: ET.Element, root: Path, source: Path) -> set[str]:
    engines = len(tree.findall("propulsion/engine"))
    names: set[str] = set()
    for part in (*(child for child in tree if child.tag != "flight_control"), *part_files(tree, root, source)):
        for element in part.iter():
            if element.tag in _READERS and element.text and element.text.strip():
                name = element.text.strip().lstrip("-")
                names.update(name.replace("#", str(engine)) for engine in range(engines))
    return names


def part_files(tree: ET.Element, root: Path, source: Path) -> Iterator[ET.Element]:
    """Yield engines and thrusters, and any other part that the model keeps in a separate file."""
    places = (source, source / "Engines", source / "Engine", root / "engine")
    for name in {element.get("file") for element in tree.iter() if element.get("file")}:
        for path in (place / f"{name}.xml" for place in places):
            if path.is_file():
                yield parsed(path)
                break
