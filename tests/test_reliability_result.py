"""Constructed tables with known counts: the hand-computed chance, probability per flight hour and interval."""

from math import comb

import numpy as np
import polars as pl
import pytest
from scipy.stats import beta as beta_distribution

from rig.studies.reliability.chain import transitions
from rig.studies.reliability.model import Given, after_flights, one_flight, perfect, rates
from rig.studies.reliability.next_fault import OUTCOMES, outcomes
from rig.studies.reliability.per_hour import Estimate, against, cases, in_series, results
from rig.studies.reliability.rates_file import Layer, SignalRates
from rig.studies.reliability.tally import Cells

LAMBDA, TAU_H = 1e-3, 0.1 / 3600.0


def certain(bad: dict[tuple[str, int], float]) -> Given:
    """Cells whose chance of an undetected error is known exactly; no false isolation."""
    cells = {("single", good): 0.0 for good in (4, 3, 2)} | {("single", 1): 1.0, ("near", 4): 0.0, ("near", 3): 0.0}
    cells |= {("near", 2): 0.0, ("alike", 4): 0.0, ("alike", 3): 0.0, ("alike", 2): 0.0} | bad
    u = {cell: np.array([[1.0 - chance, 0.0, 0.0, chance, 0.0]]) for cell, chance in cells.items()}
    return Given(u, {}, {level: np.zeros(1) for level in (4, 3, 2, 1)}, TAU_H)


def lost(given: Given, n: int = 4, beta: float = 0.0, hours: float = 1.0) -> float:
    return float(after_flights(one_flight(rates(n, LAMBDA, beta, given), n, hours), hours, 1).sum())


@pytest.mark.parametrize(
    ("cell", "chance", "expected"),
    [(("single", 4), 1e-3, 3.992e-06), (("single", 3), 1e-2, 5.985e-08), (("single", 2), 0.2, 7.989e-10)],
)
def test_one_weakness_alone_gives_its_rule_of_thumb(cell, chance, expected):
    # Without it four channels fail together once in 1e12 hours; the rule of thumb leaves that out.
    assert lost(certain({cell: chance})) - lost(certain({})) == pytest.approx(expected, rel=2e-3)


def test_a_second_fault_within_the_settling_time():
    assert lost(certain({("near", 4): 1.0})) == pytest.approx(3.340e-10, rel=5e-3)


def test_without_a_weakness_all_channels_must_fail():
    for n in (1, 2, 3, 4):
        q = 1.0 - np.exp(-LAMBDA)
        assert lost(certain({}), n) == pytest.approx(q**n, rel=1e-9) == pytest.approx(perfect(n, LAMBDA, 1.0), rel=1e-9)


def test_coverage_of_every_fault_is_the_closed_form():
    c, n, q = 0.99, 4, 1.0 - np.exp(-LAMBDA)
    given = certain({("single", good): 1.0 - c for good in (4, 3, 2)} | {("near", g): 1.0 - c for g in (4, 3, 2)})
    # The last channel's fault is the end whether it is covered or not.
    kept = sum(comb(n, f) * q**f * (1 - q) ** (n - f) * c**f for f in range(n))
    assert lost(given) == pytest.approx(1.0 - kept, rel=1e-6)


def test_two_alike_at_once():
    beta = 0.01
    assert lost(certain({("alike", 4): 1.0}), beta=beta) == pytest.approx(beta * LAMBDA, rel=2e-3)


def test_common_mode_hits_fixed_pairs_of_which_half_are_good_after_one_fault():
    """After one fault 3 of 6 pairs hit two good channels; the others hit one, as a single fault does."""
    beta, hours = 0.01, 1.0
    m = np.zeros((4, 4))  # 4, 3, 2 good, lost
    alone, pair = (1.0 - beta) * LAMBDA, beta * LAMBDA / 6
    m[0, 1], m[0, 2] = 4 * alone, 6 * pair
    m[1, 2], m[1, 3] = 3 * (alone + pair), 3 * pair  # two alike of three are lost
    m[2, 3] = 2 * (alone + 2 * pair) + pair
    given = certain({("alike", 3): 1.0, ("single", 2): 1.0, ("near", 2): 1.0, ("alike", 2): 1.0})
    assert lost(given, beta=beta) == pytest.approx(transitions(m, hours)[0, 3], rel=1e-6)


