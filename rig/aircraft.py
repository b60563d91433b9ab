"""An aircraft is a folder: ``aircraft.toml`` (airframe, sensors, monitors) and ``gains.toml`` (designed).

``defaults.toml`` beside the bundled aircraft holds what they share; an aircraft's own file says what
differs.  Tables are merged as plain data here and checked once, by scenario.py.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rig.errors import BadInput
from rig.settings import read_toml


def bundled(kind: str) -> Path:
    """The bundled ``aircraft`` or ``faults`` folder: inside the installed package, else in the checkout."""
    package = Path(__file__).parent
    installed = package / "bundled" / kind
    return installed if installed.is_dir() else package.parent / kind


def names() -> list[str]:
    """The bundled aircraft, in alphabetical order."""
    return sorted(path.parent.name for path in bundled("aircraft").glob("*/aircraft.toml"))


def folder(name: str) -> Path:
    """The folder of a bundled aircraft, or of one of the user's own given by its path."""
    for candidate in (bundled("aircraft") / name, Path(name)):
        if (candidate / "aircraft.toml").is_file():
            return candidate
    raise BadInput(f"aircraft: unknown aircraft {name!r}, allowed: {', '.join(names())} or a folder's path")


def tables(name: str) -> dict[str, Any]:
    """Everything that is known of an aircraft: defaults, its own tables, its designed gains."""
    own = folder(name)
    merged = merge(read_toml(bundled("aircraft") / "defaults.toml"), read_toml(own / "aircraft.toml"))
    gains = own / "gains.toml"
    if not gains.is_file():
        raise BadInput(f"{gains}: no such file, write it with: rig aircraft design {name}")
    return merge(merged, {"gains": read_toml(gains)})


def merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """``below`` with ``above`` laid over it: tables key by key, everything else replaced."""
    merged = dict(below)
    for key, value in above.items():
        lower = merged.get(key)
        merged[key] = merge(lower, value) if isinstance(value, dict) and isinstance(lower, dict) else value
    return merged
