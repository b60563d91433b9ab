"""Pack frames into the message records of a chunk, without a call per message; chunk_layout.py has the byte offsets."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import RigError
from rig.core.frame import FLAT, FLIGHT_INDEX, Block, RowPart, RowParts, Table
from rig.core.kernels import kernel
from rig.log.chunk_layout import FRAMES, PARTS, POSES, Moves
from rig.log.records import DERIVED, TIMES, WIRE, place
from rig.log.schema import MESSAGES, POSE_EVERY

_1, _2, _3, _4, _5, _6, _7 = (np.uint64(i) for i in range(1, 8))


class Plan(NamedTuple):
    """Data common to all chunks of one number of frames."""

    blank: NDArray[np.uint8]  # their bytes but for what follows from the frames
    moves: dict[str, Moves]  # by source, into the records of frames
    begin: int  # of the poses
    posed: Moves
    parts: dict[RowPart, tuple[int, dict[str, Moves]]]  # behind the poses: where each part begins, and its moves


@lru_cache(maxsize=4)  # all chunks of a flight are of one length but the last
def plan(frames: int, parts: RowParts = ()) -> Plan:
    """Return the plan of chunks of ``frames`` frames, with these parts of the second row."""
    poses = len(range(0, frames, POSE_EVERY))
    records, posed = FRAMES.blank(frames), POSES.blank(poses)
    moves = {source: FRAMES.moves(source, frames) for source in ("frame", "timing", "times")}
    blank, of_parts = np.concatenate([records, posed]), {}
    for part in parts:
        sources = (part, "frame", "times")
        of_parts[part] = len(blank), {source: PARTS[part].moves(source, frames) for source in sources}
        blank = np.concatenate([blank, PARTS[part].blank(frames)])
    return Plan(blank, moves, len(records), POSES.moves("derived", poses), of_parts)


@kernel
def move(
    source: NDArray[np.uint8],
    target: NDArray[np.uint8],
    words: NDArray[np.uint64],
    octets: NDArray[np.uint64],
) -> None:
    """Copy bytes of every row of ``source`` (n, m) into ``target`` (n',).

    words, octets : (w, 3) offsets of runs of eight bytes and of single bytes: in ``source``, in ``target`` for the
    first row, from there to that of the next
    """
    for i in range(words.shape[0]):
        s, t, step = words[i]
        for k in range(source.shape[0]):
            # Unsigned offsets, and all loads before all stores: it compiles to one move of eight bytes.
            x0, x1, x2, x3 = source[k, s], source[k, s + _1], source[k, s + _2], source[k, s + _3]
            x4, x5, x6, x7 = source[k, s + _4], source[k, s + _5], source[k, s + _6], source[k, s + _7]
            target[t], target[t + _1], target[t + _2], target[t + _3] = x0, x1, x2, x3
            target[t + _4], target[t + _5], target[t + _6], target[t + _7] = x4, x5, x6, x7
            t += step
    for i in range(octets.shape[0]):
        s, t, step = octets[i]
        for k in range(source.shape[0]):
            target[t] = source[k, s]
            t += step


def _bytes(rows: NDArray[Any]) -> NDArray[np.uint8]:
    size = rows.dtype.itemsize * math.prod(rows.shape[1:])
    return np.ascontiguousarray(rows).reshape(-1).view(np.uint8).reshape(len(rows), size)


_SMALL: Final = sorted({f.source for fields in MESSAGES.values() for f in fields if f.kind not in WIRE})  # in one byte


def _sign_bits() -> NDArray[np.uint64]:
    """Return the words of a row of FLAT, with the bit set that must be zero in every field of one byte."""
    bits = np.zeros(FLAT.itemsize, np.uint8)
    for source in _SMALL:
        dtype, offset = place(FLAT, source)
        bits[offset : offset + dtype.itemsize] = 128
    return bits.view(np.uint64)


_PLACES: Final = np.flatnonzero(_sign_bits())
_MUST_BE_ZERO: Final = _sign_bits()[_PLACES]


@kernel
def any_set(words: NDArray[np.uint64], places: NDArray[np.int64], bits: NDArray[np.uint64]) -> bool:
    """Return True if a row of ``words`` (n, m) has one of ``bits`` (p,) set in its words at ``places`` (p,)."""
    bits_set = np.uint64(0)
    for k in range(words.shape[0]):
        for i in range(places.shape[0]):
            bits_set |= words[k, places[i]] & bits[i]
    return bits_set != 0


def _refuse_large(rows: Block) -> None:
    """Raise RigError when a flag, level or enum does not fit in its one byte."""
    words = np.ascontiguousarray(rows).view(np.uint64).reshape(len(rows), FLAT.itemsize // 8)
    if any_set(words, _PLACES, _MUST_BE_ZERO):
        named = ", ".join(name for name in _SMALL if (rows[name] > 127).any())
        raise RigError(f"frames {rows['frame'][0]} to {rows['frame'][-1]}: {named} above 127 cannot be logged")


def pack(table: Table, times: NDArray[np.uint64], out: NDArray[np.uint8], parts: RowParts = ()) -> None:
    """Fill ``out``, which was the plan's ``blank``, with the records of the frames; ``times`` in ns.

    parts : that the log has.  RigError when a one-byte field is above 127.
    """
    rows = table.rows
    _refuse_large(rows)
    made = plan(len(rows), parts)
    for name, source in (("frame", rows), ("timing", table.timing), ("times", times.view(TIMES))):
        move(_bytes(source), out, *made.moves[name])
    derived = np.empty(len(range(0, len(rows), POSE_EVERY)), DERIVED)
    with np.errstate(all="ignore"):  # for interpreted kernels: a flight that ends not finite is logged as it is
        derive(rows, times, derived)
    move(_bytes(derived), out[made.begin :], *made.posed)
    for part, (begin, moves) in made.parts.items():
        for name, source in ((part, table.part(part)), ("frame", rows), ("times", times.view(TIMES))):
            move(_bytes(source), out[begin:], *moves[name])


_EAST, _NORTH, _ALTITUDE = (FLIGHT_INDEX[name] for name in ("east_m", "north_m", "altitude_m"))
_LATITUDE, _LONGITUDE = FLIGHT_INDEX["latitude_rad"], FLIGHT_INDEX["longitude_rad"]
_W, _X, _Y, _Z = (FLIGHT_INDEX[f"quaternion_{axis}"] for axis in "wxyz")
_SECOND: Final = np.uint64(1_000_000_000)
_HALF_TURN: Final = math.sqrt(0.5)
_DEGREE: Final = 180.0 / math.pi


@kernel
def derive(rows: Block, times: NDArray[np.uint64], derived: NDArray[Any]) -> None:
    """Fill ``derived`` (n,) DERIVED of every POSE_EVERY-th row.

    Pose with z up, as 3-D viewers expect it: east-north-up, forward-left-up.

        q_enu_flu = q_enu_ned * q_ned_frd * q_frd_flu,  q_enu_ned = (0, 1, 1, 0)/sqrt 2,  q_frd_flu = (0, 1, 0, 0)

    up to its sign; q_ned_frd is the quaternion of FLIGHT.
    """
    for i in range(len(derived)):
        k = i * POSE_EVERY
        row, flight = derived[i], rows[k]["flight"]
        row["log_time"], row["sequence"] = times[k], rows[k]["frame"]
        varint(times[k] // _SECOND, row["seconds"])
        varint(times[k] % _SECOND, row["nanoseconds"])
        translation, rotation, position = row["translation"], row["rotation"], row["position"]
        translation[0], translation[1], translation[2] = flight[_EAST], flight[_NORTH], flight[_ALTITUDE]
        w, x, y, z = flight[_W], flight[_X], flight[_Y], flight[_Z]
        rotation[0], rotation[1] = (x + y) * _HALF_TURN, (x - y) * _HALF_TURN
        rotation[2], rotation[3] = (w - z) * _HALF_TURN, (w + z) * _HALF_TURN
        position[0], position[1] = flight[_LATITUDE] * _DEGREE, flight[_LONGITUDE] * _DEGREE
        position[2] = flight[_ALTITUDE]


@kernel
def varint(value: np.uint64, out: NDArray[np.uint8]) -> None:
    """Write a number below 2^35 as a varint padded to five bytes."""
    for i in range(5):
        out[i] = np.uint8(value & np.uint64(127)) | (np.uint8(128) if i < 4 else np.uint8(0))
        value >>= np.uint64(7)
