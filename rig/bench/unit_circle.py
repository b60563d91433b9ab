"""A session for the conformance test of a unit: healthy channels of the angles cross the end of their circle.

A frequent mistake of a first voter: it computes 358 degrees between 359 and 1 degree, and loses heading at north.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, SIGNALS, Ilm, State
from rig.core.units.constants import TWO_PI
from rig.unit.unit_records import INPUT, TO_UNIT, Kind, Said, blank

FRAMES: Final = 200
_THRESHOLD_RAD: Final = 0.05
_STEP_RAD: Final = 0.01  # a frame
_APART: Final = np.array([0.1, -0.1, 0.05, -0.05])  # of the channels, in thresholds
_BESIDE_RAD: Final = 0.5  # a vote may lag behind its channels by a filter


def session(like: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return CONFIG (1,), ``like`` this one except for the angles, and INPUT (FRAMES,): only the angles move."""
    config = like.copy()
    for i, signal in enumerate(SIGNALS):
        if signal.wraps:
            row = config["signal"][0, i : i + 1]
            row["wraps"], row["low"], row["high"] = 1, signal.low, signal.low + TWO_PI
            for name in (name for name in row.dtype.names or () if "threshold" in name):
                row[name] = _THRESHOLD_RAD
    return config, _turning(config)


def _turning(config: NDArray[Any]) -> NDArray[Any]:
    made = blank(INPUT, TO_UNIT, Kind.FRAME).repeat(FRAMES)
    made["frame"] = np.arange(FRAMES)
    made["time_s"] = made["frame"] / config["rate_hz"][0]
    made["valid"], made["ilm"] = 1, Ilm.GOOD
    made["discrete_valid"], made["discrete_ilm"] = 1, Ilm.GOOD
    for i, signal in enumerate(config["signal"][0]):
        low = float(signal["low"])
        truth = np.full(FRAMES, 0.5 * (low + float(signal["high"])))
        if signal["wraps"]:
            truth = low + _STEP_RAD * (np.arange(FRAMES) - FRAMES // 2)
        channels = truth[:, None] + float(signal["threshold"]) * _APART
        made["channels"][:, i] = (channels - low) % TWO_PI + low if signal["wraps"] else channels
        made["reference"][:, i] = (truth - low) % TWO_PI + low if signal["wraps"] else truth
        made["second_reference"][:, i] = np.nan
    return made


def wrong(config: NDArray[Any], asked: NDArray[Any], answered: NDArray[Any]) -> str:
    """Return the first isolated healthy channel, or the first vote apart from its channels; "" if none.

    answered : (FRAMES,) OUTPUT, of which ``said`` names the groups that the unit has filled
    """
    for i, signal in enumerate(config["signal"][0]):
        if not signal["wraps"]:
            continue
        name, fitted = SIGNALS[i].name, min(int(signal["fitted"]), CHANNELS)
        if fitted == 0:
            continue
        states, told = answered["state"][:, i, :fitted], answered["said"] & Said.STATE != 0
        failed = (states == State.FAILED).any(axis=1) & told
        off = answered["voted"][:, i] - asked["channels"][:, i, 0]
        apart = np.abs((off + 0.5 * TWO_PI) % TWO_PI - 0.5 * TWO_PI)
        astray = ~(apart <= _BESIDE_RAD) & (answered["said"] & Said.VOTED != 0)
        k = int(np.argmax(failed | astray))
        turn = "and its circle ends there: differences go the short way round"
        if failed[k]:
            return f"frame {k}: a channel of {name} is isolated although all agree, {turn}"
        if astray[k]:
            return f"frame {k}: the vote of {name} is {apart[k]:.3g} rad from its channels, {turn}"
    return ""
