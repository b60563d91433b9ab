"""Margins: known loops, and every loop of gains.toml by two roads that do not use ``margins``."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.computer.control import gains_file as gains
from rig.computer.control.gains_file import Gains, Point
from rig.design import loops
from rig.design.loops import ACTUATORS, Law, Plane
from rig.design.stability_margins import Loop, crossover, margins, response, sampled_loop
from rig.world.plant import airframe
from rig.world.plant.linearise import Linear, linearise

AIRCRAFT = Path(__file__).parent.parent / "aircraft"
NAMES = ("f16", "b747", "b737")
POINTS = [  # the first of each aircraft in the quick tests
    pytest.param(name, point.name, marks=[pytest.mark.long] if i else [])
    for name in NAMES
    for i, point in enumerate(gains.read(AIRCRAFT / name / "gains.toml").points)
]
NEEDED_GAIN, NEEDED_PHASE = 10 ** (6 / 20), math.radians(45.0)


@cache
def designed(name: str, point: str) -> tuple[airframe.Airframe, airframe.FlightPoint, Linear, Gains, Point]:
    config = airframe.read(AIRCRAFT / name / "aircraft.toml")
    whole = gains.read(AIRCRAFT / name / "gains.toml")
    flight_point = config.point(point)
    return (
        config,
        flight_point,
        linearise(config, flight_point),
        whole,
        next(x for x in whole.points if x.name == point),
    )


def simple_loop(gain: float, pole: float, period: float = 0.01) -> Loop:
    """u = -gain y around y' = pole y + u, actuator and sensor lag of a tenth of a millisecond."""
    one = np.eye(1)
    f, g, h = sampled_loop(one * pole, one, one, one * 0.0, [1e-4], 1e-4, period)
    return Loop(f=f, g=g, k=gain * h, period_s=period)


def test_an_integrator_with_delay_has_the_margins_of_the_textbook() -> None:
    found = margins(simple_loop(2.0, 0.0), 0)
    delay = 0.015 + 2e-4  # one frame and half the hold, two small lags
    assert found.crossover_rad_s == pytest.approx(2.0, rel=1e-3)
    assert found.phase_deg == pytest.approx(90.0 - math.degrees(2.0 * delay), abs=0.1)
    assert found.gain_decrease_db == 40.0  # an integrator is stable at any low gain
    # Unstable where the delay alone turns 90 degrees: w = pi / (2 delay), to the accuracy of the sampling.
    assert found.gain_increase_db == pytest.approx(20 * math.log10(math.pi / (2 * delay) / 2.0), abs=0.5)


def test_an_unstable_plant_has_a_lower_gain_limit_too() -> None:
    found = margins(simple_loop(4.0, 1.0), 0)
    assert found.gain_decrease_db == pytest.approx(20 * math.log10(4.0), abs=0.01)
    assert found.crossover_rad_s == pytest.approx(math.sqrt(4.0**2 - 1.0), rel=1e-3)


def test_a_loop_that_is_unstable_has_no_margins() -> None:
    assert margins(simple_loop(0.5, 1.0), 0).phase_deg == 0.0


@pytest.mark.parametrize(("name", "point"), [param.values for param in POINTS])
def test_written_margins_keep_six_decibels_and_forty_five_degrees(name: str, point: str) -> None:
    (found,) = (one for one in gains.read(AIRCRAFT / name / "gains.toml").points if one.name == point)
    assert set(found.stick_margins) == {"elevator", "aileron", "rudder"}
    assert set(found.autopilot_margins) == {"elevator", "throttle", "aileron", "rudder"}
    for margin in (*found.stick_margins.values(), *found.autopilot_margins.values()):
        assert margin.gain_increase_db >= 6.0
        assert margin.gain_decrease_db >= 6.0
        assert margin.phase_deg >= 45.0


@pytest.mark.parametrize(("name", "point"), POINTS)
@pytest.mark.parametrize("law", ["stick", "autopilot"])
@pytest.mark.parametrize("plane", ["longitudinal", "lateral"])
def test_the_nyquist_curve_encircles_as_often_as_there_are_unstable_poles(
    name: str, point: str, law: Law, plane: Plane
) -> None:
    """With gain x2, x1/2 and 45 degrees less phase, at each actuator in turn."""
    config, flight_point, linear, whole, _ = designed(name, point)
    loop = loops.build(config, flight_point, linear, whole, law, plane)
    for actuator, surface in enumerate(ACTUATORS[plane]):
        if law == "stick" and surface == "throttle":
            continue
        unstable, curve = nyquist(loop, actuator)
        for factor in (1.0, NEEDED_GAIN, 1 / NEEDED_GAIN, np.exp(-1j * NEEDED_PHASE)):
            assert turns_about_zero(1.0 + factor * curve) == unstable, (surface, factor)


