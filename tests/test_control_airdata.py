"""Air data against the tables of the standard atmosphere and the geometry of the flow."""

from __future__ import annotations

import math

import pytest

from rig.computer.analytic.flight_path import path_angle
from rig.core.units import atmosphere
from rig.core.units import atmosphere as airdata

# ISO 2533: geopotential altitude [m], pressure [Pa], temperature [K]
ATMOSPHERE = [
    (0.0, 101_325.0, 288.15),
    (1_000.0, 89_874.6, 281.65),
    (5_000.0, 54_019.9, 255.65),
    (10_000.0, 26_436.3, 223.15),
    (11_000.0, 22_632.1, 216.65),
    (15_000.0, 12_044.6, 216.65),
    (20_000.0, 5_474.9, 216.65),
]


@pytest.mark.parametrize(("altitude", "pressure", "temperature"), ATMOSPHERE)
def test_the_standard_atmosphere_is_found_back(altitude: float, pressure: float, temperature: float) -> None:
    assert atmosphere.pressure_altitude(pressure) == pytest.approx(altitude, abs=0.6)
    assert atmosphere.temperature(altitude) == pytest.approx(temperature, abs=1e-9)


def test_pressure_altitude_is_continuous_at_the_tropopause() -> None:
    below = atmosphere.pressure_altitude(atmosphere.TROPOPAUSE_PRESSURE * (1 + 1e-12))
    above = atmosphere.pressure_altitude(atmosphere.TROPOPAUSE_PRESSURE * (1 - 1e-12))
    assert above == pytest.approx(below, abs=1e-6)


@pytest.mark.parametrize("mach", [0.2, 0.6, 0.84])
def test_mach_and_airspeeds_agree_with_the_definition_of_dynamic_pressure(mach: float) -> None:
    _, pressure, temperature = ATMOSPHERE[3]
    density = pressure / (287.05287 * temperature)
    airspeed = mach * math.sqrt(1.4 * 287.05287 * temperature)
    dynamic = 0.5 * density * airspeed**2
    assert airdata.mach_number(pressure, dynamic) == pytest.approx(mach, rel=1e-9)
    assert airdata.true_airspeed(mach, temperature) == pytest.approx(airspeed, rel=1e-9)
    assert airdata.equivalent_airspeed(dynamic) == pytest.approx(airspeed * math.sqrt(density / 1.225), rel=1e-4)


def test_impossible_pressures_give_numbers() -> None:
    for static in (-1.0, 0.0, 1e9):
        for dynamic in (-1.0, 0.0, 1e9):
            altitude = atmosphere.pressure_altitude(static)
            speed = airdata.true_airspeed(airdata.mach_number(static, dynamic), 220.0)
            assert math.isfinite(altitude) and math.isfinite(speed)


@pytest.mark.parametrize(
    ("theta", "phi", "alpha", "beta", "gamma"),
    [
        (0.1, 0.0, 0.04, 0.0, 0.06),  # wings level: theta - alpha
        (0.1, math.pi, 0.04, 0.0, 0.14),  # on the back: theta + alpha
        (0.0, math.pi / 2, 0.1, 0.05, -0.05),  # knife edge: sideslip points down
        (math.pi / 2, 1.0, 0.0, 0.0, math.pi / 2),  # straight up
    ],
)
def test_flight_path_angle_in_attitudes_that_can_be_drawn(
    theta: float, phi: float, alpha: float, beta: float, gamma: float
) -> None:
    assert path_angle(theta, phi, alpha, beta) == pytest.approx(gamma, abs=2e-9)
