"""Flights for the oracle: stretches of constant offsets on a common ramp, with dropouts, monitors and a reference.

One builder for two sources of choices: hypothesis, which shrinks what fails, and a seeded generator, whose even
draws reach the rules for few votes far more often.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product
from typing import Any

import numpy as np
from hypothesis import strategies as st
from oracle_answers import RESOLVERS, Settings

Pick = Callable[[Sequence[Any]], Any]

LEVELS = [0.0, 0.25, 0.5, 1.0, 1.5, 3.0, 3.5, -3.0, 6.0, -6.0, 9.25]
SPLIT = list(permutations([0.0, 0.25, 2.5, 2.75]))  # 2:2
NOISY = list(permutations([0.0, 1.25, 2.75, 3.0]))  # 1:1:2, as noise makes it of a 2:2
APART = list(permutations([0.0, 1.5, 3.0, -1.5]))  # 1:1:1:1; with a channel silent 1:1:1
TOGETHER = list(permutations([0.0, 0.25, 0.5, 0.5]))
SLOPES = [0.0, 0.0, 0.125, -0.125, 0.5]
SAYS = list(product(["good", "bad", "absent"], repeat=4))
ONE_GOOD = list(permutations(["good", "bad", "bad", "bad"]))
TWO_GOOD = list(permutations(["good", "good", "bad", "bad"]))
ONE_SIDE = [()]  # a good and a bad pair, as the samples split
NOBODY_SAYS = [("absent",) * 4]
REFERENCES = [None, None, 0.0, 0.25, 3.0, -1.5, 1.5, 6.25]
SECONDS = [*REFERENCES, 3.25, 2.5, -2.0]
NOBODY = [()]
ONE_OR_TWO = [c for n in (1, 2) for c in permutations(range(4), n)]
ALL_BUT_ONE = [*permutations(range(4), 3), (0, 1, 2, 3)]


@dataclass
class Flight:
    settings: Settings
    samples: list[list[float | None]] = field(default_factory=list)
    ilm: list[tuple[str, ...]] = field(default_factory=list)
    references: list[float | None] = field(default_factory=list)
    seconds: list[float | None] = field(default_factory=list)


def some_settings(pick: Pick, turn: bool) -> Settings:
    """Settings of a signal; on a circle no threshold is met exactly, where rounding would decide."""
    beside = 1 / 1024 if turn else 0.0
    return Settings(
        threshold=1.0 + beside,
        persistence=pick(range(1, 8)),
        singular_persistence=pick(range(1, 7)),
        resolvers=tuple(pick(list(permutations(RESOLVERS)))[: pick([5, 5, 4, 3, 2, 1, 0])]),
        trend_frames=pick([1, 2, 3, 4, 8]),
        reference_threshold=pick([0.5, 1.0, 2.0]) + beside,
        second_threshold=pick([0.5, 1.0, 2.0]) + beside,
        common_persistence=pick([1, 2, 3, 10]),
        common_fails=pick([True, False]),
        channels=pick([4] * 6 + [3, 3, 2]),
        turn=2 * np.pi if turn else 0.0,
    )


def build(pick: Pick, turn: bool = False) -> Flight:
    """A flight of one to nine stretches of one to nine frames."""
    flight = Flight(some_settings(pick, turn))
    value = pick([0.0, 3.0, -2.5, 100.0])
    for _ in range(pick(range(1, 10))):
        slope = pick(SLOPES)
        offsets = pick(pick([TOGETHER, SPLIT, NOISY, APART, APART, [None]])) or [pick(LEVELS) for _ in range(4)]
        flags = pick(pick([SAYS, ONE_GOOD, TWO_GOOD, ONE_SIDE, NOBODY_SAYS])) or one_side(offsets, pick([True, False]))
        silent = pick(pick([NOBODY] * 7 + [ONE_OR_TWO, ONE_OR_TWO, ALL_BUT_ONE]))
        offset, second = pick(REFERENCES), pick(SECONDS)
        for _ in range(pick([1, 1, 2, 2, 3, 3, 4, 6, 9])):
            value += slope
            present = set(range(flight.settings.channels)) - set(silent)
            flight.samples.append([value + offsets[c] if c in present else None for c in range(4)])
            flight.ilm.append(flags)
            flight.references.append(None if offset is None else value + offset)
            flight.seconds.append(None if second is None else value + second)
    return flight


def one_side(offsets: Sequence[float], upper: bool) -> tuple[str, ...]:
    """Monitors that say good of the two larger (smaller) samples and bad of the others."""
    return tuple("good" if (x in sorted(offsets)[2:]) == upper else "bad" for x in offsets)


def by_level(flight: Flight, pick: Pick) -> Flight:
    """The same with thresholds of their own for three and for two samples."""
    triplex, duplex = (pick([0.5, 1.5, 2.75, 3.25, None]) for _ in range(2))
    return replace(flight, settings=replace(flight.settings, threshold_triplex=triplex, threshold_duplex=duplex))


def with_outliers(flight: Flight, pick: Pick) -> Flight:
    """The same with thresholds of their own for one of four and of three samples that agree."""
    wide = {"threshold": pick([1.0, 2.0]) + 1 / 1024, "threshold_triplex": pick([None, 3.5])}
    limits = {name: pick([0.25, 0.125, 0.75, None]) for name in ("outlier", "outlier_triplex")}
    return replace(flight, settings=replace(flight.settings, **wide, **limits))


def filtered(flight: Flight, pick: Pick) -> Flight:
    """The same behind a filter; no threshold is met exactly, no reference lies on a sample: rounding would decide."""
    s, beside = flight.settings, 1 / 1024
    more = {name: getattr(s, name) + beside for name in ("threshold", "reference_threshold", "second_threshold")}
    levels = {name: pick([None, 0.5 + beside, 2.0 + beside]) for name in ("threshold_triplex", "threshold_duplex")}
    references = [None if x is None else x + beside / 2 for x in flight.references]
    return replace(
        flight, settings=replace(s, filter_share=pick([0.15, 0.4, 0.9]), **more, **levels), references=references
    )


def lasting(flight: Flight, pick: Pick) -> Flight:
    """The same for longer and with biases, which are learned, summed, or neither; samples may not repeat for ever."""
    s = flight.settings
    more = {
        "bias_bound": pick([0.0, 0.3, 0.9]),
        "bias_share": pick([0.05, 0.3]),
        "slow_allowance": pick([0.10037, 0.30171]),
        "slow_limit": pick([0.0, 0.30713, 1.11131]),
        "stale_frames": pick([0, 3, 12]),
    }
    beside = {name: getattr(s, name) + 1 / 1024 for name in ("threshold", "reference_threshold", "second_threshold")}
    longer = [k for k in range(len(flight.samples)) for _ in range(pick([1, 1, 4, 9]))]
    biases = [pick([0.0, 0.0, 0.203125, 0.453125, -0.453125]) for _ in range(4)]
    samples, ilm, references, seconds = (
        [column[k] for k in longer] for column in (flight.samples, flight.ilm, flight.references, flight.seconds)
    )
    calm = pick([0, 12, 40])  # frames before all that
    rest = [3.0 if c < s.channels else None for c in range(4)]
    samples, ilm = [rest] * calm + samples, [("good",) * 4] * calm + ilm
    references, seconds = [pick([None, 3.0])] * calm + references, [None] * calm + seconds
    samples = [[None if x is None else x + bias for x, bias in zip(row, biases, strict=True)] for row in samples]
    references = [None if x is None else x + 1 / 2048 for x in references]
    return Flight(replace(s, **more, **beside), samples, ilm, references, seconds)


@st.composite
def flights(draw: Any, turn: bool = False) -> Flight:
    return build(lambda choices: draw(st.sampled_from(choices)), turn)


def seeded(seed: int, turn: bool = False) -> Flight:
    return build(random.Random(seed).choice, turn)
