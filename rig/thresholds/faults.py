"""Faults on one channel of short pieces of a recording, for the trade-off: magnitudes in the unit of the signal.

Each takes pieces (R, n, C), the channel of each (R,), and the frame of the onset; it returns the faulty samples (R, n).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]
Fault = Callable[[Floats, Numbers, int], Floats]


def offset(size: float) -> Fault:
    """Add ``size`` from the onset on, in turn to both sides."""
    return _added(lambda frames, _: np.where(frames >= 0, size, 0.0))


def ramp(per_s: float, rate_hz: float) -> Fault:
    """Add what grows by ``per_s`` a second from the onset on, in turn to both sides."""
    return _added(lambda frames, _: np.where(frames >= 0, per_s * frames / rate_hz, 0.0))


def _added(form: Callable[[Numbers, int], Floats]) -> Fault:
    def inject(pieces: Floats, channel: Numbers, onset: int) -> Floats:
        of_channel = own(pieces, channel)
        sides = np.where(np.arange(len(pieces)) // pieces.shape[2] % 2 == 0, 1.0, -1.0)
        return of_channel + sides[:, None] * form(np.arange(pieces.shape[1]) - onset, onset)

    return inject


def noise(factor: float) -> Fault:
    """Multiply what the channel has of its own, its difference from the median of all, from the onset on."""

    def inject(pieces: Floats, channel: Numbers, onset: int) -> Floats:
        middle = _median(pieces)
        of_channel = own(pieces, channel)
        return _after(onset, middle + factor * (of_channel - middle), of_channel)

    return inject


def gain(factor: float) -> Fault:
    """Multiply the samples from the onset on."""
    return lambda pieces, channel, onset: _after(onset, factor * own(pieces, channel), own(pieces, channel))


def stuck() -> Fault:
    """Repeat the last sample before the onset."""

    def inject(pieces: Floats, channel: Numbers, onset: int) -> Floats:
        of_channel = own(pieces, channel)
        return _after(onset, of_channel[:, onset - 1 : onset], of_channel)

    return inject


def own(pieces: Floats, channel: Numbers) -> Floats:
    """Return the samples (R, n) of the channel of each piece."""
    return pieces[np.arange(len(pieces)), :, channel]


def _median(pieces: Floats) -> Floats:
    lost = np.all(np.isnan(pieces), axis=2, keepdims=True)
    return np.nanmedian(np.where(lost, 0.0, pieces), axis=2)


def _after(onset: int, faulty: Floats, healthy: Floats) -> Floats:
    return np.where(np.arange(healthy.shape[1]) < onset, healthy, faulty)
