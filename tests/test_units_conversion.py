"""Units that a user names: their factors from their definitions, and what is refused."""

from __future__ import annotations

from math import pi

import pytest

from rig.core.units.conversion import conversion

POUND_N = 0.45359237 * 9.80665


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("deg", pi / 180, "rad"),
        ("deg/s", pi / 180, "rad/s"),
        ("°/s", pi / 180, "rad/s"),
        ("rpm", 2 * pi / 60, "rad/s"),
        ("ft", 0.3048, "m"),
        ("kt", 1852 / 3600, "m/s"),
        ("psf", POUND_N / 0.3048**2, "Pa"),
        ("hPa", 100.0, "Pa"),
        ("gauss", 1e-4, "T"),
        ("mgauss", 1e-7, "T"),
        ("uT", 1e-6, "T"),
        ("g", 9.80665, "m/s^2"),
        ("ft/s^2", 0.3048, "m/s^2"),
        ("ms", 1e-3, "s"),
        ("%", 0.01, "1"),
        ("m", 1.0, "m"),
        ("1/s", 1.0, "1/s"),
    ],
)
def test_a_unit_of_ones_own_is_converted_to_the_si_unit_of_its_dimension(unit: str, factor: float, si: str):
    found = conversion(unit)
    assert found.factor == pytest.approx(factor, rel=1e-12) and found.si == si


def test_a_load_factor_is_in_g_and_may_be_given_as_an_acceleration():
    assert conversion("m/s^2", "g").factor == pytest.approx(1 / 9.80665)
    assert conversion("g", "g") == (1.0, "g")


@pytest.mark.parametrize(
    ("unit", "si", "says"),
    [
        ("ft", "rad/s", "'ft' is not a unit of this quantity; allowed: rad/s, deg/s, rpm"),
        ("Hz", "rad/s", "not a unit of this quantity"),
        ("%", "rad", "not a unit of this quantity"),
        ("deg", "1", "not a unit of this quantity"),
        ("degree per s", "rad/s", "unknown unit"),
        ("degC", None, "not a multiple of an SI unit"),
        ("dB", None, "not a multiple of an SI unit"),
        ("9**9**9**9", None, "unknown unit"),  # pint would compute it
        ("Ym^9*" * 7 + "m", None, "unknown unit"),
        ("", None, "unknown unit"),
        ("deg s", None, "unknown unit"),
    ],
)
def test_a_unit_that_does_not_fit_is_refused_with_what_is_allowed(unit: str, si: str | None, says: str):
    with pytest.raises(ValueError, match="allowed: ") as refused:
        conversion(unit, si)
    assert says in str(refused.value)
