"""Effects of faults on a value: the acts, the Effect that a kind declares, and the kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np

from rig.core.frame import Ilm
from rig.core.kernels import kernel
from rig.core.units.angles import difference, limit
from rig.core.units.constants import TWO_PI


class Act(IntEnum):
    """Operation of a kernel on a value."""

    VALID_ONLY = 0  # nothing to the value; its validity or its in-line monitor are another matter
    ADD = 1
    DRIFT = 2
    SETTLE = 3
    SET = 4
    HOLD = 5
    SCALE = 6
    NOISE = 7
    OSCILLATE = 8
    SWING = 9
    DELAY = 10
    QUANTISE = 11
    CROSS_TALK = 12
    REPEAT = 13
    NO_NUMBER = 14
    LIMIT_RATE = 15
    PITOT_STATIC_ICE = 16
    RANGE_END = 17  # an end of the range, which the schedule makes SET or, for an angle on the circle, ADD_ANGLE
    INVERT = 18  # of a discrete
    ADD_ANGLE = 19  # half a turn
    GAUSS_MARKOV = 20


# What needs the value while the fault does not act.
REMEMBERING: Final = (Act.HOLD, Act.SWING, Act.DELAY, Act.REPEAT, Act.LIMIT_RATE, Act.PITOT_STATIC_ICE)
# What needs a normal draw in each frame.
RANDOM: Final = (Act.NOISE, Act.GAUSS_MARKOV)
# What an electrical fault of one coil does to a position: an open or shorted turn, a drifting joint, a coupled wire.
# A jam, a swapped pair, a wrong excitation and all that is digital leave the sum of the coils as it is.
OF_A_COIL: Final = (
    *(Act.ADD, Act.DRIFT, Act.SETTLE, Act.RANGE_END, *RANDOM, Act.OSCILLATE, Act.SWING, Act.CROSS_TALK),
)


class Flag(IntEnum):
    """Effect of a fault on the in-line monitors of its channels."""

    LEAVE = 0
    BAD = 1
    GOOD = 2
    INVERT = 3


@dataclass(frozen=True, slots=True)
class Effect:
    """Effect of a fault on each of its values, as fields of record.TARGET."""

    act: Act
    value: float = 0.0
    thresholds: bool = False  # ``value`` is in thresholds of the signal's monitor
    time_constant_s: float = 0.0  # SETTLE, GAUSS_MARKOV
    frequency_hz: float = 0.0  # OSCILLATE, SWING
    whole_frames: bool = False  # DELAY: rounded up
    static_rate_pa_s: float = 0.0  # PITOT_STATIC_ICE; it or the pitot line's ``value`` NaN: that line is open
    source_place: str | None = None  # CROSS_TALK: the place that it comes from; PITOT_STATIC_ICE: the second pressure
    invalid: bool = False  # the sensor flags the sample
    part: int = 0  # parts.Part of a servo actuator, LinkPart of a link, ComputerPart of a computer
    different: bool = False  # of a link: the sign alternates from receiver to receiver
    uncommanded: bool = False  # the coil's current is no longer the one asked for
    seen_by_wire: bool = False  # the monitor of the coil's wire may see it, by its coverage
    seen_by_test: int = 0  # LaneTest of a computer's own that may see it, by its coverage
    test_error: float = math.inf  # share of full scale; the test can detect it only above its tolerance
    of_range: bool = False  # ``value`` is a share of the sensor's range


class Acting(NamedTuple):
    """One fault on one value in one frame."""

    target: Any  # TARGET record
    state: Any  # STATE record
    kept: Any  # KEPT record, in place
    memory: Any  # rings of what delays read, in place
    dt_s: float


@kernel
def corrupted(x, other, normal, frame, fault):
    """Apply a fault that acts in ``frame`` to the value x.

    other : the value that cross-talk comes from; normal : standard normal draw; fault : Acting
    The equations stand with the kinds.
    """
    target, elapsed = fault.target, fault.state["elapsed"]
    act = target["act"]
    if act == Act.VALID_ONLY:
        return x
    if act == Act.NO_NUMBER:
        return math.nan
    if act == Act.INVERT:
        return 1.0 - x
    if act == Act.ADD_ANGLE:
        part = min(1.0, elapsed / target["ramp"]) if target["ramp"] > 0.0 else 1.0
        return limit(x + part * target["value"], target["low"], target["high"], 1)
    y = changed(x, other, normal, frame, elapsed * fault.dt_s, fault)
    if elapsed < target["ramp"]:
        y = x + elapsed / target["ramp"] * difference(y, x, target["wraps"])
    elif act == Act.SET:
        return y
    return limit(y, target["low"], target["high"], target["wraps"])


@kernel
def changed(x, other, normal, frame, t, fault):
    """Apply the same without ramp and range; ``t`` [s] since the onset."""
    target, kept = fault.target, fault.kept
    act, value = target["act"], target["value"]
    if act == Act.ADD:
        return x + value
    if act == Act.DRIFT:
        return x + value * t
    if act == Act.SETTLE:
        return x + value * (1.0 - math.exp(-t / target["time_constant_s"]))
    if act == Act.SET:
        return value
    if act == Act.HOLD:
        return kept["held"]
    if act == Act.SCALE:
        return x * value
    if act == Act.NOISE:
        return x + value * normal
    if act == Act.GAUSS_MARKOV:
        left = math.exp(-fault.dt_s / target["time_constant_s"])
        kept["held"] = 0.0 if t == 0.0 else left * kept["held"] + value * math.sqrt(1.0 - left * left) * normal
        return x + kept["held"]
    if act in (Act.OSCILLATE, Act.SWING):
        swing = value * math.sin(TWO_PI * target["frequency_hz"] * t)
        return swing + (x if act == Act.OSCILLATE else kept["held"])
    if act == Act.DELAY:
        return earlier(frame, target, fault.memory)
    if act == Act.QUANTISE:
        return np.floor(x / value + 0.5) * value
    if act == Act.CROSS_TALK:
        return x + value * other
    if act == Act.REPEAT:
        return kept["last"]
    most = value * fault.dt_s  # LIMIT_RATE
    kept["held"] += min(max(x - kept["held"], -most), most)
    return kept["held"]


@kernel
def earlier(frame, target, memory):
    """Return the value ``value`` frames ago, between two frames in proportion."""
    length, start = target["length"], target["memory"]
    whole = int(target["value"])
    part = target["value"] - whole
    newer = memory[start + (frame - whole) % length]
    if part == 0.0:
        return newer
    older = memory[start + (frame - whole - 1) % length]
    return newer + part * difference(older, newer, target["wraps"])


@kernel
def keep(x, frame, fault):
    """Remember x, the value before this fault, for what delays read."""
    target, kept, memory = fault.target, fault.kept, fault.memory
    if target["length"] > 0:
        start, length = target["memory"], target["length"]
        if kept["started"] == 0:
            for i in range(length):
                memory[start + i] = x
        memory[start + frame % length] = x
    if kept["started"] == 0:
        kept["last"] = x
        kept["started"] = 1


@kernel
def freeze(channels, c, target, kept, fresh, t):
    """Put static and dynamic pressure of channel c behind lines that ice has closed; see systems.PitotIcing.

    t : [s] since the onset, below zero while the fault does not act
    """
    s, q = target["row"], target["source"]
    static = channels[s, c]
    total = static + channels[q, c]
    if kept["started"] == 0:
        kept["last"], kept["last_total"], kept["started"] = static, total, 1
    if fresh != 0:
        kept["held"], kept["total"] = kept["last"], kept["last_total"]
    kept["last"], kept["last_total"] = static, total
    if t < 0.0:
        return
    if target["value"] == target["value"]:
        total = kept["total"] + target["value"] * t
    if target["static_rate_pa_s"] == target["static_rate_pa_s"]:
        static = kept["held"] + target["static_rate_pa_s"] * t
        channels[s, c] = limit(static, target["low"], target["high"], 0)
    channels[q, c] = limit(total - static, target["source_low"], target["source_high"], 0)


@kernel
def measured(ilm, off, target, st, kept):
    """Return the answer of a monitor that measures: bad once one coil, and the sum with it, has been ``off`` for long.

    ilm : its answer so far; off : what the fault adds to the sample; a sample that is no number it does not see
    """
    if st["fresh"] != 0:
        kept["beyond"] = 0
    beyond = st["acts"] != 0 and abs(off) > target["tolerance"]
    kept["beyond"] = kept["beyond"] + 1 if beyond else 0
    return Ilm.BAD.value if kept["beyond"] >= target["frames"] else ilm


@kernel
def flagged(ilm, flag):
    """Return the in-line monitor's answer under a fault; one that is not fitted stays absent."""
    if flag == Flag.LEAVE or (ilm != Ilm.BAD and ilm != Ilm.GOOD):
        return ilm
    if flag == Flag.BAD:
        return Ilm.BAD.value
    if flag == Flag.GOOD:
        return Ilm.GOOD.value
    return Ilm.BAD.value if ilm == Ilm.GOOD else Ilm.GOOD.value
