"""The single laws: turns, headings, altitude capture, integrators."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.computer.control import laws
from rig.computer.control.law_state import STATE

G = 9.80665


def state(**values: float) -> NDArray[Any]:
    record = np.zeros(1, STATE)
    for name, value in values.items():
        record[name] = value
    return record


@pytest.mark.parametrize("phi", [-0.9, 0.3, 0.7])
@pytest.mark.parametrize("theta", [0.0, 0.1])
def test_the_rates_of_a_level_turn_rotate_about_the_vertical(phi: float, theta: float) -> None:
    speed = 190.0
    turn = G * math.tan(phi) / speed  # heading rate
    expected = turn * np.array([-math.sin(theta), math.sin(phi) * math.cos(theta), math.cos(phi) * math.cos(theta)])
    actual = [
        laws.turn_roll_rate(phi, theta, speed),
        laws.turn_pitch_rate(phi, theta, speed),
        laws.turn_yaw_rate(phi, theta, speed),
    ]
    assert actual == pytest.approx(expected, rel=1e-12)


def test_the_turn_pitch_rate_fades_beyond_sixty_degrees() -> None:
    at = [laws.turn_pitch_rate(math.radians(x), 0.0, 100.0) for x in (59.999, 60.001, 75.0, 90.0, 180.0)]
    assert at[0] == pytest.approx(at[1], rel=1e-3)
    assert at[1] > at[2] > at[3]
    assert at[3:] == pytest.approx([0.0, 0.0], abs=1e-15)


@pytest.mark.parametrize(
    ("command", "heading", "side"), [(0.1, 6.2, 1), (6.2, 0.1, -1), (3.2, 3.0, 1), (0.5, 3.8, 1), (3.8, 0.5, -1)]
)
def test_headings_are_turned_to_the_short_way_round(command: float, heading: float, side: int) -> None:
    bank = laws.bank_for_heading(command - heading, 0.2, 190.0, 0.5)
    assert math.copysign(1, bank) == side
    assert abs(bank) <= 0.5


@pytest.mark.parametrize("step", [100.0, -100.0, 5.0, 1000.0])
def test_the_altitude_reference_arrives_without_overshoot_and_within_its_limits(step: float) -> None:
    record = state()
    rates, dt = [0.0], 0.01
    for _ in range(20_000):
        laws.approach(step, 0.3, 15.0, 1.5, dt, record)
        rates.append(float(record["altitude_rate"][0]))
        assert abs(record["altitude_reference"][0]) <= abs(step) * 1.02
    assert record["altitude_reference"][0] == pytest.approx(step, rel=1e-6)
    assert np.max(np.abs(rates)) <= 15.0 + 1e-12
    assert np.max(np.abs(np.diff(rates))) <= 1.5 * dt + 1e-12


def test_climb_rate_takes_out_a_constant_accelerometer_error() -> None:
    record = state(altitude_estimate=0.0)
    for k in range(10_000):
        laws.vertical_motion(3.0 * 0.01 * k, 0.5, 0.4, 0.01, record)  # 3 m/s; 0.5 m/s2 that is not there
    assert record["climb_rate"][0] == pytest.approx(3.0, abs=0.02)
    assert record["acceleration_error"][0] == pytest.approx(-0.5, abs=0.01)


def test_an_integrator_stands_still_at_a_stop_and_leaves_it_at_once() -> None:
    low, high = -0.4, 0.4
    assert laws.integrate(0.5, 0.01, 0.05, low, high) == 0.5  # would push further
    assert laws.integrate(0.5, -0.01, 0.05, low, high) == 0.49  # comes back
    assert laws.integrate(-0.5, -0.01, 0.05, low, high) == -0.5
    assert laws.integrate(0.44, 0.05, 0.05, low, high) == pytest.approx(0.45)  # just reaches it
    assert laws.integrate(0.1, 0.01, 0.05, low, high) == pytest.approx(0.11)