def nyquist(loop: Loop, actuator: int) -> tuple[int, NDArray[np.complex128]]:
    """Poles of the opened loop outside a circle, and the loop gain once around that circle.

    The circle leaves out drifts slower than 0.01 rad/s (and what the law leaves to the pilot).
    """
    others = np.ones(loop.g.shape[1], complex)
    others[actuator] = 0.0
    opened = loop.closed(others)
    radius = math.exp((loop.growth_1_s + 0.01) * loop.period_s)
    unstable = int(np.sum(np.abs(np.linalg.eigvals(opened)) > radius))
    half = np.concatenate([[0.0], np.geomspace(1e-6, math.pi, 800)])
    z = radius * np.exp(1j * half)
    pencil = z[:, None, None] * np.eye(len(opened)) - opened
    inside = np.linalg.solve(pencil, np.broadcast_to(loop.g[:, actuator, None], (len(z), len(opened), 1)))
    upper = inside[:, :, 0] @ loop.k[actuator]
    return unstable, np.concatenate([upper[:0:-1].conj(), upper])  # all matrices are real


def turns_about_zero(curve: NDArray[np.complex128]) -> int:
    """Counterclockwise; the argument principle: as many as unstable open poles when the loop is stable."""
    turns = float(np.sum(np.angle(curve[1:] / curve[:-1]))) / (2 * math.pi)
    assert abs(turns - round(turns)) < 1e-3
    return round(turns)


@pytest.mark.parametrize(("name", "point"), POINTS)
@pytest.mark.parametrize("change", ["none", "double", "half", "late"])
def test_the_pitch_rate_loop_written_down_by_hand_is_stable(name: str, point: str, change: str) -> None:
    """Continuous, with Pade delays, by python-control: none of our loop code takes part."""
    import control  # half a second

    config, _, linear, whole, gain = designed(name, point)
    a, b = linear.longitudinal_a[1:3, 1:3], linear.longitudinal_b[1:3, :1]
    airframe_model = control.ss(a, b, np.eye(2), np.zeros((2, 1)))
    delay = 1.5 / whole.rate_hz
    factor = {"double": 2.0, "half": 0.5}.get(change, 1.0)
    if change == "late":
        delay += NEEDED_PHASE / gain.stick_margins["elevator"].crossover_rad_s
    numerator, denominator = control.pade(delay, 6)
    lags = ([config.elevator.lag_s, 1.0], [whole.sensor_lag_s, 1.0])
    chain = control.series(
        *(control.ss(control.tf(*x)) for x in ((numerator, denominator), *(([1.0], y) for y in lags)))
    )
    rate = control.tf([gain.elevator_pitch_rate_s, gain.elevator_pitch_rate_integral], [1.0, 0.0])
    law = control.append(control.ss([], [], [], [[gain.elevator_alpha]]), control.ss(rate))
    summed = control.ss([], [], [], [[1.0, 1.0]]) * law
    closed = control.feedback(factor * summed * airframe_model * chain, 1)
    assert np.max(np.linalg.eigvals(cast(control.StateSpace, closed).A).real) < 0.0


@pytest.mark.parametrize(("name", "point"), POINTS)
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_margins_hold_when_the_schedule_reads_a_slightly_wrong_pressure(name: str, point: str, share: float) -> None:
    config, flight_point, linear, whole, found = designed(name, point)
    pressures, table = whole.table()
    at = found.dynamic_pressure_pa
    moved = {
        column: float(np.interp(share * at, pressures, values))
        for column, values in zip(gains.COLUMNS, table.T, strict=True)
    }
    alone = whole.model_copy(update={"points": [found.model_copy(update=moved)]})
    for plane in ("longitudinal", "lateral"):
        loop = loops.build(config, flight_point, linear, alone, "autopilot", plane)
        for actuator in range(2):
            assert loop.stable(actuator, 10 ** (5.5 / 20))
            assert loop.stable(actuator, 10 ** (-5.5 / 20))
            assert loop.stable(actuator, np.exp(-1j * math.radians(42.0)))


def test_response_and_crossover_agree() -> None:
    loop = simple_loop(3.0, 0.5)
    assert abs(response(loop, 0, np.array([crossover(loop, 0)]))[0]) == pytest.approx(1.0, abs=1e-6)
