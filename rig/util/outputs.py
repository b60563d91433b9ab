"""No output over an input: what every command that writes a file which the user names asks first."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from itertools import combinations
from pathlib import Path
from typing import Final

from rig.errors import BadInput
from rig.util.files import is_file, reported

CAMPAIGN: Final = "campaign.json"  # marks the folder of a campaign
TRIALS: Final = "trials.json"  # and that of trials
LEAGUE: Final = "league.json"  # and that of a league
CUTSETS: Final = "cutsets.json"  # and that of cut sets,
SETS: Final = "sets.json"  # which holds the minimal ones
CONFIRMED: Final = "confirmed.json"  # and how they were flown again
_OWN: Final = {  # files of such a folder that are nobody else's, by their path in it
    CAMPAIGN: re.compile(r"campaign\.json|lock|\w+/\d+-\d+\.parquet|logs/run_\d+\.mcap"),
    TRIALS: re.compile(r"trials\.json|\w+\.parquet"),
    CUTSETS: re.compile(r"(cutsets|sets|confirmed)\.json"),
    LEAGUE: re.compile(r"(league|levels|result)\.json|lock|units/\d+-\d+\.parquet"),
}
_DATA: Final = (".csv", ".parquet", ".mcap", ".json")  # endings of what is read where an input is a folder


def require_apart(outputs: Mapping[str, Path | None], inputs: Iterable[Path | str | None] = ()) -> None:
    """Raise BadInput where an output is an input, another output, or a file of a campaign's or trials' own.

    outputs : by the options that name them; two paths are one file in any spelling, over links, and as hard links
    inputs  : files and folders; of a folder all data in it
    """
    named = [(option, path) for option, path in outputs.items() if path is not None]
    given = [Path(path) for path in inputs if path is not None]
    for option, path in named:
        with reported(f"{option} {path}", BadInput):
            _require_no_input(f"{option} {path}", path, given)
    for (first, a), (second, b) in combinations(named, 2):
        if _same(a, b):
            raise BadInput(f"{second} {b}: is {first} too")


def require_page(option: str, path: Path | None) -> None:
    """Raise BadInput where the name of a page does not end with .html: a browser would show its text."""
    if path is not None and path.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"{option} {path}: is a page for a browser: its name must end with .html")


def _require_no_input(what: str, path: Path, inputs: Iterable[Path]) -> None:
    places = {Path(os.path.realpath(path)), Path(os.path.realpath(path.parent), path.name)}  # a link, and its end
    for given in inputs:
        if _same(path, given):
            raise BadInput(f"{what}: is the input")
        if _is_folder(given) and (_inside(places, given) or _is_data_of(path, given)):
            raise BadInput(f"{what}: is among the data of the input {given}")
    for place in places:
        for folder in (place.parent, place.parent.parent):
            for mark, own in _OWN.items():
                if is_file(folder / mark) and own.fullmatch(place.relative_to(folder).as_posix()):
                    raise BadInput(f"{what}: is a file of the folder's own, which {mark} describes")


def _same(one: Path, other: Path) -> bool:
    """Return True for two names of one file, whether it is there or not."""
    try:
        return os.path.realpath(one) == os.path.realpath(other) or one.samefile(other)
    except (OSError, ValueError):  # one is not there, or is no name of a file
        return False


def _inside(places: Iterable[Path], folder: Path) -> bool:
    """Return True if data is at one of the places, in ``folder`` or below."""
    root = Path(os.path.realpath(folder))
    return any(place.suffix in _DATA and is_file(place) and place.is_relative_to(root) for place in places)


def _is_data_of(path: Path, folder: Path) -> bool:
    """Return True if ``path`` is a hard link of data in ``folder``."""
    if not is_file(path) or path.stat().st_nlink < 2:
        return False
    return any(_same(path, data) for data in folder.rglob("*") if data.suffix in _DATA)


def _is_folder(path: Path) -> bool:
    return os.path.isdir(path)  # noqa: PTH112 # Path.is_dir raises for a name that is too long
