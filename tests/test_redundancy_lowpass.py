"""Thresholds by the number of samples, and the filter before the comparison: analytic expectations."""

from math import exp, log

import numpy as np
import pytest
from conftest import constant, vote_samples

from rig.computer.redundancy.lowpass import gain
from rig.core.frame import DecidedBy, Pattern, State

RATE_HZ = 100.0  # of vote_samples
ALIKE = (0.0, 0.0, 0.0, 0.0)


@pytest.mark.requirement("redundancy", "a threshold for four, for three and for two samples")
@pytest.mark.parametrize(
    ("samples", "pattern"),
    [
        ((0.0, 0.0, 0.0, 1.5), Pattern.ISOLATED),
        ((0.0, 0.0, 1.5, np.nan), Pattern.NORMAL),
        ((0.0, 0.0, 2.5, np.nan), Pattern.ISOLATED),
        ((0.0, 2.5, np.nan, np.nan), Pattern.NORMAL),
        ((0.0, 3.5, np.nan, np.nan), Pattern.P1_1),
    ],
)
def test_each_number_of_samples_has_its_threshold(samples, pattern):
    out = vote_samples(constant(*samples, frames=1), threshold=1.0, threshold_triplex=2.0, threshold_duplex=3.0)
    assert out.pattern[0] == pattern


@pytest.mark.requirement("redundancy", "a threshold for four, for three and for two samples")
def test_a_threshold_that_is_not_given_is_that_of_four():
    out = vote_samples(constant(0.0, 0.0, 1.5, np.nan, frames=1), threshold=1.0, threshold_duplex=9.0)
    assert out.pattern[0] == Pattern.ISOLATED


@pytest.mark.requirement("redundancy", "a threshold for four, for three and for two samples")
def test_the_next_fault_is_found_by_the_threshold_of_those_that_are_left():
    samples = constant(*ALIKE, frames=60)
    samples[5:, 3], samples[30:, 2] = 5.0, 1.5
    found = vote_samples(samples, threshold=1.0, threshold_triplex=1.2).failed_at()
    wide = vote_samples(samples, threshold=1.0, threshold_triplex=2.0).failed_at()
    assert found == [None, None, 38, 13] and wide == [None, None, None, 13]  # counted from 1


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_an_offset_is_seen_when_the_filtered_one_leaves_the_threshold():
    offset, threshold, filter_s, persistence = 1.3, 1.0, 0.1, 8  # a step is never more than its limit, 1 / 7.5
    samples = constant(*ALIKE, frames=60)
    samples[10:, 1] = offset
    # offset (1 - exp(-t / filter_s)) > threshold, with the first filtered frame one sampling interval after frame 9.
    after = filter_s * log(offset / (offset - threshold)) * RATE_HZ
    first = 10 + int(np.floor(after)) + 1  # counted from 1
    out = vote_samples(samples, threshold=threshold, filter_s=filter_s, persistence=persistence)
    assert out.failed_at() == [None, first + persistence - 1, None, None]


@pytest.mark.requirement("redundancy", "a burst shorter than the persistence moves no comparison by a threshold")
@pytest.mark.parametrize("size", [2.9, 50.0, 900.0])
@pytest.mark.parametrize("filter_s", [0.005, 0.02, 0.1, 1.0])
@pytest.mark.parametrize("persistence", [2, 4, 8])
def test_a_burst_that_is_shorter_than_the_persistence_is_never_seen(size: float, filter_s: float, persistence: int):
    """A step is at most 1 / (persistence - 1/2) thresholds: all but one of the persistence are less than one."""
    samples = constant(*ALIKE, frames=60)
    samples[20 : 20 + persistence - 1, 2] = size
    out = vote_samples(samples, filter_s=filter_s, persistence=persistence)
    assert (out.pattern == Pattern.NORMAL).all() and (out.state == State.OK).all()


def test_one_as_long_as_the_persistence_is():
    samples = constant(*ALIKE, frames=60)
    samples[20:28, 2] = 900.0
    out = vote_samples(samples, filter_s=0.1)
    assert np.flatnonzero(out.pattern != Pattern.NORMAL).tolist() == [27] and out.failed_at() == [None] * 4


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
@pytest.mark.parametrize(("offset", "at"), [(900.0, 18), (-900.0, 18), (2.0, 18), (1.5, 22)])
def test_a_large_offset_is_seen_when_its_limited_steps_have_left_the_threshold(offset: float, at: int):
    """Steps of 2/15: 16/15 after eight; of 2 five, then 2 - 4/3 0.905^3 = 1.012 after three more; of 1.5 one, then
    1.5 - 1.367 0.905^11 = 1.045 after eleven more, where it was 0.997 after ten."""
    samples = constant(*ALIKE, frames=60)
    samples[10:, 1] = offset
    out = vote_samples(samples, filter_s=0.1)
    assert out.failed_at() == [None, at + 7, None, None]


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_vibration_fails_no_channel_behind_a_filter_and_is_voted_as_it_is():
    samples = constant(*ALIKE, frames=200)
    samples[1:, 2] = 3.0 * np.where(np.arange(199) % 4 < 2, 1.0, -1.0)  # two samples a side: 2 (3 - 0) gain < threshold
    assert vote_samples(samples, persistence=1).failed_at()[2] is not None
    out = vote_samples(samples, persistence=1, filter_s=0.2, threshold=1.0)
    assert out.failed_at() == [None] * 4
    assert np.array_equal(out.voted, vote_samples(samples, manager="median").voted)


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_a_step_of_the_vote_is_not_delayed():
    samples = constant(*ALIKE, frames=20)
    samples[10:] = 5.0
    out = vote_samples(samples, filter_s=0.5)
    assert list(out.voted[8:12]) == [0.0, 0.0, 5.0, 5.0]


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_the_filter_begins_again_after_a_sample_that_cannot_be_compared():
    """Where the vote has followed the others, which lag 50 behind their samples; so does this one, but for a step."""
    samples = constant(*ALIKE, frames=80)
    samples[20:23, 0] = np.nan
    samples[20:] += 50.0
    out = vote_samples(samples, filter_s=1.0, threshold=1.0, persistence=80)
    assert (out.pattern == Pattern.NORMAL).all() and (out.state[23:, 0] == State.OK).all()


