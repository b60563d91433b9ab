"""The campaign's statistics against published figures and constructed tables."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom
from scipy.stats import poisson as poisson_law

from rig.studies.campaign.statistics import (
    clustered_difference,
    detectable,
    mcnemar,
    median_interval,
    paired_difference,
    poisson,
    proportion,
)


@pytest.mark.parametrize(
    ("count", "trials", "low", "high"),
    [(81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617), (0, 20, 0.0, 0.1684), (1, 29, 0.0009, 0.1776)],
)
def test_a_proportion_has_the_clopper_pearson_interval_of_newcombe_1998(count, trials, low, high):
    # Newcombe, Statistics in Medicine 17 (1998) 857-872, table I, method 5.
    found = proportion(count, trials)
    assert (round(found.low or 0.0, 4), round(found.high or 0.0, 4)) == (low, high)


@pytest.mark.parametrize(
    ("confidence", "low", "high"), [(0.90, 17.38, 34.92), (0.95, 16.18, 36.90), (0.99, 14.0, 41.0)]
)
def test_a_count_of_25_has_the_garwood_interval_that_is_published(confidence, low, high):
    # GraphPad, "How QuickCalcs computes the confidence interval of a count", after Garwood (1936).
    found = poisson(25, 1.0, confidence)
    assert (found.low, found.high) == (pytest.approx(low, abs=0.006), pytest.approx(high, abs=0.006))


def test_no_event_bounds_the_rate_from_above_alone():
    found = poisson(0, 10.0)
    assert (found.value, found.low) == (0.0, 0.0)
    assert found.high == pytest.approx(0.3689, abs=1e-4)  # 3.689 events, as R's epitools documents


@given(st.integers(0, 40), st.integers(1, 40))
def test_at_either_end_of_an_interval_the_count_is_just_as_unlikely_as_it_may_be(count: int, more: int):
    trials = count + more
    found = proportion(count, trials)
    assert binom.cdf(count, trials, found.high) == pytest.approx(0.025)
    if count:
        assert binom.sf(count - 1, trials, found.low) == pytest.approx(0.025)
        assert poisson_law.sf(count - 1, poisson(count, 1.0).low) == pytest.approx(0.025)


def test_nothing_tried_is_no_rate():
    assert proportion(0, 0).value is None and poisson(0, 0.0).value is None


def test_the_logistic_fit_is_that_of_the_beetles():
    # Bliss (1935), as fitted by Dobson, An Introduction to Statistical Modelling (1990): logit p = -60.717 + 34.270 x.
    dose = [1.6907, 1.7242, 1.7552, 1.7842, 1.8113, 1.8369, 1.8610, 1.8839]
    exposed, killed = [59, 60, 62, 56, 63, 59, 62, 60], [6, 13, 18, 28, 52, 53, 61, 60]
    magnitude = np.repeat(10.0 ** np.array(dose), exposed)
    dead = np.concatenate([np.arange(n) < k for n, k in zip(exposed, killed, strict=True)])
    found = detectable(magnitude, dead)
    assert found is not None and not found.separated and found.slope is not None
    assert found.slope * np.log(10.0) == pytest.approx(34.270, abs=0.005)
    half, nearly_all = found.magnitudes
    assert np.log10(half.value) == pytest.approx(60.717 / 34.270, abs=2e-5)
    assert np.log10(nearly_all.value) == pytest.approx((60.717 + np.log(99.0)) / 34.270, abs=2e-4)
    assert half.low is not None and half.high is not None
    # The delta method at the published estimates, from Fisher's information, is close for so many trials.
    x = np.array(dose)
    p = 1.0 / (1.0 + np.exp(60.717 - 34.270 * x))
    weights = np.array(exposed) * p * (1.0 - p)
    covariance = np.linalg.inv(
        np.array([[weights.sum(), (weights * x).sum()], [(weights * x).sum(), (weights * x * x).sum()]])
    )
    assert np.sqrt(np.diag(covariance)) == pytest.approx([5.181, 2.912], abs=0.002)  # the published standard errors
    gradient = np.array([-1.0 / 34.270, -60.717 / 34.270**2])
    error = np.sqrt(gradient @ covariance @ gradient)
    assert (np.log10(half.high) - np.log10(half.low)) / 2 == pytest.approx(1.96 * error, rel=0.02)


def test_separated_trials_say_the_gap_and_an_interval_about_it():
    found = detectable(np.repeat([1.0, 2.0, 8.0, 16.0], 5), np.repeat([False, False, True, True], 5))
    assert found is not None and found.separated and found.slope is None
    half = found.magnitudes[0]
    assert half.value == pytest.approx(4.0)  # the geometric middle of 2 and 8
    assert half.low is not None and half.high is not None and half.low <= 2.01 and half.high >= 7.9


@pytest.mark.parametrize("detected", [[True, True], [False, False]])
def test_all_or_nothing_detected_is_no_fit(detected):
    assert detectable(np.array([1.0, 2.0]), np.array(detected)) is None


def test_magnitudes_that_are_drawn_from_a_known_curve_are_found_again():
    rng = np.random.default_rng(1)
    magnitude = np.exp(rng.uniform(np.log(0.01), np.log(1.0), 3000))
    p = 1.0 / (1.0 + np.exp(-4.0 * (np.log(magnitude) - np.log(0.1))))
    found = detectable(magnitude, rng.random(3000) < p)
    assert found is not None
    for m, true in zip(found.magnitudes, (0.1, 0.1 * 99.0**0.25), strict=True):
        assert m.low is not None and m.high is not None and m.low < true < m.high < 1.3 * m.low


def test_the_paired_test_is_the_published_one():
    # Fagerland, Lydersen, Laake, BMC Medical Research Methodology 13:91 (2013): 1 against 7 pairs, exact p 0.070.
    first = np.array([True] * 1 + [False] * 7 + [True] * 7 + [False] * 6)
    second = np.array([False] * 1 + [True] * 7 + [True] * 7 + [False] * 6)
    found = mcnemar(first, second)
    assert (found.only_first, found.only_second, found.both, found.neither) == (1, 7, 7, 6)
    assert round(found.p_value, 3) == 0.070


def test_equal_outcomes_have_no_difference():
    same = np.array([True, False])
    assert mcnemar(same, same).p_value == 1.0


@pytest.mark.parametrize(("both", "first", "second", "neither"), [(40, 20, 5, 35), (0, 3, 0, 60), (50, 0, 0, 2)])
def test_a_paired_difference_is_wald_of_the_table_with_half_a_trial_more_in_each_cell(both, first, second, neither):
    counts = np.array([both, first, second, neither])
    scores = np.repeat([0, 1, -1, 0], counts)  # first less second of each trial
    first_kept, second_kept = (np.repeat(column, counts).astype(bool) for column in ([1, 1, 0, 0], [1, 0, 1, 0]))
    found = paired_difference(first_kept, second_kept)
    shares = (counts + 0.5) / (counts.sum() + 2.0)
    mean = shares @ np.array([0, 1, -1, 0])
    half = 1.959964 * np.sqrt((shares @ np.array([0, 1, 1, 0]) - mean**2) / (counts.sum() + 2.0))
    assert found.value == pytest.approx(scores.mean())
    assert (found.low, found.high) == (pytest.approx(mean - half), pytest.approx(mean + half))
    assert found.low < found.value < found.high or found.value == 0.0


def test_equal_clusters_have_the_interval_of_the_t_distribution_of_their_means():
    # Means 0.6, 0.1, 0.4, 0.3 of ten trials each: mean 0.35, s 0.2082, t of 3 degrees of freedom 3.1824.
    first = np.concatenate([np.arange(10) < 10 * share for share in (0.6, 0.1, 0.4, 0.3)])
    found, p = clustered_difference(first, np.zeros(40, bool), np.repeat([7, 3, 5, 1], 10))
    half = 3.18244631 * np.std([0.6, 0.1, 0.4, 0.3], ddof=1) / 2.0
    assert found == pytest.approx((0.35, 0.35 - half, 0.35 + half), rel=1e-6)
    assert p == pytest.approx(scipy.stats.ttest_1samp([0.6, 0.1, 0.4, 0.3], 0.0)[1])


def test_trials_that_are_no_more_alike_than_others_have_the_wider_interval_of_independent_ones():
    first = np.tile([True, False], 20)
    found, p = clustered_difference(first, ~first, np.repeat(np.arange(20), 2))
    assert (found, p) == (paired_difference(first, ~first), mcnemar(first, ~first).p_value)


def test_one_cluster_bounds_nothing():
    found, p = clustered_difference(np.ones(50, bool), np.zeros(50, bool), np.zeros(50, np.int64))
    assert found == (1.0, -1.0, 1.0) and p == 1.0


def test_an_interval_over_clusters_holds_as_often_as_it_says_where_that_of_trials_does_not():
    rng, held, by_trial = np.random.default_rng(11), 0, 0
    for _ in range(1000):
        share = np.repeat(rng.uniform(0.2, 0.8, 12), 30)  # of a cluster: a mean of 0.5
        first, second = rng.random(360) < share, rng.random(360) < 0.5
        found, _ = clustered_difference(first, second, np.repeat(np.arange(12), 30))
        alone = paired_difference(first, second)
        held, by_trial = held + (found.low <= 0.0 <= found.high), by_trial + (alone.low <= 0.0 <= alone.high)
    assert 940 <= held <= 970
    assert by_trial < 800


@pytest.mark.parametrize(("n", "first"), [(5, None), (6, 1), (9, 2), (25, 8), (100, 40)])  # of ordered values: tables
def test_the_interval_of_a_median_lies_between_two_of_the_values(n: int, first: int | None):
    found = median_interval(np.arange(n, 0.0, -1.0))
    assert found.value == (n + 1) / 2
    assert (found.low, found.high) == ((None, None) if first is None else (first, n + 1 - first))


def test_the_interval_of_a_median_holds_as_often_as_it_says():
    rng = np.random.default_rng(5)
    drawn = [median_interval(rng.exponential(size=30)) for _ in range(2000)]
    held = sum(one.low <= np.log(2.0) <= one.high for one in drawn if one.low is not None and one.high is not None)
    assert 0.95 <= held / 2000 <= 0.975  # 0.957 by the binomial: the next narrower one is at 0.90
