"""Properties that hold for any samples, checked with hypothesis against plain Python."""

import itertools

import numpy as np
from conftest import vote_samples
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rig.frame import Pattern, State

# Multiples of 1/8 make sums and shifts exact, so that equality can be demanded.
EIGHTHS = st.integers(-80, 80).map(lambda n: n / 8)
FRAMES = hnp.arrays(np.float64, (20, 4), elements=EIGHTHS)
FEW = settings(max_examples=60, deadline=None)
DISTINCT = hnp.arrays(np.float64, (4,), elements=EIGHTHS, unique=True)


@FEW
@given(FRAMES, st.permutations(range(4)))
def test_a_permutation_of_channels_permutes_states_and_leaves_the_vote(samples, order):
    plain, mixed = vote_samples(samples), vote_samples(samples[:, order])
    tied = any(len(set(row)) < 4 for row in samples)
    assert np.array_equal(plain.voted, mixed.voted) or tied
    assert np.array_equal(plain.state[:, order], mixed.state) or tied


@FEW
@given(FRAMES, st.integers(-50, 50), st.sampled_from([0.5, 2.0, 4.0]))
def test_a_shift_and_a_scale_carry_over(samples, shift, scale):
    plain = vote_samples(samples)
    moved = vote_samples(samples * scale + shift, threshold=scale)
    assert np.array_equal(plain.state, moved.state)
    assert np.allclose(plain.voted * scale + shift, moved.voted, atol=1e-9)


@FEW
@given(hnp.arrays(np.float64, (12, 3), elements=st.floats(0, 0.9)), st.floats(-1000, 1000) | st.just(np.nan))
def test_one_arbitrary_channel_never_moves_the_vote_out_of_the_range_of_the_others(good, wild):
    for place in range(4):
        samples = np.insert(good, place, wild, axis=1)
        out = vote_samples(samples)
        assert (out.voted >= good.min(axis=1)).all()
        assert (out.voted <= good.max(axis=1)).all()


@FEW
@given(hnp.arrays(np.float64, (12, 2), elements=st.floats(0, 0.9)), st.floats(-1000, 1000) | st.just(np.nan))
def test_at_level_three_likewise(good, wild):
    for place in range(3):
        samples = np.insert(good, place, wild, axis=1)
        out = vote_samples(np.column_stack([samples, np.full(12, np.nan)]), channels=3)
        assert (out.voted >= good.min(axis=1)).all()
        assert (out.voted <= good.max(axis=1)).all()


@FEW
@given(hnp.arrays(np.float64, (1, 4), elements=EIGHTHS))
def test_the_vote_of_a_majority_has_the_least_sum_of_distances_to_the_samples(samples):
    out = vote_samples(samples)
    if Pattern(out.pattern[0]) not in (Pattern.NORMAL, Pattern.ISOLATED):
        return

    def distance(value: float) -> float:
        return float(np.abs(samples[0] - value).sum())

    assert distance(out.voted[0]) <= min(distance(value) for value in samples[0]) + 1e-12


@FEW
@given(hnp.arrays(np.float64, (40, 4), elements=st.floats(0, 1)))
def test_a_healthy_flight_within_the_threshold_never_suspects_anybody(samples):
    out = vote_samples(samples)
    assert (out.state == State.OK).all()
    assert (out.level == 4).all()


@FEW
@given(DISTINCT)
def test_the_pattern_is_that_of_the_definition(values):
    """Patterns from the pairwise definition of redundancy.md, section 2, written down naively."""
    agree = {(i, j): abs(values[i] - values[j]) <= 1.0 for i, j in itertools.combinations(range(4), 2)}
    partners = [sum(agree[min(i, j), max(i, j)] for j in range(4) if j != i) for i in range(4)]
    rank = np.argsort(values)
    top, bottom = tuple(sorted(rank[2:])), tuple(sorted(rank[:2]))
    middle = tuple(sorted(rank[1:3]))
    if not any(agree.values()):
        expected = Pattern.P1_1_1_1
    elif agree[top] and agree[bottom] and not agree[middle]:
        expected = Pattern.P2_2
    else:
        expected = Pattern.ISOLATED if 0 in partners else Pattern.NORMAL
    assert vote_samples(values[None]).pattern[0] == expected
