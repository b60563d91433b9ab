"""Check design data: find channels that stand out as faulty, and measure how much each signal moves.

    invalid       more samples in a row are not comparable than the longest persistence: no threshold keeps the channel
    repeats       a channel repeats one value for HOLD_S while no other channel does
    stands apart  for HOLD_S without a break the distance of a channel to every other channel exceeds OUT times the
                  largest of any other channel of the flight, OUT times its own in other flights, and APART times the
                  usual distance

In 18 flights of a vibrating quadrotor, aligned or not, the ratio is at most 3.6 for healthy channels and 40 for a fault
of 10 deg/s; OUT is between them.

The motion of a signal is that of the middle of its channels: its distance from the median over the flight, and its rate
of change, as a mean over SMOOTH_S.  The envelope holds 95 % of the frames.  The thresholds are not valid for data that
are more dynamic.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS
from rig.core.runs import runs
from rig.studies.thresholds.design import DataBlock
from rig.studies.thresholds.distances import invalid_runs, middle_two, near_first, nearest, sliding_minimum

Floats = NDArray[np.float64]
HOLD_S: Final = 1.0
OUT: Final = 10.0
APART: Final = 5.0
SHARE: Final = 0.95
SMOOTH_S: Final = 0.1
BEYOND: Final = 1.5  # times the envelope of the design data
STILL: Final = 2.0  # motion below so many times the distance between channels is not seen
_MOST_DISTANCES: Final = 100_000  # that the usual one is taken from
_MOST_VALUES: Final = 200_000  # of a flight that a quantile is taken from


class Suspect(NamedTuple):
    """A channel, counted from 1, that stands out; the place of its flight; and the reason."""

    flight: int
    channel: int
    why: str


class Envelope(NamedTuple):
    """95 % values of the distance from the median, of the rate of change (a second) and of the noise, signal's unit."""

    value: float
    rate_per_s: float
    noise: float  # 95 % of the difference of the first two channels from each other

    def in_unit(self, scale: float) -> Envelope:
        """Return the envelope in a unit that is ``scale`` of this one."""
        return Envelope(*(value / scale for value in self))

    @property
    def still(self) -> bool:
        """Return True if the signal does not move, that is, no more than its channels differ."""
        return not self.value > STILL * self.noise


def suspects(flights: Sequence[DataBlock], wraps: bool, longest: int, scale: float = 1.0) -> list[Suspect]:
    """Return the channels of a signal that stand out; ``longest`` persistence, frames; ``scale`` of printed values."""
    listed = [Suspect(f, c + 1, why) for f, flight in enumerate(flights) for c, why in _alone(flight, longest)]
    apart, since_s, usual = _distances(flights, wraps)
    everywhere = float(np.median(apart))
    for f, c in np.ndindex(*apart.shape):
        rest = [*np.delete(apart[f], c), everywhere]
        if len(flights) > 1:
            rest.append(float(np.median(np.delete(apart[:, c], f))))
        if apart[f, c] > max(OUT * max(rest), APART * usual):
            since, least, most = since_s[f, c], apart[f, c] / scale, max(rest) / scale
            why = f"for {HOLD_S:g} s from {since:.1f} s on it differed by {least:.3g} or more from every other channel"
            listed.append(Suspect(f, c + 1, f"{why}; the other channels differ by {most:.3g} at most"))
    return sorted(listed)


def _alone(flight: DataBlock, longest: int) -> Iterator[tuple[int, str]]:
    for c in invalid_runs(flight.samples, longest):
        share = 100.0 * np.isnan(flight.samples[c]).mean()
        yield c, f"{longest} samples or more in a row are not valid ({share:.3g} % of all): out of range, or no number"
    hold = round(HOLD_S * flight.rate_hz)
    same = [_repeats(column, hold) for column in flight.samples]
    if sum(k is not None for k in same) == 1:
        c = next(c for c, k in enumerate(same) if k is not None)
        since = (same[c] or 0) / flight.rate_hz
        yield c, f"it alone repeats one value for {HOLD_S:g} s from {since:.1f} s on"


def _repeats(column: Floats, hold: int) -> int | None:
    """Return the frame from which a channel repeats one value ``hold`` times, if there is one."""
    spans = runs(column)
    long = spans[spans[:, 1] - spans[:, 0] > hold]
    return int(long[0, 0]) if len(long) else None


def _distances(flights: Sequence[DataBlock], wraps: bool) -> tuple[Floats, Floats, float]:
    """Return the largest distance held for HOLD_S and since when, s, by flight and channel; the usual distance."""
    held, since_s, usual = [], [], []
    for flight in flights:
        hold = round(HOLD_S * flight.rate_hz)
        every = nearest(near_first(flight.samples) if wraps else flight.samples)
        least = [sliding_minimum(np.where(np.isfinite(distance), distance, 0.0), hold) for distance in every]
        held.append([distance.max() for distance in least])
        since_s.append([max(int(distance.argmax()) - hold + 1, 0) / flight.rate_hz for distance in least])
        usual.append(np.concatenate([d[:: max(len(d) * len(every) // _MOST_DISTANCES, 1)] for d in every]))
    values = np.concatenate(usual)
    finite = values[np.isfinite(values)]
    return np.array(held), np.array(since_s), float(np.median(finite)) if len(finite) else 0.0


def envelope(flights: Sequence[DataBlock], wraps: bool) -> Envelope:
    """Return the envelope of a signal over all flights, weighted by their frames."""
    values, rates, noises = zip(*(_of(flight, wraps) for flight in flights), strict=True)
    return Envelope(*(_within(np.concatenate(parts)) for parts in (values, rates, noises)))


def _of(flight: DataBlock, wraps: bool) -> tuple[Floats, Floats, Floats]:
    samples = near_first(flight.samples) if wraps else flight.samples
    centre = middle(samples)
    centre = centre[np.isfinite(centre)]
    if wraps:
        centre = np.unwrap(centre)
    step = max(round(SMOOTH_S * flight.rate_hz), 1)
    sums = np.cumsum(np.concatenate([[0.0], centre]))
    smooth = (sums[step:] - sums[:-step]) / step
    rate = np.abs(smooth[step:] - smooth[:-step]) * flight.rate_hz / step
    away = np.abs(centre - np.median(centre)) if len(centre) else centre
    apart = np.abs(samples[0] - samples[1])
    return _some(away), _some(rate), _some(apart[np.isfinite(apart)])


def middle(samples: Floats) -> Floats:
    """Return the median (n,) of the channels (C, n); NaN if one has no sample."""
    if len(samples) == CHANNELS:
        second, third = middle_two(samples)
        return 0.5 * (second + third)
    return np.median(samples, axis=0)


def _some(values: Floats) -> Floats:
    return values[:: max(len(values) // _MOST_VALUES, 1)]


def _within(values: Floats) -> float:
    return float(np.quantile(values, SHARE)) if len(values) else 0.0


def beyond(design: Mapping[str, Envelope], monitored: Mapping[str, Envelope]) -> list[str]:
    """Return a line for each signal that moves more than BEYOND times as much as the design data."""
    lines: list[str] = []
    for name in (name for name in design if name in monitored):
        of_motion = zip(("", " a second"), design[name], monitored[name], strict=False)  # their noise is left out
        for unit, own, other in of_motion:
            if other > BEYOND * own:
                moves = f"{100 * SHARE:g} % of its motion is within {other:.3g}{unit}, of the design data"
                lines.append(f"{name}: {moves} within {own:.3g}; the thresholds are not valid for it")
    return lines