@pytest.mark.parametrize("at", [0, 40])
def test_a_burst_that_a_filter_begins_with_fails_no_channel(at: int):
    """Two frames of 200 thresholds, at first or after a frame without a sample; a step is 1/7.5 of a threshold."""
    samples = np.where(np.arange(4) < 2, constant(0, 0, 0, 0, frames=300), np.nan)
    samples[at, 0] = np.nan
    samples[at + (at > 0) : at + (at > 0) + 2, 0] = 200.0
    out = vote_samples(samples, channels=2, filter_s=0.1, reference=0.0, persistence=8)
    assert out.failed_at() == [None] * 4 and (out.state[at + 20 :, :2] == State.OK).all()


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_a_reference_begins_at_the_filtered_vote_too():
    """Both pairs begin at 1.5 and part by a step of 2/15, and then of the gain 0.0952.  The reference, which reads 3
    as the upper pair does, comes in row 20: 1.633, 1.763 and 1.881 are off that pair's 2.796, 2.815 and 2.833 by
    1.16, 1.05 and 0.95, and off the lower one's by more."""
    samples = constant(0.0, 0.0, 3.0, 3.0, frames=25)
    reference = np.where(np.arange(1, 26) < 20, np.nan, 3.0)
    out = vote_samples(samples, reference=reference, filter_s=0.1, tie_break=["reference"], split_persistence=30)
    assert (out.decided_by[19:] == DecidedBy.REFERENCE).all() and (out.state[19:, :2] == State.SUSPECT).all()
    assert (out.state[19:21, 2:] == State.SUSPECT).all() and (out.state[21:, 2:] == State.OK).all()


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_an_angle_is_filtered_the_short_way_round():
    samples = np.tile(np.array([3.1, 3.1, -3.12, -3.12]), (60, 1))
    turning = (samples + 0.05 * np.arange(60)[:, None] + np.pi) % (2 * np.pi) - np.pi
    out = vote_samples(turning, wraps=True, limits=(-np.pi, np.pi), filter_s=0.05, threshold=0.1)
    assert (out.pattern == Pattern.NORMAL).all() and out.failed_at() == [None] * 4


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_the_halves_of_a_split_are_those_of_the_filtered_samples():
    samples = constant(*ALIKE, frames=120)
    samples[20:] = 0.0, 0.2, 4.0, 4.2
    samples[20:, 0] += 3.9 * np.where(np.arange(100) % 2 == 0, 1.0, -1.0)  # now with the one half, now with neither
    given = {"threshold": 1.5, "reference_threshold": 3.0, "reference": 0.0, "tie_break": ["reference"]}
    out = vote_samples(samples, filter_s=0.3, **given)
    assert list(out.state[-1]) == [State.OK, State.OK, State.FAILED, State.FAILED]
    assert DecidedBy.REFERENCE in out.decided_by
    assert vote_samples(samples, **given).failed_at()[2:] == [None, None]


@pytest.mark.requirement("redundancy", "comparisons behind a filter, the vote without it")
def test_a_failed_channel_comes_back_when_the_filtered_one_agrees():
    samples = constant(*ALIKE, frames=300)
    samples[10:60, 3] = 9.0
    samples[60:, 3] = 1.5 * np.where(np.arange(240) % 2 == 0, 1.0, -1.0)
    reset = [(290, 4)]
    plain = vote_samples(samples, readmit_frames=100, resets=reset)
    behind = vote_samples(samples, readmit_frames=100, resets=reset, filter_s=0.2)
    assert plain.state[295, 3] == State.FAILED and behind.state[295, 3] != State.FAILED


@pytest.mark.parametrize("rate_hz", [50.0, 400.0])
def test_a_step_is_followed_to_one_less_1_over_e_in_the_time_constant(rate_hz: float):
    frames = round(0.2 * rate_hz)
    assert 1.0 - (1.0 - gain(0.2, rate_hz)) ** frames == pytest.approx(1.0 - exp(-1.0))
    assert gain(0.0, rate_hz) == 0.0
