"""The schedule of a search: the space of a campaign, random draws first, rounds over the arms, needles found."""

import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.studies.campaign.campaign_file import Campaign, from_what
from rig.studies.search.cma_es import Strategy, population
from rig.studies.search.rounds import Draw, Method, random_count, schedule
from rig.studies.search.space import Arm, arms

TWO = {"a": {"low": 1.0, "high": 100.0, "log": True}, "b": {"low": -1.0, "high": 1.0}}


def campaign(**tables: object) -> Campaign:
    return from_what({"base": {}, "sampling": "random", "runs": 1, **tables}, "c.toml")


def cube(count: int, dimensions: int = 5) -> list[Arm]:
    return [Arm({"arm": str(i)}, {f"x{j}": lambda share: share for j in range(dimensions)}) for i in range(count)]


def searched(
    space: Sequence[Arm], draws: int, value: Callable[[Draw], float], seed: int = 0, method: Method = "cma"
) -> tuple[list[list[Draw]], list[float]]:
    """All lists of draws that a schedule asks for, and all values."""
    coming, lists, values = schedule(space, draws, seed, method), [], []
    asked = next(coming)
    while True:
        lists.append(asked)
        new = [value(draw) for draw in asked]
        values += new
        try:
            asked = coming.send(new)
        except StopIteration:
            return lists, values


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


@pytest.mark.parametrize(("draws", "count"), [(60, 24), (240, 24), (241, 25), (1000, 100)])
def test_a_tenth_and_at_least_24_draws_are_random(draws: int, count: int):
    assert random_count(cube(3), draws) == count


def test_too_few_flights_for_the_arms_or_for_a_generation_are_refused():
    with pytest.raises(BadInput, match=r"24 random draws over 8 arms are fewer than 5 each; give 400"):
        random_count(cube(8), 200)
    with pytest.raises(BadInput, match=r"30 draws are too few for 24 random ones and a population of 8"):
        random_count(cube(1), 30)
    assert random_count(cube(8), 40, "random") == 40


def test_the_worse_half_rests_and_every_fourth_round_all_fly():
    lists, _ = searched(cube(4), 600, lambda draw: draw.arm + draw.point.sum() / 100.0)
    rounds = [sorted({draw.arm for draw in asked}) for asked in lists[1:17]]
    in_turn = [[0, 1, 2, 3], [0, 1], [0], [0]]
    assert rounds == [active for active in [*in_turn, *in_turn] for _ in range(2)]


def test_generations_are_whole_and_no_flight_is_beyond_the_budget():
    lists, values = searched(cube(3), 321, lambda draw: float(draw.point.sum()))
    assert 321 - population(5) < len(values) <= 321
    for asked in lists[1:]:
        sizes = Counter(draw.arm for draw in asked).values()
        assert all(size in [population(5) << doubled for doubled in range(4)] for size in sizes)


def test_points_stay_within_the_cube():
    lists, _ = searched(cube(1), 300, lambda draw: -float(draw.point.sum()))  # the best is a corner
    points = np.array([draw.point for asked in lists for draw in asked])
    assert points.min() >= 0.0 and points.max() <= 1.0 and points[-5:].mean() > 0.9


def test_a_schedule_depends_on_its_seed_alone():
    np.random.seed(3)  # numpy's global generator, which the package would share
    before = np.random.get_state(legacy=False)
    runs = [searched(cube(2), 200, lambda draw: float((draw.point**2).sum()), seed) for seed in (0, 0, 1)]
    assert runs[0][1] == runs[1][1] != runs[2][1]
    assert str(before) == str(np.random.get_state(legacy=False))


def test_a_search_of_one_number_is_possible():
    _, values = searched(cube(1, 1), 120, lambda draw: abs(float(draw.point[0]) - 0.7))
    assert min(values) < 1e-3


def test_a_strategy_that_stagnates_begins_at_the_next_start_with_a_doubled_population():
    starts = [np.full(2, 0.5), np.full(2, 0.1)]
    strategy = Strategy(starts, 0, 0)
    sizes = []
    while len(sizes) < 200 and (not sizes or sizes[-1] == population(2)):
        asked = strategy.ask()
        sizes.append(len(asked))
        strategy.tell([1.0] * len(asked))
    assert sizes[-1] == 2 * population(2)


def needle(seed: int) -> tuple[Callable[[Draw], float], float]:
    """A ball of 1 in 2,000 of one of two cubes of five dimensions, and its share of all points."""
    rng = np.random.default_rng(seed)
    volume = math.pi**2.5 / math.gamma(3.5)
    radius = (1e-3 / volume) ** 0.2
    centre, arm = radius + rng.random(5) * (1.0 - 2.0 * radius), seed % 2
    return lambda draw: float(np.linalg.norm(draw.point - centre)) - radius + 0.3 * (draw.arm != arm), 0.5e-3


def test_of_twenty_needles_with_a_slope_eighteen_are_found_in_600_flights():
    found = dict.fromkeys(("cma", "random"), 0)
    for seed in range(20):
        value, share = needle(seed)
        assert share < 1e-3
        for method in found:
            found[method] += min(searched(cube(2), 600, value, seed, method)[1]) < 0.0
    assert found["cma"] >= 18 and found["random"] < 10
