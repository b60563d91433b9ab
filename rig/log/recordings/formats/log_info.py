"""The answer of ``rig info`` on a log of another system."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rig.core.files import is_folder
from rig.log.recordings.formats.contents import LogContents, Topic
from rig.log.recordings.formats.presets import PRESETS, comparable


def log_info(path: Path, contents: LogContents) -> dict[str, Any]:
    """Return the contents of the log at ``path`` as plain data: what can be compared, all topics, damage."""
    files = [file for file in path.iterdir() if file.is_file()] if is_folder(path) else [path]
    measured = {
        topic.name: names for topic in contents.topics if (names := _quantities(topic, contents)) or not contents.preset
    }
    spans = [topic for topic in contents.topics if topic.name in measured] or contents.topics
    return {
        "log": str(path),
        "bytes": sum(file.stat().st_size for file in files),
        "format": contents.format,
        "preset": contents.preset or None,
        "time_s": [min(topic.first_s for topic in spans), max(topic.last_s for topic in spans)],  # of the sensors
        "compared": [
            {
                "quantity": found.quantity.name,
                "signals": list(found.signals),
                "topics": [topic.name for topic in found.topics],
                "others": [topic.name for topic in found.others],
                "fields": list(found.fields.names),
                "unit": found.topics[0].units[found.fields.names[0]],
                "rate_hz": min(topic.rate_hz for topic in found.topics),
            }
            for found in comparable(contents)
        ],
        "topics": [_plain(topic, measured.get(topic.name)) for topic in contents.topics],
        "remarks": list(contents.remarks),
        "damage": "; ".join(contents.damage) or None,
    }


def _quantities(topic: Topic, contents: LogContents) -> dict[str, str]:
    """Return the quantities of the preset that a topic measures, with their units."""
    return {
        quantity.name: topic.units[fields.names[0]]
        for quantity in PRESETS.get(contents.preset, ())
        for fields in quantity.candidates
        if fields.message in ("", topic.message) and topic.holds(fields.names)
    }


def _plain(topic: Topic, measures: dict[str, str] | None) -> dict[str, Any]:
    """Return a topic; ``sensor``: it is shown without being asked for."""
    return {
        "topic": topic.name,
        "message": topic.message,
        "instance": topic.instance or None,
        "device": topic.device or None,
        "measures": measures or {},
        "sensor": measures is not None,
        "rows": topic.rows,
        "rate_hz": topic.rate_hz,
        "first_s": topic.first_s,
        "last_s": topic.last_s,
        "units": topic.units,
        "unusable": topic.unusable or None,
    }
