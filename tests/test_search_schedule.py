"""The methods of a search: the space of a campaign, what is drawn first, generations over the arms, needles found."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from search_methods import Method, cube, searched

from rig.core.errors import BadInput
from rig.studies.campaign.campaign_file import Campaign, from_what
from rig.studies.search.cma_es import cma, population
from rig.studies.search.regions import regions
from rig.studies.search.rounds import Draw, at_random, first_count
from rig.studies.search.space import arms

TWO = {"a": {"low": 1.0, "high": 100.0, "log": True}, "b": {"low": -1.0, "high": 1.0}}


def campaign(**tables: object) -> Campaign:
    return from_what({"base": {}, "sampling": "random", "runs": 1, **tables}, "c.toml")


def test_an_arm_is_a_combination_of_cases_and_listed_values():
    cases = {"size": [{"name": "small", "vary": TWO}, {"name": "large", "vary": TWO}]}
    made = arms(campaign(vary={"c": [1, 2, 3]}, cases=cases), "c.toml")
    assert [arm.fixed for arm in made] == [{"size": s, "c": c} for s in ("small", "large") for c in (1, 2, 3)]
    assert made[4].name == "large, 2" and made[4].dimensions == 2
    assert made[0].choice(np.array([0.5, 0.0])) == {"size": "small", "c": 1, "a": pytest.approx(10.0), "b": -1.0}


def test_the_far_face_of_the_cube_is_within_the_range():
    whole = arms(campaign(vary={"n": {"low": 1, "high": 3, "whole": True}}), "c.toml")[0]
    assert [whole.choice(np.array([share]))["n"] for share in (0.0, 0.5, 1.0)] == [1, 2, 3]


@pytest.mark.parametrize("vary", [{}, {"a": [1, 2]}])
def test_a_space_without_a_number_is_refused(vary: dict[str, object]):
    with pytest.raises(BadInput, match=r"^c.toml: vary: no number varies"):
        arms(campaign(vary=vary), "c.toml")


def test_a_case_without_a_number_is_named():
    cases = {"size": [{"name": "small", "vary": TWO}, {"name": "none"}]}
    with pytest.raises(BadInput, match="no number varies with none"):
        arms(campaign(cases=cases), "c.toml")


@pytest.mark.parametrize(
    ("arms_of", "draws", "count"),
    [(3, 60, 24), (3, 240, 24), (3, 241, 25), (3, 1000, 100), (16, 240, 64), (16, 100, 50), (99, 9, 9)],
)
def test_a_tenth_and_at_least_24_draws_come_first_and_four_of_each_arm_up_to_half(arms_of: int, draws: int, count: int):
    assert first_count(cube(arms_of), draws) == count


@pytest.mark.parametrize("method", [at_random, cma, regions])
@pytest.mark.parametrize(("arms_of", "draws"), [(1, 1), (1, 30), (3, 61), (30, 20)])
def test_every_method_uses_all_draws_within_the_cube(method: Method, arms_of: int, draws: int):
    lists, values = searched(cube(arms_of), draws, lambda draw: -float(draw.point.sum()), 0, method)
    points = np.array([draw.point for asked in lists for draw in asked])
    assert len(values) == len(points) == draws and points.min() >= 0.0 and points.max() <= 1.0


@pytest.mark.parametrize("method", [at_random, cma, regions])
def test_which_arms_too_few_draws_leave_out_depends_on_the_seed(method: Method):
    tried = [{draw.arm for draw in searched(cube(30), 8, lambda _: 0.0, seed, method)[0][0]} for seed in range(2)]
    assert tried[0] != tried[1] and [len(arms_tried) for arms_tried in tried] == [8, 8]


@pytest.mark.parametrize("method", [at_random, cma, regions])
def test_what_a_method_draws_depends_on_its_seed_and_the_results_alone(method: Method):
    np.random.seed(3)  # numpy's global generator, which a package may share
    before = np.random.get_state(legacy=False)
    runs = [searched(cube(2), 48, lambda draw: float((draw.point**2).sum()), seed, method) for seed in (0, 0, 1)]
    assert runs[0][1] == runs[1][1] != runs[2][1]
    assert str(before) == str(np.random.get_state(legacy=False))


@pytest.mark.parametrize(("method", "near"), [(cma, 1e-3), (regions, 1e-2)])
def test_a_search_of_one_number_is_possible(method: Method, near: float):
    _, values = searched(cube(1, 1), 120, lambda draw: abs(float(draw.point[0]) - 0.7), 0, method)
    assert min(values) < near


def test_the_worse_half_of_the_arms_rests_and_in_every_fourth_generation_none():
    lists, _ = searched(cube(4), 400, lambda draw: draw.arm + draw.point.sum() / 100.0, 0, cma)
    active = [sorted({draw.arm for draw in asked}) for asked in lists[1:9]]
    assert active == [[0, 1, 2, 3], [0, 1], [0, 1], [0, 1]] * 2
    assert {len(asked) for asked in lists[1:9]} == {2 * population(5), 4 * population(5)}


def needle(seed: int) -> tuple[Callable[[Draw], float], float]:
    """A ball of 1 in 2,000 of one of two cubes of five dimensions, and its share of all points."""
    rng = np.random.default_rng(seed)
    volume = math.pi**2.5 / math.gamma(3.5)
    radius = (1e-3 / volume) ** 0.2
    centre, arm = radius + rng.random(5) * (1.0 - 2.0 * radius), seed % 2
    return lambda draw: float(np.linalg.norm(draw.point - centre)) - radius + 0.3 * (draw.arm != arm), 0.5e-3


def needles_found(method: Method, seeds: range) -> int:
    """How many needles 600 draws of a method find."""
    found = 0
    for seed in seeds:
        value, share = needle(seed)
        assert share < 1e-3
        found += min(searched(cube(2), 600, value, seed, method)[1]) < 0.0
    return found


def test_of_four_needles_with_a_slope_three_are_found_in_600_flights():
    few = range(7, 11)  # which chance leaves out
    assert needles_found(cma, few) >= 3 and needles_found(at_random, few) == 0


@pytest.mark.long
def test_of_twenty_needles_with_a_slope_eighteen_are_found_in_600_flights():
    assert needles_found(cma, range(20)) >= 18 and needles_found(at_random, range(20)) < 10
