"""The Markov chain of one signal with n channels: faults, false isolations, and the two ways to lose the signal.

State (k, announced): k channels are faulty or isolated; announced if any of them was isolated, so that it is repaired
after the flight.  A fault is settled after a mean time tau, in which a second fault can begin.  Because tau is short
beside a flight, the model takes the outcome at once, and includes the chance of a second fault within tau.

    (k)   -> next fault         (n - k) ((1 - beta) lambda + box + k pair)
    (k)   -> two alike          C(n - k, 2) pair                k <= n - 2
    (k)   -> (k + 1, announced) (n - k) phi                     false isolation; of the last channel: annunciated loss

Common mode hits one of the C(n, 2) fixed pairs of channels: pair = beta lambda / C(n, 2).  box is the failure rate of
the LRU of one channel.  A pair with one good channel left is a single fault.
Source: docs/explanation/reliability.md, 'The model'.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import comb
from typing import Final

import numpy as np

from rig.studies.reliability.chain import Floats, transitions
from rig.studies.reliability.next_fault import BAD, BAD_LOST, KEPT, KNOWN, KNOWN_LOST, CellKey

LOSSES: Final = (KNOWN, KNOWN_LOST, BAD, BAD_LOST)


@dataclass(frozen=True, slots=True)
class Given:
    """The inputs of a chain; the first axis of arrays is the draws."""

    outcomes: Mapping[CellKey, Floats]  # (draws, OUTCOMES)
    announced: Mapping[CellKey, float]
    false_isolation: Mapping[int, Floats]  # (draws,) per channel hour, by channels in use
    settle_h: float
    box_per_hour: float = 0.0

    def of(self, design: str, good: int) -> Floats:
        """Return a cell's draws; pairs of faults that were not flown are undetected errors, divided as other cells."""
        if (design, good) in self.outcomes:
            return self.outcomes[design, good]
        single = self.outcomes["single", good]
        outcomes = np.zeros_like(single)
        outcomes[:, BAD : BAD_LOST + 1] = split(single, BAD)
        return outcomes


def split(outcome: Floats, loss: int) -> Floats:
    """Return the shares (draws, 2) of a loss, KNOWN or BAD, that the aircraft survives and does not survive."""
    both = outcome[:, loss] + outcome[:, loss + 1]
    lost = np.divide(outcome[:, loss + 1], both, out=np.ones_like(both), where=both > 0.0)
    return np.stack([1.0 - lost, lost], axis=-1)


def states(n: int) -> dict[tuple[int, bool], int]:
    """Return the places of the states (faulty channels, announced); the four losses follow them."""
    pairs = ((k, announced) for k in range(n) for announced in (False, True) if k or not announced)
    return {pair: i for i, pair in enumerate(pairs)}


def rates(n: int, per_hour: float, beta: float, given: Given) -> Floats:
    """Build the rates (draws, m, m) per hour of a signal with ``n`` channels, each failing ``per_hour``."""
    place = states(n)
    size = len(place) + len(LOSSES)
    matrix = np.zeros((len(given.outcomes["single", 1]), size, size))
    alone = (1.0 - beta) * per_hour + given.box_per_hour
    pair = beta * per_hour / comb(n, 2) if n > 1 else 0.0
    for (k, announced), here in place.items():
        row, good = matrix[:, here], n - k
        hit = good * (alone + k * pair)
        _after(row, place, k, 1, announced, hit, next_fault(given, good, per_hour + given.box_per_hour), given)
        if good >= 2 and pair > 0.0:
            _after(row, place, k, 2, announced, comb(good, 2) * pair, given.of("alike", good), given)
        phi = good * given.false_isolation[good]
        if good >= 2:
            row[:, place[k + 1, True]] += phi
        else:  # no channel is left
            row[:, len(place) : len(place) + 2] += phi[:, None] * split(given.of("single", 1), KNOWN)
    return matrix


def next_fault(given: Given, good: int, per_hour: float) -> Floats:
    """Return outcomes (draws, OUTCOMES) of the next fault, settled or followed by another fault before that."""
    single = given.of("single", good)
    second = (good - 1) * per_hour * given.settle_h
    overtaken = second / (1.0 + second)
    return single if good < 2 else (1.0 - overtaken) * single + overtaken * given.of("near", good)


def _after(
    row: Floats,
    place: Mapping[tuple[int, bool], int],
    k: int,
    more: int,
    announced: bool,
    rate: float,
    outcome: Floats,
    given: Given,
) -> None:
    """Add to ``row`` (draws, m) the transitions by ``more`` faults in state k, at ``rate`` per hour."""
    n = 1 + max(faulty for faulty, _ in place)
    losses = outcome[:, list(LOSSES)].copy()
    if k + more < n:
        share = 1.0 if announced else given.announced.get(("single" if more == 1 else "alike", n - k), 0.0)
        row[:, place[k + more, True]] += rate * outcome[:, KEPT] * share
        row[:, place[k + more, False]] += rate * outcome[:, KEPT] * (1.0 - share)
    elif more == 1:
        losses[:, :2] += outcome[:, [KEPT]] * split(outcome, KNOWN)  # a correct vote, but no channel is left
    else:
        losses[:, 2:] += outcome[:, [KEPT]] * split(outcome, BAD)  # two alike, and no other channel left
    row[:, len(place) :] += rate * losses


def one_flight(chain: Floats, n: int, hours: float) -> tuple[Floats, Floats]:
    """Return the outcome of a flight from each latent state: a latent state (draws, k, k), each loss (draws, k, 4).

    An announced fault or a loss is repaired after the flight, so that the next one begins without a fault.
    """
    place = states(n)
    latent = [i for (_, announced), i in place.items() if not announced]
    repaired = [i for (_, announced), i in place.items() if announced] + list(range(len(place), chain.shape[-1]))
    after = transitions(chain, hours, latent)
    begins = after[:, :, latent]
    begins[:, :, 0] += after[:, :, repaired].sum(axis=-1)
    return begins, after[:, :, len(place) :]


def after_flights(flight: tuple[Floats, Floats], hours: float, flights: int) -> Floats:
    """Return the probability (draws, 4) of each loss per flight hour, the mean of ``flights`` between two full checks.

    flight : from ``one_flight``; only the check finds faults that were tolerated without an announcement
    """
    begins, lost = flight
    now = np.zeros(begins.shape[:2])
    now[:, 0] = 1.0
    in_all = np.zeros_like(now)
    for _ in range(flights):
        in_all += now
        now = np.einsum("di,dij->dj", now, begins)
    return np.einsum("di,dij->dj", in_all, lost) / (flights * hours)


def perfect(n: int, per_hour: float, hours: float) -> float:
    """Return the probability per flight hour if every fault but the last is tolerated: all channels fail."""
    return float((-np.expm1(-per_hour * hours)) ** n / hours)
