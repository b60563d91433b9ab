"""The aircraft in flight: trim, forces, actuators, endings, repeatability."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from math import cos, exp, log, nan, sin
from pathlib import Path

import numpy as np
import pytest
from interpreted import printed
from one_stage import fly, hold

from rig.core.frame import DISCRETE_INDEX, FLIGHT_INDEX, INDEX, SURFACES, Block, End, new_block
from rig.world.plant import airframe, jsbsim, wind

AIRCRAFT = Path(__file__).parents[1] / "aircraft"
NAMES = ("f16", "b747", "b737")
PLANES = {name: airframe.read(AIRCRAFT / name / "aircraft.toml") for name in NAMES}
POINTS = [(name, point.name) for name in NAMES for point in PLANES[name].flight_points]
ELEVATOR, AILERON, RUDDER, THROTTLE = range(4)
DT = 0.01


def plant(
    name: str = "f16",
    point: str | None = None,
    *,
    turbulence: wind.Turbulence = "none",
    steps: int = 1,
    plane: airframe.Airframe | None = None,
) -> jsbsim.Plant:
    plane = plane or PLANES[name]
    return jsbsim.Plant(plane, plane.point(point), wind.Config(), turbulence, 1.0 / DT, steps, 1)


def position(block: Block, surface: int) -> np.ndarray:
    return block["flight"][:, FLIGHT_INDEX["elevator_rad"] + surface]


def signal(block: Block, name: str) -> np.ndarray:
    return block["truth"][:, INDEX[name]]


@pytest.mark.parametrize(("name", "point"), POINTS)
def test_the_trim_is_level_and_steady(name: str, point: str) -> None:
    flying = plant(name, point)
    block = fly(flying, hold(flying, 50))
    want = PLANES[name].point(point)
    assert block["flight"][0, FLIGHT_INDEX["altitude_m"]] == pytest.approx(want.altitude_m, abs=0.1)
    assert block["flight"][0, FLIGHT_INDEX["mach"]] == pytest.approx(want.mach, rel=1e-4)
    assert signal(block, "angle_of_attack")[0] == pytest.approx(signal(block, "pitch_angle")[0], abs=1e-6)
    for rate in ("pitch_rate", "roll_rate", "yaw_rate"):
        assert np.abs(signal(block, rate)).max() < 1e-3
    assert np.ptp(signal(block, "normal_load_factor")) < 2e-3
    assert not block["end"].any()


@pytest.mark.parametrize("name", ["b747", "b737"])
def test_a_transport_flies_ten_seconds_hands_off(name: str) -> None:
    flying = plant(name)
    block = fly(flying, hold(flying, 1000))
    for angle in ("pitch_angle", "roll_angle", "angle_of_attack"):
        assert np.abs(signal(block, angle) - signal(block, angle)[0]).max() < 0.001
    assert np.ptp(block["flight"][:, FLIGHT_INDEX["altitude_m"]]) < 2.0


def test_the_fighter_diverges_with_its_unstable_pole() -> None:
    flying = plant()
    commands = hold(flying, 601)
    commands[:10, ELEVATOR] -= 0.002  # a nudge, nose up
    alpha = signal(fly(flying, commands), "angle_of_attack")
    change = alpha - alpha[0]
    # After 3 s the stable motions are gone, and at 6 s the change is still small.
    growth = log(change[600] / change[300]) / 3.0
    assert change[600] < 0.06
    assert growth == pytest.approx(0.70, abs=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_level_accelerometers_read_gravity_less_the_turning_earth(name: str) -> None:
    flying = plant(name)
    block = fly(flying, hold(flying, 1))
    flight = block["flight"][0]
    radius = 6_378_137.0 + flight[FLIGHT_INDEX["altitude_m"]]
    # At the equator: gravitation with J2, less the turning Earth. The trim flies straight on, not
    # round the Earth, so there is no v^2 / r.
    gravitation = 3.986004418e14 / radius**2 * (1.0 + 1.5 * 1.0826e-3 * (6_378_137.0 / radius) ** 2)
    up = (gravitation - 7.2921e-5**2 * radius) / 9.80665
    theta = signal(block, "pitch_angle")[0]
    assert signal(block, "normal_load_factor")[0] == pytest.approx(up * cos(theta), abs=2e-4)
    assert signal(block, "longitudinal_load_factor")[0] == pytest.approx(up * sin(theta), abs=2e-4)
    assert signal(block, "lateral_load_factor")[0] == pytest.approx(0.0, abs=2e-4)


def at_cg(name: str) -> airframe.Airframe:
    return PLANES[name].model_copy(update={"accelerometer": airframe.Position(x_m=0.0, y_m=0.0, z_m=0.0)})


def test_the_accelerometers_agree_with_the_change_of_velocity_in_the_same_frame() -> None:
    flying = plant(plane=at_cg("f16"))
    commands = hold(flying, 60)
    commands[10:, ELEVATOR] -= 0.05
    block = fly(flying, commands)
    k = 30  # in the pull, where the load factor moves quickly
    first = FLIGHT_INDEX["velocity_north_m_s"]
    velocity = block["flight"][:, first : first + 3]
    # Velocity goes from row k to k + 1 with the acceleration of row k, as JSBSim integrates it (order 2).
    change = (velocity[k + 1] - velocity[k - 1]) / (2.0 * DT)
    w, *v = block["flight"][k, FLIGHT_INDEX["quaternion_w"] :][:4]
    names = ("longitudinal_load_factor", "lateral_load_factor", "normal_load_factor")
    force = np.array([signal(block, n)[k] for n in names]) * 9.80665 * [1.0, 1.0, -1.0]
    local = force + 2.0 * w * np.cross(v, force) + 2.0 * np.cross(v, np.cross(v, force))
    gravity = np.array([0.0, 0.0, 9.7616])  # of the turning Earth, at the equator and 6096 m
    assert local + gravity == pytest.approx(change, abs=0.03)
    jerk = np.gradient(signal(block, "normal_load_factor") * 9.80665)[k]
    assert abs(jerk) > 0.06  # else a row too early or too late would pass


def test_an_actuator_answers_a_small_step_with_its_lag() -> None:
    flying = plant()
    commands = hold(flying, 40)
    commands[:, ELEVATOR] += 0.01
    moved = position(fly(flying, commands), ELEVATOR) - flying.trim[ELEVATOR]
    lag = PLANES["f16"].elevator.lag_s
    # The command of row 0 is taken as a ramp over the first step: half a step late.
    expected = [0.01 * (1.0 - exp(-(k - 0.5) * DT / lag)) for k in range(1, 40)]
    assert moved[0] == 0.0
    assert moved[1:] == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize(("surface", "name"), [(ELEVATOR, "elevator"), (AILERON, "aileron"), (RUDDER, "rudder")])
@pytest.mark.parametrize("steps", [1, 4])
def test_an_actuator_keeps_its_rate_and_stops_at_its_limit(surface: int, name: str, steps: int) -> None:
    flying = plant(steps=steps)
    commands = hold(flying, 100)
    commands[:, surface] = 2.0
    moved = position(fly(flying, commands), surface)
    limits = getattr(PLANES["f16"], name)
    assert np.diff(moved).max() == pytest.approx(limits.rate_limit_rad_s * DT, rel=1e-3)
    assert moved.max() == pytest.approx(limits.max_rad, abs=1e-6)
    assert moved[-1] == pytest.approx(limits.max_rad, abs=1e-6)


def test_the_actuator_does_not_wind_up_beyond_its_stop() -> None:
    flying = plant("b747")
    commands = hold(flying, 260)
    commands[:200, RUDDER] = 2.0
    commands[200:, RUDDER] = 0.0
    moved = position(fly(flying, commands), RUDDER)
    assert moved[200] == pytest.approx(0.35, abs=1e-6)
    assert moved[205] < 0.34


def test_full_throttle_is_reached_and_speeds_the_aircraft_up() -> None:
    flying = plant()
    commands = hold(flying, 300)
    commands[:, THROTTLE] = 3.0
    block = fly(flying, commands)
    assert position(block, THROTTLE)[-1] == pytest.approx(1.0, abs=1e-5)
    assert np.diff(position(block, THROTTLE)).max() == pytest.approx(0.5 * DT, rel=1e-3)
    assert signal(block, "longitudinal_load_factor")[-1] > signal(block, "longitudinal_load_factor")[0] + 0.2


@pytest.mark.parametrize("name", NAMES)
def test_surface_signs_are_those_of_the_frame(name: str) -> None:
    answers = []
    for surface, rate in ((ELEVATOR, "pitch_rate"), (AILERON, "roll_rate")):
        flying = plant(name)
        commands = hold(flying, 30)
        commands[:, surface] += 0.03
        answers.append(signal(fly(flying, commands), rate)[-1])
    assert answers[0] < -1e-3  # trailing edge down pitches down
    assert answers[1] > 1e-3  # and this one rolls to the right


def test_nose_up_command_needs_a_frame_to_act() -> None:
    flying = plant()
    commands = hold(flying, 3)
    commands[:, ELEVATOR] -= 0.1
    q_dot = np.diff(signal(fly(flying, commands), "pitch_rate"))
    assert abs(q_dot[0]) < 1e-9
    assert q_dot[1] > 1e-4


@pytest.mark.parametrize("surface", range(len(SURFACES)))
def test_a_command_that_is_no_number_ends_the_flight(surface: int) -> None:
    flying = plant()
    commands = hold(flying, 6)
    commands[3, surface] = nan
    block = fly(flying, commands)
    assert not block["end"][:4].any()
    assert block["end"][-1] == End.NOT_FINITE


def test_a_simulation_that_fails_ends_the_flight_without_an_exception(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise jsbsim.jsbsim.BaseError("broken")

    flying = plant()
    monkeypatch.setattr(flying, "_run", fail)
    assert list(fly(flying, hold(flying, 2))["end"]) == [End.FLYING, End.NOT_FINITE]


def test_reaching_the_ground_ends_the_flight() -> None:
    low = airframe.FlightPoint(name="low", altitude_m=40.0, mach=0.4)
    flying = jsbsim.Plant(PLANES["b737"], low, wind.Config(), "none", 100.0, 1, 1)
    commands = hold(flying, 800)
    commands[:, ELEVATOR] += 0.02
    commands[:, THROTTLE] = 0.0
    block = fly(flying, commands)
    ended = np.flatnonzero(block["end"])
    assert len(ended)
    assert block["end"][ended[0]] == End.GROUND_CONTACT
    assert abs(block["flight"][ended[0], FLIGHT_INDEX["height_m"]]) < 5.0


def test_the_gear_is_up_and_no_wheel_touches() -> None:
    flying = plant()
    row = fly(flying, hold(flying, 1))[0]
    assert row["discrete_truth"][DISCRETE_INDEX["gear_down"]] == 0
    assert row["discrete_truth"][DISCRETE_INDEX["weight_on_wheels"]] == 0


def test_the_sticks_and_the_other_stages_fields_are_left_alone() -> None:
    flying = plant()
    block = new_block(1)
    others = {name: block[name].copy() for name in ("channels", "voted", "autopilot_command", "command", "surface")}
    block["truth"][0, [INDEX["stick_pitch"], INDEX["pedal"]]] = 0.5
    block["discrete_truth"][0, DISCRETE_INDEX["autopilot_engaged"]] = 1
    flying.read(block, 0)
    assert list(block["truth"][0, [INDEX["stick_pitch"], INDEX["pedal"]]]) == [0.5, 0.5]
    assert block["discrete_truth"][0, DISCRETE_INDEX["autopilot_engaged"]] == 1
    for name, before in others.items():
        assert np.array_equal(block[name], before)


def test_reading_twice_reads_the_same() -> None:
    flying = plant(turbulence="severe")
    fly(flying, hold(flying, 20))
    first, second = new_block(1), new_block(1)
    flying.read(first, 0)
    flying.read(second, 0)
    assert first.tobytes() == second.tobytes()


def wild(flying: jsbsim.Plant) -> Block:
    commands = hold(flying, 150)
    commands += 0.02 * np.sin(np.arange(150) / 7.0)[:, None]
    return fly(flying, commands)


@pytest.mark.parametrize("name", NAMES)
def test_two_fresh_plants_and_a_reset_one_fly_bit_for_bit_alike(name: str) -> None:
    first, second = plant(name, turbulence="moderate"), plant(name, turbulence="moderate")
    flown = wild(first).tobytes()
    assert wild(second).tobytes() == flown
    first.reset()
    assert wild(first).tobytes() == flown


_AGAIN = """
import hashlib
from test_plant_jsbsim import plant, wild
print(hashlib.sha256(wild(plant(turbulence="severe")).tobytes()).hexdigest())
"""


def test_the_interpreted_plant_flies_the_same_in_another_process() -> None:
    here = hashlib.sha256(wild(plant(turbulence="severe")).tobytes()).hexdigest()
    assert printed(_AGAIN, interpreted=True) == here


@pytest.fixture
def empty_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path


@pytest.mark.parametrize("name", NAMES)
def test_a_flight_prints_nothing_and_leaves_no_file(
    name: str, empty_directory: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    flying = plant(name, turbulence="light")
    fly(flying, hold(flying, 20))
    assert capfd.readouterr() == ("", "")
    assert not list(empty_directory.iterdir())
