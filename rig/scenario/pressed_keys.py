"""Effects of the keys in a flight: from its log, and as part of its scenario, which then needs no keys."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rig.computer.redundancy.resets import Reset
from rig.core.errors import BadInput
from rig.core.frame import DISCRETES, SIGNALS
from rig.scenario.scenario import Scenario


@dataclass
class Pressed:
    """Effects of the keys, by frame: the faults' first and last (excluded) frames, and resets of all channels."""

    faults: dict[str, list[int]] = field(default_factory=dict)  # by their labels
    resets: list[int] = field(default_factory=list)

    def to_json(self) -> str:
        """Return the effects as in the log's result."""
        return json.dumps({"faults": self.faults, "resets": self.resets})


def pressed(scenario: Scenario, result: Mapping[str, str] | None, source: str) -> Scenario:
    """Return the scenario with the effects of the keys; ``result`` of its log.  BadInput names ``source``."""
    if result is None or "keys" not in result:
        return scenario
    try:
        keys = json.loads(result["keys"])
        faults = [_moved(fault, keys["faults"].get(fault.label), scenario.rate_hz) for fault in scenario.faults]
        times, every = [frame / scenario.rate_hz for frame in keys["resets"]], (*SIGNALS, *DISCRETES)
        resets = [Reset(at_s=at_s, signal=signal.name) for at_s in times for signal in every]
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError):
        raise BadInput(f"{source}: the record of its keys is damaged") from None
    redundancy = scenario.redundancy.model_copy(update={"resets": [*scenario.redundancy.resets, *resets]})
    made = scenario.model_copy(update={"faults": faults, "redundancy": redundancy})
    return made.trusted(scenario.trust)


def _moved(fault: Any, moments: list[int] | None, rate_hz: float) -> Any:
    if not moments:
        return fault
    times = dict(zip(("start_s", "end_s"), (moment / rate_hz for moment in moments), strict=False))
    return fault.model_copy(update=times)
