"""Faults and varied numbers of a scenario in words, with units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from rig.core.frame import INDEX, SIGNALS
from rig.core.units.quantities import number, unit_of_name, unit_shown
from rig.world.faults import KINDS

Table = Mapping[str, Any]
_FAULT: Final = re.compile(r"faults\.(\d+)\.(\w+)")


def fault_places(table: Table) -> list[str]:
    """Return the faults of a scenario without their numbers: ``drift: pitch_rate, channel 1``."""
    return [f"{_kind(fault)}{_place(fault)}" for fault in table.get("faults", [])]


def fault_sentences(table: Table) -> list[str]:
    """Return the faults of a scenario: kind, size, place and onset."""
    lines = []
    for i, fault in enumerate(table.get("faults", [])):
        sizes = [name for name in KINDS[fault["kind"]].sizes if name in fault]
        size = f" of {shown(f'faults.{i}.{sizes[0]}', fault[sizes[0]], table)}" if sizes else ""
        onset = f" from {fault['start_s']:.3g} s on" if "start_s" in fault else ""
        lines.append(f"{_kind(fault)}{size}{_place(fault)}{onset}")
    return lines


def _kind(fault: Table) -> str:
    return str(fault["kind"]).replace("_", " ")


def _place(fault: Table) -> str:
    channels = fault.get("channels") or []
    which = f"{'s' if len(channels) > 1 else ''} {', '.join(map(str, channels))}"
    place = ", ".join(filter(None, [fault.get("signal"), f"channel{which}" if channels else ""]))
    return f": {place}" if place else ""


def shown(key: str, value: object, table: Table) -> str:
    """Return the value of a varied key with three digits and its unit; angles are in degrees.

    table : the scenario that has the key
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    unit, of_fault = unit_of_name(key) or ("s" if key.endswith("_s") else ""), _FAULT.fullmatch(key)
    if of_fault is not None:
        fault = table["faults"][int(of_fault[1])]
        field = KINDS[fault["kind"]].model_fields.get(of_fault[2])
        declared = field.json_schema_extra if field is not None else None
        unit = str(declared.get("unit", unit)) if isinstance(declared, dict) else unit
        if unit.startswith("signal") and fault.get("signal") in INDEX:
            of_signal = SIGNALS[INDEX[fault["signal"]]].unit
            shown_in = unit.replace("signal", unit_shown(of_signal), 1).replace("/s/s", "/s²")
            return f"{number(value, of_signal)} {shown_in}".rstrip()
    return f"{number(value, unit)} {unit_shown(unit)}".rstrip()
