"""What a draw is worth, and what becomes of a find: the worst by violations, made simple while it violates."""

import json
from collections.abc import Sequence

import pytest
from scipy.stats import binom

from rig.core.errors import BadInput
from rig.studies.campaign.statistics import at_most
from rig.studies.search.confirm_worst import Confirmed, Table, confirm, counting, worst
from rig.studies.search.objective import NONE, STEEPEST, VOTE, Measured, chosen, measured, slope_of
from rig.studies.search.shrink import BACK, MOST, TRIES, shrink, simplest
from rig.verdict.requirements.requirement import Requirement, find_requirements, load_requirements, names

SEEDS = (11, 12, 13, 14, 15)


FLAT = STEEPEST  # of a requirement without a slope


def row(robustness: float | None, status: str, vote: float = 0.5, **others: float) -> dict[str, object]:
    told = [("a", robustness, status), (VOTE.id, vote, "met"), *((name, more, "met") for name, more in others.items())]
    keys = ("requirement", "robustness", "status")
    return {"requirements": json.dumps([dict(zip(keys, each, strict=True)) for each in told])}


def test_the_least_requirement_counts_and_the_vote_settles_ties():
    both = row(-1.0, "violated", 0.4, b=2.0)
    assert measured([both], ["a", "b"]) == Measured(-1.0, 0.4 + FLAT, True, ("a",))
    closer, farther = measured([row(1.0, "met", 0.1)], ["a"]), measured([row(1.0, "met", 0.9)], ["a"])
    assert closer.value < farther.value < measured([row(1.001, "met", -1.0)], ["a"]).value


def test_a_flight_that_tells_nothing_is_never_the_worst():
    assert measured([{"outcome": "crashed"}], ["a"]) == Measured(NONE, NONE + FLAT, False)
    assert measured([row(None, "not applicable")], ["a"]).robustness == NONE


def test_against_another_setting_the_difference_counts_and_the_other_must_meet():
    worse = measured([row(-2.0, "violated"), row(1.0, "met", 0.7)], ["a"])
    assert worse == (-3.0, pytest.approx(-0.2), True, ("a",))
    assert not measured([row(-2.0, "violated"), row(-0.5, "violated")], ["a"]).violated


def formula_of_slope(formula: str, at: str = "start") -> str | None:
    slope = slope_of(Requirement.model_validate({"id": "x", "at": at, "formula": formula}))
    return None if slope is None else slope.formula


def test_a_yes_or_no_gets_the_slope_of_its_persistence_count_and_of_the_way_to_the_limits():
    each = "always[0, 20] not failed.{signal}.{channel}"
    assert formula_of_slope(each) == "always[0, 20] not (count.{signal}.{channel} >= 1)"
    assert formula_of_slope("always[0, 5] not lost") == "always[0, 5] not (departure < 0)"
    in_use = "min(level.heading, 4 - count.heading.1 - count.heading.2 - count.heading.3 - count.heading.4)"
    assert formula_of_slope("state(level.heading >= 1)") == f"({in_use} >= 1)"
    assert "count.{signal}.2" in str(formula_of_slope("not healthy.{signal}.1", at="each loss"))


@pytest.mark.parametrize("formula", ["not baseline.failed.heading.1", "healthy.heading.2"])
def test_what_has_no_persistence_has_no_slope(formula: str):
    assert formula_of_slope(formula) is None


def test_the_bundled_requirements_with_numbers_need_no_slope():
    with_numbers = load_requirements([*map(find_requirements, names())])
    assert [each.id for each in with_numbers if slope_of(each) is not None] == ["fail_operational"]


def test_a_formula_that_is_too_long_with_its_slope_has_none():
    long = " and ".join(f"not failed.heading.{1 + i % 4}" for i in range(60))
    assert formula_of_slope(long) is None


def test_a_slope_settles_what_the_vote_does_not_and_never_the_verdict():
    near, far = (measured([row(1.0, "met", 0.5, **{"a-slope-of-search": s})], ["a"]) for s in (0.1, 0.9))
    assert near.value < far.value and not near.violated
    violated = measured([row(1.0, "met", 0.5, **{"a-slope-of-search": -0.1})], ["a"])
    assert not violated.violated and violated.robustness == 1.0


