"""INPUT of ``rig thresholds``: which recordings there are.  Each is one block: one flight.

a file                                a table, or an MCAP file: a flight's log, or any with a [mapping]
a folder with the sources of [mapping]  one recording of several recorders
a folder of a campaign                its logs
any other folder                      each file and each folder of sources in it, by name
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from rig.errors import BadInput
from rig.recordings.read import ENDINGS
from rig.recordings.settings import VoteConfig

CAMPAIGN: Final = "campaign.json"
LOGS: Final = "logs"


def recordings(inputs: Iterable[Path], config: VoteConfig) -> list[Path]:
    """Return the recordings of all inputs, each once. BadInput: nothing there, or none in a folder."""
    found = [path for given in inputs for path in _of(given, config)]
    return list(dict.fromkeys(found))


def _of(given: Path, config: VoteConfig) -> list[Path]:
    try:
        if not given.is_dir():
            return [given]
        if _holds_sources(given, config):
            return [given]
        campaign = (given / CAMPAIGN).is_file()
        inside = sorted(_inside(given / LOGS if campaign else given, config), key=_by_number)
    except (OSError, ValueError) as error:
        raise BadInput(f"{given}: cannot be read: {getattr(error, 'strerror', error)}") from None
    if not inside and campaign:
        raise BadInput(f'{given}: the campaign kept no logs: fly it with logs = "all"')
    if not inside:
        wanted = f" nor a folder with {_first(config)}" if config.mapping else ""
        raise BadInput(f"{given}: no recording in it: neither a file of {', '.join(ENDINGS)}{wanted}")
    return inside


def _inside(folder: Path, config: VoteConfig) -> Iterator[Path]:
    for path in folder.iterdir() if folder.is_dir() else ():
        if _holds_sources(path, config) if path.is_dir() else path.suffix in ENDINGS:
            yield path


def _holds_sources(folder: Path, config: VoteConfig) -> bool:
    """Return True if the first source of the mapping is a file of the folder."""
    return bool(config.mapping) and (folder / _first(config)).is_file()


def _first(config: VoteConfig) -> str:
    return next(iter(config.mapping.values())).rpartition(":")[0] or "the mapped table"


def _by_number(path: Path) -> tuple[list[int | str], str]:
    """Sort path_2 before path_10."""
    parts = re.split(r"([0-9]+)", path.name)
    return [int(part) if part.isdecimal() and part.isascii() else part for part in parts], path.name
