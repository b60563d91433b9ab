"""The records of layout.py as Ada record clauses: ``rig unit header --ada``."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rig.unit.header import COMMENTS
from rig.unit.layout import ENUMS, FROM_UNIT, LAYOUT, RECORDS, TO_UNIT, VERSION, place

_ADA: Final = {
    "<f8": "IEEE_Float_64",
    "<i8": "Integer_64",
    "<u8": "Unsigned_64",
    "<u4": "Unsigned_32",
    "<u2": "Unsigned_16",
    "|u1": "Unsigned_8",
}


def specification() -> str:
    """The text of ``rig_unit.ads``."""
    parts = [
        "--  The records between the rig and a unit under test, written by 'rig unit header --ada': do not edit.",
        "--  Little-endian; docs/unit.md explains them.",
        "with Interfaces; use Interfaces;",
        "with System;",
        "",
        "package Rig_Unit is",
        f"   Version      : constant := {VERSION};",
        f"   Layout       : constant Unsigned_64 := 16#{LAYOUT:016X}#;",
        f"   Magic_Input  : constant Unsigned_32 := 16#{TO_UNIT:08X}#;",
        f"   Magic_Output : constant Unsigned_32 := 16#{FROM_UNIT:08X}#;",
        "",
        *(line for enum in ENUMS for line in _constants(enum)),
        *_array_types(),
        *(line for name in RECORDS for line in _record(name)),
        "end Rig_Unit;",
    ]
    return "\n".join(parts) + "\n"


def _constants(enum: Any) -> list[str]:
    """Numbers rather than an Ada enumeration: a byte that is none of them must not raise an exception."""
    name = enum.__name__
    return [*(f"   {name}_{one.name.capitalize()} : constant Unsigned_8 := {one.value};" for one in enum), ""]


def _shapes() -> list[tuple[str, tuple[int, ...]]]:
    """Every kind of array in the records: its element and its extents."""
    found = [
        _element(place(dtype, field)[0])
        for dtype in RECORDS.values()
        for field in dtype.names or ()
        if _element(place(dtype, field)[0])[1]
    ]
    return sorted(set(found))


def _array_types() -> list[str]:
    lines = []
    for element, shape in _shapes():
        if element.startswith("Rig_"):
            continue  # declared behind its element
        lines.append(_array(element, shape))
    return [*lines, ""]


def _array(element: str, shape: tuple[int, ...]) -> str:
    spans = ", ".join(f"0 .. {n - 1}" for n in shape)
    return f"   type {_type(element, shape)} is array ({spans}) of {element} with Pack;"


def _record(name: str) -> list[str]:
    dtype, title = RECORDS[name], _title(name)
    fields = [(field, *place(dtype, field)) for field in dtype.names or ()]
    own = [f"      {_name(field)} : {_type(*_element(of))};" for field, of, _ in fields]
    at = [f"      {_name(field)} at {first} range 0 .. {of.itemsize * 8 - 1};" for field, of, first in fields]
    arrays = [_array(element, shape) for element, shape in _shapes() if element == title]
    return [
        f"   --  {COMMENTS[name]}",
        f"   type {title} is record",
        *own,
        "   end record;",
        f"   for {title}'Bit_Order use System.Low_Order_First;",
        f"   for {title} use record",
        *at,
        "   end record;",
        f"   for {title}'Size use {dtype.itemsize * 8};",
        *arrays,
        "",
    ]


def _element(dtype: np.dtype[Any]) -> tuple[str, tuple[int, ...]]:
    base, shape = dtype.base, dtype.shape
    if base.kind == "S":
        return "Character", (base.itemsize,)
    record = next((_title(known) for known, of in RECORDS.items() if of == base), None)
    return record or _ADA[base.str], shape


def _type(element: str, shape: tuple[int, ...]) -> str:
    return "_".join([element, *map(str, shape)])


def _title(name: str) -> str:
    return "_".join(["Rig", *(part.capitalize() for part in name.split("_"))])


def _name(field: str) -> str:
    """A field as Ada writes names."""
    return "_".join(part.capitalize() for part in field.split("_"))
