"""The log of a flight: its name, and the metadata that are needed to fly it again."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Any, Final

from rig.core.errors import BadInput, RigError
from rig.core.files import new_folder, numbered, reported
from rig.core.versions import versions
from rig.log.writer import LogWriter
from rig.scenario.aircraft import names
from rig.scenario.overrides import parse_set
from rig.scenario.scenario import Scenario

LONGEST_TAG: Final = 40  # characters of the overrides in a log's name
NAME_BYTES: Final = 160  # of a log's name; behind them come seed, overrides, number and ending


def new_log(
    out: Path,
    name: str,
    scenario: Scenario,
    text: str,
    about: Mapping[str, str] | None = None,
    overrides: Sequence[str] = (),
    unit: str = "",
    known: Mapping[str, str] | None = None,
) -> LogWriter:
    """Open a log under a free name, <name>_seed<seed>[_<unit>][_<tag>][_n].mcap, in the folder ``out``, which is made.

    about : more metadata; overrides : of the file, ``key=value``, from which the tag is made; unit : that flies
    known : ``metadata`` of the scenario, which takes a tenth of a second, if it was made before
    """
    words = (word_of(named(name, scenario.aircraft)), f"seed{scenario.seed}", word_of(unit), tag(overrides))
    stem = "_".join(filter(None, words))
    with reported(out, BadInput, "logs cannot be kept there"), new_folder(out):
        for path in numbered(out, stem, ".mcap", beside=".rrd"):
            with suppress(FileExistsError):  # another flight was faster
                attached = [("scenario.toml", text.encode())]
                described = {**(known or metadata(scenario)), **(about or {})}
                return LogWriter(path, scenario.rate_hz, described, attached, new=True, parts=scenario.row_parts)
    raise RigError(f"{out}: no free name for a log")


def metadata_before(scenario: Scenario, out: Path) -> dict[str, str]:
    """Return the metadata of a log that is opened later in the folder ``out``.  BadInput: no text for a file."""
    with reported(out, BadInput, "logs cannot be kept there"):
        return metadata(scenario)


def named(name: str, aircraft: str) -> str:
    """Return the scenario's name; the name of an aircraft that is not bundled stands before it, if it lacks it."""
    own = Path(aircraft).name
    return name if own in names() or own in name else f"{own}_{name}"


def word_of(name: str) -> str:
    """Return ``name`` as part of a file's name, which has 255 bytes at most."""
    letters = "".join(c if c.isalnum() else "_" for c in name)
    return letters.encode()[:NAME_BYTES].decode(errors="ignore")


def tag(overrides: Sequence[str]) -> str:
    """Return overrides for a file's name: ``manager-mean``, in LONGEST_TAG characters, and how many more: ``and-3``.

    If not all fit, faults come first.  The last part of a key names it, of a long key the last two; the seed has a
    separate place.
    """
    entries = [(key, _part(key, value)[:LONGEST_TAG]) for key, value in map(parse_set, overrides) if key != "seed"]
    if len("_".join(part for _, part in entries)) > LONGEST_TAG:
        entries.sort(key=lambda override: override[0] != "faults")
    parts = [part for _, part in entries]
    lengths = accumulate(len(part) + 1 for part in parts)
    kept = [part for part, length in zip(parts, lengths, strict=True) if length <= LONGEST_TAG + 1]
    left = [f"and-{len(parts) - len(kept)}"] if len(kept) < len(parts) else []
    return "_".join((*kept, *left))


def _part(key: str, value: Any) -> str:
    keys = [word_of(part) for part in key.split(".") if not part.isdigit()]
    if keys == ["faults"] and value:
        return _value(value)
    return f"{'_'.join(keys[-2:] if len(keys) > 2 else keys[-1:])}-{_value(value)}"


def _value(value: Any) -> str:
    """Return a value as part of a file's name; of a fault its kind and where it sits."""
    if isinstance(value, list):
        return "-".join(map(_value, value)) or "none"
    if isinstance(value, dict):
        told = [value[key] for key in ("kind", "signal", "name") if key in value]
        return "-".join(map(_value, told or value)) or "none"
    if isinstance(value, bool | int | float):
        return f"{value}".lower().removesuffix(".0")
    return re.sub("_+", "_", word_of(str(value))).strip("_") or "none"


def metadata(scenario: Scenario) -> dict[str, str]:
    """Return what is needed to fly the log again: the resolved scenario, the seed, the versions that flew it."""
    return {
        "scenario": scenario.model_dump_json(exclude_none=True),
        "aircraft": scenario.aircraft,
        "seed": str(scenario.seed),
        **versions(),
    }
