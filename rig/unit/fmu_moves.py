"""Numbers between a record of the rig and variables of an FMU, by the mapping of a unit file (fmu_mapping.py)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.unit.host import Refused

TYPES: Final[dict[str, Any]] = {  # of an element, by the name of its Base
    "BYTE": ctypes.c_uint8,
    "SIGNED": ctypes.c_int64,
    "UNSIGNED": ctypes.c_uint64,
    "REAL": ctypes.c_double,
    "SHORT": ctypes.c_uint16,
    "WORD": ctypes.c_uint32,
}
NAMES: Final = {  # of the same in FMI 3.0
    **{"BYTE": "UInt8", "SIGNED": "Int64", "UNSIGNED": "UInt64"},
    **{"REAL": "Float64", "SHORT": "UInt16", "WORD": "UInt32"},
}
REAL: Final = ("Real", "Float64", "Float32")
Call = Callable[[], Any]
Views = dict[str, NDArray[Any]]  # a whole record as numbers of each base
_Move = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]  # of _moves


def views_of(address: int, size: int) -> Views:
    """Return the record of ``size`` bytes at an address."""
    return {
        base: np.ctypeslib.as_array((kind * (size // ctypes.sizeof(kind))).from_address(address))
        for base, kind in TYPES.items()
    }


def moving(run: dict[str, Any], views: Views, call: Call, held: Any, verb: str) -> Call:
    """Return a function that moves variables of one type between a record and ``held``, by ``call``.

    verb : Get, Set, or Set once, which refuses a number outside the type
    """
    values = np.ctypeslib.as_array(held)
    values[:] = run["start"]
    moves, is_flag = _moves(run, views), run["type"] == "Boolean"

    def put() -> None:
        for at, view, first, factor in moves:
            given = view[first]
            values[at] = given / factor if view.dtype == float else given != 0 if is_flag else given
        call()

    def get() -> None:
        call()
        for at, view, first, factor in moves:
            view[first] = values[at] * factor if view.dtype == float else _whole(values[at], view.dtype)

    def put_once() -> None:
        low, high = range_of(run["type"])
        for _, first, _, base, address in run["pairs"]:
            number = views[base][first // views[base].itemsize]
            if not low <= number <= high:
                raise Refused(f"{address} is {number}, must be from {low:g} to {high:g} for type {run['type']}")
        put()

    return {"Get": get, "Set": put, "Set once": put_once}[verb]


def _moves(run: dict[str, Any], views: Views) -> list[_Move]:
    """Return, base by base, the elements of the variables, the record's numbers, which of them, and their factors."""
    moves = []
    for base in {pair[3] for pair in run["pairs"]}:
        at, first, factor = (np.array([pair[i] for pair in run["pairs"] if pair[3] == base]) for i in range(3))
        moves.append((at, views[base], first // views[base].itemsize, factor))
    return moves


def _whole(said: Any, dtype: Any) -> Any:
    """Return the value of a variable as numbers of ``dtype``; the largest number, in no enum, if it has none."""
    most, numbers = np.iinfo(dtype).max, np.asarray(said, float)
    return np.where((numbers >= 0) & (numbers < most), np.rint(numbers), most)


def range_of(kind: str) -> tuple[float, float]:
    """Return the least and the largest number that a variable of a type can have."""
    if kind in REAL:
        return -inf, inf
    if kind == "Boolean":
        return 0, 1
    info = np.iinfo(np.int32 if kind in ("Integer", "Enumeration") else kind.lower())
    return int(info.min), int(info.max)
