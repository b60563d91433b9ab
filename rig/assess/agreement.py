"""Which frames a channel miscompared in, and which other channel it was near to: why a monitor failed it or did not.

Computed from the samples of a flight with its thresholds, as the cross-channel comparison sees them when no low-pass is
set before it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.transients import difference
from rig.frame import State

Bools = NDArray[np.bool_]


class Agreement(NamedTuple):
    """One channel over m frames: ``alone``: near no other channel in use; the ``nearest`` one, its ``distance``.

    nearest : (m,) channel from 0, -1 where none can be compared; distance : (m,) unit of the signal, infinite there
    """

    alone: Bools
    nearest: NDArray[np.intp]
    distance: NDArray[np.float64]


def comparable(samples: NDArray[np.float64], valid: Bools, out: Bools, p: NDArray[np.void]) -> Bools:
    """Return whether each of ``samples`` can be compared; out : channels that were out in the row before.

    p : the signal's config.PARAMS
    """
    with np.errstate(invalid="ignore"):
        return valid & ~out & (samples >= p["low"]) & (samples <= p["high"])


def agreement(columns: NDArray[Any], c: int, first: int, end: int, p: NDArray[np.void]) -> Agreement:
    """Compare channel ``c`` (from 0) of a signal with the others in the frames ``first`` to ``end`` (excluded).

    columns : (n,) flight_outcome.COLUMNS of the signal; p : its config.PARAMS
    """
    samples, valid = columns["channels"][first:end], columns["valid"][first:end] != 0
    before = columns["state"][np.maximum(np.arange(first, end) - 1, 0)]  # failed in this frame: compared in it
    compared = comparable(samples, valid, (before == State.FAILED) | (before == State.ABSENT), p)
    from_c = difference(samples, samples[:, c : c + 1], bool(p["wraps"]))
    off = np.where(compared & compared[:, c : c + 1], np.abs(from_c), np.inf)
    off[:, c] = np.inf
    nearest = off.argmin(axis=1)
    distance = off[np.arange(len(off)), nearest]
    alone = ~compared[:, c] | ~(distance <= allowed(compared.sum(axis=1), p))
    alone |= outlier(np.where(compared, from_c, np.nan), distance, p)
    return Agreement(alone, np.where(np.isfinite(distance), nearest, -1), distance)


def allowed(compared: NDArray[np.intp], p: NDArray[np.void]) -> NDArray[np.float64]:
    """Return (m,) thresholds while so many samples are ``compared``, unit of the signal; p : its config.PARAMS."""
    by_number = np.array([p["threshold_duplex"]] * 3 + [p["threshold_triplex"], p["threshold"]])
    return by_number[compared]


def outlier(samples: NDArray[np.float64], distance: NDArray[np.float64], p: NDArray[np.void]) -> Bools:
    """Return (m,) where all agree, but one is ``distance`` from its nearest, beyond its threshold, and two within it.

    samples : (m, 4), NaN where not compared; p : the signal's config.PARAMS
    """
    count = np.isfinite(samples).sum(axis=1)
    limit = np.array([0.0] * 3 + [p["outlier_threshold_triplex"], p["outlier_threshold"]])[count]
    gaps = np.diff(np.sort(samples, axis=1), axis=1)  # NaN come last
    together = ~(gaps > allowed(count, p)[:, None]).any(axis=1)
    return (limit > 0.0) & together & (distance > limit) & (gaps <= limit[:, None]).any(axis=1)


def last_run(flags: Bools) -> int:
    """Return how many of the last ``flags`` in a row are set."""
    unset = np.flatnonzero(~flags)
    return len(flags) - (int(unset[-1]) + 1 if len(unset) else 0)
