"""The method of regions: rounds, regions that are left, arms that each get a share, plateaus, signals in pieces."""

import re
from functools import partial

import numpy as np
import pytest
from search_methods import cube, searched, searched_to_the_end

from rig.studies.search.cma_es import cma
from rig.studies.search.regions import ROUND, regions
from rig.studies.search.rounds import NEAR, Draw, at_random

SEEDS = (0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2)))


def distance(draw: Draw, place: float) -> float:
    return float(np.linalg.norm(draw.point - place))


def test_rounds_are_of_eight_and_the_last_uses_up_what_is_left():
    lists, _ = searched(cube(1), 61, lambda draw: distance(draw, 0.3))
    assert [len(asked) for asked in lists] == [24, ROUND, ROUND, ROUND, ROUND, 5]


def test_a_region_is_left_when_it_has_enough_finds():
    lists, _ = searched(cube(1, 6), 120, lambda draw: distance(draw, 0.2) - 0.5)
    near = [sum(distance(draw, 0.2) < NEAR for draw in asked) for asked in lists]
    assert sum(near) > 24 and near[-1] < ROUND / 2


@pytest.mark.parametrize("seed", SEEDS)
def test_where_one_region_is_all_there_is_the_search_comes_back_to_it(seed: int):
    _, values = searched(cube(1, 6), 240, lambda draw: distance(draw, 0.4) - 0.3, seed)
    assert sum(value < 0.0 for value in values) >= 72  # 24 fill it


@pytest.mark.parametrize("seed", SEEDS)
def test_of_sixteen_arms_the_one_that_violates_is_found(seed: int):
    value = lambda draw: distance(draw, 0.4) - 0.35 + 2.0 * (draw.arm != 11)  # noqa: E731
    lists, values = searched(cube(16), 240, value, seed)
    assert {draw.arm for draw in lists[0]} == set(range(16)) and min(values) < 0.0


def test_arms_that_the_first_draws_leave_out_are_tried_before_any_is_tried_again_by_chance():
    lists, _ = searched(cube(40), 60, lambda draw: float(draw.arm))
    assert len({draw.arm for draw in lists[0]}) == 30
    assert len({draw.arm for asked in lists for draw in asked}) == 40


def test_without_a_slope_it_draws_by_chance_and_learns_nothing_from_a_plateau():
    lists, _ = searched(cube(1, 2), 120, lambda draw: float(draw.point.max() < 0.999))
    points = np.array([draw.point for asked in lists for draw in asked])
    counts = np.histogram2d(points[:, 0], points[:, 1], bins=2, range=[[0, 1], [0, 1]])[0]
    assert counts.min() >= 20  # of 30 in each quarter


@pytest.mark.parametrize("value", [-1.0, 1.0])
def test_where_every_draw_is_alike_the_search_ends(value: float):
    assert len(searched(cube(1, 1), 120, lambda _: value)[1]) == 120


def test_a_signal_is_first_drawn_in_one_two_and_four_equal_parts():
    lists, _ = searched(cube(1, 4), 24, lambda _: 0.0, method=partial(regions, pieces=[range(4)]))
    parts = [len(set(draw.point)) for draw in lists[0]]
    assert parts == [1, 2, 4] * 8


def test_stretches_of_a_signal_move_together_and_reach_corners():
    held = lambda draw: -float(draw.point[:6].min())  # noqa: E731
    _, values = searched(cube(1, 8), 160, held, method=partial(regions, pieces=[range(8)]))
    assert min(values) < -0.9  # six pieces above it are 1 in a million


def test_the_end_of_a_search_tells_why_each_region_was_left():
    many = lambda draw: distance(draw, 0.2) - 0.5  # noqa: E731
    none = lambda draw: 1.0 + distance(draw, 0.2)  # noqa: E731
    asked = ((6, 80, many), (1, 80, none), (1, 200, lambda _: -1.0))
    told = [searched_to_the_end(cube(1, dimensions), draws, value)[2] for dimensions, draws, value in asked]
    full = r"regions: \d+ full with 24 violations or more, the last is open with \d+ violations"
    poor = r"regions: \d+ closed after 4 poor rounds, the last is open with 0 violations"
    again = r"regions: .*open with \d+ violations; full ones were opened again, and are now full with (\d+)"
    assert re.fullmatch(full, told[0]) and re.fullmatch(poor, told[1])
    assert (of := re.fullmatch(again, told[2])) and int(of[1]) % 24 == 0


def test_a_method_that_does_not_choose_has_nothing_to_tell():
    assert searched_to_the_end(cube(2), 30, slope, method=at_random)[2] == ""
    assert searched_to_the_end(cube(2), 24, slope)[2] == ""  # the first draws alone
    assert searched_to_the_end(cube(2), 60, slope, method=cma)[2].startswith("CMA-ES began 2 times")


def slope(draw: Draw) -> float:
    return float(draw.point.sum())
