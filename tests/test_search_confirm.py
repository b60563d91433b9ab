"""What becomes of the least robustness: candidates apart, the worst by violations, made simple while it violates."""

import json
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import binom

from rig.core.errors import BadInput
from rig.studies.campaign.statistics import at_most
from rig.studies.search.confirm_worst import Confirmed, Table, confirm, least_apart, worst
from rig.studies.search.objective import NONE, VOTE, Measured, chosen, measured
from rig.studies.search.rounds import Draw
from rig.studies.search.shrink import BACK, MOST, TRIES, shrink, simplest

SEEDS = (11, 12, 13, 14, 15)


def row(robustness: float | None, status: str, vote: float = 0.5, **others: float) -> dict[str, object]:
    told = [("a", robustness, status), (VOTE.id, vote, "met"), *((name, more, "met") for name, more in others.items())]
    keys = ("requirement", "robustness", "status")
    return {"requirements": json.dumps([dict(zip(keys, each, strict=True)) for each in told])}


def test_the_least_requirement_counts_and_the_vote_settles_ties():
    both = row(-1.0, "violated", 0.4, b=2.0)
    assert measured([both], ["a", "b"]) == Measured(-1.0, 0.4, True, ("a",))
    closer, farther = measured([row(1.0, "met", 0.1)], ["a"]), measured([row(1.0, "met", 0.9)], ["a"])
    assert closer.value < farther.value < measured([row(1.001, "met", -1.0)], ["a"]).value


def test_a_flight_that_tells_nothing_is_never_the_worst():
    assert measured([{"outcome": "crashed"}], ["a"]) == Measured(NONE, NONE, False)
    assert measured([row(None, "not applicable")], ["a"]).robustness == NONE


def test_against_another_setting_the_difference_counts_and_the_other_must_meet():
    worse = measured([row(-2.0, "violated"), row(1.0, "met", 0.7)], ["a"])
    assert worse == (-3.0, pytest.approx(-0.2), True, ("a",))
    assert not measured([row(-2.0, "violated"), row(-0.5, "violated")], ["a"]).violated


def test_an_unknown_requirement_is_refused_with_the_nearest():
    with pytest.raises(BadInput, match=r"--requirement 'vot': unknown.*vote"):
        chosen(["vot"])
    assert [each.id for each in chosen(["vote", "vote"])] == ["vote"]


def test_candidates_are_apart_or_of_other_arms():
    points = [0.50, 0.51, 0.65, 0.505, 0.1]
    draws = [Draw(int(i == 3), np.array([share, 0.5])) for i, share in enumerate(points)]
    assert least_apart(draws, [1.0, 0.0, 2.0, 3.0, 4.0]) == [1, 2, 3, 4]


def test_at_most_five_candidates():
    draws = [Draw(i, np.array([0.5])) for i in range(9)]
    assert least_apart(draws, list(range(9, 0, -1))) == [8, 7, 6, 5, 4]


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
    assert simplest([table(), lucky], SEEDS, Fly(MOST)).table == table()
    assert simplest([table(), lucky], SEEDS, Fly(MOST - 1)).violations == MOST - 1
    fly = Fly(MOST)
    simplest([table(), *[lucky] * BACK], SEEDS, fly)
    assert fly.flights == BACK * len(SEEDS)
