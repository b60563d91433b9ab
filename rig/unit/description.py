"""The records of layout.py as tables in Markdown, for docs/unit-records.md: ``rig unit header --markdown``."""

from __future__ import annotations

from typing import Final

from rig.frame.fields import FIELD
from rig.unit.header import COMMENTS
from rig.unit.layout import ANSWERS, ENUMS, LAYOUT, RECORDS, VERSION, place

_BEYOND: Final = {
    "magic": "RIGI to the unit, RIGO from it",
    "version": "of the records' form",
    "kind": "what the message is, of Kind",
    "layout": "hash of all names, types, places and enums",
    "session": "drawn by the rig for each flight, echoed",
    "frame": "counts from 0, echoed: which frame is answered",
    "time_s": "frame / rate: the unit has no other clock",
    "stepped": "frames that the unit has stepped, from which lost requests are told; 0: it does not count",
    "said": "groups that are filled, of Said",
    "length": "bytes before this field",
    "crc": "CRC-32 of them, or 0",
    "reference": "of each signal, from the last votes; NaN where there is none",
    "second_reference": "of other physics; NaN where there is none",
    "law": "that flew the frame; EXTERNAL",
}


def markdown() -> str:
    """Tables of all records and enums."""
    parts = [f"Version {VERSION}, layout `{LAYOUT:016x}`.", ""]
    for name in RECORDS:
        parts += [*_record(name), ""]
    parts += ["| enum | values |", "|---|---|"]
    parts += [f"| {enum.__name__} | {', '.join(f'{one.name} {one.value}' for one in enum)} |" for enum in ENUMS]
    return "\n".join(parts) + "\n"


def _record(name: str) -> list[str]:
    dtype = RECORDS[name]
    rows = [f"`struct rig_{name}`, {dtype.itemsize} bytes: {COMMENTS[name]}.", "", "| at | field | type | what |"]
    rows.append("|---|---|---|---|")
    for field in dtype.names or ():
        of, at = place(dtype, field)
        base = next((f"rig_{known}" for known, known_type in RECORDS.items() if known_type == of.base), of.base.str[1:])
        extent = "".join(f"[{n}]" for n in of.shape)
        rows.append(f"| {at} | {field} | {base}{extent} | {_meaning(field)} |")
    return rows


def _meaning(field: str) -> str:
    if field in _BEYOND:
        return _BEYOND[field]
    group = f"group {ANSWERS[field].name}" if field in ANSWERS else ""
    known = FIELD.get(field)
    enum = f"of {known.enum.__name__}" if known is not None and known.enum is not None else ""
    return ", ".join(filter(None, (group, enum)))
