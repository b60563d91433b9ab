"""Times and quantities as people read them: degrees, milliseconds, seconds with the frame."""

from math import nan, pi

import pytest

from rig.core.units.quantities import duration, moment, number, quantity, seconds, unit_shown


@pytest.mark.parametrize(
    ("value", "unit", "says"),
    [
        (pi, "rad", "180 deg"),
        (-pi / 180, "rad/s", "-1 deg/s"),
        (0.5, "g", "0.5 g"),
        (101_325.4, "Pa", "101325 Pa"),
        (999.6, "Pa", "1000 Pa"),
        (0.25, "1", "0.25"),
        (0.00001, "g", "1.00e-05 g"),
        (0.0, "rad", "0 deg"),
        (nan, "g", "nan g"),
    ],
)
def test_a_quantity_is_shown_in_degrees_and_three_digits(value, unit, says):
    assert quantity(value, unit) == says


def test_a_sign_is_shown_when_asked_for_and_nothing_for_none():
    assert number(1.5, "g", signed=True) == "+1.5" and number(None) == ""
    assert unit_shown("rad/s") == "deg/s" and unit_shown("1") == "" and unit_shown("Pa") == "Pa"


def test_times_have_seconds_and_the_frame():
    assert moment(2007, 100.0) == "20.07 s (frame 2007)" and moment(None, 100.0) == ""
    assert seconds(2007, 1000.0) == "2.007 s" and seconds(3, 1.0) == "3.00 s"


def test_durations_are_milliseconds_below_a_second():
    assert [duration(n, 100.0) for n in (7, 100, 485, -1, None)] == ["70 ms", "1.00 s", "4.85 s", "-10 ms", ""]
    assert duration(1, 64.0) == "15.6 ms"
