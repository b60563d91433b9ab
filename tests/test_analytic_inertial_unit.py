"""What the inertial unit says in a signal's place, against the standard atmosphere, rigid bodies and rotations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rig.computer.analytic import inertial_unit as unit
from rig.computer.analytic import strapdown
from rig.computer.analytic.strapdown import ASTRAY_S, LONG_S, frames_of, level_gain, slope_gain
from rig.core.frame import INDEX, INERTIAL, S
from rig.core.units.atmosphere import pressure

G, RATE = 9.80665, 25.0
DT = 1.0 / RATE
DOWN = INERTIAL.index("velocity_down_m_s")
STATIC, PHI, THETA, PSI = (INDEX[name] for name in ("static_pressure", "roll_angle", "pitch_angle", "heading"))
ATTITUDE = 1 << PHI | 1 << THETA | 1 << PSI
Vector = NDArray[np.float64]


# Memory


def test_the_memory_is_the_least_squares_line_through_all_that_was_seen():
    """With n counted from 0 the recursion gives the regression line of numpy, whatever it begins with."""
    y = np.random.default_rng(1).normal(size=40) + 0.3 * np.arange(40)
    x, slope = 0.0, 0.0
    for n, value in enumerate(y):
        off = value - x
        x, slope = x + level_gain(n) * off, slope + slope_gain(n) * off
        if n == 0:
            slope = 0.0  # one point has no slope
        x += slope
    line = np.polyfit(np.arange(40), y, 1)
    assert (slope, x) == pytest.approx((line[0], np.polyval(line, 40)))


def test_a_time_is_at_least_one_frame():
    assert [frames_of(s, 100.0) for s in (0.0, 0.004, 0.014, 5.0)] == [1, 1, 1, 500]


# Static pressure


def votes(**values: float) -> Vector:
    x = np.zeros(S)
    for name, value in values.items():
        x[INDEX[name]] = value
    return x


def climb(voted: Any, sink: Any, agreed: Any, rate_hz: float = RATE) -> Vector:
    """The static pressure's reference over frames; the vote of a frame is seen in the next one."""
    u, said = np.zeros(1, unit.STATE)[0], []
    for k, down in enumerate(sink):
        sample = np.zeros(len(INERTIAL))
        sample[DOWN] = down
        last = max(k - 1, 0)
        known = 1 << STATIC if agreed[last] else 0
        said.append(unit.static_pressure(sample, votes(static_pressure=voted[last]), known, rate_hz, u))
        unit.keep(sample, u)
    return np.array(said)


def flown(seconds: float, climb_m_s: float, error_m_s: float = 0.0) -> tuple[Vector, Vector]:
    """True static pressure and what the unit says of the vertical velocity, level for 60 s, then climbing."""
    t = np.arange(0.0, seconds, DT)
    height = 3000.0 + climb_m_s * np.maximum(t - 60.0, 0.0)
    rising = np.where(t < 60.0, 0.0, climb_m_s)
    return np.array([pressure(h) for h in height]), error_m_s - rising


@pytest.mark.parametrize("climb_m_s", [-15.0, 0.0, 15.0])
def test_after_a_loss_the_pressure_goes_on_with_the_altitude(climb_m_s: float):
    """60 s of health, 60 s without; a velocity that is 1 m/s off has been learned, and 900 m are met within 4 m."""
    true, sink = flown(120.0, climb_m_s, error_m_s=1.0)
    agreed = np.arange(len(true)) < 60 * RATE
    said = climb(np.where(agreed, true, 0.0), sink, agreed)
    per_metre = 1.0 / 0.0915  # of pressure at 3000 m
    assert np.abs(said - true)[int(59 * RATE) :].max() < 4.0 * per_metre
    if climb_m_s == 0.0:
        assert np.abs(said - true)[int(59 * RATE) :].max() < 15.0


