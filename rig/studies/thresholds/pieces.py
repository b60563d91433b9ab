"""Run the flight's manager over many short pieces of one signal, and return the outcome for the faulty channel of each.

The rows are those of ``rig vote`` (bench/drive.py), with one signal and without anything that is not voted.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.drive import step
from rig.computer.redundancy.lowpass import follow
from rig.computer.redundancy.manager_config import MANAGERS, PARAMS, fill
from rig.computer.redundancy.managers import Manager
from rig.computer.redundancy.slow_tests import TESTS
from rig.core.frame import CHANNELS, Ilm, rows
from rig.core.kernels import long_kernel
from rig.core.runs import cluster_starts
from rig.core.threads import heed
from rig.log.recordings.vote_config import RecordedSignal
from rig.verdict.monitored_places import blank_records, lingers
from rig.verdict.signal_kernels import channel_bits, count_healthy, mark_failed, mark_wrong

Floats = NDArray[np.float64]
Frames = NDArray[np.int64]
_ROWS: Final = rows(1)


def outcomes(
    samples: Floats,
    faulty: NDArray[np.int64],
    onset: int,
    settings: RecordedSignal,
    rate_hz: float,
    first: NDArray[Any] | None = None,
) -> NDArray[Any]:
    """Return (R,) signal_kernels.SIGNAL of pieces that all begin healthy.

    samples : (R, n, C), NaN if a sample is not comparable; faulty : (R,) the channel that is faulty from ``onset`` on
    first : (R,) the first states of the manager; if not given, those of the start of a flight
    """
    return outcomes_of(
        samples, faulty, onset, Manager(MANAGERS[0], parameters(settings, samples.shape[2], rate_hz)), first
    )


def outcomes_of(
    samples: Floats, faulty: NDArray[np.int64], onset: int, manager: Manager, first: NDArray[Any] | None = None
) -> NDArray[Any]:
    """Return the same from any ``manager`` of one signal."""
    params = manager.params
    signals = np.repeat(blank_records(params["threshold"], params["fitted"], lingers(params)), len(samples))
    fresh = np.repeat(manager.new_state(), len(samples)) if first is None else first
    _run(four(samples), faulty, onset, _blank_row(), manager.data, fresh, signals)
    return signals


def isolations(samples: Floats, settings: RecordedSignal, rate_hz: float, gap: int) -> Frames:
    """Return the frames of a whole flight (n, C) in which a channel is isolated while all channels are in use.

    After each isolation the flight continues with all channels in use again, and with the learned states; isolations
    within ``gap`` frames of the last are one.
    """
    manager = Manager(MANAGERS[0], parameters(settings, samples.shape[1], rate_hz))
    frames = failures(samples, None, manager)
    return frames[cluster_starts(frames, gap)]


def failures(samples: Floats, references: Floats | None, manager: Manager) -> Frames:
    """Return the frames of a whole flight (n, C) in which ``manager``, of one signal, isolates a channel.

    references : (n, 2), the first and the second; None: there are none
    After each isolation the flight continues with all channels in use again, and with the learned states.
    """
    heed()
    failed = np.zeros(len(samples), np.uint8)
    given = np.full((len(samples), 2), np.nan) if references is None else references
    learned = (manager.state["tests"], np.zeros(1, TESTS))
    _restarted(four(samples), given, _blank_row(), manager.data, manager.new_state(), learned, failed)
    return np.flatnonzero(failed)


def low_passed(samples: Floats, settings: RecordedSignal, rate_hz: float) -> Floats:
    """Return the channels (C, n) as the comparison gets them behind the filter of ``settings``.

    The step of the filter is not limited: its limit is the threshold, which is sought.  Channels then differ more.
    """
    if settings.filter_s == 0.0:
        return samples
    filtered, params = np.empty_like(samples), parameters(settings, len(samples), rate_hz)
    params["threshold"] = np.inf
    _follow(samples, params, filtered)
    return filtered


def four(samples: Floats) -> Floats:
    """Return the samples with empty channels added up to four."""
    if samples.shape[-1] == CHANNELS:
        return np.ascontiguousarray(samples)
    padded = np.full((*samples.shape[:-1], CHANNELS), np.nan)
    padded[..., : samples.shape[-1]] = samples
    return padded


def parameters(settings: RecordedSignal, count: int, rate_hz: float) -> NDArray[Any]:
    """Return (1,) the PARAMS of a signal of ``count`` channels."""
    params = np.zeros(1, PARAMS)
    fill(params[0], settings, settings.limits, count, settings.wraps, rate_hz)
    return params


@long_kernel
def _follow(samples, params, out):
    """Pass every channel (C, n) through the manager's low-pass; NaN if a sample is not comparable."""
    p = params[0]
    for c in range(len(samples)):
        last = np.nan
        for k in range(samples.shape[1]):
            x = samples[c, k]
            last = np.nan if np.isnan(x) else follow(last, x, x, p)
            out[c, k] = last


def _blank_row() -> NDArray[Any]:
    """Make one row of one signal; only its channels change."""
    block = _ROWS.block(1)
    block["reference"] = block["second_reference"] = np.nan
    block["valid"], block["ilm"] = 1, Ilm.ABSENT
    return _ROWS.nested(block)


@long_kernel
def _run(samples, faulty, onset, rows, manager, fresh, signals):
    """Run every piece through the manager, restarted for each; add up ``signals`` (R,) SIGNAL."""
    row = rows[0]
    channels, fcc = row["bus"]["channels"], row["fcc"]
    for r in range(len(samples)):
        manager.state[0], signal = fresh[r], signals[r]
        healthy_frames, false_isolations = signal["healthy_frames"], signal["false_isolations"]
        for k in range(samples.shape[1]):
            for c in range(CHANNELS):
                channels[0, c] = samples[r, k, c]
            step(row, row, k, None, None, None, manager, None)
            before = np.int64(signal["failed"])
            if k >= onset:
                mark_wrong(1 << faulty[r], k, signal)
            became = mark_failed(channel_bits(fcc["state"][0]), k, signal)
            count_healthy(became, before, signal["level"], signal, healthy_frames, false_isolations)
            signal["level"] = fcc["level"][0]


@long_kernel
def _restarted(samples, references, rows, manager, fresh, learned, found):
    """Run one flight through the manager, restarted after each isolation; mark the frames of isolations.

    learned : TESTS (1,) of the manager's state, and a place to keep it; means begin again, biases stay
    """
    row = rows[0]
    channels, fcc = row["bus"]["channels"], row["fcc"]
    manager.state[0] = fresh[0]
    for k in range(len(samples)):
        for c in range(CHANNELS):
            channels[0, c] = samples[k, c]
        fcc["reference"][0], fcc["second_reference"][0] = references[k, 0], references[k, 1]
        step(row, row, k, None, None, None, manager, None)
        if channel_bits(fcc["state"][0]) != 0:
            found[k] = 1
            tests, kept = learned
            kept[0] = tests[0]
            manager.state[0] = fresh[0]
            tests[0] = kept[0]
            tests[0]["level"] = 0
