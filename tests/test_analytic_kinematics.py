"""The equations behind the references against vectors and rotations, for motions that have no symmetry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from one_stage import refer, remember
from test_analytic_references import RATE, designed, level_flight, ref, run

from rig.computer.analytic import kinematics
from rig.computer.analytic.designed import COLUMNS
from rig.computer.analytic.references import PARAM, STATE, Config, References
from rig.core.frame import INDEX, INERTIAL
from rig.core.units.atmosphere import air_density

G = 9.80665
SEEDS = range(6)
Vector = NDArray[np.float64]


class Case:
    """Kept votes, coefficients and place of the accelerometers, all drawn from one seed."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.st: Any = np.zeros(1, STATE)[0]
        self.p: Any = np.zeros(1, PARAM)[0]
        self.c = np.zeros(len(COLUMNS))
        self.p["accelerometer"] = self.rng.uniform(1.0, 5.0, 3) * self.rng.choice([-1.0, 1.0], 3)
        self.rates, self.accelerations = self.rng.uniform(-1.0, 1.0, (2, 3))  # p, q, r and their slopes
        for axis, name in enumerate(("roll_rate", "pitch_rate", "yaw_rate")):
            self.vote(name, self.rates[axis], self.accelerations[axis])
        self.speed, self.pressure = 180.0, self.rng.uniform(8e3, 2e4)
        self.vote("dynamic_pressure", self.pressure)

    def vote(self, name: str, value: float, slope: float = 0.0) -> None:
        self.st["voted"][INDEX[name]] = self.st["smooth"][INDEX[name]] = value
        self.st["slope"][INDEX[name]] = slope

    def coefficient(self, **values: float) -> None:
        for name, value in values.items():
            self.c[COLUMNS.index(name)] = value

    @property
    def by_turning(self) -> Vector:
        """Acceleration at the accelerometers beyond that of the centre of gravity, in g: forward, right, down."""
        place = np.array(self.p["accelerometer"])
        swing = np.cross(self.accelerations, place)
        return (swing + np.cross(self.rates, np.cross(self.rates, place))) / G


