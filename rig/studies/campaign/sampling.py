"""Choose the values of each run: points of the unit cube, or of a grid, mapped to the values of the varied keys.

Every key of ``vary`` and every group of cases is one dimension; keys that vary within cases share the dimensions
after that of their group.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import islice, product
from typing import Any, Final

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.studies.campaign.campaign_file import Campaign, Case, Distribution, Levels, Vary

_POINTS: Final = 0  # spawn keys of a campaign's seed: where the points are drawn from,
_RUNS: Final = 1  # and above it the runs' own seeds
Choice = dict[str, Any]  # the varied keys of a run, and the names of its cases by group
Valuer = Callable[[float], Any]


def seed_of(campaign: Campaign, run: int) -> int:
    """Return the seed of one run's flight, from the campaign's seed and the run's number alone."""
    state = SeedSequence(campaign.seed, spawn_key=(_RUNS, run)).generate_state(1, np.uint64)
    return int(state[0]) >> 1


def choices(campaign: Campaign) -> list[Choice]:
    """Return the varied values of each run, in the order of the runs."""
    if campaign.sampling == "stratified":
        return _stratified(campaign)
    if campaign.sampling != "grid":
        return _sampled(campaign)
    grid = [_joined(parts) for parts in islice(product(*_axes(campaign)), campaign.runs)]
    count = campaign.runs or len(grid)
    return [grid[run % len(grid)] for run in range(count)]  # beyond the grid: around again, with new seeds


def round_of(campaign: Campaign) -> int | None:
    """Return the number of runs of a round; every round has the same grid or combinations of cases.

    1: every run is drawn alone; None: the points of all runs depend on each other.
    """
    if campaign.sampling == "grid":
        return math.prod(map(len, _axes(campaign)))
    if campaign.sampling == "stratified":
        return math.prod(map(len, campaign.cases.values()))
    return 1 if campaign.sampling == "random" else None


def _axes(campaign: Campaign) -> Iterator[list[Choice]]:
    for name, cases in campaign.cases.items():
        yield [{name: case.name, **inside} for case in cases for inside in _inside(case)]
    for key, vary in campaign.vary.items():
        yield [{key: value} for value in levels(vary)]


def _inside(case: Case) -> list[Choice]:
    """Return the points of the grid within a case."""
    axes = ([{key: value} for value in levels(vary)] for key, vary in case.vary.items())
    return [_joined(parts) for parts in product(*axes)]


def _joined(parts: tuple[Choice, ...]) -> Choice:
    return {key: value for part in parts for key, value in part.items()}


def levels(vary: Vary) -> list[Any]:
    """Return the values of a grid's axis."""
    if isinstance(vary, Levels):
        return vary.values
    count = vary.levels or 1
    value = valuer(vary)
    if isinstance(vary, Distribution):
        return [value((i + 0.5) / count) for i in range(count)]
    if count == 1:
        return [value(0.5)]
    points = (np.geomspace if vary.log else np.linspace)(vary.low, vary.high, count).tolist()
    return [round(point) for point in points] if vary.whole else points


def valuer(vary: Vary) -> Valuer:
    """Return the quantile of a varied key for a share (0 to 1, excluded)."""
    if isinstance(vary, Levels):
        values, count = vary.values, len(vary.values)
        return lambda share: values[int(share * count)]
    if isinstance(vary, Distribution):
        (below, above), inverse = vary.shares(), vary.frozen().ppf  # made once: each takes longer than a value
        return lambda share: float(np.clip(inverse(below + share * (above - below)), vary.low, vary.high))
    low = vary.low
    if vary.whole:
        first, many = int(low), int(vary.high) - int(low) + 1
        return lambda share: first + int(share * many)
    if vary.log:
        ratio = vary.high / low
        return lambda share: float(low * ratio**share)
    span = vary.high - low
    return lambda share: float(low + share * span)


def _sampled(campaign: Campaign) -> list[Choice]:
    """Map the points of the unit cube to choices."""
    points = _points(campaign)
    valuers = {id(vary): valuer(vary) for _, vary in campaign.varied()}
    if campaign.cases or not campaign.vary:
        return _of_cases(campaign, points, valuers)
    columns = zip(campaign.vary.values(), points.T.tolist(), strict=True)
    values = [map(valuers[id(vary)], shares) for vary, shares in columns]
    return [dict(zip(campaign.vary, row, strict=True)) for row in zip(*values, strict=True)]


def _stratified(campaign: Campaign) -> list[Choice]:
    """Choose every combination of the cases in turn, the last group fastest; draw the other keys for each run."""
    turns = [[case.name for case in cases] for cases in campaign.cases.values()]
    count = math.prod(map(len, turns))
    valuers = {id(vary): valuer(vary) for _, vary in campaign.varied()}
    points = _points(campaign)
    for column, names in enumerate(turns):
        count //= len(names)
        points[:, column] = (np.arange(len(points)) // count % len(names) + 0.5) / len(names)
    return _of_cases(campaign, _in_order(campaign, points), valuers)


def _in_order(campaign: Campaign, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move the columns of the cases, the first of ``points``, each before the columns of its group's own keys."""
    order, rest = [], len(campaign.cases)
    for column, cases in enumerate(campaign.cases.values()):
        depth = _depth(cases)
        order += [column, *range(rest, rest + depth)]
        rest += depth
    return points[:, [*order, *range(rest, points.shape[1])]]


def _of_cases(campaign: Campaign, points: NDArray[np.float64], valuers: dict[int, Valuer]) -> list[Choice]:
    """Map points of the unit cube to choices, if there are cases."""
    depths = [_depth(cases) for cases in campaign.cases.values()]
    return [_at(campaign, point, depths, valuers) for point in points.tolist()]


def _at(campaign: Campaign, point: list[float], depths: list[int], valuers: dict[int, Valuer]) -> Choice:
    rest = iter(point)
    chosen: Choice = {}
    for (name, cases), depth in zip(campaign.cases.items(), depths, strict=True):
        case = cases[int(next(rest) * len(cases))]
        shares = [next(rest) for _ in range(depth)]
        chosen[name] = case.name
        inside = zip(case.vary.items(), shares, strict=False)  # a case may vary fewer keys than its group's most
        chosen |= {key: valuers[id(vary)](share) for (key, vary), share in inside}
    return chosen | {key: valuers[id(vary)](next(rest)) for key, vary in campaign.vary.items()}


def _depth(cases: list[Case]) -> int:
    return max(len(case.vary) for case in cases)


def _points(campaign: Campaign) -> NDArray[np.float64]:
    """Draw (runs, dimensions) points of the unit cube."""
    runs = campaign.runs or 1
    dimensions = len(campaign.vary) + sum(1 + _depth(cases) for cases in campaign.cases.values())
    rng = np.random.default_rng(SeedSequence(campaign.seed, spawn_key=(_POINTS,)))
    if campaign.sampling in ("random", "stratified") or dimensions == 0:
        return rng.random((runs, dimensions))
    from scipy.stats import qmc  # half a second, which no worker needs

    if campaign.sampling == "latin-hypercube":
        return qmc.LatinHypercube(dimensions, rng=rng).random(runs)
    power = max(0, (runs - 1).bit_length())  # Sobol's points are balanced in powers of two
    return qmc.Sobol(dimensions, rng=rng).random_base2(power)[:runs]
