"""The row of a frame, and the block of frames that all stages share.

A block is one plain structured array, ``np.zeros(n, FRAME)``, of about one second of frames.
Each stage writes its own fields of row k in place; the log, the stream and the score read the
same rows.  What a stage computes *is* what is logged.

Order of writing in one frame (see loop.py):

    pilot      demand, truth of the sticks, discrete_truth[autopilot_engaged]
    plant      truth, discrete_truth, flight, end
    sensors    channels, valid, ilm, discrete_channels, discrete_valid, discrete_ilm, inertial
    faults     the same fields, corrupted; acting
    redundancy reference
    faults     reference, corrupted; acting
    redundancy voted, state, level, pattern, resolver, reference_usable, trend_*,
               discrete_voted, discrete_state, discrete_level
    control    source, law, command, surface, actuator, estimate, trust, lie
    faults     actuator, corrupted: the surface commands that reach the actuators; acting

SI units throughout; angles in rad, load factors in g (1), sticks normalised (-1 to 1).
"""

from __future__ import annotations

from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.frame.signals import (
    CHANNELS,
    COMMANDS,
    DEMANDS,
    ESTIMATES,
    FLIGHT,
    INERTIAL,
    SURFACES,
    D,
    S,
)

MOST_FAULTS: Final = 64  # of one scenario

Block = NDArray[Any]  # structured, dtype FRAME, shape (n,)
FRAME: Final = np.dtype(
    [
        ("frame", "i8"),
        ("truth", "f8", (S,)),
        ("flight", "f8", (len(FLIGHT),)),
        ("demand", "f8", (len(DEMANDS),)),
        ("channels", "f8", (S, CHANNELS)),
        ("inertial", "f8", (len(INERTIAL),)),
        ("voted", "f8", (S,)),
        ("reference", "f8", (S,)),  # NaN where there is none
        ("second_reference", "f8", (S,)),  # of other physics than ``reference``; NaN where there is none
        ("command", "f8", (len(COMMANDS),)),
        ("estimate", "f8", (len(ESTIMATES),)),  # zeros under another law than the fault-tolerant one
        ("surface", "f8", (len(SURFACES),)),
        ("actuator", "f8", (len(SURFACES),)),  # what reaches the actuators: surface, unless a fault is between
        ("trend_high", "u1", (S,)),
        ("trend_low", "u1", (S,)),
        ("valid", "u1", (S, CHANNELS)),  # 0: the sensor itself flags the sample
        ("ilm", "u1", (S, CHANNELS)),
        ("state", "u1", (S, CHANNELS)),
        ("level", "u1", (S,)),
        ("pattern", "u1", (S,)),
        ("resolver", "u1", (S,)),
        ("reference_usable", "u1", (S,)),
        ("common_mode", "u1", (S,)),  # 1: both references speak against all channels, which agree
        ("source", "u1", (S,)),
        ("discrete_truth", "u1", (D,)),
        ("discrete_channels", "u1", (D, CHANNELS)),
        ("discrete_valid", "u1", (D, CHANNELS)),
        ("discrete_ilm", "u1", (D, CHANNELS)),
        ("discrete_voted", "u1", (D,)),
        ("discrete_state", "u1", (D, CHANNELS)),
        ("discrete_level", "u1", (D,)),
        ("acting", "u1", (MOST_FAULTS // 8,)),  # bit i % 8 of byte i // 8: fault i of the scenario acted
        ("law", "u1"),
        ("trust", "u1"),
        ("lie", "u1"),
        ("end", "u1"),
    ],
    align=True,
)
# Measured by the wall clock, so kept apart from what must be the same in every run.
TIMING: Final = np.dtype([("frame_us", "f8"), ("late_us", "f8")])


def new_block(frames: int, first_frame: int = 0) -> Block:
    """An empty block of ``frames`` rows, numbered from ``first_frame``."""
    block = np.zeros(frames, FRAME)
    block["frame"] = np.arange(first_frame, first_frame + frames)
    return block


def to_frame(time_s: float, rate_hz: float) -> int:
    """The first frame at or after ``time_s``; a time on a frame is that frame, rounding apart."""
    return ceil(time_s * rate_hz - 1e-6)
