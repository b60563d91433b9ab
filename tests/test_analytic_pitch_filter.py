"""The pitch angle without its sensor: kinematics, the filter, and the reference that it serves as."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.computer.analytic.flight_path import VERTICAL, climb, path_angle, path_pitch_angle, pitch_on_path, pitching
from rig.computer.analytic.pitch_filter import PARAM, STATE, Noise, begin, correct, follow_path, parameters, predict
from rig.core.frame import INDEX, DecidedBy, S, State
from rig.flight.loop import Rig, frames
from rig.scenario import scenario

THETA = INDEX["pitch_angle"]
SMALL = st.floats(-0.35, 0.35)


@settings(deadline=None)  # the first call compiles
@given(SMALL, SMALL, st.floats(-0.2, 0.2), st.floats(-1.2, 1.2))
def test_the_pitch_angle_on_a_path_is_the_inverse_of_the_path_s_angle(theta, alpha, beta, phi):
    gamma = path_angle(theta, phi, alpha, beta)
    assert pitch_on_path(math.sin(gamma), alpha, beta, phi) == pytest.approx(theta, abs=1e-9)


@settings(deadline=None)  # the first call compiles
@given(st.floats(-1.0, 1.0), st.floats(-0.1, 0.1), st.floats(0.0, 0.5))
def test_a_level_turn_does_not_pitch(phi, theta, turn):
    q, r = turn * math.cos(theta) * math.sin(phi), turn * math.cos(theta) * math.cos(phi)
    assert pitching(q, r, phi) == pytest.approx(0.0, abs=1e-12)


def signals(alpha: float = 0.05) -> np.ndarray:
    x = np.zeros(S)
    x[INDEX["angle_of_attack"]], x[INDEX["normal_load_factor"]] = alpha, math.cos(alpha)
    x[INDEX["longitudinal_load_factor"]] = math.sin(alpha)
    x[INDEX["static_pressure"]], x[INDEX["dynamic_pressure"]] = 23_800.0, 11_700.0
    return x


def test_in_level_flight_the_path_says_the_angle_of_attack():
    v, x = np.zeros(1, VERTICAL), signals()
    for _ in range(1000):
        climb(x, 0.05, 0.01, v[0])
    assert path_pitch_angle(x, v[0]) == pytest.approx(0.05, abs=1e-6)


def test_in_a_steady_climb_it_is_the_climb_angle_more():
    v, x, speed, gamma = np.zeros(1, VERTICAL), signals(), 0.0, 0.04
    for _ in range(6000):
        climb(x, 0.05 + gamma, 0.01, v[0])
        x[INDEX["normal_load_factor"]] = math.cos(0.05 + gamma)
        x[INDEX["longitudinal_load_factor"]] = math.sin(0.05 + gamma)
        speed = float(v[0]["speed"])
        density = 2.0 * x[INDEX["dynamic_pressure"]] / speed**2
        x[INDEX["static_pressure"]] -= density * 9.80665 * speed * math.sin(gamma) * 0.01
        x[INDEX["dynamic_pressure"]] = 0.5 * density * speed**2
    assert path_pitch_angle(x, v[0]) == pytest.approx(0.05 + gamma, abs=1e-3)


def filter_of() -> tuple[np.ndarray, np.ndarray]:
    c, e = np.zeros(1, PARAM), np.zeros(1, STATE)
    c[:] = parameters(Noise(), 100.0)
    begin(c[0], e[0], 0.05, 0.001)
    return c, e


def test_the_drift_of_the_gyros_is_found_from_a_good_sensor():
    c, e = filter_of()
    x = signals()
    x[INDEX["pitch_rate"]] = 0.002
    for _ in range(6000):
        predict(c[0], e[0], x, 36)
        correct(e[0], 0.05 - e[0]["theta"], 0.0, 1e-5)
    assert e[0]["drift"] == pytest.approx(0.002, rel=0.01)
    assert e[0]["theta"] == pytest.approx(0.05, abs=1e-4)


def test_and_from_the_path_alone_if_more_slowly():
    c, e = filter_of()
    x, v = signals(), e[0]["vertical"]
    v["speed"] = 250.0
    x[INDEX["pitch_rate"]] = 0.002
    for _ in range(30_000):
        predict(c[0], e[0], x, 36)
        follow_path(c[0], e[0], 0.05)
    assert e[0]["drift"] == pytest.approx(0.002, rel=0.05)
    assert e[0]["theta"] + e[0]["path"] == pytest.approx(0.05, abs=1e-3)


def test_another_set_of_gyros_opens_the_drift_again():
    c, e = filter_of()
    for _ in range(3000):
        predict(c[0], e[0], signals(), 36)
        correct(e[0], 0.05 - e[0]["theta"], 0.0, 1e-5)
    known = float(e[0]["p"][1, 1])
    predict(c[0], e[0], signals(), 28)
    assert e[0]["p"][1, 1] > 10.0 * known


def flown(*sets: str, seconds: float = 30.0) -> np.ndarray:
    which = scenario.load(None, ["faults=[]", f"duration_s={seconds}", "turbulence=moderate", *sets], 3)
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])


@pytest.mark.parametrize("aircraft", ["f16", "b747", "b737"])
def test_as_a_reference_it_is_near_the_true_angle_and_stays_usable(aircraft: str):
    rows = flown(f"aircraft={aircraft}")
    off = rows["reference"][1:, THETA] - rows["truth"][1:, THETA]
    assert np.abs(off).max() < rows_threshold(aircraft)
    assert rows["reference_usable"][:, THETA].all()


def rows_threshold(aircraft: str) -> float:
    measured = scenario.load(None, [f"aircraft={aircraft}", "faults=[]"]).references
    found = measured.error("pitch_angle", "kinematic")
    assert found is not None
    return found.threshold


@pytest.mark.requirement("fault-tolerant", "the reference never asks the sensor")
def test_as_a_reference_it_never_asks_the_sensor():
    """All four channels off: the reference stays, and says so by becoming unusable."""
    sensor_fault = 'faults=[{kind="offset",signal="pitch_angle",channels=[1,2,3,4],start_s=20.0,offset=0.2}]'
    kept = ("control.vertical=stick", "redundancy.common_mode=report")  # a failed signal disputes nothing
    healthy, rows = flown(*kept), flown(*kept, sensor_fault)
    assert rows["truth"][:2001].tobytes() == healthy["truth"][:2001].tobytes()
    assert (rows["reference"][:2002, THETA] == healthy["reference"][:2002, THETA])[1:].all()
    assert not rows["reference_usable"][2100, THETA]


@pytest.mark.requirement("fault-tolerant", "the reference never asks the sensor")
def test_as_a_reference_it_settles_a_split_between_pairs():
    sensor_fault = 'faults=[{kind="offset",signal="pitch_angle",channels=[1,2],start_s=20.0,offset=0.1}]'
    rows = flown(sensor_fault, 'redundancy.signals.pitch_angle.tie_break=["reference"]')
    assert (rows["state"][-1, THETA] == [State.FAILED, State.FAILED, State.OK, State.OK]).all()
    assert (rows["decided_by"][2000:2010, THETA] == DecidedBy.REFERENCE).all()


def test_a_lost_partner_takes_it_along_and_gives_it_back():
    lost = 'faults=[{kind="dropout",signal="angle_of_attack",channels=[1,2,3,4],start_s=10.0}]'
    rows = flown(lost, "redundancy.references.pitch_angle=kinematic", seconds=15.0)
    assert np.isfinite(rows["reference"][1:1000, THETA]).all() and np.isnan(rows["reference"][1100:, THETA]).all()
