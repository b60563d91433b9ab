"""Kinds of faults in the cells: settled each in its time, weighed by the rates file, slow drifts beside the others."""

import polars as pl
import pytest
from test_reliability_result import GIVEN, LAMBDA, NO_ALARMS, table

from rig.studies.reliability.next_fault import SETTLE_S, outcomes, settling
from rig.studies.reliability.per_hour import cases, results
from rig.studies.reliability.rates_file import SignalRates
from rig.studies.reliability.tally import Cells


def settled(**means: float) -> pl.DataFrame:
    """A table whose kinds take so long to settle."""
    return table().with_columns(settle_s_mean=pl.col("kind").replace_strict(means, default=None))


def test_the_settling_time_is_the_mean_of_the_trials_of_each_kind_by_its_share():
    shares = {"hardover": 0.75, "drift": 0.25}
    assert settling(settled(hardover=0.1, drift=0.5), shares) == pytest.approx({"hardover": 0.1, "drift": 0.5})
    assert outcomes(settled(hardover=0.1, drift=0.5), shares, "here", None).settle_s == pytest.approx(0.2)
    assert settling(settled(drift=0.4), shares) == pytest.approx({"hardover": 0.4, "drift": 0.4})  # none was settled
    assert settling(settled(), shares) == dict.fromkeys(shares, SETTLE_S)


def with_slow(slow_bad: dict[str, int], condition: str = "level", settle_s: float = 0.2) -> pl.DataFrame:
    """Half a million trials of each kind; of slow drifts, in one condition, so many not kept by design and good."""
    counts = table(trials=500_000)
    slow = counts.filter((pl.col("kind") == "drift") & (pl.col("condition") == condition)).with_columns(
        kind=pl.lit("slow drift"), condition=pl.lit("climb"), settle_s_mean=pl.lit(settle_s)
    )
    near = pl.concat([counts, slow]).filter(pl.col("good_before") == 4).with_columns(design=pl.lit("near"))
    whole = pl.concat([counts, slow, near])
    place = pl.concat_str("design", pl.lit(" "), "good_before")
    bad = (
        pl.when(pl.col("kind") == "slow drift")
        .then(place.replace_strict(slow_bad, default=0))
        .otherwise("undetected_error")
    )
    return whole.with_columns(undetected_error=bad.cast(pl.Int64), correct=(pl.col("trials") - bad).cast(pl.Int64))


def loss_of(counts: pl.DataFrame, kinds: dict[str, float]) -> float:
    given = SignalRates(per_hour=[LAMBDA], source="a test", kinds=kinds, false_isolations_per_channel_hour=0.0)
    [found] = results(Cells("m", counts, NO_ALARMS), "pitch_rate", given, cases(given, (4,), 1.0, 1))
    return found.loss.median


SLOWS = {"hardover": 0.5, "drift": 0.3, "slow drift": 0.2}


def test_slow_drifts_weigh_by_the_share_that_the_rates_file_gives_them():
    """By hand, four channels an hour: 4 lambda u4 + 6 lambda^2 u3, u a fifth of the slow drifts that are not kept."""
    counts = with_slow({"single 4": 5_000, "single 3": 100_000})
    u4, u3 = 0.2 * 5_000 / 500_000, 0.2 * 100_000 / 500_000
    assert loss_of(counts, SLOWS) == pytest.approx(4 * LAMBDA * u4 + 6 * LAMBDA**2 * u3, rel=0.02)


def test_rates_without_slow_drifts_do_not_count_them():
    slow = with_slow({"single 4": 5_000, "single 3": 100_000}, settle_s=1e4)
    fast = slow.filter(pl.col("kind") != "slow drift")
    with_and_without = [
        results(Cells("m", counts, NO_ALARMS), "pitch_rate", GIVEN, cases(GIVEN, (4,), 1.0, 1))
        for counts in (slow, fast)
    ]
    assert with_and_without[0] == with_and_without[1]


def test_a_second_fault_meets_the_kind_that_takes_the_longest_to_settle():
    """By hand: a slow drift, a fifth of the faults, waits 18 s for its second fault, the others 0.2 s."""
    counts, others_s, slow_s = with_slow({"near 4": 500_000}, settle_s=18.0), 0.2, 18.0
    near = 4 * LAMBDA * 3 * LAMBDA * 0.2 * slow_s / 3600.0
    kept = with_slow({}, settle_s=18.0)
    assert loss_of(counts, SLOWS) - loss_of(kept, SLOWS) == pytest.approx(near, rel=0.02)
    assert outcomes(counts, SLOWS, "m", None).settle_s == pytest.approx(0.8 * others_s + 0.2 * slow_s)


def test_kinds_that_were_not_flown_in_level_flight_leave_the_others_their_weight():
    """Stuck together count by the chance of level flight, slow drifts of one condition as they were flown."""
    counts = table(trials=10**6).filter(pl.col("good_before") == 2)
    latent = table(bad=800_000, trials=10**6).filter((pl.col("good_before") == 2) & (pl.col("condition") == "level"))
    slow = table(bad=100_000, trials=10**6, kinds=("slow drift",)).filter(pl.col("good_before") == 2)
    whole = pl.concat([counts, latent.with_columns(condition=pl.lit("level then manoeuvre")), slow])
    mean = outcomes(whole, SLOWS, "here", None, level=0.5).draws["single", 2]
    assert 1.0 - mean[0, 0] == pytest.approx(0.8 * 0.8 * 0.5**2 + 0.2 * 0.1, rel=1e-4)
    assert mean.sum() == pytest.approx(1.0)
