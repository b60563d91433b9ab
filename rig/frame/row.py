"""The row of a frame, and the block of frames that all stages share.

A block is one plain structured array of about one second of frames.  Each stage writes its own fields of row k in
place; the log, the stream and the score read the same rows.  What a stage computes *is* what is logged.

FRAME is nested by who writes a field: kernels are given the parts that they may read and write.  FLAT names the same
bytes field by field: ``rows["voted"]`` of a FLAT block is ``rows["fcc"]["voted"]`` of its view as FRAME.

Order of writing in one frame (see loop.py):

    pilot      bus: demand, resets; truth: sticks, discrete_truth[autopilot_engaged]
    plant      truth
    sensors    bus: channels, valid, ilm, the same of the discretes, inertial
    faults     bus, corrupted; actuation: acting
    references fcc: reference, second_reference; then corrupted by faults
    manager    fcc: voted, state, level, pattern, resolver, ...; the same of the discretes
    control    fcc: source, law, command, surface, estimate, trust, lie
    faults     actuation: actuator = surface, corrupted; acting

SI units throughout; angles in rad, load factors in g (1), sticks normalised (-1 to 1).
"""

from __future__ import annotations

from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.frame.fields import BASES, FIELD, FIELDS, PARTS, Part

Block = NDArray[Any]  # structured, dtype FLAT, shape (n,)
Nested = NDArray[Any]  # the same bytes, dtype FRAME


def _part(part: Part) -> np.dtype[Any]:
    """The fields of a part, the widest first: no padding but at its end."""
    fields = [(f.name, BASES[f.kind], f.shape) for f in FIELDS if f.part == part]
    return np.dtype(sorted(fields, key=lambda field: -np.dtype(field[1]).itemsize), align=True)


TRUTH, BUS, FCC, ACTUATION = map(_part, PARTS)
_DTYPES: Final = dict(zip(PARTS, (TRUTH, BUS, FCC, ACTUATION), strict=True))
FRAME: Final = np.dtype([("frame", "i8"), *_DTYPES.items()], align=True)


def offset(name: str) -> int:
    """Where a field begins in a row, in bytes."""
    part = FIELD[name].part
    return _offset(FRAME, part) + _offset(_DTYPES[part], name)


def _offset(dtype: np.dtype[Any], name: str) -> int:
    fields: Any = dtype.fields
    return fields[name][1]


_IN_MEMORY: Final = sorted(FIELDS, key=lambda field: offset(field.name))  # numpy and buffers want no other order
FLAT: Final = np.dtype(
    {
        "names": ["frame", *(field.name for field in _IN_MEMORY)],
        "formats": ["i8", *((BASES[field.kind], field.shape) for field in _IN_MEMORY)],
        "offsets": [0, *(offset(field.name) for field in _IN_MEMORY)],
        "itemsize": FRAME.itemsize,
    },
    align=True,
)
# Measured by the wall clock, so kept apart from what must be the same in every run.
TIMING: Final = np.dtype([("frame_us", "f8"), ("late_us", "f8"), ("reply_us", "f8")])


def new_block(frames: int, first_frame: int = 0) -> Block:
    """An empty block of ``frames`` rows, numbered from ``first_frame``."""
    block = np.zeros(frames, FLAT)
    block["frame"] = np.arange(first_frame, first_frame + frames)
    return block


def nested(block: Block) -> Nested:
    """The rows of ``block`` as FRAME: the same memory."""
    return block.view(FRAME)


def to_frame(time_s: float, rate_hz: float) -> int:
    """The first frame at or after ``time_s``; a time on a frame is that frame, rounding apart."""
    return ceil(time_s * rate_hz - 1e-6)
