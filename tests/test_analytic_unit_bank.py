"""The inertial unit's rates and bank angle: kinematics of a steady turn, and what is learned of its yaw rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.atmosphere import GRAVITY
from rig.computer.analytic.unit_bank import UNIT, finite, follow_unit
from rig.frame import INDEX, INERTIAL, S

DT, SPEED = 0.01, 200.0
P, Q, R, NORTH, EAST = (
    INERTIAL.index(name)
    for name in (
        *("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"),
        *("velocity_north_m_s", "velocity_east_m_s"),
    )
)


class Turn:
    """A level turn at a constant bank, as unit, accelerometers and compass see it; the pitch angle is zero."""

    def __init__(self, bank: float, drift: float = 0.0) -> None:
        self.rate = GRAVITY * math.tan(bank) / SPEED
        self.inertial, self.x, self.heading = np.zeros(len(INERTIAL)), np.zeros(S), 1.0
        self.inertial[Q], self.inertial[R] = self.rate * math.sin(bank), self.rate * math.cos(bank) + drift
        self.x[INDEX["normal_load_factor"]] = 1.0 / math.cos(bank)
        self.unit = np.zeros(1, UNIT)

    def fly(self, seconds: float, learn: bool = False, compass: float = 1.0) -> None:
        """``compass`` : factor of what is said of the heading."""
        for _ in range(round(seconds / DT)):
            self.heading += self.rate * DT
            self.inertial[NORTH] = SPEED * math.cos(self.heading)
            self.inertial[EAST] = SPEED * math.sin(self.heading)
            self.x[INDEX["heading"]] = (compass * self.heading) % (2.0 * math.pi)
            follow_unit(self.inertial, self.x, 0.0, learn, DT, self.unit[0])


@pytest.mark.parametrize("bank", [-0.5, 0.2, 0.9])
def test_a_turn_shows_its_bank_angle_from_any_first_guess(bank: float):
    turn = Turn(bank)
    turn.fly(30.0)
    assert turn.unit[0]["roll_angle"] == pytest.approx(bank, abs=1e-3)


def test_a_roll_shows_at_once():
    turn = Turn(0.0)
    turn.inertial[P] = 0.5
    turn.fly(0.5)
    assert turn.unit[0]["roll_angle"] == pytest.approx(0.25, abs=0.02)


def test_pushing_over_the_rates_alone_carry_the_bank_angle():
    turn = Turn(0.3)
    turn.x[INDEX["normal_load_factor"]], turn.unit[0]["roll_angle"] = 0.1, -0.2
    turn.fly(10.0)
    assert turn.unit[0]["roll_angle"] == pytest.approx(-0.2)


@pytest.mark.parametrize("bank", [0.0, 0.4])
def test_the_drift_of_the_yaw_rate_is_what_the_heading_does_not_confirm(bank: float):
    turn = Turn(bank, drift=0.002)
    turn.unit[0]["roll_angle"] = bank
    turn.fly(30.0, learn=True)
    assert turn.unit[0]["yaw_drift"] == pytest.approx(0.002, abs=1e-4)
    assert turn.unit[0]["yaw_rate"] == pytest.approx(turn.rate * math.cos(bank), abs=1e-4)


def test_nothing_is_learned_when_somebody_is_suspected_or_the_bank_is_steep():
    for bank, learn in ((0.0, False), (1.4, True)):
        turn = Turn(bank, drift=0.002)
        turn.unit[0]["roll_angle"] = bank
        turn.fly(10.0, learn=learn)
        assert turn.unit[0]["yaw_drift"] == 0.0


def test_a_heading_that_begins_to_lie_teaches_little_before_it_is_found():
    """Half of the heading from 30 s on, with the jump that this is: at most 1 mrad/s a minute."""
    turn = Turn(0.4)
    turn.unit[0]["roll_angle"] = 0.4
    turn.fly(30.0, learn=True)
    turn.fly(3.0, learn=True, compass=0.5)
    assert abs(turn.unit[0]["yaw_drift"]) < 1e-4


def test_the_pitch_rate_is_led_by_the_lag_of_the_unit():
    turn = Turn(0.0)
    turn.fly(0.1)
    turn.inertial[Q] = 0.001
    turn.fly(DT)
    assert turn.unit[0]["pitch_rate"] == pytest.approx(0.001 + 0.015 / DT * 0.001)


@pytest.mark.parametrize("which", [P, Q, R, NORTH, EAST])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_unit_that_gives_no_number_is_not_heard(which: int, value: float):
    inertial = np.zeros(len(INERTIAL))
    assert finite(inertial)
    inertial[which] = value
    assert not finite(inertial)
