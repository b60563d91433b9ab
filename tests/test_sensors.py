import numpy as np
import pytest
from numpy.random import SeedSequence
from one_stage import step_stage
from pydantic import ValidationError

from rig.core.frame import INDEX, SIGNALS, D, Ilm, new_block
from rig.world import sensors

ERRORS = ("noise_std", "bias_tolerance", "scale_tolerance", "lag_s", "quantum", "skew_frames")
IDEAL = dict.fromkeys(ERRORS, 0.0)
Q, PSI, PHI = INDEX["pitch_rate"], INDEX["heading"], INDEX["roll_angle"]
RATE = 100.0


def suite(**per_signal):
    return sensors.Suite.model_validate({s.name: {**IDEAL, **per_signal.get(s.name, {})} for s in SIGNALS})


def measured(truth, seed=0, **per_signal):
    """Rows of a flight whose every signal has the truth given, (n,)."""
    stage = sensors.Sensors(suite(**per_signal), RATE, SeedSequence(seed))
    block = new_block(len(truth))
    block["truth"] = np.asarray(truth, float)[:, None]
    stage.prepare(block)
    for k in range(len(block)):
        step_stage(stage, block, k)
    return block


def test_ideal_sensors_say_the_truth_on_four_channels():
    rows = measured([0.1, 0.2, 0.3])
    assert np.array_equal(rows["channels"][:, Q], np.repeat([[0.1], [0.2], [0.3]], 4, axis=1))
    assert (rows["valid"] == 1).all() and (rows["ilm"] == Ilm.GOOD).all()


def test_noise_has_its_deviation_and_is_independent_between_channels_and_frames():
    rows = measured(np.zeros(20_000), pitch_rate={"noise_std": 0.01})
    x = rows["channels"][:, Q]
    assert x.std(axis=0) == pytest.approx(np.full(4, 0.01), rel=0.03)
    assert np.abs(np.corrcoef(x.T) - np.eye(4)).max() < 0.03
    assert abs(np.corrcoef(x[1:, 0], x[:-1, 0])[0, 1]) < 0.03


def test_bias_and_scale_stay_within_their_tolerance_and_differ_between_channels():
    stage = [measured(np.full(2, 1.0), seed, pitch_rate={"bias_tolerance": 0.1}) for seed in range(200)]
    bias = np.array([rows["channels"][0, Q] - 1.0 for rows in stage])
    assert np.abs(bias).max() <= 0.1
    assert bias.std() == pytest.approx(0.1 / np.sqrt(3), rel=0.1)
    scaled = measured([0.0, 1.0], pitch_rate={"scale_tolerance": 0.1})["channels"][:, Q]
    assert (scaled[0] == 0).all() and (np.abs(scaled[1] - 1) <= 0.1).all() and len(set(scaled[1])) == 4


def test_the_lag_is_first_order_with_its_time_constant():
    x = measured(np.r_[0.0, np.ones(200)], pitch_rate={"lag_s": 0.1})["channels"][:, Q, 0]
    t = np.arange(201) / RATE
    assert np.allclose(x, 1 - np.exp(-t / 0.1), atol=1e-12)


def test_a_skewed_channel_lags_a_ramp_by_at_most_its_share_of_a_frame():
    x = measured(np.arange(50) * 0.01, pitch_rate={"skew_frames": 0.5})["channels"][:, Q]
    behind = (np.arange(50)[1:, None] * 0.01 - x[1:]) / 0.01
    assert (behind >= 0).all() and (behind <= 0.5).all()
    assert np.allclose(behind, behind[0], atol=1e-9) and len(set(behind[0].round(9))) == 4


def test_samples_are_multiples_of_the_quantum_and_round_to_nearest():
    x = measured([0.0, 0.0249, 0.0251, -0.03], pitch_rate={"quantum": 0.05})["channels"][:, Q, 0]
    assert x.tolist() == [0.0, 0.0, 0.05, -0.05]


def test_a_sample_saturates_at_the_range_of_the_suite():
    x = measured([0.0, 5.0, -5.0], pitch_rate={"low": -1.0, "high": 2.0})["channels"][:, Q, 0]
    assert x.tolist() == [0.0, 2.0, -1.0]


def test_angles_go_round_instead_of_saturating_and_lag_the_short_way():
    turn = 2 * np.pi
    rows = measured([turn - 0.02, turn - 0.01, 0.01, 0.02], heading={"lag_s": 0.02, "skew_frames": 1.0})
    x = rows["channels"][:, PSI]
    assert (np.abs(np.sin(x)) < 0.03).all()
    assert ((x >= 0) & (x <= turn)).all()


def test_a_channel_that_is_not_fitted_is_no_number_and_shifts_no_draws():
    noisy = {"noise_std": 0.01, "bias_tolerance": 0.1}
    four = measured([0.0, 0.0], pitch_rate=noisy, yaw_rate=noisy)["channels"]
    three = measured([0.0, 0.0], pitch_rate={**noisy, "channels": 3}, yaw_rate=noisy)["channels"]
    assert np.isnan(three[:, Q, 3]).all()
    assert np.array_equal(three[:, Q, :3], four[:, Q, :3])
    assert np.array_equal(three[:, INDEX["yaw_rate"]], four[:, INDEX["yaw_rate"]])


def test_discretes_pass_to_every_channel():
    stage = sensors.Sensors(suite(), RATE, SeedSequence(0))
    block = new_block(1)
    block["discrete_truth"][0] = [1, 0, 1]
    stage.prepare(block)
    step_stage(stage, block, 0)
    assert np.array_equal(block["discrete_channels"][0], np.repeat([[1], [0], [1]], 4, axis=1))
    assert D == 3


def test_a_discrete_channel_that_is_not_fitted_says_nothing():
    of_three = sensors.Suite.model_validate({**suite().model_dump(), "gear_down": {"channels": 3}})
    stage = sensors.Sensors(of_three, RATE, SeedSequence(0))
    block = new_block(1)
    block["discrete_truth"][0] = 1
    stage.prepare(block)
    step_stage(stage, block, 0)
    row = block[0]
    assert row["discrete_channels"].tolist() == row["discrete_valid"].tolist() == [[1] * 4, [1] * 3 + [0], [1] * 4]
    assert row["discrete_ilm"].tolist() == [[1] * 4, [1] * 3 + [2], [1] * 4]
    with pytest.raises(ValidationError):
        sensors.Suite.model_validate({**suite().model_dump(), "gear_down": {"channels": 1}})


@pytest.mark.parametrize("bad", [{"noise_std": -1.0}, {"channels": 1}, {"channels": 5}, {"low": 3.0, "high": 1.0}])
def test_impossible_sensors_are_refused(bad):
    with pytest.raises(ValidationError):
        suite(pitch_rate=bad)