def test_an_unknown_requirement_is_refused_with_the_nearest():
    with pytest.raises(BadInput, match=r"--requirement 'vot': unknown.*vote"):
        chosen(["vot"])
    assert [each.id for each in chosen(["vote", "vote"])] == ["vote"]


def test_most_violations_are_worst_then_the_least_median_margin():
    def of(*robustness: float) -> Confirmed:
        return Confirmed({}, SEEDS[: len(robustness)], tuple(Measured(m, 0.0, m < 0.0) for m in robustness))

    lucky, steady, steadier = of(-9.0, 1.0, 1.0), of(-0.1, -0.2, 1.0), of(-0.3, -0.4, 1.0)
    assert worst([lucky, steady, steadier]) is steadier
    assert lucky.seed == SEEDS[0] and of(0.5, -0.1, -0.2).seed == SEEDS[2]


@pytest.mark.parametrize(("count", "trials"), [(0, 24), (3, 24), (10, 600)])
def test_the_bound_is_exact_and_of_one_side(count: int, trials: int):
    assert binom.cdf(count, trials, at_most(count, trials)) == pytest.approx(0.05, abs=1e-9)
    assert at_most(0, 24) == pytest.approx(0.117, abs=5e-4) and at_most(24, 24) == 1.0


def table(**changes: object) -> Table:
    offset = {"kind": "offset", "signal": "pitch_rate", "channels": [1], "start_s": 2.12345, "offset": 0.4321}
    drift = {"kind": "drift", "signal": "pitch_rate", "channels": [2], "start_s": 2.5, "rate_per_s": 0.031}
    pilot = {"autopilot_engaged": True, "manoeuvres": [{"kind": "doublet"}]}
    return {"duration_s": 20.0, "turbulence": "light", "pilot": pilot, "faults": [offset, drift], **changes}


class Fly:
    """Violates on ``most`` of five seeds while the offset is above 0.1 and begins before 5 s."""

    def __init__(self, most: int) -> None:
        self.most, self.flights = most, 0

    def __call__(self, tables: Sequence[Table]) -> list[Measured]:
        self.flights += len(tables)
        return [Measured(0.0, 0.0, self._violates(each)) for each in tables]

    def _violates(self, each: Table) -> bool:
        offsets = [fault for fault in each["faults"] if fault["kind"] == "offset"]
        held = bool(offsets) and offsets[0]["offset"] > 0.1 and offsets[0]["start_s"] < 5.0
        return held and SEEDS.index(each["seed"]) < self.most


def test_a_case_is_shrunk_to_what_it_needs():
    simple = shrink(table(), SEEDS, Fly(MOST))[-1]
    assert len(simple["faults"]) == 1 and simple["pilot"] == {"autopilot_engaged": True, "manoeuvres": []}
    fault = simple["faults"][0]
    assert 0.1 < fault["offset"] < 0.13 and 4.0 < fault["start_s"] < 5.0 and simple["turbulence"] == "none"
    assert all(float(f"{fault[key]:.2g}") == fault[key] for key in ("offset", "start_s"))


def test_nothing_is_shrunk_that_does_not_violate_on_most_seeds():
    fly = Fly(MOST - 1)
    assert shrink(table(), SEEDS, fly) == [table()] and fly.flights <= TRIES * len(SEEDS)


def test_a_confirmed_scenario_has_its_seeds():
    flown = confirm([table(), table(faults=[])], SEEDS, Fly(4))
    assert [each.violations for each in flown] == [4, 0] and flown[0].seed == SEEDS[0]


def test_a_step_that_holds_by_luck_is_undone_on_other_seeds():
    lucky = table(turbulence="none", faults=[])
    held = table(turbulence="none")
    assert simplest([table(), held, lucky], SEEDS, counting(Fly(MOST))) == held
    fly = Fly(MOST - 1)
    assert simplest([table(), *[held] * (BACK + 1)], SEEDS, counting(fly)) == table()
    assert fly.flights == BACK * len(SEEDS)


def test_no_fault_at_all_is_tried_first():
    always = lambda tables: [Measured(-1.0, 0.0, True) for _ in tables]  # noqa: E731
    assert shrink(table(), SEEDS, always)[1] == table(faults=[])


def test_no_more_seeds_are_flown_than_a_step_takes():
    fly = Fly(0)
    shrink(table(), SEEDS, fly)
    tried = fly.flights // MOST
    assert fly.flights == tried * MOST and 5 < tried <= TRIES
