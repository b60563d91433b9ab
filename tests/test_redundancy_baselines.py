"""The managers to compare with."""

import warnings
from typing import Any

import numpy as np
import pytest
from conftest import FEWER, constant, vote_samples
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rig.frame import Pattern, State


def test_the_mean_follows_a_hardover_and_fails_nobody():
    out = vote_samples(constant(0, 0, 0, 8), manager="mean")
    assert (out.voted == 2.0).all()
    assert out.failed_at() == [None] * 4


def test_the_cross_voter_isolates_a_single_fault_but_blames_all_of_a_split():
    single = vote_samples(constant(0, 0, 0, 8), manager="cross-voter")
    split = vote_samples(constant(0, 0, 8, 8), manager="cross-voter")
    assert single.failed_at() == [None, None, None, 8]
    assert split.failed_at() == [8, 8, 8, 8]


def test_the_median_shrugs_off_one_channel_for_ever_and_fails_nobody():
    out = vote_samples(constant(0, 0.2, 0.4, 8), manager="median")
    assert np.allclose(out.voted, 0.3) and out.failed_at() == [None] * 4


def test_a_baseline_holds_its_vote_when_nobody_speaks():
    samples = constant(3.0, 3.0, 3.0, 3.0, frames=20)
    samples[5:] = np.nan
    for manager in ("mean", "median", "cross-voter", "selection"):
        assert (vote_samples(samples, manager=manager).voted == 3.0).all()


def test_a_selection_leaves_its_channel_when_the_integrated_deviation_is_used_up():
    """Channel 1 is off by 8: the mean by 2, its deviation is 6, of which 5 a frame count towards 100."""
    chosen: dict[str, Any] = {"selection_deviation": 1.0, "selection_integral_s": 1.0}  # 1 s is 100 frames
    out = vote_samples(constant(8, 0, 0, 0, frames=40), manager="selection", **chosen)
    assert (out.voted[:20] == 8).all() and (out.voted[20:] == 0).all()
    assert out.failed_at() == [21, None, None, None]


def test_a_selection_that_finds_nobody_trusted_stays_on_the_channel_that_it_had():
    """Channels 1 and 2 are silent from the start, so it sits on 3; when all are silent it does not go back."""
    samples = constant(1.0, 2.0, 3.0, 4.0, frames=20)
    samples[:, :2] = np.nan
    samples[10:15] = np.nan
    samples[15:, :3] = (1.0, 2.0, 3.0)
    samples[15:, 3] = np.nan
    out = vote_samples(samples, manager="selection")
    assert (out.voted == 3.0).all()


def test_a_selection_stays_where_it_is_and_trusts_again_what_came_back():
    chosen: dict[str, Any] = {"selection_deviation": 1.0, "selection_integral_s": 1.0}
    samples = constant(8, 0.5, 0, 0, frames=300)
    samples[60:] = [0, 0.5, 0, 0]
    out = vote_samples(samples, manager="selection", **chosen)
    assert (out.voted[21:] == 0.5).all()
    assert out.state[59, 0] == State.FAILED and out.state[-1, 0] == State.OK


def test_a_selection_leaves_a_silent_channel_at_once_and_blames_neither_of_two():
    samples = constant(5.0, 1.0, 1.0, 1.0, frames=10)
    samples[4:, 0] = np.nan
    out = vote_samples(samples, manager="selection")
    assert (out.voted[4:] == 1.0).all()
    pair = constant(9.0, 0.0, np.nan, np.nan, frames=500)
    assert (vote_samples(pair, manager="selection").voted == 9.0).all()


def test_a_selection_may_come_back_to_the_first_channel():
    chosen: dict[str, Any] = {"selection_deviation": 1.0, "selection_integral_s": 0.1}
    samples = constant(3, 0.5, 0, 0, frames=200)
    samples[20:] = [0, 0.5, 0, 0]
    samples[100:] = [0, 3, 0, 0]
    out = vote_samples(samples, manager="selection", **chosen)
    assert out.voted[99] == 0.5 and out.voted[-1] == 0 and out.state[-1].tolist() == [0, 2, 0, 0]


