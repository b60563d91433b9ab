"""The effects that are fixed for a flight, each against its equation."""

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interpreted import printed
from numpy.random import SeedSequence
from one_stage import WIDE, sense, step_stage, suite, truths
from pydantic import ValidationError

from rig.core.frame import INDEX, new_block
from rig.world.sensors import Sensors
from rig.world.sensors.params import natural_frequency, transition

Q, P, R, PSI = (INDEX[name] for name in ("pitch_rate", "roll_rate", "yaw_rate", "heading"))
NX, NY, NZ = (INDEX[f"{name}_load_factor"] for name in ("longitudinal", "lateral", "normal"))
STEP = np.r_[0.0, np.ones(300)]
TURN = 2 * pi


def one(values, name="pitch_rate", c=0, **keys):
    """Channel c of one signal whose truth is ``values``."""
    return sense(truths(len(values), **{name: values}), suite(**{name: keys}))[:, INDEX[name], c]


@pytest.mark.parametrize("damping", [0.2, 0.7071, 1.0, 1.8])
def test_the_low_pass_answers_a_step_as_a_second_order_system(damping):
    x = one(STEP, bandwidth_hz=3.0, damping=damping, **WIDE)
    omega, t = natural_frequency(3.0, damping), np.arange(301) / 100
    roots = np.roots([1, 2 * damping * omega, omega**2]) * (1 + 1e-7 * np.array([1, -1]))  # apart for damping 1
    expected = 1 + (roots[1] * np.exp(roots[0] * t) - roots[0] * np.exp(roots[1] * t)) / (roots[0] - roots[1])
    assert np.allclose(x, expected.real, atol=1e-6)


@pytest.mark.parametrize("damping", [0.3, 0.7071, 1.5])
def test_the_gain_has_fallen_by_3_db_at_the_bandwidth(damping):
    omega, at = natural_frequency(5.0, damping), 2 * pi * 5.0
    gain = omega**2 / abs(complex(omega**2 - at**2, 2 * damping * omega * at))
    assert gain == pytest.approx(1 / sqrt(2))


def test_the_transition_is_that_of_the_equation_over_any_split_of_the_time():
    whole = transition(20.0, 0.3, 0.05)
    assert np.allclose(whole, np.linalg.matrix_power(transition(20.0, 0.3, 0.005), 10))
    turn, decay = 20 * sqrt(1 - 0.09), exp(-6 * 0.05)
    assert whole[0, 1] == pytest.approx(decay * sin(turn * 0.05) / turn)
    assert whole[0, 0] == pytest.approx(decay * (cos(turn * 0.05) + 6 / turn * sin(turn * 0.05)))


def test_a_low_pass_far_above_the_frame_rate_passes_everything():
    x = np.sin(np.arange(50))
    assert np.allclose(one(x, bandwidth_hz=1e6), x, atol=1e-12)
    assert np.allclose(one(x, bandwidth_hz=1e6, damping=2.0), x, atol=1e-12)


@pytest.mark.parametrize("latency", [0.01, 0.03, 0.5])
def test_a_latency_of_whole_frames_is_exact(latency):
    x, n = one(np.sin(np.arange(200) / 7)), round(latency * 100)
    assert np.array_equal(one(np.sin(np.arange(200) / 7), latency_s=latency), np.r_[np.full(n, x[0]), x[:-n]])


@given(st.floats(1e-4, 0.3))
@settings(max_examples=20, deadline=None)
def test_a_latency_between_frames_delays_a_ramp_by_itself(latency):
    t = np.arange(100) / 100
    x = one(t, latency_s=latency)
    late = t >= latency + 0.01
    assert np.allclose(x[late], t[late] - latency, atol=1e-9)


def test_latency_and_low_pass_go_the_short_way_round():
    turning = (TURN - 0.5 + np.arange(200) * 0.01) % TURN
    x = one(turning, "heading", latency_s=0.015, bandwidth_hz=5.0)
    straight = one(np.arange(200) * 0.01, latency_s=0.015, bandwidth_hz=5.0, **WIDE)
    assert np.allclose(np.cos(x - (straight + TURN - 0.5)), 1.0, atol=1e-12)
    assert ((x >= 0) & (x <= TURN)).all()


