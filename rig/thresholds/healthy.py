"""Design data that hold a fault: which channel of which flight stands out, and how that was told.

    invalid       more samples in a row are not comparable than the longest persistence: no threshold keeps the channel
    repeats       a channel repeats one value for HOLD_S while no other does
    stands apart  for HOLD_S on end a channel was further from every other channel than OUT times what any other channel
                  of the flight was, and it in the other flights; and than APART times the usual distance

In 18 flights of a vibrating quadrotor, aligned or not, healthy channels reach 3.6 of OUT; a fault of 10 deg/s is at 40.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.thresholds.design import Flight
from rig.thresholds.distances import invalid_runs, near, nearest, sliding_minimum

Floats = NDArray[np.float64]
HOLD_S: Final = 1.0
OUT: Final = 10.0
APART: Final = 5.0
_MOST: Final = 100_000  # distances that the usual one is taken from


class Suspect(NamedTuple):
    """A channel, from 1, of a flight, its place among them, and how it was told."""

    flight: int
    channel: int
    why: str


def suspects(flights: Sequence[Flight], wraps: bool, longest: int) -> list[Suspect]:
    """Return the channels of a signal that stand out; ``longest`` persistence, frames."""
    found = [Suspect(f, c + 1, why) for f, flight in enumerate(flights) for c, why in _alone(flight, longest)]
    apart, at, usual = _distances(flights, wraps)
    everywhere = float(np.median(apart))
    for f, c in np.ndindex(*apart.shape):
        rest = [*np.delete(apart[f], c), everywhere]
        if len(flights) > 1:
            rest.append(float(np.median(np.delete(apart[:, c], f))))
        if apart[f, c] > max(OUT * max(rest), APART * usual):
            why = (
                f"for {HOLD_S:g} s from {at[f, c]:.1f} s on it was at least {apart[f, c]:.3g} from every other channel"
            )
            found.append(Suspect(f, c + 1, f"{why}; {max(rest):.3g} is the most of the others"))
    return sorted(found)


def _alone(flight: Flight, longest: int) -> Iterator[tuple[int, str]]:
    for c in invalid_runs(flight.samples, longest):
        yield c, f"{longest} samples or more in a row are not valid"
    hold = round(HOLD_S * flight.rate_hz)
    same = [_repeats(column, hold) for column in flight.samples]
    if sum(k is not None for k in same) == 1:
        c = next(c for c, k in enumerate(same) if k is not None)
        yield c, f"it repeats one value for {HOLD_S:g} s from {(same[c] or 0) / flight.rate_hz:.1f} s on, no other does"


def _repeats(column: Floats, hold: int) -> int | None:
    """Return the frame from which one value is repeated ``hold`` times, if there is one."""
    runs = np.flatnonzero(sliding_minimum((np.diff(column) == 0).astype(np.float64), hold))
    return int(runs[0]) - hold + 1 if len(runs) else None


def _distances(flights: Sequence[Flight], wraps: bool) -> tuple[Floats, Floats, float]:
    """Return the largest distance held for HOLD_S and since when, s, by flight and channel; the usual distance."""
    held, at, usual = [], [], []
    for flight in flights:
        hold = round(HOLD_S * flight.rate_hz)
        every = nearest(near(flight.samples) if wraps else flight.samples)
        least = [sliding_minimum(np.where(np.isfinite(distance), distance, 0.0), hold) for distance in every]
        held.append([one.max() for one in least])
        at.append([max(int(one.argmax()) - hold + 1, 0) / flight.rate_hz for one in least])
        usual.append(np.concatenate([one[:: max(len(one) * len(every) // _MOST, 1)] for one in every]))
    values = np.concatenate(usual)
    return np.array(held), np.array(at), float(np.median(values[np.isfinite(values)])) if len(values) else 0.0
