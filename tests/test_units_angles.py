from math import inf, isnan, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.units.angles import difference, limit, wrap

ANGLES = st.floats(-100, 100)


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
