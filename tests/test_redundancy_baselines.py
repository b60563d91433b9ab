"""The managers to compare with."""

import warnings
from typing import Any

import numpy as np
import pytest
from conftest import FEWER, constant, vote_samples
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rig.bench.vote_rows import vote
from rig.core.frame import Pattern, State
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import VoteConfig


def test_the_mean_follows_a_hardover_and_fails_no_channel():
    out = vote_samples(constant(0, 0, 0, 8), manager="mean")
    assert (out.voted == 2.0).all()
    assert out.failed_at() == [None] * 4


def test_the_cross_voter_isolates_a_single_fault_but_blames_all_of_a_split():
    single = vote_samples(constant(0, 0, 0, 8), manager="cross-voter")
    split = vote_samples(constant(0, 0, 8, 8), manager="cross-voter")
    assert single.failed_at() == [None, None, None, 8]
    assert split.failed_at() == [8, 8, 8, 8]


def test_the_median_tolerates_one_channel_for_ever_and_fails_no_channel():
    out = vote_samples(constant(0, 0.2, 0.4, 8), manager="median")
    assert np.allclose(out.voted, 0.3) and out.failed_at() == [None] * 4


def test_a_baseline_holds_its_vote_when_no_channel_transmits():
    samples = constant(3.0, 3.0, 3.0, 3.0, frames=20)
    samples[5:] = np.nan
    for manager in ("mean", "median", "cross-voter", "selection"):
        assert (vote_samples(samples, manager=manager).voted == 3.0).all()


def test_a_selection_leaves_its_channel_when_the_integrated_deviation_is_used_up():
    """Channel 1 is off by 8, the mean by 2: after k frames its deviation is 6 (1 - 0.95^k), less 1 of which is summed.

    The others are off by 2, which is more than 1 too: but one alone is distrusted, the one that is off most.
    """
    chosen: dict[str, Any] = {"selection_deviation": 1.0, "selection_integral_s": 1.0}  # 1 s is 100 frames
    out = vote_samples(constant(8, 0, 0, 0, frames=400), manager="selection", **chosen)
    excess = np.cumsum(np.maximum(6.0 * (1.0 - 0.95 ** np.arange(1, 401)) - 1.0, 0.0))
    first = int(np.flatnonzero(excess > 100.0)[0])
    assert (out.voted[:first] == 8).all() and (out.voted[first:] == 0).all()
    assert out.failed_at() == [first + 1, None, None, None]


def test_a_selection_that_finds_no_trusted_channel_stays_on_the_channel_that_it_had():
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
    assert (out.voted[41:] == 0.5).all()
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
    samples = constant(3, 0.5, 0, 0, frames=300)
    samples[40:] = [0, 0.5, 0, 0]
    samples[200:] = [0, 3, 0, 0]
    out = vote_samples(samples, manager="selection", **chosen)
    assert out.voted[199] == 0.5 and out.voted[-1] == 0 and out.state[-1].tolist() == [0, 2, 0, 0]


# An independent expectation of each, in plain Python over random samples with gaps.
SAMPLE = st.sampled_from([0.0, 0.5, 1.0, 1.25, 3.0, 8.0, -4.0, np.nan])
FLIGHTS = hnp.arrays(np.float64, (25, 4), elements=SAMPLE)
MANY = settings(max_examples=round(80 / FEWER), deadline=None, derandomize=True)


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
        samples, manager="selection", channels=channels, selection_deviation=0.75, selection_integral_s=0.009
    )
    excess, smooth, selected, last = [0.0] * 4, [0.0] * 4, 0, [0.0] * 4
    for k, row in enumerate(samples):
        use = [c for c in range(channels) if not np.isnan(row[c])]
        for c in use:
            smooth[c] = 0.95 * smooth[c] + 0.05 * (row[c] - np.mean(row[use]))
            off = abs(smooth[c]) - 0.75 if len(use) > 2 else 0.0
            excess[c] = max(excess[c] + off, 0.0)
        most = max(use, key=lambda c: excess[c], default=0)
        trusted = [c for c in use if c != most or excess[c] <= 0.9]
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
    """Channel 1 is distrusted and alone has samples for a while; it is what there is."""
    samples = constant(30, 0, 0, 0, frames=200)
    samples[150:, 1:] = np.nan
    out = vote_samples(samples, manager="selection")
    assert out.level[149] == 3 and out.level[150] == 0
    assert (out.voted[100:150] == 0.0).all() and (out.voted[150:] == 30.0).all()


def test_a_silent_channel_does_not_blind_the_selection_to_another():
    """NaN in one channel of four: the offset of another is found as without it, against the mean of three."""
    chosen: dict[str, Any] = {"selection_deviation": 1.0, "selection_integral_s": 1.0}
    samples = constant(8, 0, 0, 0, frames=400)
    samples[:, 3] = np.nan
    out = vote_samples(samples, manager="selection", **chosen)
    excess = np.cumsum(np.maximum(16.0 / 3.0 * (1.0 - 0.95 ** np.arange(1, 401)) - 1.0, 0.0))
    assert out.failed_at() == [int(np.flatnonzero(excess > 100.0)[0]) + 1, None, None, 1]


def test_the_axes_of_a_unit_are_one_vector_and_one_selection():
    """6, 3 and 2 off on three axes are 7 together, of which the mean takes a quarter."""
    n, rate = 600, 100.0
    off = (6.0, 3.0, 2.0)
    signals = {f"w{i}": Samples([np.full(n, size), *(np.zeros(n) for _ in range(3))]) for i, size in enumerate(off)}
    config = {"threshold": 9.0, "manager": "selection", "selection_deviation": 4.0, "selection_integral_s": 1.5}
    settings = VoteConfig(default=config).signals(signals, "")
    recording = Recording(np.arange(n) / rate, signals)
    together = vote(recording, settings, [], triads={"w": list(signals)})
    excess = np.cumsum(np.maximum(0.75 * 7.0 * (1.0 - 0.95 ** np.arange(1, n + 1)) - 4.0, 0.0))
    first = int(np.flatnonzero(excess > 1.5 * rate)[0])
    for name, size in zip(signals, off, strict=True):
        assert [(f.channel, f.frame) for f in together[name].failures] == [(1, first + 1)]
        assert (together[name].voted[:first] == size).all() and (together[name].voted[first:] == 0).all()
    apart = vote(recording, settings, [])
    assert [len(apart[name].failures) for name in signals] == [1, 0, 0]
    gap = signals["w1"].channels[2]
    gap[300:] = np.nan  # one axis of another channel
    voted = vote(recording, settings, [], triads={"w": list(signals)})
    assert [(f.channel, f.frame) for f in voted["w0"].failures] == [(1, first + 1), (3, 301)]