@pytest.mark.parametrize(("every_h", "expected"), [(None, 0.8), (1.0, 0.8), (0.5, 0.8 / 4), (0.25, 0.8 / 16)])
def test_stuck_channels_count_as_often_as_no_manoeuvre_comes_between(every_h, expected):
    """After two earlier faults all three lie in one stretch of level flight with the chance (every_h / hours)^2."""
    counts = table(trials=10**6).filter(pl.col("good_before") == 2)
    latent = table(bad=800_000, trials=10**6).filter((pl.col("good_before") == 2) & (pl.col("condition") == "level"))
    counts = pl.concat([counts, latent.with_columns(condition=pl.lit("level then manoeuvre"))])
    given = SignalRates(per_hour=[LAMBDA], source="a test", kinds=KINDS, manoeuvre_every_h=every_h)
    mean = outcomes(counts, KINDS, "here", None, level=given.level(1.0)).draws["single", 2]
    assert 1.0 - mean[0, 0] == pytest.approx(expected, rel=1e-4)


def test_the_settling_time_is_short_enough_to_be_taken_at_once():
    """The chain with the unsettled states in it, by hand, for three channels."""
    u, near = 0.02, 0.3
    m = np.zeros((6, 6))  # 0: none, 1: one unsettled, 2: one, 3: two unsettled, 4: two, 5: lost
    m[0, 1], m[1, 2], m[1, 5] = 3 * LAMBDA, (1 - u) / TAU_H, u / TAU_H
    m[1, 4], m[1, 5] = 2 * LAMBDA * (1 - near), m[1, 5] + 2 * LAMBDA * near
    m[2, 3], m[3, 4], m[3, 5], m[4, 5] = 2 * LAMBDA, 1.0 / TAU_H, LAMBDA, LAMBDA
    expected = transitions(m, 1.0)[0, 5]
    found = lost(certain({("single", 3): u, ("near", 3): near, ("near", 2): 1.0}), 3)
    assert found == pytest.approx(expected, rel=1e-4)  # apart from faults of the last tenth of a second


def test_a_false_isolation_costs_a_channel():
    phi = 0.5
    given = certain({})
    given = Given(given.outcomes, given.announced, {**given.false_isolation, 2: np.full(1, phi)}, TAU_H)
    m = np.zeros((3, 3))
    m[0, 1], m[1, 2] = 2 * (LAMBDA + phi), LAMBDA
    assert lost(given, 2) == pytest.approx(transitions(m, 1.0)[0, 2], rel=1e-4)


def test_a_fault_without_an_annunciation_is_still_there_in_the_next_flight():
    """Two channels; the first fault is tolerated without a word, until a check every ten flights."""
    given, flights = certain({("single", 1): 1.0}), 10
    average = float(after_flights(one_flight(rates(2, LAMBDA, 0.0, given), 2, 1.0), 1.0, flights).sum())
    q = 1.0 - np.exp(-LAMBDA)
    state, by_hand = np.array([1.0, 0.0]), 0.0  # of no and of one faulty channel
    for _ in range(flights):
        end = state[0] * q * q + state[1] * q
        by_hand += end
        state = np.array([state[0] * (1 - q) ** 2 + end, state[0] * 2 * q * (1 - q) + state[1] * (1 - q)])
    assert average == pytest.approx(by_hand / flights, rel=1e-6)
    told = Given(given.outcomes, {("single", 2): 1.0}, given.false_isolation, TAU_H)
    assert float(after_flights(one_flight(rates(2, LAMBDA, 0.0, told), 2, 1.0), 1.0, flights).sum()) == pytest.approx(
        q * q, rel=1e-3
    )


KINDS = {"hardover": 0.5, "drift": 0.5}


def table(bad: int = 0, known: int = 0, trials: int = 1000, kinds: tuple[str, ...] = tuple(KINDS)) -> pl.DataFrame:
    """The same counts in every cell of single faults."""
    rows = [
        {"signal": "pitch_rate", "good_before": good, "design": "single", "kind": kind, "condition": condition}
        | {"trials": trials, "correct": trials - bad - known, "annunciated_loss": known, "undetected_error": bad}
        | {"lost_aircraft_annunciated": 0, "lost_aircraft_undetected": bad, "announced": 0, "settle_s_mean": 0.2}
        for good in (4, 3, 2, 1)
        for kind in kinds
        for condition in ("level", "manoeuvre")
    ]
    return pl.DataFrame(rows)


