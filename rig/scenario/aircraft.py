"""An aircraft is a folder: ``aircraft.toml`` (airframe, sensors, monitors), and the files of its design:
``gains.toml`` (control law) and ``references.toml``.

``defaults.toml`` beside the bundled aircraft holds their common values; the file of an aircraft holds the
differences.  This module merges tables as plain data; scenario.py checks them once.  ``sensor_classes.toml`` holds
the data-sheet classes that a sensor may name.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any, Final

from rig.computer.analytic.designed import Designed
from rig.computer.analytic.reference_sources import Config as Sources
from rig.computer.control.gains_file import Gains
from rig.core.errors import BadInput, RigError
from rig.core.files import NOT_WHOLE, bundled, is_file
from rig.core.frame import INDEX
from rig.core.settings import Settings, build, read_own, read_toml
from rig.core.text import choices, quoted
from rig.world.sensors.classes import SensorClass, under

DESIGN: Final[dict[str, type[Settings]]] = {"gains": Gains, "references": Designed}  # files beside aircraft.toml
DEFAULT: Final = "f16"  # of a scenario that names none
DESIGNED_AT_HZ: Final = 100.0  # slow-fault tests: a sample is taken up to a part of a frame early
SAME_ERRORS: Final = {"channels", "monitor"}  # keys of a sensor that leave the errors of its channels as they are
TESTS: Final = {"slow_tests": None}  # designed from a sensor's healthy samples, at the bundled aircraft's rate
ERRORS: Final = ("reference_error", "reference_frames")  # of the source that the aircraft's references have
LEVELS: Final = ("threshold", "threshold_triplex", "threshold_duplex")
STALE: Final = {"stale_frames": 0}  # designed by the repeats of a sensor's samples, whatever the threshold


def names() -> list[str]:
    """Return the bundled aircraft, in alphabetical order."""
    return sorted(path.parent.name for path in bundled("aircraft").glob("*/aircraft.toml"))


def own_names() -> list[str]:
    """Return the aircraft in the current folder: its folders with an aircraft.toml, in alphabetical order."""
    return sorted(str(path.parent) for path in Path().glob("*/aircraft.toml"))


def folder(name: str) -> Path:
    """Return the folder of a bundled aircraft, or of a user's aircraft given by its path."""
    for candidate in (bundled("aircraft") / name, Path(name)):
        if is_file(candidate / "aircraft.toml"):
            return candidate
    if name == DEFAULT:
        raise RigError(f"{bundled('aircraft') / name / 'aircraft.toml'}: {NOT_WHOLE}: no such file")
    raise BadInput(f"aircraft: unknown aircraft {quoted(name)}, {choices(name, names())} or a folder's path")


def located(name: str, beside: Path) -> str:
    """Return ``name``, or its path from ``beside`` if only that is the folder of an aircraft."""
    if not any(is_file(home / name / "aircraft.toml") for home in (bundled("aircraft"), Path())):
        path = os.path.normpath(beside / name)
        if is_file(Path(path) / "aircraft.toml"):
            return path
    return name


def tables(name: str) -> dict[str, Any]:
    """Return all tables of an aircraft: defaults, its file, its designed gains and references."""
    merged = own_tables(name)
    for kind in DESIGN:
        path = folder(name) / f"{kind}.toml"
        if not is_file(path):
            raise BadInput(f"{path}: no such file; write it with: rig aircraft design {name}")
        merged = merge(merged, {kind: read_toml(path)})
    return merged


def default_stale_frames() -> dict[str, int]:
    """Return the count of stale samples that all aircraft share, by signal."""
    signals = read_own(bundled("aircraft") / "defaults.toml")["redundancy"]["signals"]
    return {name: int(keys.get("stale_frames", 0)) for name, keys in signals.items()}


def default_factors() -> dict[str, float]:
    """Return the factor of the slow-fault tests that all aircraft share, by signal; 0: none."""
    signals = read_own(bundled("aircraft") / "defaults.toml")["redundancy"]["signals"]
    return {name: float(keys.get("slow_tests", {}).get("factor", 0.0)) for name, keys in signals.items()}


def default_boxes() -> dict[str, list[str]]:
    """Return the sets of signals that one unit of each channel measures, common to all aircraft."""
    return read_own(bundled("aircraft") / "defaults.toml")["redundancy"]["boxes"]


def own_tables(name: str) -> dict[str, Any]:
    """Return an aircraft's tables without its design: the defaults and its file."""
    path = folder(name) / "aircraft.toml"
    return lay_over(read_own(bundled("aircraft") / "defaults.toml"), read_toml(path), str(path))


