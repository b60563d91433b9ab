"""Names of faults, from their settings as plain data: of a scenario, or of a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

_CLOSED: Final = {"pitot": "dynamic_pressure"}  # any other closed line corrupts both pressures


def place(fault: Mapping[str, Any]) -> str:
    """Return the signal, surface, reference or quantity of a fault; for a fault of the environment, all its signals."""
    if "blocked" in fault:
        return _CLOSED.get(fault["blocked"], "static_pressure+dynamic_pressure")
    return "+".join(fault["vanes"]) if "vanes" in fault else fault["signal"]


def label(fault: Mapping[str, Any]) -> str:
    """Return a fault's name in events, tables and the viewer: its id, or without one its kind and place."""
    if fault.get("id"):
        return fault["id"]
    where = fault.get("blocked") or place(fault)
    channels = ",".join(map(str, fault["channels"]))
    return f"{fault['kind']} {where}.{channels}" if channels else f"{fault['kind']} {where}"