def test_the_memory_of_an_agreed_pressure_is_long_against_a_fault():
    """A common drift of 10 Pa/s reaches the monitor's 300 Pa in 30 s; the reference has taken less than a quarter."""
    true, sink = flown(230.0, 0.0)
    t = np.arange(len(true)) * DT
    drift = np.clip(10.0 * (t - 200.0), 0.0, None)
    said = climb(true + drift, sink, np.ones(len(true), bool))
    moved = (said - true)[-1]
    assert 300.0 / 20.0 < moved < 300.0 / 4.0 and LONG_S == 300.0


def test_a_vote_far_off_is_not_learned_and_after_half_a_minute_used():
    true, sink = flown(120.0, 0.0)
    t = np.arange(len(true)) * DT
    voted = np.where(t < 60.0, true, true + 5000.0)
    said = climb(voted, sink, np.ones(len(true), bool))
    used_s = 60.0 + ASTRAY_S
    assert np.abs(said - true)[t < used_s].max() < 1e-6
    assert np.abs(said - voted)[t > used_s + 0.1].max() < 1.0


def test_without_a_velocity_there_is_no_pressure_until_the_vote_is_agreed_again():
    true, sink = flown(8.0, 0.0)
    t = np.arange(len(true)) * DT
    sink = np.where((t >= 2.0) & (t < 3.0), np.nan, sink)
    agreed = (t < 2.0) | (t >= 5.0)
    there = np.isfinite(climb(true, sink, agreed))
    assert there[t < 2.0].all() and not there[(t >= 2.0) & (t < 5.0)].any() and there[t >= 5.0 + 2 * DT].all()


# Load factors


@pytest.mark.parametrize("seed", range(4))
def test_load_factors_are_those_of_a_point_of_a_rigid_body(seed: int):
    rng = np.random.default_rng(seed)
    rates, accelerations, place = rng.uniform(-1.0, 1.0, (3, 3)) * np.array([[1.0], [1.0], [5.0]])
    force = rng.uniform(-20.0, 20.0, 3)
    u, sample = np.zeros(1, unit.STATE)[0], np.concatenate([rates, np.zeros(3), force])
    u["slope"], u["last"] = accelerations, sample
    expected = (force + np.cross(accelerations, place) + np.cross(rates, np.cross(rates, place))) / G
    assert [unit.load_factor(axis, sample, 2.0, place, u) for axis in range(3)] == pytest.approx(expected)


def test_force_and_rate_are_led_by_the_unit_s_lag():
    u, sample = np.zeros(1, unit.STATE)[0], np.arange(9.0)
    u["last"] = sample - 0.5
    assert unit.rate(1, sample, 3.0, u) == 1.0 + 1.5
    assert unit.load_factor(0, sample, 3.0, np.zeros(3), u) == pytest.approx((6.0 + 1.5) / G)


def test_the_filter_on_the_rates_gives_their_slope_and_begins_again_after_no_number():
    u = np.zeros(1, unit.STATE)[0]
    for k in range(200):
        sample = np.full(9, math.nan if k == 100 else 0.3 * k * DT)
        unit.follow(sample, 0.5, RATE, u)
        unit.keep(sample, u)
        assert k in (0, 100, 101) or np.isfinite(u["slope"]).all()
        if k in (0, 101):
            assert (u["slope"] == 0.0).all() and (u["smooth"] == sample[:3]).all()
    assert u["slope"] == pytest.approx(np.full(3, 0.3))


# Attitude


