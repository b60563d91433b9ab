"""The inertial unit's rates and bank angle: kinematics of a steady turn, and what is learned of its yaw rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.atmosphere import GRAVITY
from rig.computer.analytic.unit_bank import UNIT, bank_by, finite, follow_unit, learn_bank
from rig.frame import INDEX, INERTIAL, S

pytestmark = pytest.mark.requirement("fault-tolerant", "the unit's bank angle, its usual difference and yaw drift")

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


def straight(seconds: float, roll_drift: float, side: float, voted: float = 0.0, unit=None):
    """Level flight with a roll rate [rad/s] and a lateral load factor that are off, the bank angles compared."""
    turn = Turn(0.0)
    turn.unit = turn.unit if unit is None else unit
    turn.inertial[P], turn.x[INDEX["lateral_load_factor"]] = roll_drift, side
    for _ in range(round(seconds / DT)):
        turn.fly(DT)
        learn_bank(turn.unit[0], voted - turn.unit[0]["roll_angle"], True, DT)
    return turn.unit


@pytest.mark.parametrize(("roll_drift", "side"), [(0.0015, 0.0), (0.0, 0.012), (-0.0015, 0.012)])
def test_what_is_constant_is_known_after_five_seconds_of_straight_flight(roll_drift: float, side: float):
    """0 = p + 0.3 (0 - sin phi - n_y cos phi): phi is off by p / 0.3 - n_y."""
    unit = straight(5.0, roll_drift, side)[0]
    off = roll_drift / 0.3 - side
    assert unit["roll_angle"] == pytest.approx(off * (1.0 - math.exp(-0.3 * 5.0)), rel=0.01)
    assert unit["usual_bank"] == pytest.approx(-off, rel=0.2)
    assert bank_by(unit) == pytest.approx(0.0, abs=0.15 * abs(off))
    assert bank_by(straight(30.0, roll_drift, side)[0]) == pytest.approx(0.0, abs=0.001)


def test_a_bank_angle_that_is_off_later_teaches_a_milliradian_a_minute():
    unit = straight(60.0, 0.0, 0.0)
    straight(60.0, 0.0, 0.0, voted=0.02, unit=unit)
    assert 0.0 < unit[0]["usual_bank"] < 0.0011


def test_in_a_turn_or_under_suspicion_the_usual_difference_stays():
    for bank, learn in ((0.2, True), (0.0, False)):
        unit = np.zeros(1, UNIT)[0]
        unit["roll_angle"] = bank
        for _ in range(1000):
            learn_bank(unit, 0.02, learn, DT)
        assert unit["usual_bank"] == 0.0


@pytest.mark.parametrize("which", [P, Q, R, NORTH, EAST])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_unit_that_gives_no_number_is_not_heard(which: int, value: float):
    inertial = np.zeros(len(INERTIAL))
    assert finite(inertial)
    inertial[which] = value
    assert not finite(inertial)