NO_ALARMS = pl.DataFrame(
    {"signal": ["pitch_rate"] * 4, "level": [4, 3, 2, 1], "channel_hours": [1e9] * 4, "events": [0] * 4}
)
GIVEN = SignalRates(per_hour=[LAMBDA], source="a test", kinds=KINDS)


COUNTED = (
    "trials",
    "correct",
    "annunciated_loss",
    "undetected_error",
    "lost_aircraft_annunciated",
    "lost_aircraft_undetected",
)


def drawn(counts: pl.DataFrame, seed: int = 1, draws: int = 4000) -> np.ndarray:
    return outcomes(counts, KINDS, "here", np.random.default_rng(seed), draws).draws["single", 4]


def test_the_draws_of_a_cell_are_those_of_its_counts():
    u = drawn(table(bad=20, known=10))
    assert np.allclose(u.sum(axis=1), 1.0)
    assert u[:, 3:].sum(axis=1).mean() == pytest.approx(20 / 1000, rel=0.05)
    assert u[:, 1:3].sum(axis=1).mean() == pytest.approx(10 / 1000, rel=0.05)


def test_an_empty_table_counts_a_half_whatever_the_number_of_kinds():
    """Of 4000 trials without a failure the chance is Beta(1/2, 4000 + 1/2), as if they were of one kind."""
    expected = beta_distribution.ppf(0.975, 0.5, 4000.5)
    for kinds in (("hardover", "drift"), ("hardover", "drift", "offset", "stuck", "noise", "dropout", "oscillation")):
        shares = dict.fromkeys(kinds, 1.0 / len(kinds))
        counts = table(trials=2000 // len(kinds), kinds=kinds)
        u = outcomes(counts, shares, "here", np.random.default_rng(2), 20000).draws["single", 4]
        assert np.quantile(1.0 - u[:, 0], 0.975) == pytest.approx(expected, rel=0.15)


def test_the_share_of_a_kind_weighs_it():
    counts = table().with_columns(
        undetected_error=pl.when(pl.col("kind") == "drift").then(500).otherwise(0),
        correct=pl.when(pl.col("kind") == "drift").then(500).otherwise(1000),
        lost_aircraft_undetected=pl.lit(0),
    )
    rare = {"hardover": 0.9, "drift": 0.1}
    u = outcomes(counts, rare, "here", np.random.default_rng(1), 4000).draws["single", 4]
    assert (1.0 - u[:, 0]).mean() == pytest.approx(0.05, rel=0.02)


def run(counts: pl.DataFrame, layers: tuple[Layer, ...] = (), checks: int = 1):
    found = Cells("cross-channel", counts, NO_ALARMS)
    return results(found, "pitch_rate", GIVEN, cases(GIVEN, (4,), 1.0, checks), layers)


def test_a_result_is_the_rule_of_thumb_with_the_interval_of_its_cell():
    [found] = run(table(bad=10))
    u = 10 / 1000
    rule = 4 * LAMBDA * u + 6 * LAMBDA**2 * u
    assert found.estimates["undetected_error"].median == pytest.approx(rule, rel=0.03)
    low, high = beta_distribution.ppf((0.025, 0.975), 40.5, 4000 - 40 + 0.5)
    assert found.estimates["undetected_error"].low == pytest.approx(4 * LAMBDA * low, rel=0.05)
    assert found.estimates["undetected_error"].high == pytest.approx(4 * LAMBDA * high, rel=0.05)
    assert found.estimates["lost_aircraft"].median == pytest.approx(rule, rel=0.05)  # every undetected error cost one
    assert found.contributions[0].cell == "single, 4 good" and found.contributions[0].share > 0.98


def test_false_isolations_that_are_given_take_the_place_of_those_of_few_hours():
    few = Cells("here", table(bad=1), NO_ALARMS.with_columns(channel_hours=pl.lit(0.1)))
    case = cases(GIVEN, (2,), 1.0, 1)
    [counted] = results(few, "pitch_rate", GIVEN, case)
    chosen = GIVEN.model_copy(update={"false_isolations_per_channel_hour": 0.0})
    [given] = results(few, "pitch_rate", chosen, case)
    assert counted.contributions[0].cell == "false isolations" and counted.estimates["annunciated_loss"].median > 0.1
    assert given.estimates["annunciated_loss"].median < 1e-5


def test_a_cell_that_never_came_to_be_is_an_undetected_error():
    counts = table(bad=1).with_columns(
        *(pl.when(pl.col("good_before") == 3).then(0).otherwise(pl.col(n)).alias(n) for n in COUNTED)
    )
    [found] = run(counts)
    # The second of four channels is then the end: 6 lambda^2.
    assert found.estimates["undetected_error"].median == pytest.approx(4e-3 * 1e-3 + 6e-6, rel=0.05)
    assert found.unreached == ("single, 3 good",)


def test_where_nothing_was_seen_there_is_no_lower_end():
    [found] = run(table())
    assert found.estimates["undetected_error"].low is None
    [seen] = run(table(bad=1))
    assert seen.estimates["undetected_error"].low is not None


def test_the_order_of_the_rows_changes_nothing():
    counts = table(bad=3, known=2)
    assert run(counts) == run(counts.sample(fraction=1.0, shuffle=True, seed=4))


def test_the_requirement_is_met_by_the_upper_end():
    [few] = run(table(trials=100))
    [many] = run(table(trials=100_000))
    assert few.requirement == {"military": False, "civil": False}
    assert few.standing == {"military": "not shown", "civil": "not shown"}  # nothing was seen: more trials decide
    assert many.requirement["military"] and not many.requirement["civil"]
    assert many.standing == {"military": "met", "civil": "not shown"}


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [(1e-9, 9e-8, "met"), (1e-8, 2e-7, "not shown"), (None, 2e-7, "not shown"), (2e-7, 3e-7, "not met")],
)
def test_a_target_is_met_or_not_by_the_whole_interval(low, high, says):
    assert against(Estimate(1e-7, low, high), 1e-7) == says