class Motion:
    """Attitudes (Rotation, body to north-east-down) and velocities over frames, and what a perfect unit says."""

    def __init__(self, turned: Rotation, velocity: Vector, dt: float = DT) -> None:
        self.turned, self.dt = turned, dt
        change = (turned[:-1].inv() * turned[1:]).as_rotvec() / dt  # mean rates between two frames
        rates = np.vstack([change[:1], 0.5 * (change[:-1] + change[1:]), change[-1:]])
        acceleration = np.gradient(velocity, dt, axis=0)
        force = turned.inv().apply(acceleration - np.array([0.0, 0.0, G]))
        self.unit = np.hstack([rates, velocity, force])

    def angles(self) -> Vector:
        """Roll, pitch, heading (n, 3)."""
        return self.turned.as_euler("ZYX")[:, ::-1]

    def followed(self, agreed: Any = 0, voted: Vector | None = None, lead_s: float = 0.0) -> Vector:
        e, out, said = np.zeros(1, strapdown.STATE)[0], np.zeros(3), []
        seen = self.angles() if voted is None else voted
        for k, sample in enumerate(self.unit):
            last = max(k - 1, 0)
            x = np.zeros(S)
            x[[PHI, THETA, PSI]] = seen[last]
            known = int(np.broadcast_to(agreed, len(self.unit))[last])
            strapdown.attitude(sample, self.unit[last], x, known, 1.0 / self.dt, lead_s, e, out)
            said.append(out.copy())
        return np.array(said)


def around(a: Vector, b: Vector) -> Vector:
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def turning(bank: float, seconds: float = 120.0, speed: float = 150.0, dt: float = DT) -> Motion:
    """A steady level coordinated turn."""
    t = np.arange(0.0, seconds, dt)
    psi = G * math.tan(bank) / speed * t
    turned = Rotation.from_euler("ZYX", np.column_stack([psi, np.zeros_like(t), np.full_like(t, bank)]))
    return Motion(turned, speed * np.column_stack([np.cos(psi), np.sin(psi), np.zeros_like(t)]), dt)


def test_rolling_pitching_and_turning_are_integrated():
    t = np.arange(0.0, 4.0, 0.01)
    angles = np.column_stack([0.3 * np.sin(0.7 * t), 0.2 * np.sin(1.3 * t), 1.5 * np.sin(2.0 * t)])
    motion = Motion(Rotation.from_euler("ZYX", angles), np.tile([150.0, 0.0, 0.0], (len(t), 1)), 0.01)
    said = motion.followed(ATTITUDE)
    assert around(said, motion.angles()).max() < 1e-3 and said[:, 0].max() > 1.4


@pytest.mark.parametrize(("bank", "after_40_s", "after_110_s"), [(-0.8, 0.07, 0.07), (0.5, 0.02, 0.01)])
def test_a_coordinated_turn_is_told_from_level_flight_without_a_vote_of_roll_or_pitch(bank, after_40_s, after_110_s):
    """Levelled by accelerometers that feel no side force, it begins with wings level and finds the bank of the turn."""
    motion = turning(bank)
    off = around(motion.followed(1 << PSI), motion.angles())
    assert off[0, 0] == pytest.approx(abs(bank), abs=1e-6)
    t = np.arange(len(off)) * DT
    assert off[t > 40.0, :2].max() < after_40_s and off[t > 110.0, :2].max() < after_110_s


def test_a_slip_and_a_change_of_speed_are_no_bank_and_no_pitch():
    """Wings and nose level, pushed sideways and forwards for ten seconds: the velocity tells."""
    t = np.arange(0.0, 60.0, DT)
    push = np.clip(t - 20.0, 0.0, 10.0)
    velocity = np.column_stack([150.0 + 2.0 * push, 3.0 * push, np.zeros_like(t)])
    motion = Motion(Rotation.from_euler("ZYX", np.zeros((len(t), 3))), velocity)
    assert np.abs(motion.followed(1 << PSI)[:, :2]).max() < 1e-3


def test_the_gyros_drift_is_learned_and_does_not_run_away():
    motion = turning(0.0, 120.0)
    motion.unit[:, :3] += (0.002, -0.0015, 0.001)
    off = around(motion.followed(ATTITUDE), motion.angles())
    assert off.max() < 0.01 and off[-1].max() < 2e-3


