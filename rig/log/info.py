"""What a log says of itself, and whether the file is whole."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from rig.errors import BadLog
from rig.log.decode import Damaged
from rig.log.overrides import FILE, overrides
from rig.log.recover import RECOVERED
from rig.log.scan import About, iter_parts
from rig.log.schema import EVENTS, FRAME_TOPICS


def info(path: Path | str) -> dict[str, Any]:
    """The log at ``path`` as plain data; ``damage`` is one line where it is cut or damaged, else None.

    BadLog when it is missing, foreign or of another schema version.
    """
    path, about = Path(path), About()
    frames, last, damage, events = 0, 0, None, Counter[str]()
    try:
        for part in iter_parts(path, about):
            frames += len(part.rows)
            last = int(part.rows["frame"][-1]) if len(part.rows) else last
            events.update(event.name for event in part.events)
    except Damaged as error:
        if not about.metadata:
            raise
        damage = error.what
    return {
        "log": str(path),
        "bytes": path.stat().st_size,
        **_flown(about, path),
        "frames": frames,
        "duration_s": frames / about.rate_hz,
        "last_frame": last if frames else None,
        "events": dict(events.most_common()),
        "topics": {topic.name: frames for topic in FRAME_TOPICS} | {EVENTS.name: events.total()},
        "result": about.result,
        "attachments": {name: len(data) for name, data in about.attachments.items()},
        "health": _health(about, damage),
        "damage": damage,
    }


def _flown(about: About, path: Path) -> dict[str, Any]:
    """What flew: scenario, seed, versions."""
    said = about.metadata
    try:
        scenario = json.loads(said.get("scenario") or "{}")
    except (ValueError, RecursionError):
        raise BadLog(f"{path}: the scenario in its metadata is damaged") from None
    versions = {key.removeprefix("version "): said[key] for key in said if key.startswith("version ")}
    return {
        "title": scenario.get("title", ""),
        "aircraft": said.get("aircraft", ""),
        "manager": scenario.get("redundancy", {}).get("manager"),
        "overrides": overrides(about.attachments.get(FILE, b"").decode(errors="replace"), scenario),
        "seed": scenario.get("seed"),
        "rate_hz": about.rate_hz,
        "planned_s": scenario.get("duration_s"),
        "faults": len(scenario.get("faults", ())),
        "schema_version": int(said["schema_version"]),
        "versions": versions,
        "commit": said.get("git commit"),
        "machine": said.get("machine"),
        "what_if": said.get("what if"),
        "what_if_of": said.get("what if of"),
    }


def _health(about: About, damage: str | None) -> str:
    if damage is not None:
        return f"{damage}; rig recover saves what is before"
    mended = about.others.get(RECOVERED)
    whole = "whole, every checksum matches"
    if mended is not None:
        return f"{whole}; recovered from a log that was {mended.get('damage', 'damaged')}"
    return whole if about.result is not None else f"{whole}; not ended by the loop"
