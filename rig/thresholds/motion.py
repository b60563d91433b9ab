"""How much the design data move, and whether other data move more: then the thresholds say nothing of them.

The motion of a signal is that of the middle of its channels: how far it is from its median over the flight, and how
fast it changes, as a mean over SMOOTH_S.  The envelope is what 95 % of the frames stay within.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.frame import CHANNELS
from rig.thresholds.design import Flight
from rig.thresholds.distances import near
from rig.units.angles import TURN

Floats = NDArray[np.float64]
SHARE: Final = 0.95
SMOOTH_S: Final = 0.1
BEYOND: Final = 1.5  # times the envelope of the design data
STILL: Final = 2.0  # motion below so many times the distance between channels is not seen
_MOST: Final = 200_000  # values of a flight that a quantile is taken from


class Envelope(NamedTuple):
    """95 % of the distance from the median, unit of the signal, of its rate of change, unit a second; of the noise."""

    value: float
    rate_per_s: float
    noise: float  # 95 % of the difference of the first two channels from each other

    @property
    def still(self) -> bool:
        """Return True if the signal does not move: channels differ by as much as it does."""
        return not self.value > STILL * self.noise


def envelope(flights: Sequence[Flight], wraps: bool) -> Envelope:
    """Return the envelope of a signal over all flights, those of more frames counting more."""
    values, rates, noises = zip(*(_of(flight, wraps) for flight in flights), strict=True)
    return Envelope(*(_within(np.concatenate(parts)) for parts in (values, rates, noises)))


def _of(flight: Flight, wraps: bool) -> tuple[Floats, Floats, Floats]:
    samples = near(flight.samples) if wraps else flight.samples
    centre = middle(samples)
    centre = centre[np.isfinite(centre)]
    if wraps:
        centre = np.unwrap(centre, period=TURN)
    step = max(round(SMOOTH_S * flight.rate_hz), 1)
    sums = np.cumsum(np.concatenate([[0.0], centre]))
    smooth = (sums[step:] - sums[:-step]) / step
    rate = np.abs(smooth[step:] - smooth[:-step]) * flight.rate_hz / step
    away = np.abs(centre - np.median(centre)) if len(centre) else centre
    apart = np.abs(samples[0] - samples[1])
    return _some(away), _some(rate), _some(apart[np.isfinite(apart)])


def middle(samples: Floats) -> Floats:
    """Return (n,) the median of the channels (C, n); NaN where one has no sample."""
    if len(samples) == CHANNELS:
        a, b, c, d = samples
        second = np.maximum(np.minimum(a, b), np.minimum(c, d))
        return 0.5 * (second + np.minimum(np.maximum(a, b), np.maximum(c, d)))
    return np.median(samples, axis=0)


def _some(values: Floats) -> Floats:
    return values[:: max(len(values) // _MOST, 1)]


def _within(values: Floats) -> float:
    return float(np.quantile(values, SHARE)) if len(values) else 0.0


def beyond(design: Mapping[str, Envelope], monitored: Mapping[str, Envelope]) -> list[str]:
    """Return a line for each signal that moves by more than BEYOND times the design data."""
    lines: list[str] = []
    for name, known in design.items():
        if name not in monitored:
            continue
        got = monitored[name]
        for what, most, found in (("", known.value, got.value), (" a second", known.rate_per_s, got.rate_per_s)):
            if found > BEYOND * most:
                moves = f"{100 * SHARE:g} % of its motion is {found:.3g}{what}, of the design data {most:.3g}"
                lines.append(f"{name}: {moves}: the thresholds are not made for it")
    return lines
