"""JSON schemas of the files that users write, for editors (Even Better TOML, taplo): names, types, ranges, choices.

An aircraft gives what a scenario leaves out, so nothing is required there; the models check the rest when a file is
read.
"""

from __future__ import annotations

import json
from typing import Any, Final, Literal

_CHOSEN_BY: Final = "kind"  # entries of a list that are complete in themselves: faults, manoeuvres


def of_file(kind: Literal["scenario", "campaign", "unit"]) -> str:
    """Return the schema of a kind of file as JSON text."""
    make = {"scenario": _scenario, "campaign": _campaign, "unit": _unit}[kind]
    return json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **make()}, indent=1)


def _scenario() -> dict[str, Any]:
    from rig.scenario import Scenario

    found = Scenario.model_json_schema()
    for model in (found, *found["$defs"].values()):
        if _CHOSEN_BY not in model.get("properties", {}):
            model.pop("required", None)
    return found


def _campaign() -> dict[str, Any]:
    """As it is written: the base is a name; what varies may be a plain list, or nested tables for a dotted key."""
    from rig.campaign.config import Campaign

    found = Campaign.model_json_schema()
    found["properties"]["base"] = {"title": "Base", "type": "string"}
    for model in (found, *found["$defs"].values()):
        if "vary" in model.get("properties", {}):
            written = {"anyOf": [{"type": "array"}, {"type": "object"}]}
            model["properties"]["vary"] = {"title": "Vary", "type": "object", "additionalProperties": written}
    return found


def _unit() -> dict[str, Any]:
    from rig.unit.settings import Unit

    return Unit.model_json_schema()
