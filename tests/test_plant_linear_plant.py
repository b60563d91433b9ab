"""The linear plant: exact steps, signals that belong together, the whole rig on it."""

from __future__ import annotations

import hashlib
import json
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interpreted import printed
from one_stage import fly, hold
from scipy.integrate import solve_ivp
from scipy.linalg import solve_discrete_lyapunov

from rig.core.errors import BadInput
from rig.core.frame import FLIGHT_INDEX, INDEX, Block, End, new_block
from rig.core.settings import read_toml
from rig.core.units import atmosphere
from rig.flight.cost import bench
from rig.flight.fly import fly as fly_logged
from rig.log import read_log
from rig.scenario.scenario import from_resolved, load
from rig.studies.papers import ding2015
from rig.world.plant import airframe, dryden, wind
from rig.world.plant.linear_plant import LinearPlant
from rig.world.plant.linearise import linearise

ROOT = Path(__file__).parents[1]
TABLE = read_toml(ROOT / "aircraft" / "b707" / "aircraft.toml")["airframe"]
RATE_HZ = 100.0
ELEVATOR, THROTTLE = 0, 3


def config(**changes: Any) -> airframe.LinearConfig:
    found = airframe.parse(TABLE | changes, "test")
    assert isinstance(found, airframe.LinearConfig)
    return found


def model(**changes: Any) -> airframe.LinearConfig:
    return config(model=TABLE["model"] | changes)


def plant(
    frame: airframe.LinearConfig | None = None,
    air: wind.Config | None = None,
    turbulence: wind.Turbulence = "none",
    steps: int = 1,
) -> LinearPlant:
    frame = frame or config()
    return LinearPlant(frame, frame.point(), air or wind.Config(), turbulence, RATE_HZ, steps, 7)


def wild(flying: LinearPlant, frames: int = 400) -> Block:
    commands = hold(flying, frames)
    time = np.arange(frames) / RATE_HZ
    commands[:, ELEVATOR] += 0.02 * np.sin(2.0 * time)
    commands[:, THROTTLE] += 0.1 * np.sin(0.7 * time)
    return fly(flying, commands)


def signal(block: Block, name: str) -> np.ndarray:
    return block["truth"][:, INDEX[name]]


def flight(block: Block, name: str) -> np.ndarray:
    return block["flight"][:, FLIGHT_INDEX[name]]


def test_the_aircraft_is_the_papers_but_for_the_throttle() -> None:
    linear = linearise(config(), config().point())
    assert np.array_equal(linear.longitudinal_a, ding2015.A)
    assert np.array_equal(linear.longitudinal_b[:, 0], ding2015.B[:, 1])
    force, moment = linear.longitudinal_b[[0, 2], 1] / ding2015.B[[0, 2], 0]
    assert 1.0 / force == pytest.approx(100e3, rel=1e-3)  # kg
    assert 1.0 / moment == pytest.approx(7.8e6, rel=1e-3)  # kg m2


def test_in_trim_nothing_moves() -> None:
    flying = plant()
    block = fly(flying, hold(flying, 1000))
    assert np.max(np.ptp(block["truth"], axis=0)) == 0.0
    assert signal(block, "normal_load_factor")[0] == pytest.approx(np.cos(0.05))
    assert flight(block, "altitude_m")[-1] == pytest.approx(10668.0, abs=1e-9)
    assert flight(block, "north_m")[-1] == pytest.approx(9.99 * flight(block, "true_airspeed_m_s")[0])


@pytest.mark.requirement("ding2015", "exact steps")
@pytest.mark.parametrize("steps", [1, 4])
def test_a_step_of_the_plant_is_that_of_an_independent_integration(steps: int) -> None:
    frame = config()
    flying = plant(frame, steps=steps)
    commands = hold(flying, 300)
    commands[50:, ELEVATOR] += 0.01
    commands[120:, THROTTLE] -= 0.05
    block = fly(flying, commands)
    a, b = ding2015.A, np.array(frame.model.B)[:, ::-1]  # elevator, throttle
    lags = np.array([frame.elevator.lag_s, frame.throttle.lag_s])

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        wanted = commands[min(int(t * RATE_HZ + 1e-9), 299)] - flying.trim
        return np.concatenate([a @ z[:4] + b @ z[4:], (wanted[[ELEVATOR, THROTTLE]] - z[4:]) / lags])

    z = np.zeros(6)
    for start, end in ((0, 50), (50, 120), (120, 299)):
        span = (start / RATE_HZ, end / RATE_HZ - 1e-7)
        z = solve_ivp(rates, span, z, rtol=1e-10, atol=1e-13, max_step=0.05).y[:, -1]
    last = block[-1:]
    found = [flight(last, "true_airspeed_m_s")[0] - flight(block, "true_airspeed_m_s")[0]]
    found += [signal(last, name)[0] for name in ("angle_of_attack", "pitch_rate", "pitch_angle")]
    assert np.array(found) - [0.0, 0.05, 0.0, 0.05] == pytest.approx(z[:4], abs=2e-6)
    assert flight(last, "elevator_rad")[0] == pytest.approx(z[4], abs=1e-8)