@pytest.mark.parametrize("lost_s", [10.0, 60.0])
def test_a_lost_heading_goes_on_by_the_gyros_whose_drift_was_learned_whatever_the_wind(lost_s: float):
    """Ten minutes from the start, a turn of two radians among them; a wind makes another drift angle of each course."""
    t = np.arange(0.0, 600.0, DT)
    bank = 0.6 * np.clip((t - 100.0) / 3.0, 0.0, 1.0) * np.clip((140.0 - t) / 3.0, 0.0, 1.0)
    psi = np.cumsum(G * np.tan(bank) / 150.0) * DT
    turned = Rotation.from_euler("ZYX", np.column_stack([psi, np.zeros_like(t), bank]))
    course = 150.0 * np.column_stack([np.cos(psi), np.sin(psi), np.zeros_like(t)])
    motion = Motion(turned, course + np.array([20.0, -15.0, 0.0]))
    motion.unit[:, :3] += (0.001, -0.0017, 0.0017)
    known = np.where(t < lost_s, ATTITUDE, 1 << PHI | 1 << THETA)
    seen = np.where(t[:, None] < lost_s, motion.angles(), motion.angles() + np.array([0.0, 0.0, 1.0]))
    off = around(motion.followed(known, seen)[:, 2], motion.angles()[:, 2])
    assert psi[-1] > 1.5 and off.max() < 0.008


def test_a_unit_that_begins_without_an_agreed_heading_has_none_until_it_is_agreed():
    motion = turning(0.3, 8.0)
    known = np.where((np.arange(len(motion.unit)) >= 50) & (np.arange(len(motion.unit)) < 60), ATTITUDE, 0)
    off = around(motion.followed(known), motion.angles())
    assert np.isfinite(off[:, :2]).all()
    # agreed in the vote of frame 50, which the next frame sees and the one after it begins with
    assert np.isnan(off[:52, 2]).all() and off[52:, 2].max() < 0.02


def test_the_votes_of_roll_and_pitch_count_in_the_first_frame_alone():
    motion = turning(0.4, 20.0)
    wrong = motion.angles() + np.array([0.15, -0.1, 0.0])
    wrong[0] = motion.angles()[0]
    assert motion.followed(ATTITUDE).tobytes() == motion.followed(ATTITUDE, wrong).tobytes()


def test_angles_are_led_at_the_present_rates():
    motion = turning(0.6, 2.0)
    plain, led = motion.followed(ATTITUDE), motion.followed(ATTITUDE, lead_s=0.02)
    assert led[:, 2] - plain[:, 2] == pytest.approx(np.full(len(led), 0.02 * G * math.tan(0.6) / 150.0), rel=1e-3)
    assert np.abs(led[:, :2] - plain[:, :2]).max() < 1e-5
    motion.unit[:, :3] = (1.0, 0.0, 0.0)
    rolled = motion.followed(ATTITUDE, lead_s=0.02)[0, 0] - motion.followed(ATTITUDE)[0, 0]
    assert rolled == pytest.approx(0.02)


def test_a_unit_that_says_no_number_gives_no_attitude_and_is_aligned_again():
    motion = turning(0.5, 4.0)
    for quantity in range(len(INERTIAL)):
        faulty = turning(0.5, 4.0)
        faulty.unit[25:30, quantity] = math.nan
        said = faulty.followed(ATTITUDE)
        assert np.flatnonzero(np.isnan(said[:, 0])).tolist() == list(range(25, 30))
        assert around(said[30:], motion.angles()[30:]).max() < 0.03


def test_a_unit_that_was_wrong_for_a_while_finds_its_attitude_again():
    """A roll gyro at its stop for two seconds, and half a minute later the memory begins again."""
    motion = turning(0.0, 100.0)
    t = np.arange(len(motion.unit)) * DT
    motion.unit[(t >= 50.0) & (t < 52.0), 0] = 1.4
    off = around(motion.followed(ATTITUDE), motion.angles())
    assert off[(t > 51.0) & (t < 53.0), 0].max() > 1.0
    assert off[t > 52.0 + ASTRAY_S + 1.0].max() < 0.1
