"""Rows a second of a recording, whose stamps are rounded to some decimals."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.log.recordings.stamps import GAP

_DECIMALS: Final = 9  # of a stamp, at most: nanoseconds
_REFINED: Final = 3  # times
_VAGUE: Final = 0.5  # of a row, or of a row a second: what the decimals leave open must be less


def rows_a_second(time_s: NDArray[np.float64]) -> float:
    """Return the rows a second by stamps (n,) that rise; 1 of one row.

    The whole number of them whose instants, rounded to the decimals of the stamps, all stamps are: at 300 a second
    milliseconds rise by 3 and by 4.  Else by the median interval.
    """
    if len(time_s) < 2:
        return 1.0
    steps = np.diff(time_s)
    median_s = float(np.median(steps))
    usual = steps[steps < GAP * median_s]  # with rows that are missing, without pauses
    rate_hz = 1.0 / median_s
    for _ in range(_REFINED):  # a few rows together are not told by the median of 2 and 3 ms
        rate_hz = float(np.rint(usual * rate_hz).sum() / usual.sum())
    whole = round(rate_hz)
    return float(whole) if whole > 0 and _are_instants(time_s, whole) else 1.0 / median_s


def _are_instants(time_s: NDArray[np.float64], rate_hz: float) -> bool:
    """Return True if all stamps are whole periods after the first as far as their decimals tell, and these tell it."""
    noise_s = float(np.spacing(np.abs(time_s).max()))
    unit_s = _last_decimal(time_s, noise_s)
    span_s = float(time_s[-1] - time_s[0])
    if unit_s * rate_hz >= _VAGUE * min(1.0, span_s):
        return False
    periods = (time_s - time_s[0]) * rate_hz
    return bool((np.abs(periods - np.rint(periods)) <= (unit_s + 4.0 * noise_s) * rate_hz).all())


def _last_decimal(time_s: NDArray[np.float64], noise_s: float) -> float:
    """Return the unit of the last decimal that any stamp has, s; 0: they are not rounded."""
    for decimals in range(_DECIMALS + 1):
        if (np.abs(time_s - np.round(time_s, decimals)) <= noise_s).all():
            return 10.0**-decimals
    return 0.0