def shares(signal, others, **keys):
    """(channels, others): what each channel of ``signal`` shows for a truth of 1 in each of the others."""
    config = suite(**{signal: {**keys, **WIDE}})
    still = sense(truths(1), config)[0, INDEX[signal]]
    return np.array([sense(truths(1, **{o: 1.0}), config)[0, INDEX[signal]] - still for o in others]).T


RATES, LOADS = ("roll_rate", "yaw_rate"), ("longitudinal_load_factor", "lateral_load_factor", "normal_load_factor")


def test_a_misaligned_gyro_sees_the_two_other_rates_and_nothing_else():
    found = shares("pitch_rate", RATES, misalignment_tolerance_rad=0.01)
    assert (np.abs(found) <= 0.01).all() and len(set(found.ravel())) == 8
    assert not shares("pitch_rate", [*LOADS, "angle_of_attack"], misalignment_tolerance_rad=0.01).any()
    truth = truths(5, pitch_rate=0.2, roll_rate=0.5, yaw_rate=-0.3)
    x = sense(truth, suite(pitch_rate={"misalignment_tolerance_rad": 0.01}))[:, Q]
    assert np.allclose(x, 0.2 + found @ [0.5, -0.3], atol=1e-15)


def test_a_misaligned_accelerometer_sees_the_other_load_factors():
    found = shares("lateral_load_factor", (LOADS[0], LOADS[2]), misalignment_tolerance_rad=0.01)
    assert (np.abs(found) <= 0.01).all() and found.any(axis=0).all()
    assert not shares("lateral_load_factor", RATES, misalignment_tolerance_rad=0.01).any()


def test_a_gyro_feels_each_load_factor_in_proportion():
    found = shares("yaw_rate", LOADS, g_sensitivity_tolerance=0.002)
    assert (np.abs(found) <= 0.002).all() and len(set(found.ravel())) == 12
    truth = truths(5, longitudinal_load_factor=0.1, lateral_load_factor=-0.2, normal_load_factor=4.0)
    x = sense(truth, suite(yaw_rate={"g_sensitivity_tolerance": 0.002}))[:, R]
    assert np.allclose(x, found @ [0.1, -0.2, 4.0], atol=1e-15)


def test_the_shares_fill_their_tolerance_over_many_flights():
    def drawn(seed):
        config = suite(pitch_rate={"misalignment_tolerance_rad": 0.01, "g_sensitivity_tolerance": 0.002})
        return Sensors(config, 100.0, SeedSequence(seed)).params[Q]["share"]

    found = np.array([drawn(seed) for seed in range(300)])
    assert found[:, :2].std() == pytest.approx(0.01 / sqrt(3), rel=0.05)
    assert found[:, 2:].std() == pytest.approx(0.002 / sqrt(3), rel=0.05)


def test_what_is_felt_of_others_is_skewed_with_the_channel():
    """A channel that samples early sees the other signals early too."""
    ramp = np.arange(50) * 0.01
    config = suite(pitch_rate={"misalignment_tolerance_rad": 0.01, "skew_frames": 0.8})
    x = sense(truths(50, pitch_rate=ramp, roll_rate=ramp), config)[:, Q]
    aligned = suite(pitch_rate={"misalignment_tolerance_rad": 0.01})
    gain = sense(truths(1, pitch_rate=1.0, roll_rate=1.0), aligned)[0, Q]
    behind = ramp[1:, None] - x[1:] / gain
    assert np.allclose(behind, behind[0]) and (behind >= 0).all() and (behind <= 0.008).all()


@pytest.mark.parametrize("signal", ["angle_of_attack", "angle_of_sideslip", "static_pressure", "dynamic_pressure"])
def test_a_position_error_is_linear_in_angle_of_attack_and_dynamic_pressure_and_common(signal):
    keys = {"position_error_per_rad": 0.3, "position_error_per_pa": 2e-6, **WIDE}
    truth = truths(3, angle_of_attack=[0.0, 0.1, 0.2], dynamic_pressure=[0.0, 1e4, 3e4])
    x = sense(truth, suite(**{signal: keys}))[:, INDEX[signal]]
    expected = truth[:, INDEX[signal]] + 0.3 * np.array([0.0, 0.1, 0.2]) + 2e-6 * np.array([0.0, 1e4, 3e4])
    assert np.allclose(x, expected[:, None], rtol=1e-15, atol=1e-15)
    assert (np.ptp(x, axis=1) == 0).all()


