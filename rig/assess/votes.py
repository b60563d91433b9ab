"""How far the votes were off."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.record import VoteError
from rig.frame import SIGNALS, TWO_PI, Block
from rig.kernels import kernel
from rig.units.angles import difference as short_way

WRAPS: Final = np.array([signal.wraps for signal in SIGNALS])


OFF: Final = np.dtype(
    [("peak", "f8"), ("at", "i8"), ("squares", "f8"), ("finite", "i8"), ("above", "i8"), ("above_after", "i8")]
)


def vote_errors(
    rows: Block, clean: NDArray[np.float64], params: NDArray[np.void], onset: int | None, rate_hz: float
) -> dict[str, VoteError]:
    """Of every signal, against the truth and against ``clean`` (n, S), the vote of healthy channels.

    onset : first frame in which any fault acted, None when none did
    A vote that is no number is above any threshold, and no part of peak and RMS; nor is a truth that is none.
    """
    off = np.zeros((len(SIGNALS), 2), OFF)
    add_up(rows, clean, params, len(rows) if onset is None else onset, off)
    rms = np.sqrt(off["squares"] / np.maximum(off["finite"], 1))
    return {
        signal.name: VoteError(
            peak=float(from_truth["peak"]),
            peak_frame=int(from_truth["at"]) if from_truth["finite"] else None,
            rms=float(rms[s, 0]),
            above_threshold_s=float(from_truth["above"] / rate_hz),
            above_threshold_after_onset_s=float(from_truth["above_after"] / rate_hz),
            clean_peak=float(from_clean["peak"]),
            clean_rms=float(rms[s, 1]),
            clean_above_threshold_s=float(from_clean["above"] / rate_hz),
        )
        for s, (signal, (from_truth, from_clean)) in enumerate(zip(SIGNALS, off, strict=True))
    }


@kernel
def add_up(rows, clean, params, onset, off):
    """Add up how far the votes of ``rows`` (n,) FRAME are from truth and from ``clean`` (n, S).

    params : (S,) config.PARAMS; onset : row from which ``above_after`` counts; off : (S, 2) OFF, in place
    """
    for k in range(len(rows)):
        truth, voted = rows[k]["truth"], rows[k]["voted"]
        for s in range(len(params)):
            known, p = math.isfinite(truth[s]), params[s]
            add(off[s, 0], k, abs(short_way(voted[s], truth[s], p["wraps"])), known, p["threshold"], onset)
            add(off[s, 1], k, abs(short_way(voted[s], clean[k, s], p["wraps"])), known, p["threshold"], onset)


@kernel
def add(total, k, off, known, threshold, onset):
    """One vote, ``off`` by so much; NaN is above any threshold."""
    if math.isfinite(off):
        total["finite"] += 1
        total["squares"] += off * off
        if off > total["peak"]:
            total["peak"], total["at"] = off, k
    if known and not off <= threshold:
        total["above"] += 1
        total["above_after"] += k >= onset


def deviation(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, S) size of ``a - b``, angles the short way round; NaN where either is no number."""
    return np.abs(difference(a, b, WRAPS))


def difference(a: NDArray[np.float64], b: NDArray[np.float64], wraps: NDArray[np.bool_] | bool) -> NDArray[np.float64]:
    """``a - b``, the short way round where the signal (last axis) ``wraps``; angles.difference for arrays."""
    with np.errstate(invalid="ignore"):
        off = a - b
        off[..., wraps] = (off[..., wraps] + np.pi) % TWO_PI - np.pi
    return off
