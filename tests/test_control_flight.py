"""The law flies the nonlinear aircraft: voted signals are the truth plus noise and bias."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.computer.control import gains_file as gains
from rig.computer.control.autopilot import Config, Control
from rig.core.frame import (
    AUTOPILOT_COMMANDS,
    CHANNELS,
    DISCRETE_INDEX,
    FLIGHT_INDEX,
    INDEX,
    SIGNALS,
    Block,
    S,
    new_block,
)
from rig.world.plant import airframe, wind
from rig.world.plant.jsbsim import Plant

AIRCRAFT = Path(__file__).parent.parent / "aircraft"
NAMES = ("f16", "b747", "b737")
POINTS = [  # the first of each aircraft in the quick tests
    pytest.param(name, point.name, marks=[pytest.mark.long] if i else [])
    for name in NAMES
    for i, point in enumerate(airframe.read(AIRCRAFT / name / "aircraft.toml").flight_points)
]
RATE_HZ = 100.0
DEGREE = np.pi / 180
NOISE = {"rate": 1e-3, "angle_of": 2e-3, "pressure": 12.0, "load_factor": 0.01, "_angle": 5e-4, "heading": 1e-3}
BIAS = {"rate": 0.1 * DEGREE, "angle_of": 0.3 * DEGREE, "static": 20.0, "dynamic": 30.0}
BIAS |= {"load_factor": 0.01, "_angle": 0.2 * DEGREE, "heading": 0.2 * DEGREE}


def sizes(table: dict[str, float]) -> NDArray[np.float64]:
    """Per signal, the entry whose key its name contains; 0 for the sticks."""
    return np.array([next((v for key, v in table.items() if key in signal.name), 0.0) for signal in SIGNALS])


def fly(
    name: str,
    point: str | None,
    seconds: float,
    *,
    config: Config | None = None,
    turbulence: wind.Turbulence = "none",
    errors: int | None = None,
    autopilot_command: tuple[str, float] | None = None,
    stick: tuple[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] | None = None,
    elevator_factor: float = 1.0,
) -> Block:
    """Flown frames; ``autopilot_command`` steps at 2 s, ``stick`` flies by hand, ``errors`` seeds noise and biases."""
    frame = airframe.read(AIRCRAFT / name / "aircraft.toml")
    plant = Plant(frame, frame.point(point), wind.Config(), turbulence, RATE_HZ, 1, 3)
    control = Control(config or Config(), gains.read(AIRCRAFT / name / "gains.toml"), RATE_HZ, frame.surface_limits)
    control.reset(plant.trim)
    n = int(seconds * RATE_HZ)
    block, error, t = new_block(n), np.zeros((n, S)), np.arange(n) / RATE_HZ
    block["level"] = CHANNELS
    if errors is not None:
        rng = np.random.default_rng(errors)
        error = sizes(NOISE) * rng.standard_normal((n, S)) + sizes(BIAS) * rng.choice([-1.0, 1.0], S)
    if autopilot_command:
        block["autopilot_command"][:, AUTOPILOT_COMMANDS.index(autopilot_command[0])] = np.where(
            t >= 2.0, autopilot_command[1], 0.0
        )
    block["discrete_voted"][:, DISCRETE_INDEX["autopilot_engaged"]] = stick is None
    if stick:
        block["truth"][:, INDEX[stick[0]]] = stick[1](t)
    for k in range(n):
        assert plant.read(block, k) == 0, f"departed at {t[k]} s"
        block["voted"][k] = block["truth"][k] + error[k]
        control.step(block, k)
        block["surface_command"][k] = block["surface"][k]
        block["surface_command"][k, 0] = plant.trim[0] + elevator_factor * (block["surface"][k, 0] - plant.trim[0])
        plant.step(block, k)
    return block


def truth(block: Block, name: str) -> NDArray[np.float64]:
    return block["truth"][:, INDEX[name]]


def flight(block: Block, name: str) -> NDArray[np.float64]:
    return block["flight"][:, FLIGHT_INDEX[name]]


def heading_change(block: Block) -> NDArray[np.float64]:
    turn = truth(block, "heading") - truth(block, "heading")[0]
    return (turn + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize(("name", "point"), POINTS)
@pytest.mark.parametrize("errors", [1, pytest.param(2, marks=pytest.mark.long)])
def test_turbulence_and_biased_sensors_leave_altitude_and_heading_held(name: str, point: str, errors: int) -> None:
    block = fly(name, point, 60.0, turbulence="moderate", errors=errors)
    altitude = flight(block, "altitude_m")
    assert np.max(np.abs(altitude - altitude[0])) < 30.0
    assert np.max(np.abs(heading_change(block))) < 3.0 * DEGREE


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_altitude_step_settles_with_little_overshoot(name: str, point: str) -> None:
    climbed = flight(block := fly(name, point, 50.0, autopilot_command=("altitude_m", 100.0)), "altitude_m")
    climbed = climbed - climbed[0]
    assert np.max(climbed) < 120.0
    assert np.max(np.abs(climbed[3500:] - 100.0)) < 5.0
    assert np.max(np.abs(truth(block, "normal_load_factor") - 1.0)) < 0.6


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_heading_change_is_a_coordinated_turn_without_overshoot(name: str, point: str) -> None:
    block = fly(name, point, 50.0, autopilot_command=("heading_rad", 30.0 * DEGREE))
    turn, altitude = heading_change(block), flight(block, "altitude_m")
    assert np.max(turn) < 31.5 * DEGREE
    assert abs(turn[-1] - 30.0 * DEGREE) < 1.0 * DEGREE
    assert np.max(np.abs(truth(block, "angle_of_sideslip"))) < 1.5 * DEGREE
    assert np.max(np.abs(altitude - altitude[0])) < 10.0


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_pitch_attitude_step_is_well_damped(name: str, point: str) -> None:
    block = fly(name, point, 20.0, config=Config(vertical="pitch"), autopilot_command=("pitch_angle_rad", 5.0 * DEGREE))
    pitch = truth(block, "pitch_angle") - truth(block, "pitch_angle")[0]
    assert np.max(pitch) < 5.5 * DEGREE
    assert np.max(np.abs(pitch[1500:] - 5.0 * DEGREE)) < 0.5 * DEGREE


@pytest.mark.parametrize(("name", "point"), [x for x in POINTS if x.values[0] == "f16"])
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_the_unstable_fighter_flies_on_with_half_and_with_twice_the_elevator(
    name: str, point: str, factor: float
) -> None:
    """The margin in the flesh: only what the law adds to the trim is scaled."""
    block = fly(name, point, 30.0, autopilot_command=("altitude_m", 20.0), elevator_factor=factor)
    assert np.max(np.abs(truth(block, "pitch_rate")[2000:])) < 1.0 * DEGREE
    assert flight(block, "altitude_m")[-1] - flight(block, "altitude_m")[0] == pytest.approx(20.0, abs=5.0)


def test_a_pull_on_the_stick_gives_its_load_factor() -> None:
    most = gains.read(AIRCRAFT / "f16" / "gains.toml").max_load_factor
    pull = lambda t: np.where((t >= 1) & (t < 6), 3.0 / (most - 1.0), 0.0)  # noqa: E731
    block = fly("f16", "20000ft_m08", 10.0, stick=("stick_pitch", pull))
    load = truth(block, "normal_load_factor")
    assert 3.2 < np.max(load) < 4.4
    assert abs(truth(block, "pitch_rate")[-1]) < 0.5 * DEGREE


def test_a_full_pull_at_low_speed_stays_below_the_alpha_limit_with_a_margin() -> None:
    block = fly("f16", "30000ft_m05", 8.0, stick=("stick_pitch", lambda t: np.where(t >= 1, 1.0, 0.0)))
    limit = gains.read(AIRCRAFT / "f16" / "gains.toml").max_alpha_rad
    assert np.max(truth(block, "angle_of_attack")) < limit + 0.05


def test_roll_stick_gives_its_roll_rate_and_a_doublet_comes_back() -> None:
    doublet = lambda t: np.select([(t >= 1) & (t < 3), (t >= 3) & (t < 5)], [0.5, -0.5], 0.0)  # noqa: E731
    block = fly("f16", "20000ft_m06", 10.0, stick=("stick_roll", doublet))
    point = next(x for x in gains.read(AIRCRAFT / "f16" / "gains.toml").points if x.name == "20000ft_m06")
    rate = truth(block, "roll_rate")
    assert rate[290] == pytest.approx(0.5 * point.max_roll_rate_rad_s, rel=0.1)
    assert abs(rate[-1]) < 0.5 * DEGREE
    assert np.max(np.abs(truth(block, "angle_of_sideslip"))) < 2.0 * DEGREE