@pytest.mark.requirement("ding2015", "load factors, pressures, place")
def test_the_load_factor_is_that_of_the_path() -> None:
    """Specific force by differences of the velocity over ground, turned into body axes."""
    flying = plant(config(accelerometer={"x_m": 0.0, "y_m": 0.0, "z_m": 0.0}))
    block = wild(flying)
    north, down = flight(block, "velocity_north_m_s"), flight(block, "velocity_down_m_s")
    a_north, a_down = np.gradient(north, 0.01)[2:-2], np.gradient(down, 0.01)[2:-2] - 9.80665
    theta = signal(block, "pitch_angle")[2:-2]
    along = a_north * np.cos(theta) - a_down * np.sin(theta)
    up = -(a_north * np.sin(theta) + a_down * np.cos(theta))
    assert signal(block, "longitudinal_load_factor")[2:-2] == pytest.approx(along / 9.80665, abs=2e-4)
    assert signal(block, "normal_load_factor")[2:-2] == pytest.approx(up / 9.80665, abs=2e-4)
    assert np.ptp(up) > 0.3


@pytest.mark.requirement("ding2015", "load factors, pressures, place")
def test_pressures_are_those_of_speed_and_altitude() -> None:
    block = wild(plant(), 2000)
    assert np.ptp(flight(block, "altitude_m")) > 5.0
    for row in block[::100]:
        static, dynamic = (row["truth"][INDEX[name]] for name in ("static_pressure", "dynamic_pressure"))
        altitude = atmosphere.pressure_altitude(static)
        assert altitude == pytest.approx(row["flight"][FLIGHT_INDEX["altitude_m"]], abs=1e-6)
        mach = atmosphere.mach_number(static, dynamic)
        speed = atmosphere.true_airspeed(mach, atmosphere.temperature(altitude))
        assert mach == pytest.approx(row["flight"][FLIGHT_INDEX["mach"]], rel=1e-9)
        assert speed == pytest.approx(row["flight"][FLIGHT_INDEX["true_airspeed_m_s"]], rel=1e-9)


def test_altitude_is_the_integral_of_the_climb() -> None:
    block = wild(plant(), 2000)
    climb = -flight(block, "velocity_down_m_s")
    gained = np.sum(0.5 * (climb[1:] + climb[:-1])) / RATE_HZ
    assert flight(block, "altitude_m")[-1] - 10668.0 == pytest.approx(gained, abs=1e-6)
    path = signal(block, "pitch_angle") - signal(block, "angle_of_attack")
    assert climb == pytest.approx(flight(block, "true_airspeed_m_s") * np.sin(path), abs=1e-9)


def test_a_surface_moves_no_faster_than_its_limit_and_stops_at_its_stop() -> None:
    flying = plant()
    commands = hold(flying, 200)
    commands[:, ELEVATOR] = 3.0
    elevator = flight(fly(flying, commands), "elevator_rad")
    limit = config().elevator
    assert 0.9 * limit.rate_limit_rad_s < np.max(np.diff(elevator)) * RATE_HZ <= limit.rate_limit_rad_s
    assert elevator[-1] == pytest.approx(limit.max_rad, abs=1e-6) and np.max(elevator) <= limit.max_rad


def test_a_command_that_is_no_number_ends_the_flight() -> None:
    flying = plant()
    commands = hold(flying, 6)
    commands[3, ELEVATOR] = nan
    assert list(fly(flying, commands)["end"]) == [0, 0, 0, 0, End.NOT_FINITE, End.NOT_FINITE]


def test_leaving_the_limits_ends_the_flight() -> None:
    frame = model(initial=[0.0, 0.4, 0.0, 0.0])
    block = new_block(1)
    assert plant(frame).read(block, 0) == End.DEPARTURE_ANGLE_OF_ATTACK


def test_the_initial_state_is_that_of_the_first_frame() -> None:
    block = new_block(1)
    plant(model(initial=[5.0, 0.01, 0.002, 0.03])).read(block, 0)
    first = [signal(block, name)[0] for name in ("angle_of_attack", "pitch_rate", "pitch_angle")]
    assert first == pytest.approx([0.06, 0.002, 0.08])


