"""How far the votes were off."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import SIGNALS, TWO_PI, Block
from rig.score.record import VoteError

WRAPS: Final = np.array([signal.wraps for signal in SIGNALS])


def vote_errors(
    rows: Block, clean: NDArray[np.float64], params: NDArray[np.void], onset: int | None, rate_hz: float
) -> dict[str, VoteError]:
    """Of every signal, against the truth and against ``clean`` (n, S), the vote of healthy channels.

    onset : first frame in which any fault acted, None when none did
    A vote that is no number is above any threshold, and no part of peak and RMS; nor is a truth that is none.
    """
    voted, truth = np.ascontiguousarray(rows["voted"]), np.ascontiguousarray(rows["truth"])
    known = np.isfinite(truth)
    off, off_clean = deviation(voted, truth), deviation(voted, clean)
    above = known & ~(off <= params["threshold"])
    clean_above = known & ~(off_clean <= params["threshold"])
    peak, at, rms = _size(off)
    clean_peak, _, clean_rms = _size(off_clean)
    after = above[len(above) if onset is None else onset :]
    counts = (above.sum(axis=0), after.sum(axis=0), clean_above.sum(axis=0))
    seconds = [count / rate_hz for count in counts]
    return {
        signal.name: VoteError(
            peak=float(peak[s]),
            peak_frame=int(at[s]),
            rms=float(rms[s]),
            above_threshold_s=float(seconds[0][s]),
            above_threshold_after_onset_s=float(seconds[1][s]),
            clean_peak=float(clean_peak[s]),
            clean_rms=float(clean_rms[s]),
            clean_above_threshold_s=float(seconds[2][s]),
        )
        for s, signal in enumerate(SIGNALS)
    }


def deviation(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, S) size of ``a - b``, angles the short way round; NaN where either is no number."""
    return np.abs(difference(a, b, WRAPS))


def difference(a: NDArray[np.float64], b: NDArray[np.float64], wraps: NDArray[np.bool_] | bool) -> NDArray[np.float64]:
    """``a - b``, the short way round where the signal (last axis) ``wraps``; angles.difference for arrays."""
    with np.errstate(invalid="ignore"):
        off = a - b
        off[..., wraps] = (off[..., wraps] + np.pi) % TWO_PI - np.pi
    return off


def _size(off: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Largest, where, and root mean square of each column, over what is finite; 0 when nothing is."""
    finite = np.isfinite(off)
    off = np.where(finite, off, 0.0)
    at = off.argmax(axis=0)
    count = np.maximum(finite.sum(axis=0), 1)
    return off.max(axis=0), at, np.sqrt((off * off).sum(axis=0) / count)
