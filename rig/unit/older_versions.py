"""Configuration of a unit that was built for an older version of the records, and its limits.

The rig refuses the flight if a setting is on that has no field in that version.  It flies without settings that the
scenario did not choose: values that all aircraft share (slow-fault tests, stale samples, boxes by sets, giving up a
split), and consequences of the configured references (the use of the trend beside them, which of them count as two).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.box import box_of_signals
from rig.computer.redundancy.manager_config import Config
from rig.core.frame import SIGNALS, S
from rig.core.settings import in_frames
from rig.scenario.aircraft import default_boxes, default_factors, default_stale_frames
from rig.unit.ready_message import REBUILD, UnitStopped
from rig.unit.unit_records import INTERFACE, MORE_THAN_HALF, SINCE, Interface, Role

_NAMES: Final = [signal.name for signal in SIGNALS]
Unasked = Mapping[str, NDArray[Any]]  # by field: (S,) values that were not asked for


class _Switch(NamedTuple):
    """A field of CONFIG that is on above ``off``, and the scenario's key for it."""

    part: str
    field: str
    key: str = ""  # of the signal; that of ``field`` when empty
    of_all: str = ""  # a key of [redundancy] instead
    off: int = 0


_SWITCHES: Final = (
    *(_Switch("slow_faults", field) for field in ("slow_limit", "stale_frames")),
    *(_Switch("rules", field) for field in ("count_down", "trend_beside_reference")),
    _Switch("rules", "trend_small", off=-1),
    _Switch("rules", "trend_tumbles", "trend_window"),
    _Switch("rules", "unresolved_frames", of_all="unresolved_s"),
    _Switch("rules", "referred", of_all="references"),
    _Switch("rules", "sources", of_all="references"),
    _Switch("slow_tests", "slow_means", "slow_tests"),
)


def config_for(interface: Interface, config: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the bytes of CONFIG (1,) in the format of a version of the records.

    UnitStopped: the scenario chose a setting for which the version has no field
    """
    config["version"], config["layout"] = interface.version, interface.layout
    if interface == INTERFACE:
        return config.view(np.uint8)
    if config["role"][0] == Role.CONTROL_LAW and SINCE["law_input"] > interface.version:
        raise UnitStopped(
            f"was built for version {interface.version} of the records, which has no role control-law: {REBUILD}"
        )
    if key := asked_since(interface, config, unasked(config)):
        raise UnitStopped(f"was built for version {interface.version} of the records, which has no {key}: {REBUILD}")
    told = config.copy()
    if SINCE["rules"] > interface.version:  # all signals are one box there: 0, never, where they are in several
        if not _is_one(config[0]["rules"]["box"]):
            told["box_signals"] = 0
        elif told["box_signals"][0] == MORE_THAN_HALF:
            told["box_signals"] = S // 2 + 1
    whole = told.view(np.uint8)[: interface.config_bytes].copy()
    whole[-8:] = np.frombuffer((interface.config_bytes - 8).to_bytes(8, "little"), np.uint8)  # length, no checksum
    return whole


def asked_since(interface: Interface, config: NDArray[Any], without: Unasked = MappingProxyType({})) -> str:
    """Return the key of the first setting of CONFIG (1,) that is on and not in a version; empty for none.

    without : settings that a flight may lack; a conformance test needs them too, and passes none
    """
    for part, field, key, of_all, off in _SWITCHES:
        value = config[0][part][field]
        on = np.flatnonzero((value > off) & (value != without.get(field, off)))
        if SINCE[part] > interface.version and len(on):
            return f"redundancy.{of_all}" if of_all else f"redundancy.signals.{_NAMES[on[0]]}.{key or field}"
    return "redundancy.boxes" if SINCE["rules"] > interface.version and _asks_for_sets(config, without) else ""


def unasked(config: NDArray[Any]) -> Unasked:
    """Return the settings of CONFIG (1,) that its scenario did not choose."""
    stale, factors, rules = default_stale_frames(), default_factors(), config[0]["rules"]
    unresolved_s = Config.model_fields["unresolved_s"].default
    return {
        "stale_frames": np.array([stale.get(name, 0) for name in _NAMES]),
        "slow_means": np.array([factors.get(name, 0.0) for name in _NAMES]),
        "unresolved_frames": np.full(S, in_frames(0, unresolved_s, float(config["rate_hz"][0]))),
        "referred": rules["referred"],
        "sources": rules["sources"],
        "box": np.array(box_of_signals(default_boxes(), _NAMES)),
    }


def _asks_for_sets(config: NDArray[Any], without: Unasked) -> bool:
    """Return True if CONFIG isolates channels by sets of boxes; an older unit has only one box."""
    box, signals = config[0]["rules"]["box"], int(config["box_signals"][0])
    if signals == 0 or _is_one(box):
        return False
    shared = without.get("box", np.ones(S, np.int64))
    return signals != MORE_THAN_HALF or not np.array_equal(box, shared)


def _is_one(box: NDArray[np.int64]) -> bool:
    return bool((box == box[0]).all()) and box[0] > 0