# An independent expectation of each, in plain Python over random samples with gaps.
SAMPLE = st.sampled_from([0.0, 0.5, 1.0, 1.25, 3.0, 8.0, -4.0, np.nan])
FLIGHTS = hnp.arrays(np.float64, (25, 4), elements=SAMPLE)
MANY = settings(max_examples=80 // FEWER, deadline=None, derandomize=True)


def held(values: list[float]) -> list[float]:
    """Where there is no number, the one before; 0 before the first."""
    out, last = [], 0.0
    for value in values:
        last = last if np.isnan(value) else value
        out.append(last)
    return out


@MANY
@given(FLIGHTS, st.sampled_from([0.0, 50.0, -7.5]), st.integers(2, 4))
def test_mean_and_median_are_those_of_what_is_there(samples, shift, channels):
    samples = samples + shift
    samples[:, channels:] = np.nan
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        mean, median = np.nanmean(samples, axis=1), np.nanmedian(samples, axis=1)
    silent = np.isnan(samples[:, :channels]).all(axis=1)
    for name, wanted in (("mean", mean), ("median", median)):
        out = vote_samples(samples, manager=name, channels=channels, persistence=1000)
        assert out.voted.tolist() == pytest.approx(held(wanted.tolist()))
        assert [Pattern(p).label for p in out.pattern] == ["lost" if s else "normal" for s in silent]
        assert (out.level == channels).all() and (out.reference_usable == 0).all()


@MANY
@given(FLIGHTS, st.sampled_from([0.0, 50.0]), st.integers(1, 4))
def test_the_cross_voter_is_that_of_its_definition(samples, shift, persistence):
    samples = samples + shift
    out = vote_samples(samples, manager="cross-voter", persistence=persistence)
    counts, failed, vote = [0] * 4, set(), 0.0
    for k, row in enumerate(samples):
        use = [c for c in range(4) if c not in failed and not np.isnan(row[c])]
        vote = float(np.median(row[use])) if use else vote
        assert out.voted[k] == pytest.approx(vote)
        for c in set(range(4)) - failed:
            off = c not in use or abs(row[c] - vote) > 1.0
            counts[c] = counts[c] + 1 if off else 0
            expected = State.SUSPECT if off else State.OK
            assert out.state[k, c] == (State.FAILED if counts[c] >= persistence else expected)
        failed |= {c for c in range(4) if counts[c] >= persistence}
        assert out.level[k] == 4 - len(failed)


@MANY
@given(FLIGHTS, st.sampled_from([0.0, 50.0]), st.integers(2, 4))
def test_the_selection_is_that_of_its_definition(samples, shift, channels):
    samples = samples + shift
    samples[:, channels:] = np.nan
    out = vote_samples(
        samples, manager="selection", channels=channels, selection_deviation=0.75, selection_integral_s=0.035
    )
    excess, selected, last = [0.0] * 4, 0, [0.0] * 4
    for k, row in enumerate(samples):
        use = [c for c in range(channels) if not np.isnan(row[c])]
        for c in use:
            off = abs(row[c] - np.mean(row[use])) - 0.75 if len(use) > 2 else 0.0
            excess[c] = max(excess[c] + off, 0.0)
        trusted = [c for c in use if excess[c] <= 3.5]
        if selected not in trusted and trusted:
            selected = trusted[0]
        last = [x if np.isnan(new) else new for x, new in zip(last, row, strict=True)]
        assert out.voted[k] == pytest.approx(last[selected])
        bad = [c not in trusted for c in range(channels)]
        assert [s == State.FAILED for s in out.state[k, :channels]] == bad
        assert out.level[k] == channels - sum(bad)


def test_a_baseline_votes_an_angle_the_short_way_round():
    turn = 2 * np.pi
    samples = constant(0.01, turn - 0.03, 0.02, turn - 0.02, frames=3)
    for manager in ("mean", "median", "cross-voter"):
        out = vote_samples(samples, manager=manager, wraps=True, limits=(0.0, turn), threshold=0.1)
        assert np.allclose(np.sin(out.voted), -0.005, atol=1e-9) and (np.cos(out.voted) > 0.99).all()


def test_the_selection_without_a_trusted_channel_goes_to_the_one_that_was_least_off():
    """Every channel is off the mean for long; the last one trusted stays chosen until it has no sample."""
    samples = constant(0, 30, -31, 80, frames=120)
    samples[100:, 1] = np.nan
    out = vote_samples(samples, manager="selection")
    assert out.failed_at()[1] is not None and (out.level[99] == 0)
    assert (out.voted[80:100] == 30.0).all() and (out.voted[100:] == 0.0).all()
