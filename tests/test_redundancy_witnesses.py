"""Witnesses against the last channel and where nobody agrees; eps 1, persistence 8, singular persistence 10."""

import numpy as np
import pytest
from conftest import constant, vote_samples

from rig.frame import Ilm, Pattern, Resolver, State

BAD, GOOD, ABSENT = int(Ilm.BAD), int(Ilm.GOOD), int(Ilm.ABSENT)


def alone(*values: float, frames: int = 30):
    """One channel, the others silent from the start."""
    samples = np.full((frames, 4), np.nan)
    samples[:, 0] = np.resize(values, frames)
    return samples


def test_the_last_channel_is_failed_by_its_own_monitor():
    flags = np.full((30, 4), ABSENT)
    flags[12:, 0] = BAD
    out = vote_samples(alone(2.0), ilm=flags)
    assert out.failed_at()[0] == 20
    assert (out.resolver[12:20] == Resolver.ILM).all() and (out.state[12:19, 0] == State.SUSPECT).all()
    assert (out.pattern[12:20] == Pattern.NORMAL).all() and (out.pattern[20:] == Pattern.LOST).all()
    assert (out.voted == 2.0).all()  # the last vote holds
    assert out.level[18] == 1 and out.level[19] == 0


@pytest.mark.parametrize(("off", "at"), [(1.4, None), (1.6, 8), (-1.6, 8), (-1.4, None)])
def test_the_last_channel_is_failed_beyond_one_and_a_half_reference_thresholds(off: float, at: int | None):
    out = vote_samples(alone(2.0), reference=2.0 + off, reference_threshold=1.0)
    assert out.failed_at()[0] == at
    voted = 2.0 if at is None else 2.0 + off
    assert (out.voted[:8] == voted).all()
    assert (out.resolver[:8] == (Resolver.NONE if at is None else Resolver.REFERENCE)).all()


def test_a_monitor_that_says_bad_names_itself_before_the_reference():
    flags = np.tile([BAD, ABSENT, ABSENT, ABSENT], (30, 1))
    out = vote_samples(alone(2.0), ilm=flags, reference=9.0)
    assert (out.resolver[:8] == Resolver.ILM).all() and (out.voted[:8] == 9.0).all()


def test_a_last_channel_that_is_good_again_in_time_stays():
    reference = np.full(30, 2.0)
    reference[5:12] = 5.0
    out = vote_samples(alone(2.0), reference=reference)
    assert out.failed_at()[0] is None
    assert (out.voted[5:12] == 5.0).all() and (out.voted[12:] == 2.0).all()


def test_the_reference_is_not_monitored_against_the_last_channel():
    out = vote_samples(alone(2.0), reference=3.4)
    assert (out.reference_usable == 1).all()


def split(frames: int = 60):
    """Pairs at 0 and 5, the low pair torn apart by 1.2 in every second frame from the sixth on."""
    samples = constant(0.0, 0.1, 5.0, 5.1, frames=frames)
    samples[5::2, 1] = 1.2
    return samples


def test_noise_that_splits_the_good_pair_does_not_fail_it():
    """2:2 and 1:1:2 in turns: without the wait the counts of the torn pair go on and fail both."""
    out = vote_samples(split(), reference=0.0, resolvers=["reference"], persistence=8)
    assert Pattern.ISOLATED in out.pattern[5:] and Pattern.P2_2 in out.pattern[6:]
    assert (out.state[:, :2] != State.FAILED).all()


def test_counts_stand_still_as_long_as_the_run_was():
    """Six frames of 2:2, then channel 4 alone: its count begins after six more frames."""
    samples = constant(0.0, 0.1, 5.0, 5.1, frames=40)
    samples[6:, 2] = 0.2
    out = vote_samples(samples, resolvers=["reference"])
    assert out.failed_at() == [None, None, None, 6 + 6 + 8]
    longer = constant(0.0, 0.1, 5.0, 5.1, frames=60)
    longer[25:, 2] = 0.2
    assert vote_samples(longer, resolvers=["reference"]).failed_at() == [None, None, None, 25 + 10 + 8]


def test_a_silent_channel_counts_during_the_wait():
    samples = constant(0.0, 0.1, 5.0, 5.1, frames=40)
    samples[6:, 2:] = np.nan
    assert vote_samples(samples, resolvers=["reference"]).failed_at() == [None, None, 14, 14]


@pytest.mark.parametrize("kept", range(4))
def test_one_good_monitor_of_four_keeps_an_extreme(kept: int):
    flags = np.full((30, 4), BAD)
    flags[:, kept] = GOOD
    values = (-9.0, -3.0, 3.0, 9.0)
    out = vote_samples(constant(*values), ilm=flags)
    assert out.failed_at() == [None if c == kept else 10 for c in range(4)]
    assert (out.resolver[:10] == Resolver.ILM).all() and (out.voted == values[kept]).all()


@pytest.mark.parametrize("flags", [[GOOD, GOOD, BAD, BAD], [GOOD, BAD, BAD, ABSENT], [BAD] * 4])
def test_monitors_that_name_not_exactly_one_are_not_asked_further(flags: list[int]):
    out = vote_samples(constant(-9, -3, 3, 9), ilm=np.tile(flags, (30, 1)))
    assert (out.resolver[:10] == Resolver.EXTREMES).all()


@pytest.mark.parametrize("kept", range(3))
def test_one_sample_near_the_reference_is_kept(kept: int):
    values = (-5.0, 0.0, 5.0)
    samples = np.column_stack([constant(*values), np.full(30, np.nan)])
    out = vote_samples(samples, channels=3, reference=values[kept] + 0.9)
    assert out.failed_at() == [None if c == kept else 10 for c in range(3)] + [None]
    assert (out.voted == values[kept]).all()


def test_a_reference_near_two_or_nobody_leaves_it_to_the_rules_of_rank():
    two = vote_samples(constant(-9, 0.0, 1.5, 9), reference=0.75)
    nobody = vote_samples(constant(-9, -3, 3, 9), reference=0.0)
    for out in (two, nobody):
        assert (out.resolver[:10] == Resolver.EXTREMES).all()
        assert out.failed_at()[0] == out.failed_at()[3] == 10


def test_the_rules_of_rank_are_asked_last_whatever_their_place():
    out = vote_samples(constant(-9, -3, 3, 9), reference=9.0, resolvers=["extremes", "middle", "reference"])
    assert (out.resolver[:10] == Resolver.REFERENCE).all()


@pytest.mark.parametrize("values", [(-9.0, -3.0, 3.0, 9.0), (-5.0, 0.0, 5.0, np.nan)])
def test_without_the_rules_of_rank_nobody_is_failed(values: tuple[float, ...]):
    four = not np.isnan(values[3])
    out = vote_samples(constant(*values), channels=4 if four else 3, resolvers=["ilm", "reference", "trend"])
    assert (out.resolver == Resolver.UNRESOLVED).all()
    assert out.failed_at() == [None] * 4


def test_an_unresolved_split_does_not_move_the_vote():
    samples = constant(0.0, 0.0, 0.0, 0.0)
    samples[5:, 2:] = 5.0
    out = vote_samples(samples, resolvers=["reference"])
    assert (out.voted == 0.0).all()
    moving = samples + 0.1 * np.arange(30.0)[:, None]
    expected = 0.1 * np.arange(30.0)
    expected[5:] -= 0.1  # the change of the first frame counts as zero
    assert np.allclose(vote_samples(moving, resolvers=["reference"]).voted, expected)
