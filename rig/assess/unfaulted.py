"""The clean channels: what the sensors said before any fault, kept in flight or computed again from the recorded truth.

The sensors are deterministic in the scenario's seed, so what they give for the recorded truth is, bit for
bit, what they gave in flight; the recorded channels less these are the injected errors.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.vote import mean
from rig.errors import BadInput
from rig.frame import CHANNELS, FLAT, SIGNALS, Block, S, nested, new_block
from rig.kernels import kernel
from rig.scenario import Scenario
from rig.sensors import Sensors, measure
from rig.units.angles import difference, limit

ROWS: Final = 256  # of the clean block: half a megabyte, which stays in the cache
_SAME: Final = -1


class Clean(NamedTuple):
    """``error`` (n, S, 4): the injected error, NaN where the sample is lost (no number, or flagged invalid),
    0 where the channel is not fitted.  ``vote`` (n, S): the median of all clean channels of a signal.
    """

    error: NDArray[np.float64]
    vote: NDArray[np.float64]


def recompute(scenario: Scenario, rows: Block, params: NDArray[np.void]) -> Clean:
    """Run the sensors over the recorded truth; ``params`` are the (S,) records of the manager.

    BadInput when a channel differs before any fault has acted: then these are not the sensors that were flown.
    """
    sensors = Sensors(scenario.sensors, scenario.rate_hz, scenario.streams()["sensors"])
    scratch, comparison = new_block(min(ROWS, len(rows))), _Comparison(rows, params)
    for first in range(0, len(rows), ROWS):
        recorded = rows[first : first + ROWS]
        clean = scratch[: len(recorded)]
        clean.view(np.uint8)[:] = recorded.view(np.uint8)
        sensors.prepare(clean)
        measure_again(nested(clean), sensors.data)
        comparison.add(clean)
    return comparison.found


def of_flight(rows: Block, clean: NDArray[np.void], params: NDArray[np.void]) -> Clean:
    """The same from ``clean`` (n,) faults.CLEAN, kept while ``rows`` were flown."""
    comparison = _Comparison(rows, params)
    comparison.add(clean)
    return comparison.found


class _Comparison:
    """Recorded rows against their clean channels, part after part."""

    def __init__(self, rows: Block, params: NDArray[np.void]) -> None:
        self.found = Clean(np.zeros((len(rows), S, CHANNELS)), np.empty((len(rows), S)))
        self._rows, self._params, self._done = rows, params, 0
        self._acted = np.zeros(1, np.uint8)

    def add(self, clean: NDArray[np.void]) -> None:
        """Compare the next rows."""
        part = slice(self._done, self._done + len(clean))
        rows, error, vote = self._rows[part], self.found.error[part], self.found.vote[part]
        at = compare(rows, clean, self._params, self._acted, error, vote)
        if at != _SAME:
            k, s, c = np.unravel_index(at, (len(rows), S, CHANNELS))
            raise BadInput(
                "the sensors of this version do not give the recorded channels again: first "
                f"{SIGNALS[s].name} channel {c + 1} in frame {rows['frame'][k]}; the flight cannot be scored"
            )
        self._done = part.stop


def checked(rows: Block) -> Block:
    """``rows`` in memory as FLAT lies; BadInput unless they are a flight from its first frame on."""
    if len(rows) == 0 or rows["frame"][0] != 0:
        raise BadInput("a flight is scored from its frame 0 on")
    if rows.dtype == FLAT and rows.flags.c_contiguous and rows.flags.aligned and rows.flags.writeable:
        return rows
    whole: NDArray[Any] = np.zeros(len(rows), FLAT)
    whole[:] = rows
    return whole


@kernel
def measure_again(clean, data):
    """Fill the channels of ``clean`` (n,) FRAME from its truth; data : SensorData."""
    for k in range(len(clean)):
        measure(clean[k]["truth"], clean[k]["bus"], k, data)


@kernel
def compare(rows, clean, params, acted, error, vote):
    """Compare the channels of ``rows``, recorded, with the clean ones.

    rows : (n,) FLAT; clean : (n,) records with its channels and valid; params : (S,) config.PARAMS
    acted : (1,) not 0 once a fault has acted, in place
    error, vote : (n, S, 4), zeros, and (n, S), out, see Clean
    Returns -1, or row * S * 4 + signal * 4 + channel of the first error that no fault can have made.
    """
    for k in range(len(rows)):
        row, tidy = rows[k], clean[k]
        acting = row["acting"]
        for i in range(len(acting)):
            acted[0] |= acting[i]
        corrupted = not same(row["channels"], tidy["channels"]) or not same(row["valid"], tidy["valid"])
        for s in range(len(params)):
            p = params[s]
            for c in range(p["fitted"] if corrupted else 0):
                error[k, s, c] = injected(row, tidy, s, c, p["wraps"])
                if acted[0] == 0 and error[k, s, c] != 0.0:
                    return (k * len(params) + s) * CHANNELS + c
            vote[k, s] = middle(tidy["channels"][s], row["truth"][s], p)
    return _SAME


@kernel
def same(a, b):
    """Whether two (S, 4) arrays are equal, element by element; a NaN is equal to nothing."""
    different = 0
    for s in range(a.shape[0]):
        for c in range(a.shape[1]):
            different |= a[s, c] != b[s, c]
    return different == 0


@kernel
def injected(row, clean, s, c, wraps):
    """Recorded less clean sample; NaN for a sample that a fault has taken away."""
    if row["valid"][s, c] == 0 and clean["valid"][s, c] != 0:
        return np.nan
    dirty, tidy = row["channels"][s, c], clean["channels"][s, c]
    if dirty == tidy or tidy != tidy:
        return 0.0
    return difference(dirty, tidy, wraps)


@kernel
def middle(channels, near, p):
    """The median of the fitted ``channels`` (4,), the mean of the middle two when their number is even.

    Angles are taken ``near`` to the truth.  NaN where truth or a channel is no number.
    """
    n, wraps = p["fitted"], p["wraps"]
    a, b = around(channels[0], near, wraps), around(channels[1], near, wraps)
    c = around(channels[2], near, wraps) if n > 2 else a
    d = around(channels[3], near, wraps) if n > 3 else b
    # Of four: the larger of the pairs' smaller ones and the smaller of their larger ones. Of two: each counts twice.
    one, other = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    if n == 3:
        one = other = max(min(a, b), min(max(a, b), c))
    if a + b + c + d != a + b + c + d:
        return np.nan
    return limit(mean(min(one, other), max(one, other), 0.5), p["low"], p["high"], wraps)


@kernel
def around(sample, near, wraps):
    """An angle as a number ``near`` another, anything else as it is."""
    return near + difference(sample, near, 1) if wraps != 0 else sample
