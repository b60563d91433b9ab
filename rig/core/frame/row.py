"""The row of a frame, and the block of frames that all stages share.

A block is one plain structured array of consecutive frames.  Each stage writes its own fields of row k in
place; the log, the stream and the score read the same rows.  The log holds exactly what a stage computes.

FRAME is nested by the writer of a field: kernels get the parts that they may read and write.  FLAT names the same
bytes field by field: ``rows["voted"]`` of a FLAT block is ``rows["fcc"]["voted"]`` of its view as FRAME.

Order of writing in one frame (see loop.py):

    pilot      bus: autopilot_command, resets; truth: sticks, discrete_truth[autopilot_engaged]
    plant      truth
    sensors    bus: channels, valid, ilm, the same of the discretes, inertial
    faults     bus, corrupted; actuation: acting
    references fcc: reference, second_reference; then corrupted by faults
    manager    fcc: voted, state, level, pattern, decided_by, ...; the same of the discretes
    control    fcc: source, law, command, surface, estimate, trust, sensor_fault
    faults     actuation: surface_command = surface, corrupted; acting

SI units throughout; angles in rad, load factors in g (1), sticks normalised (-1 to 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.decimals import SURE, slack_of_product
from rig.core.frame.fields import BASES, DISCRETE, FIELD, FIELDS, PARTS, SIGNAL, Field, Part
from rig.core.frame.signals import D, S

Block = NDArray[Any]  # structured, dtype FLAT, shape (n,)
Nested = NDArray[Any]  # the same bytes, dtype FRAME

# Signals and discretes of the row types that there are: a kernel is compiled once for each that it meets.
_CAPACITIES: Final = ((1, 1), (S, D), (64, 64))
_ROUNDING: Final = 1e-6  # of a frame


@dataclass(frozen=True, slots=True)
class Rows:
    """A row type for a number of signals and discretes; ``frame`` is nested by part, ``flat`` by field."""

    signals: int
    discretes: int
    frame: np.dtype[Any]
    flat: np.dtype[Any]

    def block(self, frames: int, first_frame: int = 0) -> Block:
        """Return an empty block of ``frames`` rows, numbered from ``first_frame``."""
        block = np.zeros(frames, self.flat)
        block["frame"] = np.arange(first_frame, first_frame + frames)
        return block

    def nested(self, block: Block) -> Nested:
        """Return the rows of ``block`` nested by part: the same memory."""
        return block.view(self.frame)


def rows(signals: int, discretes: int = 0) -> Rows:
    """Return the smallest row type with room for these numbers of signals and discretes.

    A flight has S and D.  Kernels process one signal at a time, so all types share them; loops over rows are compiled
    for each type.  So there are types for 1, 16 and 64 signals, and for multiples of 64.
    """
    for room in _CAPACITIES:
        if signals <= room[0] and discretes <= room[1]:
            return _row_type(*room)
    many = 64 * ceil(max(signals, discretes) / 64)
    return _row_type(many, many)


@cache
def _row_type(signals: int, discretes: int) -> Rows:
    parts = {part: _part(part, signals, discretes) for part in PARTS}
    frame = np.dtype([("frame", "i8"), *parts.items()], align=True)
    offsets = {field.name: _offset(frame, field.part) + _offset(parts[field.part], field.name) for field in FIELDS}
    in_memory = sorted(FIELDS, key=lambda field: offsets[field.name])  # numpy and buffers want no other order
    flat = np.dtype(
        {
            "names": ["frame", *(field.name for field in in_memory)],
            "formats": ["i8", *((BASES[field.kind], _shape(field, signals, discretes)) for field in in_memory)],
            "offsets": [0, *(offsets[field.name] for field in in_memory)],
            "itemsize": frame.itemsize,
        },
        align=True,
    )
    return Rows(signals, discretes, frame, flat)


def _part(part: Part, signals: int, discretes: int) -> np.dtype[Any]:
    """Return the fields of a part, the widest first: no padding but at its end."""
    fields = [(f.name, BASES[f.kind], _shape(f, signals, discretes)) for f in FIELDS if f.part == part]
    return np.dtype(sorted(fields, key=lambda field: -np.dtype(field[1]).itemsize), align=True)


def _shape(field: Field, signals: int, discretes: int) -> tuple[int, ...]:
    """Return the shape of a field in a row with these numbers of signals and discretes."""
    many = {SIGNAL: signals, DISCRETE: discretes}.get(field.message)
    return field.shape if many is None else (many, *field.shape[1:])


def _offset(dtype: np.dtype[Any], name: str) -> int:
    fields: Any = dtype.fields
    return fields[name][1]


_FLIGHT: Final = rows(S, D)
FRAME: Final = _FLIGHT.frame
FLAT: Final = _FLIGHT.flat
TRUTH, BUS, FCC, ACTUATION = (FRAME[part] for part in PARTS)


def offset(name: str) -> int:
    """Return where a field begins in a row of a flight, in bytes."""
    part = FIELD[name].part
    return _offset(FRAME, part) + _offset(FRAME[part], name)


# Measured by the wall clock, so kept apart from what must be the same in every run.
TIMING: Final = np.dtype([("frame_us", "f8"), ("late_us", "f8"), ("reply_us", "f8")])


def new_block(frames: int, first_frame: int = 0) -> Block:
    """Return an empty block of ``frames`` rows of a flight, numbered from ``first_frame``."""
    return _FLIGHT.block(frames, first_frame)


def copied(block: Block) -> Block:
    """Return a copy of neighbouring rows, byte by byte: numpy's copies each field, 13 us a row instead of 3."""
    return block.view(np.uint8).copy().view(block.dtype)


def nested(block: Block) -> Nested:
    """Return the rows of a flight's ``block`` as FRAME: the same memory."""
    return block.view(FRAME)


def to_frame(time_s: float, rate_hz: float) -> int:
    """Return the first frame at or after ``time_s``; a time on a frame is that frame, rounding apart.

    At 60 Hz 0.0166667 s is frame 1.
    """
    return ceil(time_s * rate_hz - max(_ROUNDING, slack_of_product(time_s, rate_hz)))


def to_frames(times_s: NDArray[np.float64], rate_hz: float) -> NDArray[np.int64]:
    """Return ``to_frame`` of many times, (n,); their decimals are looked at only where they can count."""
    exact = times_s * rate_hz
    frames = np.ceil(exact - _ROUNDING).astype(np.int64)
    for i in np.flatnonzero(np.ceil(exact - SURE) < frames).tolist():  # no slack of a product is more than SURE
        frames[i] = to_frame(float(times_s[i]), rate_hz)
    return frames
