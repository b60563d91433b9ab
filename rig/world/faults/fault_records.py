"""The faults of a flight as records: parameters and state of the kernels."""

from __future__ import annotations

from enum import IntEnum
from math import prod
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, FCC, INERTIAL, D, S


class Trigger(IntEnum):
    """Trigger of a fault."""

    TIME = 0
    CONDITION = 1
    TRANSITION = 2
    AFTER = 3
    RANDOM = 4


FOREVER: Final = int(np.iinfo(np.int64).max)

PARAM: Final = np.dtype(
    [
        ("dt_s", "f8"),
        ("samples", "i8"),  # the targets up to here are channels of signals and the inertial unit,
        ("discretes", "i8"),  # from there up to here channels of discretes,
        ("references", "i8"),  # from there up to here references,
        ("surfaces", "i8"),  # from there up to here surfaces,
        ("parts", "i8"),  # from there up to here parts of servo actuators,
        ("links", "i8"),  # from there up to here links between lanes,
        ("computers", "i8"),  # from there up to here computers
        ("watches", "u1"),  # whether a trigger needs the last frame's votes
    ],
    align=True,
)
# One record a fault, in the order of the scenario.  Times are in frames; excluded ends.
SCHEDULE: Final = np.dtype(
    [
        ("turn", "i8"),  # the fault whose trigger is looked at in this place: one that others come after goes first
        ("trigger", "u1"),
        ("flag", "u1"),  # effects.Flag
        ("duty_cycle", "u1"),  # trigger.DutyCycle
        ("again", "u1"),  # triggers again when it is over
        ("first", "i8"),  # the trigger is armed
        ("last", "i8"),
        ("delay", "i8"),  # from the trigger to the onset
        ("duration", "i8"),
        ("period", "i8"),  # of repetition; 0: none
        ("repeats", "i8"),
        ("begin", "i8"),  # steps of the condition, from here
        ("end", "i8"),
        ("hold", "i8"),  # that the condition must last
        ("needs_votes", "u1"),  # it reads what is voted
        ("place", "i8"),  # of what must change, as ``code`` gives it; the fault that this comes after
        ("value", "i8"),  # that a transition leads to
        ("chance", "f8"),  # of a random trigger, in a frame
        ("on", "i8"),  # length of a pulse
        ("cycle", "i8"),  # of regular pulses
        ("enter", "f8"),  # chance that a random pulse begins,
        ("leave", "f8"),  # or ends, in a frame
        ("times", "i8"),  # given pulses, from here in ``times``
        ("times_end", "i8"),
        ("draw", "i8"),  # column of the uniform draws for the trigger
        ("pulse_draw", "i8"),  # and for the pulses
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("onset", "i8"),  # FOREVER until the trigger has fired
        ("held", "i8"),  # frames in a row that the condition held
        ("elapsed", "i8"),  # frames since the present episode began
        ("left", "i8"),  # frames left of a random pulse; 1 within a gap of a telegraph
        ("acts", "u1"),
        ("fresh", "u1"),  # it did not act in the last frame
    ],
    align=True,
)
# One record a value that a fault acts on, in the order of the scenario within each of the sorts.
TARGET: Final = np.dtype(
    [
        ("fault", "i8"),
        ("act", "u1"),  # effects.Act
        ("remembers", "u1"),  # it needs the value while the fault does not act
        ("invalid", "u1"),
        ("wraps", "u1"),
        ("part", "u1"),  # parts.Part, LinkPart or ComputerPart
        ("uncommanded", "u1"),
        ("seen_by_wire", "u1"),
        ("seen_by_test", "u1"),  # LaneTest that sees it
        ("row", "i8"),  # index of the signal, discrete or actuator, sender of a link, lane; -1: the inertial unit
        ("column", "i8"),  # channel; index of the quantity, the reference, the surface; receiver of a link
        ("source", "i8"),  # cross-talk: index of the signal, quantity or reference; ice: the dynamic pressure
        ("low", "f8"),
        ("high", "f8"),
        ("source_low", "f8"),
        ("source_high", "f8"),
        ("value", "f8"),
        ("time_constant_s", "f8"),
        ("frequency_hz", "f8"),
        ("static_rate_pa_s", "f8"),
        ("ramp", "f8"),  # frames
        ("memory", "i8"),  # its ring begins here
        ("length", "i8"),
        ("draw", "i8"),  # column of the normal draws
        ("tolerance", "f8"),  # of the in-line monitor that measures it,
        ("frames", "i8"),  # and frames in a row beyond it until it says bad; 0: none measures
    ],
    align=True,
)
KEPT: Final = np.dtype(
    [
        ("last", "f8"),  # the value of the last frame, before this fault
        ("held", "f8"),  # what it is stuck at, moves about, or stood at last
        ("total", "f8"),  # trapped total pressure
        ("last_total", "f8"),
        ("beyond", "i8"),  # frames in a row that it has been beyond the monitor's tolerance
        ("started", "u1"),
    ],
    align=True,
)
# The fields of FCC whose changes trigger faults, in the order of their numbers in SEEN.
WATCHED: Final = (
    *("level", "pattern", "decided_by", "source", "state"),
    *("discrete_voted", "discrete_level", "discrete_state"),
)
_SIZES: Final = [prod(FCC[field].shape) for field in WATCHED]


def code(field: str, *index: int) -> int:
    """Return the place in SEEN of an element of a watched field."""
    first = sum(_SIZES[: WATCHED.index(field)])
    return first + int(np.ravel_multi_index(index, FCC[field].shape))


# What triggers see of the last frame, and of its decisions in the frame before.
SEEN: Final = np.dtype(
    [
        ("voted", "f8", (S,)),
        ("discrete", "u1", (D,)),
        ("code", "u1", (sum(_SIZES),)),
        ("code_before", "u1", (sum(_SIZES),)),
        ("frames", "i8"),
    ],
    align=True,
)


# Samples of the sensors before any fault, as the fields of BUS; kept for who scores a flight in memory.
def clean_of(signals: int) -> np.dtype[Any]:
    """Return the record of the samples of ``signals`` signals, and of the inertial unit, before any fault."""
    channels = ("channels", "f8", (signals, CHANNELS)), ("valid", "u1", (signals, CHANNELS))
    return np.dtype([*channels, ("inertial", "f8", (len(INERTIAL),))], align=True)


CLEAN: Final = clean_of(S)


class FaultData(NamedTuple):
    """Data of the faults besides the row; the draws and ``clean`` are those of a block of n rows."""

    param: NDArray[Any]  # (1,) PARAM
    schedule: NDArray[Any]  # (F,) SCHEDULE
    state: NDArray[Any]  # (F,) STATE, in place
    targets: NDArray[Any]  # (T,) TARGET
    kept: NDArray[Any]  # (T,) KEPT, in place
    program: NDArray[Any]  # steps of all conditions (expression.STEP)
    stack: NDArray[np.float64]  # workspace of the conditions
    times: NDArray[np.int64]  # frames of given pulses
    memory: NDArray[np.float64]  # rings of past values, in place
    seen: NDArray[Any]  # (1,) SEEN, in place
    uniform: NDArray[np.float64]  # (n, U) draws of triggers and pulses
    normal: NDArray[np.float64]  # (n, N) draws of noise
    clean: NDArray[Any]  # (n,) CLEAN, or no rows: not kept
