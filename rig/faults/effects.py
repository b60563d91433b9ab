"""What a fault makes of one value."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.faults.settings import Act, Flag
from rig.frame import TWO_PI, Ilm
from rig.kernels import kernel
from rig.units.angles import difference, limit

_TURN: Final = TWO_PI


@kernel
def corrupted(x, other, drawn, target, kept, memory, frame, elapsed, dt_s):
    """The value x under a fault that has acted for ``elapsed`` frames.

    other : the value that cross-talk comes from; drawn : standard normal; target, kept : TARGET and KEPT record
    memory : rings of what delays read; the equations stand with the kinds
    """
    act = target["act"]
    if act == Act.NOTHING:
        return x
    if act == Act.NO_NUMBER:
        return math.nan
    if act == Act.INVERT:
        return 1.0 - x
    if act == Act.TURN:
        part = min(1.0, elapsed / target["ramp"]) if target["ramp"] > 0.0 else 1.0
        return limit(x + part * target["value"], target["low"], target["high"], 1)
    y = changed(act, x, other, drawn, target, kept, memory, frame, elapsed * dt_s, dt_s)
    if elapsed < target["ramp"]:
        y = x + elapsed / target["ramp"] * difference(y, x, target["wraps"])
    elif act == Act.SET:
        return y
    return limit(y, target["low"], target["high"], target["wraps"])


@kernel
def changed(act, x, other, drawn, target, kept, memory, frame, t, dt_s):
    """The same without ramp and range; ``t`` [s] since the onset."""
    value = target["value"]
    if act == Act.ADD:
        return x + value
    if act == Act.DRIFT:
        return x + value * t
    if act == Act.SETTLE:
        return x + value * (1.0 - math.exp(-t / target["second"]))
    if act == Act.SET:
        return value
    if act == Act.HOLD:
        return kept["held"]
    if act == Act.SCALE:
        return x * value
    if act == Act.NOISE:
        return x + value * drawn
    if act in (Act.OSCILLATE, Act.SWING):
        swing = value * math.sin(_TURN * target["second"] * t)
        return swing + (x if act == Act.OSCILLATE else kept["held"])
    if act == Act.DELAY:
        return earlier(frame, target, memory)
    if act == Act.QUANTISE:
        return np.floor(x / value + 0.5) * value
    if act == Act.CROSS_TALK:
        return x + value * other
    if act == Act.REPEAT:
        return kept["last"]
    most = value * dt_s  # LIMIT_RATE
    kept["held"] += min(max(x - kept["held"], -most), most)
    return kept["held"]


@kernel
def earlier(frame, target, memory):
    """The value ``value`` frames ago, between two frames in proportion."""
    length, start = target["length"], target["memory"]
    whole = int(target["value"])
    part = target["value"] - whole
    newer = memory[start + (frame - whole) % length]
    if part == 0.0:
        return newer
    older = memory[start + (frame - whole - 1) % length]
    return newer + part * difference(older, newer, target["wraps"])


@kernel
def keep(x, target, kept, memory, frame):
    """Remember x, the value before this fault, for what delays read."""
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
    """Static and dynamic pressure of channel c behind lines that ice has closed; see systems.PitotIcing."""
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
    if target["second"] == target["second"]:
        static = kept["held"] + target["second"] * t
        channels[s, c] = limit(static, target["low"], target["high"], 0)
    channels[q, c] = limit(total - static, target["source_low"], target["source_high"], 0)


@kernel
def measured(says, off, target, st, kept):
    """The answer of a monitor that measures: bad once one coil, and the sum with it, has been ``off`` for long enough.

    says : its answer so far; off : what the fault adds to the sample; a sample that is no number it does not see
    """
    if st["fresh"] != 0:
        kept["beyond"] = 0
    beyond = st["acts"] != 0 and abs(off) > target["tolerance"]
    kept["beyond"] = kept["beyond"] + 1 if beyond else 0
    return Ilm.BAD.value if kept["beyond"] >= target["frames"] else says


@kernel
def flagged(says, flag):
    """The in-line monitor's answer under a fault; one that is not fitted stays absent."""
    if flag == Flag.LEAVE or (says != Ilm.BAD and says != Ilm.GOOD):
        return says
    if flag == Flag.BAD:
        return Ilm.BAD.value
    if flag == Flag.GOOD:
        return Ilm.GOOD.value
    return Ilm.BAD.value if says == Ilm.GOOD else Ilm.GOOD.value
