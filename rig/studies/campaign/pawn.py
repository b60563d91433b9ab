"""PAWN indices: the effect of each input of given data on an output, with intervals and the level of pure noise.

The index of an input is the median, over groups of rows in which the input is about the same, of the distance
(Kolmogorov and Smirnov) between the distribution of the output in the group and in all rows: 0 to 1.  It needs no
special design, takes outputs of two values, counts and long tails, and inputs that are names.  The groups of a
number are slices with about the same number of rows, those of names and of few numbers their levels.

Sources: Pianosi and Wagener, Environmental Modelling & Software 67 (2015) 1-11 and 108 (2018) 197-207.  SALib's PAWN
has the same distances (tests/test_campaign_sensitivity.py), but splits levels, and leaves out the largest value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.progress import tell
from rig.studies.campaign.group_rates import MOST_LEVELS

SLICES: Final = 10  # of a number, of at least LEAST_ROWS
LEAST_ROWS: Final = 20
RESAMPLES: Final = 500  # for the interval
SHUFFLES: Final = 200  # for the floor
DUMMY: Final = "dummy"  # an input of random numbers, which drives nothing
_ENDS: Final = (2.5, 97.5)  # per cent
Codes = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Index:
    """The index of one input.

    low, high : 95 %, by resampled rows, without the shift that resampling adds
    floor     : that 95 % of the indices do not exceed when the values of the input are shuffled
    largest   : distance of the group that differs most
    """

    name: str
    groups: int
    rows: int
    index: float
    low: float
    high: float
    floor: float
    largest: float

    @property
    def is_above_floor(self) -> bool:
        """Return True if noise alone would hardly reach the index."""
        return self.index > self.floor


def slices(values: Floats) -> Codes:
    """Return the group of each number (n,): its level if there are few, else its slice; -1 where it is not finite."""
    finite = np.isfinite(values)
    levels = np.unique(values[finite])
    codes = np.full(len(values), -1, np.int64)
    if len(levels) <= MOST_LEVELS:
        codes[finite] = np.searchsorted(levels, values[finite])
        return codes
    count = int(np.clip(finite.sum() // LEAST_ROWS, 2, SLICES))
    edges = np.quantile(values[finite], np.arange(1, count) / count)
    codes[finite] = np.searchsorted(np.unique(edges), values[finite], side="right")
    return codes


def indices(inputs: Mapping[str, Codes], output: Floats, seed: int = 0) -> list[Index]:
    """Return the index of each input, and of a dummy one, the largest first.

    inputs : groups (n,) of the rows, by name; -1: the row does not have the input, and is left out for it
    output : (n,), finite
    """
    numbers = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,))).random(len(output))
    every = {**inputs, DUMMY: slices(numbers)}
    found = []
    for place, (name, codes) in enumerate(every.items()):
        tell(f"{name} ({place + 1} of {len(every)})")
        has = codes >= 0
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, place)))
        found.append(_index(name, codes[has], output[has], rng))
    return sorted(found, key=lambda each: -each.index)


def _index(name: str, codes: Codes, output: Floats, rng: np.random.Generator) -> Index:
    apart = distances(codes, output)
    value = float(np.median(apart))
    picks = (rng.integers(0, len(output), len(output)) for _ in range(RESAMPLES))
    again = np.array([np.median(distances(codes[pick], output[pick])) for pick in picks])
    shuffled = [np.median(distances(rng.permutation(codes), output)) for _ in range(SHUFFLES)]
    low, high = np.clip(np.percentile(again, _ENDS) - (again.mean() - value), 0.0, 1.0)
    floor = float(np.quantile(shuffled, 0.95))
    return Index(name, len(apart), len(output), value, float(low), float(high), floor, float(apart.max()))


def distances(codes: Codes, output: Floats) -> Floats:
    """Return the distance of each group (groups,) from all rows; one group alone has the distance 0."""
    order = np.argsort(output)
    ordered = output[order]
    ends = np.append(ordered[1:] != ordered[:-1], True)  # the last of equal outputs
    groups, group = np.unique(codes, return_inverse=True)
    within = np.cumsum(group[order, np.newaxis] == np.arange(len(groups)), axis=0)
    shares = within[ends] / within[-1] - (np.flatnonzero(ends) + 1.0)[:, np.newaxis] / len(output)
    return np.abs(shares).max(axis=0)
