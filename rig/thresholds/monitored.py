"""The flight's manager over many short pieces of one signal: in which frame each channel is failed.

The rows of ``rig vote`` (bench/run.py), with one signal and without what is not voted.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.run import step
from rig.computer.redundancy.config import MANAGERS, PARAMS, fill
from rig.computer.redundancy.lowpass import follow
from rig.computer.redundancy.manager import new_state
from rig.computer.redundancy.managers import Manager
from rig.frame import CHANNELS, Ilm, rows
from rig.kernels import long_kernel
from rig.recordings.settings import RecordedSignal
from rig.util.runs import cluster_starts

Floats = NDArray[np.float64]
Frames = NDArray[np.int64]
NEVER: Final = -1
_ROWS: Final = rows(1)


def failures(samples: Floats, settings: RecordedSignal, rate_hz: float) -> Frames:
    """(R, C) the frame in which each channel is failed, NEVER if it is not; every piece begins healthy.

    samples : (R, n, C), NaN where a sample is not comparable
    """
    pieces, _, count = samples.shape
    params = _params(settings, count, rate_hz)
    first, manager = np.full((pieces, CHANNELS), NEVER), Manager(MANAGERS[0], params)
    _run(_four(samples), _blank_row(), manager.data, new_state(params), first)
    return first[:, :count]


def isolations(samples: Floats, settings: RecordedSignal, rate_hz: float, gap: int) -> Frames:
    """Return the frames of a whole flight (n, C) in which somebody is failed while all channels are in use.

    After each the flight goes on with all channels in use again; those within ``gap`` frames of the last are one.
    """
    params = _params(settings, samples.shape[1], rate_hz)
    found = np.zeros(len(samples), np.uint8)
    _restarted(_four(samples), _blank_row(), Manager(MANAGERS[0], params).data, new_state(params), found)
    at = np.flatnonzero(found)
    return at[cluster_starts(at, gap)]


def low_passed(samples: Floats, settings: RecordedSignal, rate_hz: float) -> Floats:
    """Return the channels (C, n) as the comparison sees them behind the filter of ``settings``."""
    if settings.filter_s == 0.0:
        return samples
    found = np.empty_like(samples)
    _follow(samples, _params(settings, len(samples), rate_hz), found)
    return found


def _four(samples: Floats) -> Floats:
    """Return the samples with the channels that a signal of fewer than four does not have."""
    if samples.shape[-1] == CHANNELS:
        return np.ascontiguousarray(samples)
    padded = np.full((*samples.shape[:-1], CHANNELS), np.nan)
    padded[..., : samples.shape[-1]] = samples
    return padded


def _params(settings: RecordedSignal, count: int, rate_hz: float) -> NDArray[Any]:
    params = np.zeros(1, PARAMS)
    fill(params[0], settings, settings.limits, count, settings.wraps, rate_hz)
    return params


@long_kernel
def _follow(samples, params, out):
    """Every channel (C, n) through the manager's low-pass; NaN where a sample is not comparable."""
    p = params[0]
    for c in range(len(samples)):
        last = np.nan
        for k in range(samples.shape[1]):
            x = samples[c, k]
            last = np.nan if np.isnan(x) else follow(last, x, x, p)
            out[c, k] = last


def _blank_row() -> NDArray[Any]:
    """One row of one signal, whose channels alone change."""
    block = _ROWS.block(1)
    block["reference"] = block["second_reference"] = np.nan
    block["valid"], block["ilm"] = 1, Ilm.ABSENT
    return _ROWS.nested(block)


@long_kernel
def _run(samples, rows, manager, fresh, first):
    """Every piece through the manager, which begins again with each; writes ``first`` (R, 4)."""
    p, row = manager.params[0], rows[0]
    channels = row["bus"]["channels"]
    for r in range(len(samples)):
        manager.state[0] = fresh[0]
        for k in range(samples.shape[1]):
            for c in range(CHANNELS):
                channels[0, c] = samples[r, k, c]
            step(row, row, k, None, None, None, manager, None)
            for c in range(p["fitted"]):
                if manager.state[0]["failed"][c] and first[r, c] < 0:
                    first[r, c] = k


@long_kernel
def _restarted(samples, rows, manager, fresh, found):
    """One flight through the manager, which begins again after each failure; marks the frames of failures."""
    p, row = manager.params[0], rows[0]
    channels = row["bus"]["channels"]
    for k in range(len(samples)):
        for c in range(CHANNELS):
            channels[0, c] = samples[k, c]
        step(row, row, k, None, None, None, manager, None)
        if manager.state[0]["level"] < p["fitted"]:
            found[k] = 1
            manager.state[0] = fresh[0]
