"""Sensors over truths of the test's own: what the tests of the sensors share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.frame import CHANNELS, INDEX, SIGNALS, S, new_block
from rig.kernels import bind
from rig.sensors import Sensors, Suite, measure

ERRORS = ("noise_std", "bias_tolerance", "scale_tolerance", "lag_s", "quantum", "skew_frames")
IDEAL: dict[str, Any] = dict.fromkeys(ERRORS, 0.0)
WIDE: dict[str, Any] = {"low": -1e9, "high": 1e9}


def suite(**per_signal: dict[str, Any]) -> Any:
    """Ideal sensors, but for the keys given by signal."""
    return Suite.model_validate({s.name: {**IDEAL, **per_signal.get(s.name, {})} for s in SIGNALS})


def truths(frames: int, **per_signal: Any) -> NDArray[np.float64]:
    """(frames, S) truth: what is given by signal, else 0."""
    truth = np.zeros((frames, S))
    for name, values in per_signal.items():
        truth[:, INDEX[name]] = values
    return truth


def sense(
    truth: NDArray[np.float64],
    settings: Any,
    *,
    seed: int = 0,
    rate_hz: float = 100.0,
    split: int = 500,
    field: str = "channels",
) -> NDArray[np.float64]:
    """(frames, S, 4) samples of the truths, or another field of the channels, in blocks of ``split`` rows."""
    stage, memory, step = Sensors(settings, rate_hz, SeedSequence(seed)), new_block(min(split, len(truth))), None
    out = np.empty((len(truth), S, CHANNELS))
    for first in range(0, len(truth), split):
        block = memory[: len(truth) - first]
        block["truth"] = truth[first : first + len(block)]
        stage.prepare(block)
        data = stage.data
        step = step or bind(measure, block, 0, data)
        for k in range(len(block)):
            step(block, k, data)
        out[first : first + len(block)] = block[field]
    return out
