"""Metadata of a log, whether the file is whole, and the overrides of the flight."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.renamed import data_now
from rig.core.settings import build, parse_toml
from rig.log.reader import scenario_of, unit_of
from rig.log.scan import RECOVERED, Contents, contents
from rig.log.schema import topics
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario, from_resolved
from rig.scenario.scenario_notes import notes

FILE: Final = "scenario.toml"  # the attachment


def info(path: Path | str) -> dict[str, Any]:
    """Return the log at ``path`` as plain data; ``damage``: None, or a line on where the file is cut.

    BadLog when it is missing, foreign or of another schema version.
    """
    path = Path(path)
    log = contents(path)
    if log.damaged is not None and not log.metadata:
        raise log.damaged
    return {
        "log": str(path),
        "bytes": path.stat().st_size,
        **_flown(log, path),
        "frames": log.frames,
        "duration_s": log.frames / log.rate_hz,
        "last_frame": log.last_frame if log.frames else None,
        "events": dict(log.events.most_common()),
        "topics": {topic.name: log.messages[topic.name] for topic in topics(log.parts)},
        "result": log.result,
        "attachments": {name: len(data) for name, data in log.attachments.items()},
        "health": _health(log),
        "damage": log.damage or None,
    }


def _flown(log: Contents, path: Path) -> dict[str, Any]:
    """Return what flew: scenario, seed, versions."""
    metadata, scenario = log.metadata, scenario_of(log.metadata, path)
    versions = {key.removeprefix("version "): text for key, text in metadata.items() if key.startswith("version ")}
    return {
        "title": scenario.get("title", ""),
        "aircraft": metadata.get("aircraft", ""),
        "manager": scenario.get("redundancy", {}).get("manager"),
        "unit": unit_of(metadata).get("name"),
        "lane": unit_of(metadata).get("lane"),
        "unit_files": unit_of(metadata).get("read_sha256"),
        "unit_environment": unit_of(metadata).get("environment"),
        "role": unit_of(metadata).get("role"),
        "voter": unit_of(metadata).get("voter"),
        "overrides": overrides(log.attachments.get(FILE, b"").decode(errors="replace"), scenario),
        "seed": scenario.get("seed"),
        "rate_hz": log.rate_hz,
        "planned_s": scenario.get("duration_s"),
        "faults": len(scenario.get("faults", ())),
        "notes": _notes(scenario),
        "schema_version": int(metadata["schema_version"]),
        "versions": versions,
        "commit": metadata.get("git commit"),
        "machine": metadata.get("machine"),
        "what_if": metadata.get("what if"),
        "what_if_of": metadata.get("what if of"),
    }


def _notes(scenario: dict[str, Any]) -> list[str]:
    """Return notes on unlikely settings of the scenario; none of a scenario that this version does not read."""
    try:
        return notes(from_resolved(scenario, FILE))
    except BadInput:
        return []


def _health(log: Contents) -> str:
    if log.damage:
        return f"{log.damage}; rig recover saves the frames before it"
    mended = log.others.get(RECOVERED)
    whole = "whole, every checksum matches"
    if log.again:
        whole = f"another program wrote its records again; {whole}"
    if log.unchecked:
        whole = "another program wrote its records again, without a checksum of all; whole as far as can be told"
    if mended is not None:
        return f"{whole}; recovered from a log that was {mended.get('damage', 'damaged')}"
    return whole if log.result is not None else f"{whole}; the flight has no regular end"


def overrides(text: str, resolved: dict[str, Any]) -> list[str] | None:
    """Return ``key=value`` of all that ``resolved``, which was flown, has otherwise than the file ``text``; no seed.

    None when that cannot be told: no file, or one that this version does not read.
    """
    try:
        data = data_now(parse_toml(text, FILE))
        tables = aircraft.tables(str(data.get("aircraft", "f16")))
        filed = build(Scenario, aircraft.lay_over(tables, data, FILE), FILE).resolved()
    except BadInput:
        return None
    before, flown = dict(leaves(filed)), dict(leaves(resolved))
    changed = [key for key in {**before, **flown} if before.get(key) != flown.get(key) and key != "seed"]
    return [f"{key}={flown[key]}" if key in flown else f"{key} not set" for key in changed]


def leaves(node: dict[str, Any], within: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and values of nested tables; a list is one value unless it is of tables."""
    for key, value in node.items():
        name = f"{within}{key}"
        if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            value = {str(i): item for i, item in enumerate(value)}
        if isinstance(value, dict):
            yield from leaves(value, f"{name}.")
        else:
            yield name, value
