"""Clusters of violating points: those of one arm around a best point.  Nothing here needs a campaign or a flight."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from rig.studies.search.rounds import Draw, radius

APART: Final = 0.1  # between two points of a cluster of which one is chosen


class Cluster(NamedTuple):
    """The violating draws around a best one."""

    arm: int
    places: tuple[int, ...]  # among the draws, the smallest value first


def clusters(draws: Sequence[Draw], values: Sequence[float], violated: Sequence[bool]) -> list[Cluster]:
    """Return the clusters, of each arm the worst first, then the second of each.

    From the smallest value on, a violating point begins a cluster or belongs to the nearest one that begins within
    ``radius``.  No two clusters of an arm begin nearer to each other.
    """
    made: list[list[int]] = []
    for i in _ranked(values, (i for i, found in enumerate(violated) if found)):
        apart = [(_apart(draws, of[0], i), k) for k, of in enumerate(made) if draws[of[0]].arm == draws[i].arm]
        nearest = min(apart, default=(math.inf, -1))
        if nearest[0] <= radius(len(draws[i].point)):
            made[nearest[1]].append(i)
        else:
            made.append([i])
    return list(_in_turn(Cluster(draws[of[0]].arm, tuple(of)) for of in made))


def apart(draws: Sequence[Draw], places: Iterable[int], most: int) -> list[int]:
    """Return the first ``most`` of the places whose points are APART from those before."""
    kept: list[int] = []
    for i in places:
        if len(kept) < most and all(_apart(draws, k, i) >= APART for k in kept):
            kept.append(i)
    return kept


def _ranked(values: Sequence[float], places: Iterable[int]) -> list[int]:
    return sorted(places, key=lambda i: (values[i], i))


def _apart(draws: Sequence[Draw], a: int, b: int) -> float:
    return float(np.linalg.norm(draws[a].point - draws[b].point))


def _in_turn(ranked: Iterable[Cluster]) -> Iterator[Cluster]:
    """Yield the clusters by their rank within their arm; those of one rank stay in order."""
    of_rank: dict[int, list[Cluster]] = {}
    drawn: dict[int, int] = {}
    for each in ranked:
        rank = drawn[each.arm] = drawn.get(each.arm, -1) + 1
        of_rank.setdefault(rank, []).append(each)
    for several in of_rank.values():
        yield from several