def test_noise_of_a_density_is_that_density_at_any_frame_rate():
    for rate in (50.0, 200.0):
        x = sense(truths(50_000), suite(pitch_rate={"noise_density": 0.001}), rate_hz=rate)[:, Q]
        assert x.std() == pytest.approx(0.001 * sqrt(rate), rel=0.01)


def test_the_new_effects_shift_no_other_draws_and_none_of_the_old_ones():
    old = {"noise_std": 0.01, "bias_tolerance": 0.1, "skew_frames": 0.5, "scale_tolerance": 0.01, **WIDE}
    new = {"misalignment_tolerance_rad": 0.01, "g_sensitivity_tolerance": 0.01, "latency_s": 0.02, "bandwidth_hz": 9.0}
    plain, more = (sense(truths(200), suite(pitch_rate=keys, yaw_rate=old)) for keys in (old, {**old, **new}))
    assert np.array_equal(plain, more)  # the truth is at rest, so the effects show nothing


EVERYTHING = {
    "noise_std": 0.01,
    "bias_instability_std": 0.01,
    "bias_correlation_s": 5.0,
    "rate_random_walk": 0.001,
    "misalignment_tolerance_rad": 0.01,
    "g_sensitivity_tolerance": 0.01,
    "bandwidth_hz": 8.0,
    "latency_s": 0.013,
    "mode_rms": 0.01,
    "mode_frequency_hz": 9.0,
    "skew_frames": 0.5,
    "quantum": 1e-4,
}
MOVING = np.cumsum(np.random.default_rng(0).normal(0, 0.01, truths(400).shape), axis=0)


def test_recorded_truth_gives_the_same_channels_again():
    config = suite(pitch_rate=EVERYTHING)
    assert np.array_equal(sense(MOVING, config, split=100), sense(MOVING, config, split=33))


@pytest.mark.long
def test_compiled_and_interpreted_sensors_give_the_same_bits():
    program = (
        "import hashlib\n"
        "from one_stage import sense, suite\nfrom test_sensors_effects import EVERYTHING, MOVING\n"
        "turning = {'latency_s': 0.013, 'bandwidth_hz': 8.0, 'skew_frames': 0.5}\n"
        "air = {'position_error_per_rad': 0.1, 'position_error_per_pa': 0.1}\n"
        "config = suite(pitch_rate=EVERYTHING, heading=turning, angle_of_attack=air)\n"
        "print(hashlib.sha256(sense(MOVING, config).tobytes()).hexdigest())\n"
    )

    assert printed(program, interpreted=True) == printed(program, interpreted=False)


REFUSED = [
    ("heading", {"misalignment_tolerance_rad": 0.01}, "only rates and load factors"),
    ("normal_load_factor", {"g_sensitivity_tolerance": 0.01}, "only rates"),
    ("pitch_rate", {"position_error_per_rad": 0.01}, "only air data"),
    ("pitch_rate", {"bias_instability_std": 0.01}, "bias_correlation_s: must be above 0"),
    ("pitch_rate", {"mode_rms": 0.01}, "mode_frequency_hz: must be above 0"),
    ("pitch_rate", {"noise_rate_hz": 100.0}, "noise_file: must be given"),
    ("pitch_rate", {"noise_file": "a.csv"}, "noise_rate_hz: must be given"),
    ("pitch_rate", {"noise_file": "a.csv", "noise_rate_hz": 1.0, "noise_std": 0.1}, "noise_std: must be 0"),
    ("pitch_rate", {"latency_s": 2.0}, "less than or equal to 1"),
    ("pitch_rate", {"damping": 0.0}, "greater than 0"),
]


@pytest.mark.parametrize(("signal", "keys", "says"), REFUSED)
def test_an_effect_that_a_signal_cannot_have_is_refused(signal, keys, says):
    with pytest.raises(ValidationError, match=says):
        suite(**{signal: keys})


def test_a_block_of_one_row_is_measured_like_any_other():
    stage, block = Sensors(suite(pitch_rate={"latency_s": 0.01}), 100.0, SeedSequence(0)), new_block(1)
    block["truth"][0, Q] = 0.5
    stage.prepare(block)
    step_stage(stage, block, 0)
    assert (block["channels"][0, Q] == 0.5).all()
