"""The pitch angle's reference among the others: what it is fed with, when there is none, when it begins again."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from one_stage import refer, remember
from test_analytic_references import LEVEL_ALPHA, RATE, designed, level_flight, ref, run

from rig.computer.analytic.pitch_filter import PARTNERS, Noise
from rig.computer.analytic.references import Config, References
from rig.core.frame import INDEX, Block


def on_a_level_path(theta: np.ndarray, **votes: Any) -> Block:
    """Rows of a path that stays level at the pitch angle ``theta`` (n,): angle of attack and pitch angle are one."""
    loads = {"normal_load_factor": np.cos(theta), "longitudinal_load_factor": np.sin(theta)}
    return level_flight(len(theta), angle_of_attack=theta, **loads, **votes)


def test_it_is_the_angle_of_this_frame_though_the_votes_are_those_of_the_last():
    q = np.where(np.arange(150) < 50, 0.0, 0.2)
    theta = LEVEL_ALPHA + np.cumsum(q) / RATE
    out = ref(run(on_a_level_path(theta, pitch_rate=q)), "pitch_angle")
    assert out[:50] == pytest.approx(theta[:50], abs=1e-6)
    assert out[52:] == pytest.approx(theta[52:], abs=1.1e-3)  # half a frame's turn, from the step; a frame's is 2e-3
    assert np.diff(out)[52:] == pytest.approx(0.2 / RATE, rel=0.02)


def test_without_a_source_there_is_none():
    assert np.isnan(ref(run(level_flight(20), Config(pitch_angle="none")), "pitch_angle")).all()


@pytest.mark.parametrize("partner", PARTNERS)
def test_after_the_loss_of_a_partner_it_begins_anew_at_the_angle_of_level_flight(partner: str):
    """And what was before is forgotten: here 0.1 rad less and another altitude."""
    theta, static = np.full(300, LEVEL_ALPHA), np.full(300, 101_325.0)
    theta[100:] += 0.1
    static[100:] -= 5_000.0  # 450 m of climb, had it been climbed
    block = on_a_level_path(theta, static_pressure=static)
    block["level"][80:120, INDEX[partner]] = 0
    out = ref(run(block), "pitch_angle")
    assert np.isnan(out[81:121]).all() and np.isfinite(out[:81]).all()
    assert out[121:] == pytest.approx(LEVEL_ALPHA + 0.1, abs=1e-5)


def test_a_first_angle_is_a_guess_of_three_degrees():
    """With a gust's variance as large, the path would move it by half; it counts 2 x 533 m / (V dt) times less."""
    alpha = np.full(3, LEVEL_ALPHA)
    alpha[1:] += 0.01
    out = ref(run(level_flight(3, angle_of_attack=alpha)), "pitch_angle")
    guess, gust = 0.05**2, 0.01**2
    counts = 2.0 * 533.4 / 150.0 * RATE
    learned = gust + (0.01 / (0.02 + 3.0)) * (0.01**2 - gust)
    share = guess / (guess + 0.008**2 + learned * counts)
    assert out[2] - LEVEL_ALPHA == pytest.approx(0.01 * share, rel=0.1)  # it has been said twice before


def test_whenever_other_gyros_vote_their_drift_is_less_certain():
    stage = References(Config(pitch_angle="kinematic"), designed(), RATE)
    sets = list(itertools.product(range(1, 5), repeat=2))
    codes = set()
    for pitch, yaw in sets:
        block = level_flight(1)
        block["level"][0, [INDEX["pitch_rate"], INDEX["yaw_rate"]]] = pitch, yaw
        remember(block, 0, stage.data)
        codes.add(int(stage.state["gyros"][0]))
    assert len(codes) == len(sets)
    block = level_flight(200)
    block["level"][100:, INDEX["yaw_rate"]] = 3
    stage, uncertain = References(Config(pitch_angle="kinematic"), designed(), RATE), []
    for k in range(len(block)):
        refer(block, k, stage.data)
        remember(block, k, stage.data)
        uncertain.append(float(stage.state["pitch_filter"]["p"][0][1, 1]))
    steps = np.diff(uncertain)
    assert steps[100] == pytest.approx(Noise().drift_sigma_rad_s ** 2, rel=0.01)
    assert np.delete(steps, 100).max() < 0.01 * steps[100]


def test_rates_of_the_first_frame_lead_nothing():
    """The lead is a difference between frames: a first sample has none to differ from but itself."""
    block = level_flight(3)
    block["inertial"][:, :3] = 0.3
    rates = {"pitch_rate": "inertial", "roll_rate": "inertial", "yaw_rate": "inertial"}
    config = Config.model_validate({**rates, "pitch_angle": "kinematic", "inertial_lead_s": 0.05})
    out = run(block, config)
    for name in ("roll_rate", "pitch_rate", "yaw_rate"):
        assert ref(out, name) == pytest.approx(0.3, abs=1e-12)
    assert math.isfinite(ref(out, "pitch_rate")[0])