def test_an_updraught_raises_the_angle_of_attack_and_leaves_the_path() -> None:
    flying = plant(air=wind.Config(steps=[wind.Step(start_s=0.5, down_m_s=-2.0, north_m_s=3.0)]))
    block = fly(flying, hold(flying, 60))
    speed = flight(block, "true_airspeed_m_s")
    assert np.diff(signal(block, "angle_of_attack"))[49] == pytest.approx(2.0 / speed[0], rel=0.02)
    assert np.diff(speed)[49] == pytest.approx(-3.0, rel=0.02)
    assert np.max(np.abs(np.diff(flight(block, "velocity_down_m_s")))) < 0.2
    assert np.max(np.abs(np.diff(flight(block, "velocity_north_m_s")))) < 0.2


def test_in_steady_wind_the_trim_holds_and_the_ground_goes_by_faster() -> None:
    flying = plant(air=wind.Config(north_m_s=20.0, east_m_s=5.0))
    block = fly(flying, hold(flying, 100))
    assert np.max(np.ptp(signal(block, "angle_of_attack"))) == 0.0
    airspeed = flight(block, "true_airspeed_m_s")[0]
    assert flight(block, "velocity_north_m_s")[-1] == pytest.approx(airspeed + 20.0)
    assert flight(block, "east_m")[-1] == pytest.approx(5.0 * 0.99)


@pytest.mark.parametrize("dt_s", [0.01, 0.5])
def test_turbulence_has_its_standard_deviation_at_any_frame_rate(dt_s: float) -> None:
    f, gain, c = dryden.filters(1.5, 237.0, dt_s)
    spread = c @ solve_discrete_lyapunov(f, gain @ gain.T) @ c.T
    assert np.diag(spread) == pytest.approx([1.5**2] * 3, rel=1e-6)


def test_the_turbulence_kernel_is_its_matrices() -> None:
    f, gain, c = dryden.filters(1.5, 237.0, 0.01)
    noise, z, out = np.random.default_rng(1).standard_normal((50, 5)), np.zeros(5), np.zeros(3)
    expected = np.zeros(5)
    for k in range(50):
        dryden.stir(z, noise, k, f, gain, c, out)
        expected = f @ expected + gain @ noise[k]
    assert z == pytest.approx(expected) and out == pytest.approx(c @ expected)


def test_calm_and_turbulent_air_differ_and_a_seed_repeats_itself() -> None:
    calm, rough = plant(), plant(turbulence="moderate")
    assert np.ptp(signal(wild(rough), "angle_of_attack")) > 1.05 * np.ptp(signal(wild(calm), "angle_of_attack"))


def test_a_gust_that_the_model_cannot_take_up_does_not_carry_the_aircraft() -> None:
    """Without a state of sideslip a gust from the side would move the aircraft sideways, with no force at all."""
    known = plant(turbulence="moderate")
    assert known._stir[2].any(axis=1).tolist() == [row.any() for row in known._outputs[[0, 4, 1]]]
    block = wild(known)
    assert not known._outputs[4].any()
    assert np.ptp(flight(block, "wind_down_m_s")) > 0.5 and np.ptp(flight(block, "wind_east_m_s")) < 1e-9
    assert np.ptp(flight(block, "velocity_east_m_s")) < 1e-9


@pytest.mark.requirement("ding2015", "the same flight twice")
def test_the_same_flight_again_is_the_same_bit_for_bit() -> None:
    first, second = plant(turbulence="moderate"), plant(turbulence="moderate")
    flown = wild(first, 1500).tobytes()
    assert wild(second, 1500).tobytes() == flown
    first.reset()
    assert wild(first, 1500).tobytes() == flown


_AGAIN = """
import hashlib
from test_plant_linear_plant import plant, wild
print(hashlib.sha256(wild(plant(turbulence="severe")).tobytes()).hexdigest())
"""


def test_the_interpreted_plant_flies_the_same_in_another_process() -> None:
    here = hashlib.sha256(wild(plant(turbulence="severe")).tobytes()).hexdigest()
    assert printed(_AGAIN, interpreted=True) == here


def test_the_factors_change_the_aircraft_and_not_what_is_known_of_it() -> None:
    off = model(a_factor=1.1, b_factor=0.9)
    assert np.array_equal(linearise(off, off.point()).longitudinal_a, ding2015.A)
    flying = plant(off)
    commands = hold(flying, 3)
    commands[0, ELEVATOR] += 0.001
    nominal = plant()
    change = [np.diff(signal(fly(p, commands), "pitch_rate"))[0] for p in (flying, nominal)]
    assert change[0] / change[1] == pytest.approx(0.9, rel=0.01)