def about(axis: int, angle: float) -> NDArray[np.float64]:
    """Components of a fixed vector after the axes have turned by ``angle`` about one of them."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.eye(3)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    turn[i, i] = turn[j, j] = cos
    turn[i, j], turn[j, i] = sin, -sin
    return turn


@pytest.mark.parametrize("seed", SEEDS)
def test_turning_adds_the_acceleration_of_a_point_of_a_rigid_body(seed: int):
    case = Case(seed)
    _, right, down = case.by_turning
    assert kinematics.lateral_by_turning(case.p, case.st) == pytest.approx(right)
    assert kinematics.normal_by_turning(case.p, case.st) == pytest.approx(-down)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_pitch_rate_is_the_one_that_moves_the_angle_of_attack_so(seed: int):
    """Newton in body axes with any sideslip, bank and rates; only the lift across the path is known."""
    case = Case(seed)
    alpha, theta, phi, beta = case.rng.uniform(0.05, 0.4, 4)
    lift, along = case.rng.uniform(0.5, 3.0, 2)
    velocity = case.speed * np.array(
        [math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)]
    )
    gravity = about(0, phi) @ about(1, theta) @ np.array([0.0, 0.0, G])
    path, across = np.array([math.cos(alpha), 0.0, math.sin(alpha)]), np.array([math.sin(alpha), 0.0, -math.cos(alpha)])
    change = gravity + G * (lift * across + along * path) - np.cross(case.rates, velocity)
    u, _, w = velocity
    case.vote("angle_of_attack", alpha, (u * change[2] - w * change[0]) / (u * u + w * w))
    case.vote("angle_of_sideslip", beta)
    case.vote("pitch_angle", theta)
    case.vote("roll_angle", phi)
    slope = 3e-4
    zero_lift = alpha - lift / (case.pressure * slope)
    case.coefficient(lift_slope_1_pa=slope, zero_lift_alpha_rad=zero_lift, pitch_rate_gain=0.8)
    assert kinematics.pitch_rate(case.c, case.st, case.speed) == pytest.approx(case.rates[1] / 0.8)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_rates_from_attitude_are_those_of_turning_heading_pitch_and_bank(seed: int):
    case = Case(seed)
    phi, theta, psi = case.rng.uniform(-1.0, 1.0, 3)
    of_phi, of_theta, of_psi = case.rng.uniform(-1.0, 1.0, 3)
    case.vote("roll_angle", phi, of_phi)
    case.vote("pitch_angle", theta, of_theta)
    case.vote("heading", psi, of_psi)
    to_bank, to_pitch = about(0, phi), about(1, theta)
    rates = (
        np.array([of_phi, 0, 0]) + to_bank @ np.array([0, of_theta, 0]) + to_bank @ to_pitch @ np.array([0, 0, of_psi])
    )
    assert kinematics.roll_rate(case.st) == pytest.approx(rates[0])
    assert kinematics.pitch_rate_of_attitude(case.st) == pytest.approx(rates[1])
    assert kinematics.yaw_rate(case.st) == pytest.approx(rates[2])


def longitudinal(case: Case) -> tuple[float, float]:
    """A consistent flight: the angle of attack, and the load factor that the accelerometers say."""
    alpha, along = case.rng.uniform(0.1, 0.4), case.rng.uniform(-0.5, 0.5)
    gain, arm, slope, zero_lift = 0.4, 0.4, 4e-4, -0.03
    case.coefficient(lift_slope_1_pa=slope, zero_lift_alpha_rad=zero_lift, pitch_rate_gain=gain, elevator_arm_m=arm)
    wing = case.pressure * slope * (alpha - zero_lift)
    tail = (case.speed * (1 - gain) * case.rates[1] - arm * case.accelerations[1]) / G
    case.vote("longitudinal_load_factor", along)
    case.vote("angle_of_attack", alpha)
    # The axis across the path leans back by alpha: n_w = n_z cos alpha - n_x sin alpha.
    centre = (wing + tail + along * math.sin(alpha)) / math.cos(alpha)
    return alpha, centre - case.by_turning[2]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_load_factor_is_that_of_wing_tail_and_turning(seed: int):
    case = Case(seed)
    _, load = longitudinal(case)
    assert kinematics.normal_load_factor(case.c, case.p, case.st, case.speed) == pytest.approx(load)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_angle_of_attack_comes_back_from_the_load_factor(seed: int):
    case = Case(seed)
    alpha, load = longitudinal(case)
    case.vote("normal_load_factor", load)
    case.st["alpha"] = alpha
    assert kinematics.angle_of_attack(case.c, case.p, case.st, case.speed) == pytest.approx(alpha)
    assert case.st["alpha"] == pytest.approx(alpha)


@pytest.mark.parametrize(("load", "kept"), [(1e3, 1.5), (-1e3, -1.5), (0.0, 0.0)])
def test_the_kept_angle_of_attack_stays_within_a_quarter_turn(load: float, kept: float):
    case = Case(0)
    case.p["accelerometer"] = 0.0
    case.coefficient(lift_slope_1_pa=1e-4, pitch_rate_gain=1.0)
    case.vote("normal_load_factor", load)
    case.st["alpha"] = 0.0
    kinematics.angle_of_attack(case.c, case.p, case.st, case.speed)
    assert case.st["alpha"] == pytest.approx(kept, abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_sideslip_comes_back_from_the_side_force(seed: int):
    case = Case(seed)
    beta, slope, roll_arm, yaw_arm = 0.07, -3e-4, 0.6, -1.1
    case.coefficient(side_slope_1_pa=slope, roll_arm_m=roll_arm, yaw_arm_m=yaw_arm)
    of_surfaces = (roll_arm * case.accelerations[0] + yaw_arm * case.accelerations[2]) / G
    case.vote("lateral_load_factor", case.pressure * slope * beta + of_surfaces + case.by_turning[1])
    assert kinematics.angle_of_sideslip(case.c, case.p, case.st) == pytest.approx(beta)


@pytest.mark.parametrize(("pressure", "counted"), [(50.0, 200.0), (199.0, 200.0), (201.0, 201.0)])
def test_divisions_by_dynamic_pressure_take_at_least_200_pascals(pressure: float, counted: float):
    case = Case(0)
    case.p["accelerometer"] = 0.0
    case.vote("dynamic_pressure", pressure)
    case.vote("normal_load_factor", 1.0)
    case.vote("lateral_load_factor", 1.0)
    case.coefficient(lift_slope_1_pa=0.1, side_slope_1_pa=0.1, pitch_rate_gain=1.0)
    assert kinematics.angle_of_attack(case.c, case.p, case.st, case.speed) == pytest.approx(1 / (0.1 * counted))
    assert kinematics.angle_of_sideslip(case.c, case.p, case.st) == pytest.approx(1 / (0.1 * counted))


@pytest.mark.parametrize("constant_s", [0.004, 0.1])
def test_a_filters_share_of_a_new_sample_is_that_of_its_time_constant(constant_s: float):
    """Shorter than a frame too: after one frame 1 - exp(-T / tau) of a step is through."""
    stage = References(Config(), designed(alpha_filter_s=constant_s), RATE)
    block = level_flight(2)
    block["voted"][1, INDEX["angle_of_attack"]] += 1.0
    for k in range(2):
        refer(block, k, stage.data)
        remember(block, k, stage.data)
    before = stage.state["smooth"][0, INDEX["angle_of_attack"]]
    refer(block, 1, stage.data)
    after = stage.state["smooth"][0, INDEX["angle_of_attack"]]
    assert after - before == pytest.approx(1.0 - math.exp(-1.0 / RATE / constant_s))


def test_dynamic_pressure_takes_the_speed_in_space():
    inertial = np.full(len(INERTIAL), np.nan)
    inertial[INERTIAL.index("velocity_north_m_s")] = 30.0
    inertial[INERTIAL.index("velocity_east_m_s")] = 40.0
    inertial[INERTIAL.index("velocity_down_m_s")] = 120.0
    assert kinematics.dynamic_pressure(inertial, 1.1) == pytest.approx(0.5 * 1.1 * 130.0**2)


@pytest.mark.parametrize(("pressure", "counted"), [(500.0, 1000.0), (1000.0, 1000.0), (1200.0, 1200.0)])
def test_density_is_that_of_the_cold_stratosphere_and_at_least_of_ten_hectopascals(pressure: float, counted: float):
    assert air_density(pressure) == pytest.approx(counted / (287.05287 * 216.65))


def test_density_at_sea_level_is_that_of_the_standard():
    assert air_density(101_325.0) == pytest.approx(101_325.0 / (287.05287 * 288.15), rel=1e-9)


# Lateral load factor and roll angle


@pytest.mark.parametrize("seed", SEEDS)
def test_the_lateral_load_factor_is_that_of_sideslip_surfaces_and_turning(seed: int):
    case = Case(seed)
    beta, slope, roll_arm, yaw_arm = 0.07, -3e-4, 0.6, -1.1
    case.coefficient(side_slope_1_pa=slope, roll_arm_m=roll_arm, yaw_arm_m=yaw_arm)
    case.vote("angle_of_sideslip", beta)
    of_surfaces = (roll_arm * case.accelerations[0] + yaw_arm * case.accelerations[2]) / G
    expected = case.pressure * slope * beta + of_surfaces + case.by_turning[1]
    assert kinematics.lateral_load_factor(case.c, case.p, case.st) == pytest.approx(expected)


@pytest.mark.parametrize(("pressure", "counted"), [(50.0, 200.0), (201.0, 201.0)])
def test_a_side_force_is_that_of_200_pascals_at_least(pressure: float, counted: float):
    case = Case(0)
    case.p["accelerometer"] = 0.0
    case.coefficient(side_slope_1_pa=-3e-4)
    case.vote("dynamic_pressure", pressure)
    case.vote("angle_of_sideslip", 0.1)
    assert kinematics.lateral_load_factor(case.c, case.p, case.st) == pytest.approx(-3e-5 * counted)


def banked(seed: int, phi: float) -> Case:
    """Any rates and attitude without a slip: the lateral load factor is acceleration less gravity."""
    case = Case(seed)
    alpha, theta = case.rng.uniform(0.05, 0.4, 2)
    velocity = case.speed * np.array([math.cos(alpha), 0.0, math.sin(alpha)])
    gravity = about(0, phi) @ about(1, theta) @ np.array([0.0, 0.0, G])
    case.vote("angle_of_attack", alpha)
    case.vote("pitch_angle", theta)
    case.vote("lateral_load_factor", (np.cross(case.rates, velocity)[1] - gravity[1]) / G)
    return case


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("phi", [-1.2, 0.7])
def test_the_roll_angle_begins_with_that_at_which_gravity_turns_the_aircraft(seed: int, phi: float):
    case = banked(seed, phi)
    assert kinematics.roll_angle(case.p, case.st, case.speed, True) == pytest.approx(phi)
    assert case.st["rolling"] == 1 and case.st["roll_angle"] == pytest.approx(phi)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("kept", "drawn"), [(0.5, 0.2), (-3.0, -2.583185)])  # the short way to 0.7
def test_then_it_follows_the_gyros_and_is_drawn_to_that_of_the_turn_within_ten_seconds(seed, kept, drawn):
    case = banked(seed, 0.7)
    case.st["rolling"], case.st["roll_angle"], case.p["rate_hz"] = 1, kept, 50.0
    theta = float(case.st["voted"][INDEX["pitch_angle"]])
    # Rates of the body are those of roll angle, pitch angle and heading, in the axes that each turns about.
    to_bank = about(0, kept)
    axes = np.column_stack([[1.0, 0.0, 0.0], to_bank[:, 1], (to_bank @ about(1, theta))[:, 2]])
    rolling = float(np.linalg.solve(axes, case.rates)[0])
    expected = kept + (rolling + drawn / 10.0) / 50.0
    said = kinematics.roll_angle(case.p, case.st, case.speed, True)
    assert math.remainder(said - expected, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    assert case.st["roll_angle"] == said and -math.pi <= said < math.pi


def test_without_its_partners_there_is_no_roll_angle_and_it_begins_again():
    case = banked(1, 0.7)
    case.st["rolling"], case.st["roll_angle"] = 1, 0.1
    assert math.isnan(kinematics.roll_angle(case.p, case.st, case.speed, False))
    assert kinematics.roll_angle(case.p, case.st, case.speed, True) == pytest.approx(0.7)


@pytest.mark.parametrize(("load", "angle"), [(-5.0, 0.5 * math.pi), (5.0, -0.5 * math.pi)])
def test_a_turn_that_no_bank_makes_is_a_bank_of_a_quarter_turn(load: float, angle: float):
    case = banked(0, 0.0)
    for axis in ("roll_rate", "yaw_rate"):
        case.vote(axis, 0.0)
    case.vote("lateral_load_factor", load)
    assert kinematics.roll_angle_of_turn(case.st, case.speed) == pytest.approx(angle)


def test_near_the_vertical_the_cosine_of_the_pitch_angle_counts_as_a_tenth():
    case = banked(0, 0.0)
    for axis in ("roll_rate", "yaw_rate"):
        case.vote(axis, 0.0)
    case.vote("pitch_angle", 1.57)
    case.vote("lateral_load_factor", -0.05)
    assert kinematics.roll_angle_of_turn(case.st, case.speed) == pytest.approx(math.asin(0.5))


@pytest.mark.parametrize("bank", [-0.4, 0.8])
def test_in_a_level_turn_the_roll_angle_by_body_rates_is_the_bank(bank: float):
    turn = G * math.tan(bank) / 150.0
    rates = {"pitch_rate": turn * math.sin(bank), "yaw_rate": turn * math.cos(bank)}
    block = run(level_flight(50, angle_of_attack=0.0, **rates), Config(roll_angle="body_rates"))
    assert ref(block, "roll_angle") == pytest.approx(np.full(50, bank), abs=1e-3)
