"""What was laid over a scenario's file when it was flown: told from a log, which has the file and what was flown."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from rig import aircraft
from rig.errors import BadInput
from rig.scenario import Scenario
from rig.settings import build, parse_toml

FILE: Final = "scenario.toml"  # the attachment


def overrides(text: str, resolved: dict[str, Any]) -> list[str] | None:
    """Return ``key=value`` of all that ``resolved``, which was flown, has otherwise than the file ``text``; no seed.

    None when that cannot be told: no file, or one that this version does not read.
    """
    try:
        data = parse_toml(text, FILE)
        tables = aircraft.tables(str(data.get("aircraft", "f16")))
        filed = build(Scenario, aircraft.lay_over(tables, data, FILE), FILE).resolved()
    except BadInput:
        return None
    before, flown = dict(_leaves(filed)), dict(_leaves(resolved))
    changed = [key for key in {**before, **flown} if before.get(key) != flown.get(key) and key != "seed"]
    return [f"{key}={flown[key]}" if key in flown else f"{key} not set" for key in changed]


def _leaves(node: dict[str, Any], within: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of nested tables; a list is one value unless it is of tables."""
    for key, value in node.items():
        name = f"{within}{key}"
        if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            value = {str(i): item for i, item in enumerate(value)}
        if isinstance(value, dict):
            yield from _leaves(value, f"{name}.")
        else:
            yield name, value