def test_the_design_sees_outputs_whatever_the_states_are() -> None:
    turn = np.array([[2.0, 0, 0, 0], [0, 1, 0.5, 0], [0, 0, 1, 0], [0, 0.1, 0, 1]])  # y = turn x
    back = np.linalg.inv(turn)
    b = np.array(TABLE["model"]["B"])
    frame = model(A=(back @ ding2015.A @ turn).tolist(), B=(back @ b).tolist(), C=turn.tolist())
    linear = linearise(frame, frame.point())
    assert linear.longitudinal_a == pytest.approx(ding2015.A, abs=1e-12)
    assert linear.longitudinal_b == pytest.approx(b[:, ::-1], abs=1e-12)
    assert wild(plant(frame))["truth"] == pytest.approx(wild(plant())["truth"], abs=1e-6)


def test_an_aircraft_that_rolls_turns() -> None:
    """Roll angle and body rates of a coordinated turn, held: psi' = g tan(phi) / V, n_y = 0, n_z = 1 / cos(phi)."""
    rows = [*TABLE["model"]["outputs"], "angle_of_sideslip", "roll_rate", "yaw_rate", "roll_angle"]
    still, unit = np.zeros((8, 8)).tolist(), np.eye(8).tolist()
    turning = 9.80665 * np.tan(0.3) / 237.228
    p, q, r = turning * np.array([-np.sin(0.05), np.sin(0.3) * np.cos(0.05), np.cos(0.3) * np.cos(0.05)])
    start = [0.0, 0.0, q, 0.0, 0.0, p, r, 0.3]
    flying = plant(model(A=still, B=np.zeros((8, 2)).tolist(), C=unit, outputs=rows, initial=start))
    block = fly(flying, hold(flying, 501))
    assert signal(block, "heading")[-1] == pytest.approx(5.0 * turning, rel=1e-6)
    track = np.arctan2(flight(block, "velocity_east_m_s"), flight(block, "velocity_north_m_s"))
    assert track[-1] - track[0] == pytest.approx(5.0 * turning, rel=1e-3)
    assert abs(signal(block, "lateral_load_factor")[-1]) < 5e-3
    assert signal(block, "normal_load_factor")[-1] == pytest.approx(1.0 / np.cos(0.3), rel=5e-3)


def missing(key: str) -> dict[str, Any]:
    return {k: v for k, v in TABLE["model"].items() if k != key}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"model": TABLE["model"] | {"B": [[1.0]]}}, r"airframe\.model: matrix B must have 4 rows of 2 numbers"),
        ({"model": TABLE["model"] | {"initial": [0.0]}}, r"airframe\.model: initial must have 4 numbers"),
        ({"model": TABLE["model"] | {"inputs": ["throttle", "throttle"]}}, r"inputs must have different names"),
        ({"model": TABLE["model"] | {"A": "x"}}, r"airframe\.model\.A: "),
        ({"model": missing("C")}, r"airframe\.model\.C: missing"),
        ({"trim": TABLE["trim"] | {"elevator_rad": 0.5}}, r"beyond the elevator's stops"),
        ({"flight_points": 2 * TABLE["flight_points"]}, r"airframe\.flight_points: .*at most 1"),
        ({"plant": "glider"}, r'airframe: plant must be "jsbsim" or "linear"'),
        ({"freeze_fuel": True}, r"airframe\.freeze_fuel: unknown key"),
    ],
)
def test_a_table_that_cannot_be_flown_is_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        airframe.parse(TABLE | changes, "mine.toml")


def test_outputs_that_are_missing_are_named() -> None:
    three = TABLE["model"] | {"outputs": TABLE["model"]["outputs"][:3], "C": TABLE["model"]["C"][:3]}
    with pytest.raises(BadInput, match="missing: pitch_angle"):
        config(model=three)


def test_a_model_that_cannot_be_turned_round_cannot_be_designed_for() -> None:
    frame = model(C=[*TABLE["model"]["C"][:3], [0.0, 0.0, 1.0, 0.0]])
    with pytest.raises(BadInput, match="C must be square and regular"):
        linearise(frame, frame.point())


def test_the_whole_rig_flies_on_it_votes_the_liar_out_and_logs_what_can_be_flown_again(tmp_path: Path) -> None:
    scenario = load("b707_pitch_angle_hardover", ["duration_s=20"])
    flown = fly_logged(scenario, out=tmp_path)
    assert flown.survived and flown.failed == {"pitch_angle": [2]}
    pitch = flown.signal("pitch_angle").truth
    assert pitch[-1] - pitch[0] == pytest.approx(0.02, abs=2e-3)
    again = fly_logged(from_resolved(json.loads(read_log(flown.log).metadata["scenario"]), "log"), out=tmp_path)
    assert again.digest == flown.digest


def test_there_is_no_bare_jsbsim_to_measure_it_against() -> None:
    with pytest.raises(BadInput, match="b707 is a linear model; the cost is measured against bare JSBSim"):
        bench(load("b707_pitch_angle_hardover"), 1)
