"""From JSBSim's numbers to the true row of a frame."""

from __future__ import annotations

from math import nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.core.frame import FLIGHT_INDEX, INDEX, End, new_block
from rig.world.plant import airframe, truth

PLANE = airframe.read(Path(__file__).parents[1] / "aircraft" / "f16" / "aircraft.toml")


def cruise(**values: float) -> NDArray[Any]:
    raw = np.zeros(1, truth.RAW)
    level = {"mass_slug": 641.2, "force_z_lbf": -20_630.0, "height_ft": 20_000.0, "altitude_ft": 20_000.0}
    for name, value in (level | values).items():
        raw[name] = value
    return raw


def row(raw: NDArray[Any], constants: NDArray[Any] | None = None) -> Any:
    block = new_block(1)
    code = truth.write_row(block, 0, raw, truth.fixed(PLANE, 0.0, 0.0) if constants is None else constants)
    assert code == block["end"][0]
    return block[0]


def end(**values: float) -> End:
    return End(row(cruise(**values))["end"])


def test_the_accelerometers_feel_their_lever_arm() -> None:
    arm = np.array([4.57, -0.5, 0.8])
    rate, turning = np.array([0.7, 0.3, -0.2]), np.array([1.5, -2.0, 0.4])
    constants = truth.fixed(PLANE, 0.0, 0.0)
    for axis, value in zip("xyz", arm, strict=True):
        constants[f"accelerometer_{axis}_m"] = value
    names = ("p_rad_s", "q_rad_s", "r_rad_s", "p_dot_rad_s2", "q_dot_rad_s2", "r_dot_rad_s2")
    raw = cruise(**dict(zip(names, (*rate, *turning), strict=True)), force_x_lbf=100.0, force_y_lbf=50.0)
    at_cg = np.array([100.0, 50.0, -20_630.0]) / 641.2 * 0.3048
    expected = (at_cg + np.cross(turning, arm) + np.cross(rate, np.cross(rate, arm))) / 9.80665
    told = row(raw, constants)
    felt, first = told["truth"], FLIGHT_INDEX["specific_force_forward_m_s2"]
    assert told["flight"][first : first + 3] == pytest.approx(at_cg)
    assert felt[INDEX["longitudinal_load_factor"]] == pytest.approx(expected[0])
    assert felt[INDEX["lateral_load_factor"]] == pytest.approx(expected[1])
    assert felt[INDEX["normal_load_factor"]] == pytest.approx(-expected[2])


def test_pressures_are_in_pascal() -> None:
    values = row(cruise(static_pressure_psf=2116.2166, dynamic_pressure_psf=1.0))["truth"]
    assert values[INDEX["static_pressure"]] == pytest.approx(101_325.0, rel=1e-6)
    assert values[INDEX["dynamic_pressure"]] == pytest.approx(47.880259)


@pytest.mark.parametrize(("given", "heading"), [(2 * pi, 0.0), (-0.1, 2 * pi - 0.1), (1.0, 1.0), (0.0, 0.0)])
def test_heading_stays_below_a_full_turn(given: float, heading: float) -> None:
    assert row(cruise(psi_rad=given))["truth"][INDEX["heading"]] == pytest.approx(heading)


@pytest.mark.parametrize(("given", "roll"), [(-pi, pi), (pi, pi), (pi + 0.1, 0.1 - pi), (-1.0, -1.0)])
def test_roll_stays_within_half_a_turn(given: float, roll: float) -> None:
    assert row(cruise(phi_rad=given))["truth"][INDEX["roll_angle"]] == pytest.approx(roll)


def test_the_quaternion_turns_body_axes_to_the_local_frame() -> None:
    phi, theta, psi = 0.4, -0.3, 2.0
    flight = row(cruise(phi_rad=phi, theta_rad=theta, psi_rad=psi))["flight"]
    w, *v = flight[FLIGHT_INDEX["quaternion_w"] :][:4]
    nose = np.array([1.0, 0.0, 0.0])
    turned = nose + 2.0 * w * np.cross(v, nose) + 2.0 * np.cross(v, np.cross(v, nose))
    ahead = [np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)]
    assert turned == pytest.approx(ahead)
    wing = np.array([0.0, 1.0, 0.0])
    turned = wing + 2.0 * w * np.cross(v, wing) + 2.0 * np.cross(v, np.cross(v, wing))
    assert turned[2] == pytest.approx(np.sin(phi) * np.cos(theta))


def test_the_quaternion_does_not_jump_when_the_heading_passes_north() -> None:
    first = FLIGHT_INDEX["quaternion_w"]
    west, east = (row(cruise(psi_rad=psi))["flight"][first : first + 4] for psi in (2 * pi - 0.01, 0.01))
    assert west == pytest.approx(east, abs=0.011)


def test_distances_follow_the_ellipsoid_at_the_start() -> None:
    raw = cruise(latitude_rad=np.radians(46.0), longitude_rad=np.radians(9.0))
    constants = truth.fixed(PLANE, np.radians(45.0), np.radians(8.0))
    flight = row(raw, constants)["flight"]
    # One degree on WGS 84 at 45 degrees north: 111.13 km of latitude, 78.85 km of longitude.
    assert flight[FLIGHT_INDEX["north_m"]] == pytest.approx(111_132.0, rel=1e-4)
    assert flight[FLIGHT_INDEX["east_m"]] == pytest.approx(78_847.0, rel=1e-4)


def test_level_cruise_goes_on() -> None:
    assert end() is End.FLYING


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"q_rad_s": nan}, End.NOT_FINITE),
        ({"longitude_rad": nan}, End.NOT_FINITE),
        ({"static_pressure_psf": float("inf")}, End.NOT_FINITE),
        ({"height_ft": -1.0}, End.GROUND_CONTACT),
        ({"ground_force_lbf": -500.0}, End.GROUND_CONTACT),
        ({"alpha_rad": 0.62}, End.DEPARTURE_ANGLE_OF_ATTACK),
        ({"alpha_rad": -0.36}, End.DEPARTURE_ANGLE_OF_ATTACK),
        ({"beta_rad": -0.53}, End.DEPARTURE_SIDESLIP),
        ({"force_z_lbf": -210_000.0}, End.DEPARTURE_LOAD_FACTOR),
        ({"force_z_lbf": 90_000.0}, End.DEPARTURE_LOAD_FACTOR),
        ({"p_rad_s": -5.4}, End.DEPARTURE_RATE),
    ],
)
def test_the_flight_ends_for_the_right_reason(values: dict[str, float], code: End) -> None:
    assert end(**values) is code


def test_attitude_ends_a_flight_only_where_it_is_limited() -> None:
    limits = PLANE.limits.model_copy(update={"roll_angle_max_rad": 1.2})
    limited = truth.fixed(PLANE.model_copy(update={"limits": limits}), 0.0, 0.0)
    assert row(cruise(phi_rad=-1.3), limited)["end"] == End.DEPARTURE_ATTITUDE
    assert end(phi_rad=-1.3) is End.FLYING


def test_wheels_and_gear_are_told_as_zero_or_one() -> None:
    assert list(row(cruise())["discrete_truth"][:2]) == [0, 0]
    down = row(cruise(wheels_on_ground=1.0, gear_position=1.0, ground_force_lbf=-1.0))
    assert list(down["discrete_truth"][:2]) == [1, 1]
