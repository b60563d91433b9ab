"""The decision on the pitch-angle sensor, frame by frame: its sigma, its two tests, what is kept, and the way back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rig.computer.fdi import decision
from rig.computer.fdi.pitch_test_state import BOTH, GYROS_ALONE, KEPT, STATE, UNIT_ALONE, Config, parameters
from rig.core.frame import INDEX, S, Trust

pytestmark = pytest.mark.requirement("fault-tolerant", "the two tests, the way back and the arbiter")

DT, SIGMA = 0.01, 0.001
CONFIG = Config()
RETURN_FRAMES = round(CONFIG.return_s / DT)
C = parameters(CONFIG, True, 1.0 / DT)[0]


def state(trust: Trust = Trust.TRUSTED, **fields: Any) -> Any:
    """A sensor off by nothing with a sigma of 1 mrad; no unit, so that every trip is a sensor fault."""
    w = np.zeros(1, STATE)[0]
    w["trust"], w["rates"], w["sigma"] = trust, GYROS_ALONE, SIGMA
    for name, value in fields.items():
        w[name] = value
    return w


def decide(
    w: Any, sigmas: float, known: bool = True, heard: bool = False, path: float = 0.0, second: float = 1.0
) -> None:
    """One frame of a sensor that is off by so many ``sigmas``, from the ``second`` mean by that share of it."""
    said = w["filter"]["theta"] + sigmas * SIGMA
    w["innovation"], w["second_innovation"] = sigmas * SIGMA, second * sigmas * SIGMA
    decision.decide(known, heard, C, w, said, path)


@pytest.mark.parametrize(("rates", "turn_error"), [(BOTH, 0.001), (GYROS_ALONE, 0.001), (UNIT_ALONE, 0.051)])
def test_sigma_is_the_root_of_the_squares_of_its_four_parts(rates: int, turn_error: float):
    w, x = state(rates=rates, turning=0.07), np.zeros(S)
    x[INDEX["pitch_rate"]], x[INDEX["yaw_rate"]] = -0.03, 0.04
    w["filter"]["rate"], w["filter"]["p"][0, 0] = 0.1, 3e-4**2
    w["filter"]["theta"], w["second"]["theta"] = 0.02, 0.05
    decision.innovate(C, w, 0.03, x)
    lag = 0.07 * turn_error * CONFIG.lag_s
    parts = (3e-4, CONFIG.innovation_floor_rad, 0.1 * CONFIG.timing_s, lag)
    assert w["sigma"] == pytest.approx(math.hypot(*parts), rel=1e-9)
    assert w["turning"] == pytest.approx(0.07)
    assert (w["innovation"], w["second_innovation"]) == pytest.approx((0.01, -0.02))


def test_the_rate_of_turn_is_smoothed_over_the_lag():
    w, x = state(), np.zeros(S)
    x[INDEX["pitch_rate"]], x[INDEX["yaw_rate"]] = -0.03, -0.04
    decision.innovate(C, w, 0.0, x)
    assert w["turning"] == pytest.approx(0.07 * DT / CONFIG.lag_s)


def test_only_innovations_beyond_the_jump_running_are_counted():
    w = state()
    for sigmas, over in ((-6.1, 1), (5.9, 0), (6.1, 1)):
        decide(w, sigmas)
        assert w["jump_frames"] == over and w["trust"] == Trust.TRUSTED
    decide(w, -6.1)
    assert w["trust"] == Trust.CORRECTED and (w["jump_frames"], w["cusum"], w["agreed"]) == (0, 0.0, 0)


def test_a_trip_that_the_second_mean_leaves_open_is_decided_when_it_has_said():
    """By 0.4 of the first residual it neither confirms nor refutes it."""
    for share, trust, rates in ((1.0, Trust.CORRECTED, BOTH), (0.0, Trust.TRUSTED, UNIT_ALONE)):
        w = state(rates=BOTH)
        for over in (1, 2, 3, 4):
            decide(w, 10.0, second=0.4)
            assert (w["jump_frames"], w["trust"], w["rates"]) == (over, Trust.TRUSTED, BOTH)
        decide(w, 10.0, second=share)
        assert (w["jump_frames"], w["trust"], w["rates"]) == (0, trust, rates)


def test_a_ramp_is_summed_beyond_its_sigma_an_innovation_as_six_at_most():
    w = state()
    for sigmas, cusum in ((1.0, 0.0), (-3.0, 0.015), (100.0, 0.06), (1.0, 0.055), (0.0, 0.04)):
        decide(w, sigmas)
        assert w["cusum"] == pytest.approx(cusum, abs=1e-12)
    for _ in range(640):  # 0.04 + 640 x 0.0015
        assert w["trust"] == Trust.TRUSTED
        decide(w, 1.65)
    decide(w, 1.65)
    assert w["trust"] == Trust.CORRECTED


def test_a_sensor_that_nothing_can_test_is_followed():
    w = state(jump_frames=1, cusum=0.5)
    w["filter"]["theta"] = 0.1
    decide(w, 50.0, known=False)
    assert w["trust"] == Trust.TRUSTED and (w["jump_frames"], w["cusum"]) == (0, 0.0)
    assert w["filter"]["theta"] == pytest.approx(0.15)
    assert w["filter"]["p"][0, 0] == pytest.approx(CONFIG.innovation_floor_rad**2)


@pytest.mark.parametrize(("heard", "share"), [(True, DT / (3.0 + DT)), (False, 0.0)])
def test_sensor_and_estimate_are_held_against_the_path(heard: bool, share: float):
    w = state(sensor_off_path=0.01, theta_off_path=0.02)
    w["filter"]["theta"], w["filter"]["path"] = 0.1, 0.03
    decide(w, 2.0, heard=heard, path=0.2)
    assert w["sensor_off_path"] == pytest.approx(0.01 + share * (0.2 - 0.03 - 0.102 - 0.01), rel=1e-9)
    assert w["theta_off_path"] == pytest.approx(0.02 + share * (0.2 - 0.03 - 0.1 - 0.02), rel=1e-9)
    assert w["recent"] == pytest.approx(0.002 * DT / (0.5 + DT), rel=1e-9)


def test_drift_and_path_are_kept_every_ten_seconds_and_go_back_at_least_thirty():
    w = state()
    for frame in range(round(60.0 / DT)):
        w["filter"]["frames"], w["filter"]["drift"], w["filter"]["path"] = frame, frame * DT, -frame * DT
        decision.keep(C, w)
        if frame * DT < 10.0:  # not known well enough to go back to
            assert (w["kept"] == (frame * DT, -frame * DT)).all()
    ago = np.array([50.0, 40.0, 30.0, 20.0])
    assert w["kept"] == pytest.approx(np.stack([ago, -ago], axis=1), abs=0.05)


@pytest.mark.parametrize(("before", "drift", "path", "variance"), [(0.0011, 0.5, 0.6, 5e-6), (0.0009, 0.1, 0.2, 1e-6)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_drift_and_path_go_back_for_a_ramp_and_stay_for_a_jump(
    before: float, drift: float, path: float, variance: float, sign: float
):
    """2 mrad, of which half or more is new in a jump."""
    w = state(innovation=sign * 0.002, agreed=3, jump_frames=2, cusum=1.0, sensor_off_path=1.0, theta_off_path=1.0)
    w["filter"]["drift"], w["filter"]["path"], w["filter"]["p"][0, 0] = 0.1, 0.2, 1e-6
    w["kept"][KEPT - 1] = 0.5, 0.6
    decision.declare(w, sign * before)
    told = w["filter"]["drift"], w["filter"]["path"], w["filter"]["p"][0, 0]
    assert told == pytest.approx((drift, path, variance), rel=1e-9)
    assert w["trust"] == Trust.CORRECTED and (w["recent"], w["worst"]) == (sign * 0.002, 0.002)
    for name in ("agreed", "jump_frames", "cusum", "sensor_off_path", "theta_off_path"):
        assert w[name] == 0, name


@pytest.mark.parametrize(
    ("recent", "innovation", "worst", "back"),
    [
        (-0.0029, 0.0, 0.05, True),
        (0.0031, 0.0, 0.05, False),
        (0.0009, 0.0, 0.002, True),  # a small fault: half of its worst
        (0.0011, 0.0, 0.002, False),
        (0.0, -0.0089, 0.05, True),  # one sample
        (0.0, 0.0091, 0.05, False),
    ],
)
def test_a_sensor_near_the_estimate_for_five_seconds_has_come_back(
    recent: float, innovation: float, worst: float, back: bool
):
    w = state(Trust.CORRECTED, recent=recent, innovation=innovation, worst=worst)
    w["filter"]["theta"] = 0.1
    for frame in range(RETURN_FRAMES):
        assert w["trust"] == Trust.CORRECTED and w["agreed"] == (frame if back else 0)
        decision.clear_or_withdraw(C, w, 0.08)
    assert w["trust"] == (Trust.TRUSTED if back else Trust.CORRECTED) and w["agreed"] == 0
    assert w["fade"] == pytest.approx(0.02 if back else 0.0) and w["filter"]["theta"] == 0.1


def test_one_sample_that_strays_begins_the_five_seconds_again():
    w = state(Trust.CORRECTED, worst=0.05, agreed=RETURN_FRAMES - 1, innovation=0.02)
    decision.clear_or_withdraw(C, w, 0.0)
    assert w["trust"] == Trust.CORRECTED and w["agreed"] == 0


@pytest.mark.parametrize(("gust", "margin"), [(0.001, 0.02), (0.01, 0.04)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_correction_is_withdrawn_when_the_path_speaks_for_the_sensor(gust: float, margin: float, sign: float):
    """Four sigma of the gusts, at least 20 mrad."""
    for beyond in (-0.001, 0.001):
        w = state(Trust.CORRECTED, sensor_off_path=-0.01, theta_off_path=sign * (0.01 + margin + beyond), worst=0.05)
        w["agreed"], w["filter"]["gust_variance"], w["filter"]["theta"], w["filter"]["drift"] = (
            9,
            gust * gust,
            0.1,
            0.004,
        )
        decision.clear_or_withdraw(C, w, 0.3)
        if beyond < 0.0:
            assert w["trust"] == Trust.CORRECTED and w["filter"]["theta"] == 0.1
    assert w["trust"] == Trust.WITHDRAWN and (w["filter"]["theta"], w["filter"]["drift"]) == (0.3, 0.0)
    assert w["agreed"] == 0 and w["fade"] == pytest.approx(-0.2) and w["fade_left"] == round(CONFIG.return_fade_s / DT)
    assert w["filter"]["p"][0, 0] == pytest.approx(CONFIG.innovation_floor_rad**2)


def test_after_a_withdrawal_the_sensor_is_tested_again_once_it_has_agreed_for_five_seconds():
    w = state(Trust.WITHDRAWN)
    decide(w, 5.9)
    decide(w, -6.1)
    for frame in range(RETURN_FRAMES):
        assert w["trust"] == Trust.WITHDRAWN and w["agreed"] == frame
        decide(w, -5.9)
    assert w["trust"] == Trust.TRUSTED
