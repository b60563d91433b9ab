"""The log of a flight: its name, and what it must say of the flight to be flown again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Final

from rig.errors import BadInput, RigError
from rig.log.writer import LogWriter
from rig.scenario import Scenario
from rig.util.files import numbered, reported
from rig.util.versions import versions

LONGEST_TAG: Final = 40  # characters of the overrides in a log's name
_HASH: Final = 6
NAME_BYTES: Final = 160  # of a log's name; behind them come seed, overrides, number and ending


def new_log(
    out: Path,
    name: str,
    scenario: Scenario,
    text: str,
    about: Mapping[str, str] | None = None,
    overrides: Sequence[str] = (),
) -> LogWriter:
    """Open a log under a free name, <name>_seed<seed>[_<tag>][_n].mcap, in the folder ``out``, which is made.

    about : more metadata; overrides : of the file, ``key=value``, from which the tag is made
    """
    with reported(out, BadInput, "logs cannot be kept there"):
        out.mkdir(parents=True, exist_ok=True)
    suffix = tag(overrides)
    for path in numbered(out, f"{word_of(name)}_seed{scenario.seed}{f'_{suffix}' if suffix else ''}", ".mcap"):
        with suppress(FileExistsError):  # another flight was faster
            attached = [("scenario.toml", text.encode())]
            described = {**metadata(scenario), **(about or {})}
            return LogWriter(path, scenario.rate_hz, described, attached, new=True)
    raise RigError(f"{out}: no free name for a log")


def word_of(name: str) -> str:
    """Return ``name`` as part of a file's name, which has 255 bytes at most."""
    letters = "".join(c if c.isalnum() else "_" for c in name)
    return letters.encode()[:NAME_BYTES].decode(errors="ignore")


def tag(overrides: Sequence[str]) -> str:
    """Return overrides for a file's name, at most LONGEST_TAG characters: ``manager-mean``; longer ones end in a hash.

    The last part of a key names it, of a long key the last two; the seed has a place of its own.
    """
    parts = [_part(text) for text in overrides if text.partition("=")[0].strip() != "seed"]
    whole = "_".join(parts)
    if len(whole) <= LONGEST_TAG:
        return whole
    digest = sha256("\n".join(overrides).encode()).hexdigest()[:_HASH]
    return f"{whole[: LONGEST_TAG - _HASH - 1].rstrip('_.-')}_{digest}"


def _part(text: str) -> str:
    key, _, value = text.partition("=")
    named = key.strip().split(".")
    shown = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "" for c in value.strip())
    if not shown:
        shown = "none" if value.strip() in ("", "[]", "{}") else sha256(value.encode()).hexdigest()[:_HASH]
    return f"{word_of('.'.join(named[-2:]) if len(named) > 2 else named[-1])}-{shown}"


def metadata(scenario: Scenario) -> dict[str, str]:
    """Return what is needed to fly the log again: the resolved scenario, the seed, the versions that flew it."""
    return {
        "scenario": scenario.model_dump_json(exclude_none=True),
        "aircraft": scenario.aircraft,
        "seed": str(scenario.seed),
        **versions(),
    }