def refuse_bad(name: str, model: type[Settings], designed: bool = True) -> None:
    """Refuse an aircraft whose settings are wrong by themselves; BadInput names the file of the aircraft, and the key.

    model : of a scenario, which has all settings of an aircraft
    designed : False if its own design is not there yet, or is made again; that of another one stands in
    """
    home, settings = folder(name), own_tables(name)
    for kind, of_kind in DESIGN.items():
        path = (home if designed else folder(DEFAULT)) / f"{kind}.toml"
        settings[kind] = build(of_kind, read_toml(path), str(path)).model_dump(exclude_none=True)
    build(model, settings, str(home / "aircraft.toml"))


def sensor_classes() -> dict[str, SensorClass]:
    """Return the data-sheet classes of sensors, by name."""
    path = bundled("aircraft") / "sensor_classes.toml"
    return {name: build(SensorClass, table, f"{path}: {name}") for name, table in read_own(path).items()}


def lay_over(below: dict[str, Any], above: dict[str, Any], source: str) -> dict[str, Any]:
    """Merge, with the sensor classes that ``above`` names put under its own keys; BadInput names ``source``.

    Values designed from healthy samples are dropped if ``above`` has other sensors, narrower thresholds or lower rates.
    """
    below = without_designed(below, above)
    wanted, present = above.get("sensors"), below.get("sensors")
    if not isinstance(wanted, dict) or not isinstance(present, dict):
        return merge(below, above)
    return merge({**below, "sensors": under(present, wanted, sensor_classes(), source)}, above)


def without_designed(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Return ``below`` without slow-fault tests and a count of stale samples where ``above`` changes the sensors.

    A signal with a narrower threshold has no tests: their biases may be as large.  At a lower rate none has tests: a
    sample is older then, and the aircraft moves further from frame to frame.  A reference of another source has
    another error: it is not asked about halves.  At another rate its error in motion is that of the same time.
    """
    signals, designed_hz = _tables(below.get("redundancy"), "signals"), _rate_hz(below, DESIGNED_AT_HZ)
    rate_hz = _rate_hz(above, designed_hz)
    sensors = [name for name, table in _tables(above, "sensors").items() if table.keys() - SAME_ERRORS]
    without = [
        *(INDEX if rate_hz < DESIGNED_AT_HZ and "rate_hz" in above else ()),
        *_narrowed(signals, _tables(above.get("redundancy"), "signals")),
    ]
    off = {**dict.fromkeys(without, TESTS), **{name: {**TESTS, **STALE} for name in sensors}}
    gone = {name: {**signals[name], **keys} for name, keys in off.items() if name in signals}
    faster, others = rate_hz / designed_hz, _of_other_sources(below, above)
    for name in signals if faster != 1.0 else others:
        tests = gone.get(name, signals.get(name, {})).get("slow_tests")
        if isinstance(tests, dict):
            factors = dict.fromkeys(ERRORS, 0.0) if name in others else {"reference_frames": faster}
            scaled = {
                key: tests[key] * factor for key, factor in factors.items() if isinstance(tests.get(key), int | float)
            }
            gone[name] = {**gone.get(name, signals[name]), "slow_tests": tests | scaled}
    return merge(below, {"redundancy": {"signals": gone}}) if gone else below


def _rate_hz(data: dict[str, Any], otherwise: float) -> float:
    """Return the frame rate in ``data``; ``otherwise`` if it has none, or one that will be refused."""
    rate_hz = data.get("rate_hz")
    return float(rate_hz) if isinstance(rate_hz, int | float) and rate_hz > 0 else otherwise


def _of_other_sources(below: dict[str, Any], above: dict[str, Any]) -> list[str]:
    """Return the signals whose reference has another source in ``above`` than in ``below``."""
    defaults = {name: field.default for name, field in Sources.model_fields.items()}
    present = defaults | _tables(below, "redundancy").get("references", {})
    given = _tables(above, "redundancy").get("references", {})
    return [name for name, source in given.items() if source != present.get(name)]


def _narrowed(below: dict[str, dict[str, Any]], above: dict[str, dict[str, Any]]) -> list[str]:
    """Return the signals for which ``above`` has a threshold below the one in ``below``."""
    given = {
        name: [table[key] for key in LEVELS if isinstance(table.get(key), int | float)] for name, table in above.items()
    }
    return [
        name
        for name, values in given.items()
        if min(values, default=math.inf) < below.get(name, {}).get("threshold", 0.0)
    ]


def _tables(data: Any, key: str) -> dict[str, dict[str, Any]]:
    """Return the tables in the table ``key`` of ``data``; none if it is not a table."""
    inner = data.get(key) if isinstance(data, dict) else None
    return {name: table for name, table in inner.items() if isinstance(table, dict)} if isinstance(inner, dict) else {}


def merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Return ``below`` with ``above`` laid over it: tables key by key, everything else replaced."""
    merged = dict(below)
    for key, value in above.items():
        lower = merged.get(key)
        merged[key] = merge(lower, value) if isinstance(value, dict) and isinstance(lower, dict) else value
    return merged
