from math import inf, isnan, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.core.units.angles import (
    difference,
    differences,
    limit,
    near,
    short_way,
    step_sizes,
    unwrapped,
    within_a_turn,
    wrap,
)

ANGLES, TURN = st.floats(-100, 100), 2 * pi


@given(ANGLES)
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    out = wrap(angle)
    assert -pi <= out <= pi
    turns = (angle - out) / (2 * pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


@given(ANGLES, ANGLES)
def test_the_short_way_is_at_most_half_a_turn(a, b):
    assert abs(difference(a, b, 1)) <= pi
    assert difference(a, b, 0) == a - b


def test_limits_saturate_or_go_round():
    assert limit(3.0, -1.0, 2.0, 0) == 2.0 and limit(-3.0, -1.0, 2.0, 0) == -1.0 and limit(0.5, -1.0, 2.0, 0) == 0.5
    assert limit(7.0, 0.0, 2 * pi, 1) == pytest.approx(7.0 - 2 * pi)
    assert limit(inf, -1.0, 2.0, 0) == 2.0
    assert isnan(limit(nan, -1.0, 2.0, 0)) and isnan(wrap(nan))


@given(
    st.floats(-20.0, 20.0) | st.sampled_from([0.0, -0.0, TURN, -TURN, 5e-324, np.nextafter(TURN, 0.0), -1e-17, 1e300])
)
def test_within_a_turn_is_the_remainder_to_the_bit_but_for_the_sign_of_zero(angle):
    assert within_a_turn(angle) == angle % TURN


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_arrays_go_the_short_way_to_the_bits_of_the_kernel(angles):
    assert short_way(np.array(angles)).tolist() == [wrap(angle) for angle in angles]


def test_a_difference_of_arrays_wraps_the_columns_that_are_angles():
    a, b = np.array([[3.0, 3.0], [nan, inf]]), np.array([[-3.0, -3.0], [0.0, inf]])
    off = differences(a, b, np.array([True, False]))
    assert off[0].tolist() == [difference(3.0, -3.0, 1), 6.0] and np.isnan(off[1]).all()
    assert differences(a[0], b[0], True).tolist() == [difference(3.0, -3.0, 1)] * 2
    assert differences(a[0], b[0], False).tolist() == [6.0, 6.0]


def test_angles_near_a_base_are_the_same_directions_within_half_a_turn():
    base = np.array([10.0, -7.0])
    moved = near(np.array([0.1, 0.2]), base)
    assert (np.abs(moved - base) <= pi).all()
    assert np.sin(moved) == pytest.approx(np.sin([0.1, 0.2]))


def test_unwrapped_angles_keep_what_is_no_number():
    out = unwrapped(np.array([3.0, nan, -3.0, inf]))
    assert out[0] == 3.0 and out[2] == pytest.approx(2 * pi - 3.0) and isnan(out[1]) and out[3] == inf


def test_the_size_of_a_step_of_an_angle_is_at_most_half_a_turn():
    assert step_sizes(np.array([0.1, 2 * pi - 0.1]), True) == pytest.approx([0.2])
    assert step_sizes(np.array([0.1, 2 * pi - 0.1]), False) == pytest.approx([2 * pi - 0.2])
