"""The inertial unit's rates and bank angle: kinematics of a steady turn, and what is learned of its yaw rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.computer.analytic.unit_bank import UNIT, bank_by, finite, follow_unit, learn_bank, learned
from rig.core.frame import INDEX, INERTIAL, S
from rig.core.units.constants import GRAVITY

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


def frame(phi: float, theta: float = 0.0, learn: bool = False, **fields: float):
    """One frame of a turn in which everything is something, at 190 m/s, 10 mrad/s of heading and course."""
    inertial, x, unit = np.zeros(len(INERTIAL)), np.zeros(S), np.zeros(1, UNIT)[0]
    unit["roll_angle"], unit["started"] = phi, 1
    unit["last"] = 0.019, 190.0 * math.cos(2.0), 190.0 * math.sin(2.0), math.pi - 0.00005
    for name, value in fields.items():
        unit[name] = value
    inertial[[P, Q, R]] = 0.03, 0.02, 0.05
    inertial[[NORTH, EAST]] = 190.0 * math.cos(2.0001), 190.0 * math.sin(2.0001)
    x[INDEX["heading"]] = -math.pi + 0.00005
    x[INDEX["normal_load_factor"]], x[INDEX["lateral_load_factor"]] = 1.1, 0.04
    follow_unit(inertial, x, theta, learn, DT, unit)
    return unit


@pytest.mark.parametrize(("phi", "theta"), [(0.3, 0.2), (-0.5, -0.1), (1.5, 0.1)])
def test_one_frame_of_the_bank_angle_is_the_rate_of_the_page_above(phi: float, theta: float):
    """At 1.5 rad the load factor along the vertical is too small to be asked."""
    unit, sine, cosine = frame(phi, theta, yaw_drift=0.004), math.sin(phi), math.cos(phi)
    rate, level = 0.03 + (0.02 * sine + 0.046 * cosine) * math.tan(theta), 1.1 * cosine - 0.04 * sine
    if level > 0.3:
        rate += 0.3 * (190.0 * 0.01 / GRAVITY - 1.1 * sine - 0.04 * cosine) / level
    assert unit["roll_angle"] == pytest.approx(phi + DT * rate, abs=1e-9)
    assert unit["pitch_rate"] == pytest.approx(0.02 + 0.015 / DT * 0.001) and unit["yaw_rate"] == pytest.approx(0.046)
    velocity = 190.0 * math.cos(2.0001), 190.0 * math.sin(2.0001)
    assert unit["last"] == pytest.approx([0.02, *velocity, -math.pi + 0.00005])


def test_the_first_frame_knows_no_change():
    unit = frame(0.0, started=0)
    assert unit["started"] == 1 and unit["pitch_rate"] == 0.02
    assert unit["roll_angle"] == pytest.approx(DT * (0.03 - 0.3 * 0.04 / 1.1))


def test_a_velocity_that_hardly_is_one_counts_as_thirty_metres_a_second():
    """The same turn at 3 m/s: the acceleration that it shows is a tenth of V chi'."""
    unit, inertial, x = np.zeros(1, UNIT)[0], np.zeros(len(INERTIAL)), np.zeros(S)
    unit["started"], unit["last"] = 1, (0.0, 3.0, 0.0, 0.0)
    inertial[NORTH], inertial[EAST], x[INDEX["normal_load_factor"]] = 3.0, 0.02, 1.0
    follow_unit(inertial, x, 0.0, False, DT, unit)
    assert unit["roll_angle"] == pytest.approx(DT * 0.3 * 3.0 * 0.02 / (30.0 * DT) / GRAVITY, rel=1e-9)


@pytest.mark.parametrize(("before", "seconds", "drift"), [(0.03, 2.0, 0.004), (0.03, 30.0, 0.0), (-0.03, 90.0, 0.0)])
def test_one_frame_of_the_yaw_drift_is_what_the_heading_does_not_confirm(before: float, seconds: float, drift: float):
    """Smoothed over a second; after five seconds no more than 1 mrad/s of it counts, and after sixty as after sixty."""
    unit = frame(0.3, 0.2, learn=True, yaw_error=before, yaw_seconds=seconds, yaw_drift=drift)
    turn = (0.01 * math.cos(0.2) - 0.02 * math.sin(0.3)) / math.cos(0.3)
    error = before + DT / (1.0 + DT) * (0.05 - drift - turn - before)
    assert unit["yaw_error"] == pytest.approx(error, rel=1e-9)
    assert unit["yaw_seconds"] == pytest.approx(seconds + DT)
    counted = error if seconds < 5.0 else math.copysign(0.001, error)
    assert unit["yaw_drift"] == pytest.approx(drift + DT / (min(seconds + DT, 60.0) + 1.0) * counted, rel=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_heading_that_jumps_counts_as_a_turn_of_three_tenths_of_a_radian_a_second(sign: float):
    turn = Turn(0.0)
    turn.fly(DT)
    turn.unit[0]["last"][3] -= sign * 0.1
    turn.fly(DT, learn=True)
    assert turn.unit[0]["yaw_error"] == pytest.approx(-sign * 0.3 * DT / (1.0 + DT), rel=1e-9)


@pytest.mark.parametrize(
    ("seconds", "error", "counted"),
    [(0.5, -0.02, -0.02), (5.0, 0.02, 0.02), (5.1, 0.02, 0.001), (5.1, -0.02, -0.001), (5.1, 0.0004, 0.0004)],
)
def test_a_mean_that_is_known_learns_no_more_than_a_milliradian_a_second(seconds: float, error: float, counted: float):
    assert learned(error, seconds, DT) == pytest.approx(DT / (seconds + 1.0) * counted, rel=1e-9)
    assert learned(0.0004, 100.0, DT) == pytest.approx(DT / 61.0 * 0.0004, rel=1e-9)


@pytest.mark.parametrize(("seconds", "apart"), [(2.0, 0.02), (5.1, 0.02), (90.0, -0.02), (90.0, 0.0042)])
@pytest.mark.parametrize("bank", [-0.09, 0.09])
def test_one_frame_of_the_usual_difference_is_least_squares_on_its_share(seconds: float, apart: float, bank: float):
    """Half of its convergence behind it; after five seconds of straight flight a milliradian counts."""
    unit = np.zeros(1, UNIT)[0]
    unit["roll_angle"], unit["settled"], unit["usual_bank"], unit["bank_seconds"] = bank, 0.5, 0.008, seconds
    learn_bank(unit, apart, True, DT)
    share = 0.5 + DT * 0.3 * 0.5
    known, most = seconds + DT * share * share, math.inf if seconds < 5.0 else 0.001
    error = min(max(apart - share * 0.008, -most), most)
    assert unit["settled"] == pytest.approx(share) and unit["bank_seconds"] == pytest.approx(known)
    assert unit["usual_bank"] == pytest.approx(0.008 + DT * share / (min(known, 60.0) + 0.3) * error, abs=1e-12)
    assert bank_by(unit) == pytest.approx(bank + share * unit["usual_bank"], rel=1e-12)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_usual_difference_is_thirty_milliradians_at_most(sign: float):
    unit = np.zeros(1, UNIT)[0]
    for _ in range(1000):
        learn_bank(unit, sign * 0.2, True, DT)
    assert unit["usual_bank"] == sign * 0.03
