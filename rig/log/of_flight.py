"""The log of a flight: its name, and what it must say of the flight to be flown again."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from rig.errors import BadInput, RigError
from rig.files import numbered, reported
from rig.log.writer import LogWriter
from rig.scenario import Scenario
from rig.versions import versions

NAME_BYTES: Final = 180  # of a log's name; behind them come seed, number and ending


def new_log(out: Path, name: str, scenario: Scenario, text: str, about: Mapping[str, str] | None = None) -> LogWriter:
    """A log of its own, whoever else begins to fly: <name>_seed<seed>[_n].mcap in ``out``, which is made.

    about : more metadata
    """
    with reported(out, BadInput, "logs cannot be kept there"):
        out.mkdir(parents=True, exist_ok=True)
    for path in numbered(out, f"{word_of(name)}_seed{scenario.seed}", ".mcap"):
        with suppress(FileExistsError):  # another flight was faster
            attached = [("scenario.toml", text.encode())]
            told = {**metadata(scenario), **(about or {})}
            return LogWriter(path, scenario.rate_hz, told, attached, new=True)
    raise RigError(f"{out}: no free name for a log")


def word_of(name: str) -> str:
    """``name`` as part of a file's name, which has 255 bytes at most."""
    letters = "".join(c if c.isalnum() else "_" for c in name)
    return letters.encode()[:NAME_BYTES].decode(errors="ignore")


def metadata(scenario: Scenario) -> dict[str, str]:
    """What a log needs to be flown again: the resolved scenario, the seed, the versions that flew it."""
    return {
        "scenario": scenario.model_dump_json(exclude_none=True),
        "aircraft": scenario.aircraft,
        "seed": str(scenario.seed),
        **versions(),
    }
