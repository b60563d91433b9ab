"""Properties that hold for any samples, checked with hypothesis against plain Python."""

import itertools

import numpy as np
import pytest
from conftest import vote_samples
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rig.computer.redundancy.managers import MANAGERS, manager_kind
from rig.core.frame import DecidedBy, Pattern, State
from rig.core.units.angles import difference
from rig.core.units.constants import TWO_PI

# Multiples of 1/8 make sums and shifts exact, so that equality can be asked for.
EIGHTHS = st.integers(-80, 80).map(lambda n: n / 8)
FRAMES = hnp.arrays(np.float64, (20, 4), elements=EIGHTHS)
FEW = settings(max_examples=60, deadline=None)
HOSTILE = st.sampled_from([np.nan, np.inf, -np.inf, 1e16, 1e300, -1e300, 1.7e308, -1.7e308, 5e-324, 0.0, 0.5, 1.0, 6.0])
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


@pytest.mark.requirement("redundancy", "one arbitrary channel cannot move the vote out of the others' range")
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


@pytest.mark.requirement("redundancy", "the vote has the least sum of distances (theorem, section 5)")
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


@pytest.mark.requirement("redundancy", "patterns are those of the definition")
@FEW
@given(DISTINCT)
def test_the_pattern_is_that_of_the_definition(values):
    """Patterns from the pairwise definition of decisions.md, written down naively."""
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


@settings(max_examples=150)
@given(
    hnp.arrays(np.float64, (12, 4), elements=HOSTILE),
    hnp.arrays(np.int64, (12, 4), elements=st.sampled_from([1, 1, 1, 0])),
    st.sampled_from(MANAGERS),
    st.sampled_from([(0.0, TWO_PI, True), (-1000.0, 1000.0, False), (-1.7e308, 1.7e308, False)]),
    st.sampled_from([0.0, 0.05]),
)
def test_the_vote_is_finite_and_within_the_comparable_samples(samples, valid, manager, sensor, fade_s):
    """Out of it only by what the requirement holds: an unresolved pattern, the last one lost, a fade."""
    low, high, wraps = sensor
    chosen = {"threshold": 0.2, "persistence": 3, "split_persistence": 4, "fade_s": fade_s}
    with np.errstate(all="ignore"):  # interpreted kernels warn where compiled ones overflow in silence
        out = vote_samples(samples, valid=valid, manager=manager, limits=(low, high), wraps=wraps, **chosen)
    assert np.isfinite(out.voted).all()
    latches = manager_kind(manager).latches
    for k in range(len(samples)):
        failed = out.state[k - 1] == State.FAILED if latches and k else np.zeros(4, bool)
        use = samples[k][~failed & (valid[k] == 1) & (samples[k] >= low) & (samples[k] <= high)]
        if len(use) == 0 or out.decided_by[k] == DecidedBy.UNRESOLVED or fade_s:
            continue
        if wraps:
            off = np.array([difference(x, out.voted[k], True) for x in use])
            assert off.min() <= 1e-9 and off.max() >= -1e-9, k
        else:
            assert use.min() <= out.voted[k] <= use.max(), k


def test_an_infinite_first_sample_does_not_poison_an_angle():
    samples = np.full((30, 4), 1.0)
    samples[0, 0] = np.inf
    for manager in MANAGERS:
        with np.errstate(invalid="ignore"):
            out = vote_samples(samples, manager=manager, limits=(0.0, TWO_PI), wraps=True, threshold=0.02)
        assert np.allclose(out.voted, 1.0, atol=1e-12), manager
        assert out.failed_at() == [None] * 4 or manager == "selection", manager