def test_a_trial_that_told_nothing_of_the_aircraft_gives_no_probability_of_its_loss():
    open_loop = table(bad=3).with_columns(
        lost_aircraft_annunciated=pl.lit(None, pl.Int64), lost_aircraft_undetected=pl.lit(None, pl.Int64)
    )
    [found] = run(open_loop)
    assert set(found.estimates) == {"undetected_error", "annunciated_loss"}


@pytest.mark.parametrize("true", [0.02, *(pytest.param(true, marks=pytest.mark.long) for true in (0.002, 0.2))])
def test_the_interval_holds_the_truth_in_nine_to_ninety_nine_of_a_hundred_campaigns(true: float):
    rng, held = np.random.default_rng(11), 0
    kinds = ("hardover", "drift", "offset", "stuck")
    shares = {kind: 0.25 for kind in kinds}  # noqa: C420 # typed by text
    for _ in range(200):
        counts = table(trials=50, kinds=kinds).filter(pl.col("good_before") == 4)
        bad = rng.binomial(50, true, len(counts))
        counts = counts.with_columns(undetected_error=bad, correct=50 - bad, lost_aircraft_undetected=pl.lit(0))
        u = outcomes(counts, shares, "here", rng, 400).draws["single", 4]
        low, high = np.quantile(1.0 - u[:, 0], (0.025, 0.975))
        held += low <= true <= high
    assert 180 <= held <= 198


def test_a_layer_is_lost_by_a_fault_that_is_not_covered_or_by_all():
    layer = Layer(name="computers", channels=2, per_hour=1e-4, not_covered=[1e-3, 1.0], source="a test")
    q = 1.0 - np.exp(-1e-4)
    expected = 2 * 1e-4 * 1e-3 + q * q
    assert in_series(layer, 1.0) == pytest.approx(expected, rel=1e-3)
    [alone], [with_it] = run(table(bad=1)), run(table(bad=1), layers=(layer,))
    more = with_it.estimates["undetected_error"].median - alone.estimates["undetected_error"].median
    assert more == pytest.approx(expected, rel=1e-2) and with_it.layers == ("computers",)


def test_the_outcomes_of_a_cell_are_five():
    assert drawn(table()).shape == (4000, OUTCOMES)
