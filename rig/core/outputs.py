"""No output over an input: the check of every command before it writes a file that the user names."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from typing import Final

from rig.core.errors import BadInput
from rig.core.files import is_file, is_folder, reported

CAMPAIGN: Final = "campaign.json"  # marks the folder of a campaign
UNTIL: Final = "until.json"  # beside it: when the campaign stops
_WORST: Final = ("worst.toml", *(f"worst_{i}.toml" for i in range(2, 6)))  # a scenario of each cluster
BESIDE_RUNS: Final = ("search.json", "search.html", *_WORST)  # that a search writes into it
PLANT_SEARCH: Final = "plant-search.json"  # and that of a search over a plant
TRIALS: Final = "trials.json"  # and that of trials
BENCHMARK: Final = "benchmark.json"  # and that of a benchmark
CUTSETS: Final = "cutsets.json"  # and that of cut sets,
SETS: Final = "sets.json"  # which holds the minimal ones
CONFIRMED: Final = "confirmed.json"  # and how they were flown again
_OWN: Final = {  # files that belong to such a folder, by their path in it
    CAMPAIGN: re.compile(
        r"campaign\.json|lock|\w+/\d+-\d+\.parquet|logs/run_\d+\.mcap|(search|until)\.json|worst(_\d)?\.toml"
    ),
    PLANT_SEARCH: re.compile(
        r"(plant-)?search\.json|lock|(rounds|choosing|confirming|shrinking)/[\d-]+\.json|cluster_\d\.csv"
    ),
    TRIALS: re.compile(r"trials\.json|lock|\w+\.parquet"),
    CUTSETS: re.compile(r"(cutsets|sets|confirmed)\.json|lock"),
    BENCHMARK: re.compile(r"(benchmark|levels|result)\.json|lock|(units|flights)/\d+-\d+\.parquet"),
}
_DATA: Final = (".csv", ".parquet", ".mcap", ".json")  # endings of what is read where an input is a folder


def require_apart(outputs: Mapping[str, Path | None], inputs: Iterable[Path | str | None] = ()) -> None:
    """Raise BadInput if an output is an input, another output, or a file that belongs to a campaign or to trials.

    outputs : by their options; two paths are one file in any spelling, over links, and as hard links
    inputs  : files and folders; for a folder all data in it, and the data that links in it lead to
    """
    named = [(option, path) for option, path in outputs.items() if path is not None]
    given = [Path(path) for path in inputs if path is not None]
    for option, path in named:
        with reported(f"{option} {path}", BadInput):
            _require_no_input(f"{option} {path}", path, given)
    for (first, a), (second, b) in combinations(named, 2):
        if _same(a, b):
            raise BadInput(f"{second} {b}: is the file of {first} too")


def require_page(option: str, path: Path | None) -> None:
    """Raise BadInput if the name of a page does not end with .html: a browser would show its text."""
    require_ending(option, path, "a page for a browser", ".html", ".htm")


def require_ending(option: str, path: Path | None, what: str, *endings: str) -> None:
    """Raise BadInput if a name has none of ``endings``: it may be code or settings that an input refers to."""
    if path is not None and path.suffix.lower() not in endings:
        raise BadInput(f"{option} {path}: must end with {endings[0]}, as {what}")


def _require_no_input(what: str, path: Path, inputs: Iterable[Path]) -> None:
    places = {Path(os.path.realpath(path)), Path(os.path.realpath(path.parent), path.name)}  # a link, and its end
    for given in inputs:
        if _same(path, given):
            raise BadInput(f"{what}: is the input")
        if is_folder(given) and _is_data_of(path, given):
            raise BadInput(f"{what}: is among the data of the input {given}")
    for place in places:
        for folder in (place.parent, place.parent.parent):
            for mark, own in _OWN.items():
                if is_file(folder / mark) and own.fullmatch(place.relative_to(folder).as_posix()):
                    raise BadInput(f"{what}: belongs to the folder that {mark} describes; choose another name")


def _same(one: Path, other: Path) -> bool:
    """Return True for two names of one file, which need not exist."""
    try:
        return os.path.realpath(one) == os.path.realpath(other) or one.samefile(other)
    except (OSError, ValueError):  # one is not there, or is no name of a file
        return False


def _is_data_of(path: Path, folder: Path) -> bool:
    """Return True if ``path`` is data in ``folder`` or below, or the target of a link there."""
    if not is_file(path):
        return False
    own = path.stat()
    return any(os.path.samestat(own, data.stat()) for data in _data(folder) if data.is_file())


def _data(folder: Path) -> Iterator[os.DirEntry[str]]:
    """Yield the data in a folder and below, in folders that links lead to as well."""
    left, seen = [os.path.realpath(folder)], set[str]()
    while left:
        seen.add(place := left.pop())
        with suppress(OSError), os.scandir(place) as entries:  # one that cannot be read is no input
            for entry in entries:
                if entry.is_dir():
                    left += {os.path.realpath(entry)} - seen
                elif entry.name.endswith(_DATA):
                    yield entry
