"""The environment of a unit's process: the variables of its unit file, and a few of the rig's own.

A variable of the shell that is not among these does not reach the unit: who flies it does not change it.  The variables
of the file reach the process of the unit alone, not its guard and not the rig.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from rig.core.files import is_file

# Of the rig: where programs and libraries are, who the user is, language, time zone, temporary files, licences.
_KEPT: Final = re.compile(
    r"PATH|(DY)?LD_LIBRARY_PATH|HOME|USER|LOGNAME|LANG|LANGUAGE|LC_\w+|TZ|TMPDIR|TEMP|TMP|\w*LICENSE\w*"
)
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_PLACE: Final = re.compile(r"\$\{(\w*)\}?")
_PLACES: Final = ("folder", "scratch")
_OF_RIG: Final = "RIG_UNIT_"  # begins the names of what the rig itself sets
_PRELOAD: Final = "LD_PRELOAD"  # names libraries that run in the unit, between blanks or colons
_MOST: Final = 65536  # characters of all names and values
NUL: Final = "\0"


def wrong_in(variables: Mapping[str, str]) -> str:
    """Return what is wrong with the variables of a unit file, empty if nothing is."""
    for name, value in variables.items():
        if not _NAME.fullmatch(name):
            return (
                f"{name!r} is not the name of a variable: it must have letters, digits and _, and begin with no digit"
            )
        if name.startswith(_OF_RIG):
            return f"variable {name}: the rig sets those that begin with {_OF_RIG}; choose another name"
        if NUL in value:
            return f"variable {name}: must not contain the character NUL"
        for place in _PLACE.finditer(value):
            if place[1] not in _PLACES or not place[0].endswith("}"):
                return f"variable {name}: {place[0]!r} must be ${{folder}}, of the unit file, or ${{scratch}}"
    size = sum(len(name) + len(value) for name, value in variables.items())
    return f"has {size} characters, at most {_MOST} are allowed" if size > _MOST else ""


def wrong_preload(variables: Mapping[str, str], folder: Path) -> str:
    """Return what is wrong with the libraries that are loaded before others, empty if nothing is.

    The system ignores a library that it does not find: the unit would be another one.
    """
    if "${folder}" in variables.get(_PRELOAD, "") and re.search("[ :]", str(folder)):
        return f"{_PRELOAD}: {folder} contains a blank or a colon, which separate libraries there"
    relative = [name for name, path in preloaded(variables, folder) if not path.is_absolute()]
    if relative:
        return f"{_PRELOAD}: {relative[0]}: must begin with / or ${{folder}}/"
    missing = [name for name, path in preloaded(variables, folder) if not is_file(path)]
    return f"{_PRELOAD}: {missing[0]}: no such file" if missing else ""


def preloaded(variables: Mapping[str, str], folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield name and path of the libraries that the unit file has loaded before others, where it gives a path."""
    for word in re.split("[ :]+", variables.get(_PRELOAD, "")):
        if "/" in word:
            path = Path(word.replace("${folder}", str(folder)))
            inside = word.removeprefix("${folder}/") if word.startswith("${folder}/") else word
            yield inside, path


def kept() -> dict[str, str]:
    """Return the variables of the rig's own environment that a unit has too."""
    return {name: value for name, value in os.environ.items() if _KEPT.fullmatch(name)}


def declared(variables: Mapping[str, str], folder: Path, scratch: Path) -> dict[str, str]:
    """Return the variables of a unit file with the places in their values."""
    places = {"folder": str(folder), "scratch": str(scratch)}
    return {name: _PLACE.sub(lambda found: places[found[1]], value) for name, value in variables.items()}
