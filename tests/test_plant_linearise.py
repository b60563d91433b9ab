"""The linear model against measured modes and against the flight of the nonlinear aircraft."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from rig.core.frame import FLIGHT_INDEX, INDEX, new_block
from rig.world.plant import airframe, wind
from rig.world.plant.jsbsim import Plant
from rig.world.plant.linearise import Linear, linearise

AIRCRAFT = Path(__file__).parent.parent / "aircraft"
RATE_HZ = 100.0


def aircraft(name: str, **changes: float) -> airframe.Airframe:
    return airframe.read(AIRCRAFT / name / "aircraft.toml").model_copy(update=changes)


def fastest(matrix: NDArray[np.float64]) -> complex:
    """The eigenvalue of largest real part among those beyond 0.2 rad/s."""
    values = np.linalg.eigvals(matrix)
    return max((x for x in values if abs(x) > 0.2), key=lambda x: (x.real, x.imag))


@pytest.mark.parametrize(("shift_inches", "expected"), [(0, -0.724 + 0.660j), (6, 0.553), (8, 0.806), (10, 1.021)])
def test_the_f16_turns_unstable_as_its_centre_of_gravity_moves_aft(shift_inches: float, expected: complex) -> None:
    config = aircraft("f16", cg_x_shift_m=shift_inches * 0.0254)
    linear = linearise(config, config.point("20000ft_m06"))
    assert fastest(linear.longitudinal_a) == pytest.approx(expected, abs=2e-3)


def test_the_b747_has_the_short_period_of_high_altitude_cruise() -> None:
    config = aircraft("b747")
    linear = linearise(config, config.point("35000ft_m084"))
    assert fastest(linear.longitudinal_a) == pytest.approx(-0.459 + 1.241j, abs=2e-3)


def test_trim_is_level_flight_at_the_flight_point() -> None:
    config = aircraft("f16")
    trim = linearise(config, config.point("20000ft_m06")).trim
    assert trim.airspeed_m_s == pytest.approx(0.6 * 316.0, rel=2e-3)  # speed of sound at 6096 m
    assert trim.dynamic_pressure_pa == pytest.approx(0.5 * 0.6527 * trim.airspeed_m_s**2, rel=2e-3)
    assert trim.theta_rad == pytest.approx(trim.alpha_rad, abs=1e-9)
    assert 0.0 < trim.throttle < 1.0


@cache
def at_first_point(name: str) -> Linear:
    return linearise(aircraft(name), aircraft(name).flight_points[0])


@pytest.mark.parametrize("name", ["f16", "b747", "b737"])
@pytest.mark.parametrize("surface", ["elevator", "aileron", "rudder", "throttle"])
def test_small_motions_follow_the_nonlinear_aircraft(name: str, surface: str) -> None:
    """Half a second after a small step, rates and angles agree within 7 % of the largest response."""
    config = aircraft(name)
    point = config.flight_points[0]
    linear = at_first_point(name)
    step = 0.03 if surface == "throttle" else 0.005
    flown = fly(config, point, surface, step, frames=51)
    for plane, expected in predict(linear, config, surface, step, frames=50).items():
        actual = np.array([flown[key] for key in ORDER[plane]])
        assert np.max(np.abs(actual - expected)) < 0.07 * np.max(np.abs(expected)) + 2e-5, plane


ORDER = {"longitudinal": ("V", "alpha", "q", "theta"), "lateral": ("beta", "p", "r", "phi")}


def fly(
    config: airframe.Airframe, point: airframe.FlightPoint, surface: str, step: float, frames: int
) -> dict[str, float]:
    plant = Plant(config, point, wind.Config(), "none", RATE_HZ, 1, 0)
    block = new_block(frames)
    commands = plant.trim.copy()
    commands[["elevator", "aileron", "rudder", "throttle"].index(surface)] += step
    for k in range(frames):
        plant.read(block, k)
        block["surface_command"][k] = commands
        plant.step(block, k)
    change = block["truth"][-1] - block["truth"][0]
    names = {
        "alpha": "angle_of_attack",
        "q": "pitch_rate",
        "theta": "pitch_angle",
        "beta": "angle_of_sideslip",
        "p": "roll_rate",
        "r": "yaw_rate",
        "phi": "roll_angle",
    }
    found = {key: float(change[INDEX[name]]) for key, name in names.items()}
    speed = block["flight"][:, FLIGHT_INDEX["true_airspeed_m_s"]]
    return found | {"V": float(speed[-1] - speed[0])}


def predict(
    linear: Linear, config: airframe.Airframe, surface: str, step: float, frames: int
) -> dict[str, NDArray[np.float64]]:
    """The linear response behind the actuator's lag; a command acts one frame late."""
    plane = "longitudinal" if surface in ("elevator", "throttle") else "lateral"
    a = linear.longitudinal_a if plane == "longitudinal" else linear.lateral_a
    b = linear.longitudinal_b if plane == "longitudinal" else linear.lateral_b
    column = b[:, 0 if surface in ("elevator", "aileron") else 1]
    lag = getattr(config, surface).lag_s
    system = np.zeros((6, 6))
    system[:4, :4], system[:4, 4] = a, column
    system[4, 4], system[4, 5] = -1.0 / lag, 1.0 / lag
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, step])
    response = np.asarray(expm(system * (frames - 1) / RATE_HZ), np.float64) @ start
    return {plane: response[:4]}
