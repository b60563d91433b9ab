from typing import Any

import numpy as np
import pytest
from numpy.random import SeedSequence
from one_stage import step_stage
from pydantic import TypeAdapter, ValidationError

from rig.core.errors import BadInput
from rig.core.frame import FLIGHT_INDEX, INDEX, INERTIAL, SIGNALS, new_block
from rig.flight.loop import Rig, frames
from rig.scenario import scenario
from rig.world.faults import Fault, Faults
from rig.world.sensors import inertial
from rig.world.sensors.inertial import Config, Inertial

RATE = 100.0
PERFECT = {
    "rate_noise_std_rad_s": 0.0,
    "rate_bias_tolerance_rad_s": 0.0,
    "velocity_noise_std_m_s": 0.0,
    "velocity_bias_tolerance_m_s": 0.0,
    "force_noise_std_m_s2": 0.0,
    "force_bias_tolerance_m_s2": 0.0,
    "force_scale_tolerance": 0.0,
    "force_quantum_m_s2": 0.0,
    "misalignment_tolerance_rad": 0.0,
    "lag_s": 0.0,
}
PARSE = TypeAdapter(Fault)
NORTH = FLIGHT_INDEX["velocity_north_m_s"]
FORCE = FLIGHT_INDEX["specific_force_forward_m_s2"]
LEVEL = (0.5, -0.25, -9.75)
RATES = [INDEX["roll_rate"], INDEX["pitch_rate"], INDEX["yaw_rate"]]


def sensed(
    p: Any = 0.1,
    q: Any = 0.2,
    r: Any = 0.3,
    velocity=(200.0, -5.0, 3.0),
    force: Any = LEVEL,
    frames=200,
    seed=1,
    **settings: Any,
):
    """(frames, 9) of a unit in steady motion; a value may be an array over the frames."""
    unit = Inertial(Config(**{**PERFECT, **settings}), RATE, SeedSequence(seed))
    block = new_block(frames)
    for s, rate in zip(RATES, (p, q, r), strict=True):
        block["truth"][:, s] = rate
    block["flight"][:, NORTH : NORTH + 3] = velocity
    block["flight"][:, FORCE : FORCE + 3] = force
    unit.prepare(block)
    for k in range(frames):
        step_stage(unit, block, k)
    return block["inertial"]


def test_a_perfect_unit_says_the_truth_in_the_order_of_the_frame():
    assert (sensed() == [0.1, 0.2, 0.3, 200.0, -5.0, 3.0, *LEVEL]).all()
    assert INERTIAL[0].startswith("roll") and INERTIAL[1].startswith("pitch")


def test_the_noise_has_its_standard_deviation_and_every_quantity_its_own():
    out = sensed(frames=20_000, rate_noise_std_rad_s=0.01, velocity_noise_std_m_s=0.5, force_noise_std_m_s2=0.2)
    assert out.std(axis=0) == pytest.approx([0.01] * 3 + [0.5] * 3 + [0.2] * 3, rel=0.03)
    assert np.abs(np.corrcoef(out.T) - np.eye(9)).max() < 0.03


def test_a_bias_is_constant_in_a_flight_and_spread_over_its_tolerance_between_flights():
    settings: Any = {
        "rate_bias_tolerance_rad_s": 0.01,
        "velocity_bias_tolerance_m_s": 2.0,
        "force_bias_tolerance_m_s2": 0.5,
    }
    healthy = sensed(frames=3)[0]
    off = np.array([sensed(frames=3, seed=seed, **settings) - healthy for seed in range(60)])
    assert (off == off[:, :1]).all()
    for quantities, tolerance in ((slice(0, 3), 0.01), (slice(3, 6), 2.0), (slice(6, 9), 0.5)):
        size = np.abs(off[:, 0, quantities])
        assert size.max() <= tolerance and size.max() > 0.9 * tolerance


def test_the_lag_is_of_first_order():
    q = np.where(np.arange(100) < 10, 0.0, 1.0)
    out = sensed(q=q, frames=100, lag_s=0.05)[:, 1]
    n = np.maximum(np.arange(100) - 9, 0)
    assert np.allclose(out, 1.0 - np.exp(-n / RATE / 0.05), atol=1e-12)


def test_a_box_that_sits_askew_turns_the_rates_and_leaves_their_size():
    out = sensed(p=2.0, q=0.0, r=0.0, frames=1, misalignment_tolerance_rad=0.01)[0]
    assert 0.0 < np.hypot(out[1], out[2]) <= 2.0 * np.hypot(0.01, 0.01)
    assert np.linalg.norm(out[:3]) == pytest.approx(2.0, rel=2e-4)


def test_the_accelerometers_share_the_misalignment_of_the_gyros():
    """The same small turn for both: what the rates of a roll show, a forward force shows a hundredfold."""
    out = sensed(p=1.0, q=0.0, r=0.0, force=(100.0, 0.0, 0.0), frames=1, misalignment_tolerance_rad=0.01)[0]
    assert out[6:] == pytest.approx(100.0 * out[:3]) and np.abs(out[7:]).min() > 0.0


def test_a_scale_error_is_of_the_force_and_within_its_tolerance():
    share = np.array([sensed(frames=1, seed=s, force_scale_tolerance=0.1)[0, 6:] / LEVEL - 1.0 for s in range(60)])
    assert 0.09 < np.abs(share).max() <= 0.1
    assert np.abs(np.corrcoef(share.T) - np.eye(3)).max() < 0.4
    assert (sensed(frames=1, force_scale_tolerance=0.1)[0, :6] == sensed(frames=1)[0, :6]).all()


def test_the_force_comes_in_steps_of_its_quantum_and_nothing_else_does():
    out = sensed(frames=1, force_quantum_m_s2=0.2)[0]
    assert out[6:] == pytest.approx([0.6, -0.2, -9.8]) and (out[:6] == sensed(frames=1)[0, :6]).all()


def test_the_figures_of_the_forces_shift_no_draw_of_rates_and_velocity():
    settings: Any = {"rate_noise_std_rad_s": 0.01, "velocity_noise_std_m_s": 0.5, "velocity_bias_tolerance_m_s": 1.0}
    noisy = sensed(force_noise_std_m_s2=0.3, force_bias_tolerance_m_s2=0.1, **settings)
    assert (noisy[:, :6] == sensed(**settings)[:, :6]).all() and (noisy[:, 6:] != LEVEL).any()


def test_what_it_says_stays_within_its_range():
    out = sensed(q=50.0, velocity=(-5000.0, 0.0, 0.0), force=(0.0, 900.0, 0.0), frames=1)[0]
    limits = inertial.ranges()
    assert (out[1], out[3], out[7]) == (limits[1, 1], limits[3, 0], limits[7, 1])
    assert limits[[0, 3, 6], 1].tolist() == [7.0, 1000.0, 200.0]


def test_its_draws_shift_no_others():
    """A stage of its own stream: the plant, the sensors and all the rest fly the same flight."""
    quiet, noisy = (
        scenario.load(None, ["duration_s=1.0", "turbulence=light", f"inertial.rate_noise_std_rad_s={std}"])
        for std in (0.0005, 0.05)
    )
    a, b = (np.concatenate([rows.copy() for rows, _ in frames(Rig(s), s)]) for s in (quiet, noisy))
    assert not np.array_equal(a["inertial"], b["inertial"])
    for name in ("truth", "channels", "voted", "surface", "flight"):
        assert np.array_equal(a[name], b[name], equal_nan=True)


def corrupted(**fault):
    ranges = np.vstack([np.array([(s.low, s.high) for s in SIGNALS]), inertial.ranges()])
    stage = Faults([PARSE.validate_python({"start_s": 0.1, **fault})], ranges, RATE)
    block = new_block(40)
    block["channels"], block["inertial"], block["valid"] = 0.25, 0.5, 1
    for k in range(len(block)):
        step_stage(stage, block, k)
    return block


@pytest.mark.parametrize("quantity", range(len(INERTIAL)), ids=INERTIAL)
def test_an_offset_on_a_quantity_moves_it_alone(quantity):
    block = corrupted(kind="offset", signal=f"inertial.{INERTIAL[quantity]}", offset=0.125, end_s=0.2)
    expected = np.full((40, len(INERTIAL)), 0.5)
    expected[10:20, quantity] = 0.625
    assert (block["inertial"] == expected).all()
    assert (block["channels"] == 0.25).all() and (block["valid"] == 1).all()
    assert block["acting"][:, 0].sum() == 10


def test_a_quantity_drifts_and_goes_hard_over_like_a_sensor():
    elapsed = np.maximum(np.arange(40) - 10, 0) / RATE
    drift = corrupted(kind="drift", signal="inertial.velocity_north_m_s", rate_per_s=3.0)["inertial"][:, 3]
    assert np.allclose(drift, 0.5 + 3.0 * elapsed)
    hard = corrupted(kind="hardover", signal="inertial.yaw_rate_rad_s", direction="low")["inertial"][:, 2]
    assert (hard[10:] == inertial.ranges()[2, 0]).all() and (hard[:10] == 0.5).all()


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"signal": "inertial"}, "unknown signal, nearest: .*inertial"),
        ({"signal": "inertial.alpha"}, "unknown signal"),
        ({"channels": [1]}, "inertial.pitch_rate_rad_s has none"),
        ({"seen_by_ilm": True}, "no in-line monitor"),
        ({"kind": "ilm", "says": "bad"}, "ilm cannot act on inertial.pitch_rate_rad_s"),
        ({"kind": "rate_loss", "max_rate_per_s": 1.0}, "rate_loss cannot act on"),
    ],
)
def test_what_it_cannot_have_is_refused(bad, says):
    fault = {"kind": "offset", "offset": 0.1, "start_s": 1.0, "signal": "inertial.pitch_rate_rad_s", **bad}
    if fault["kind"] != "offset":
        del fault["offset"]
    with pytest.raises(ValidationError, match=says):
        PARSE.validate_python(fault)


@pytest.mark.parametrize("override", ["inertial.lag_s=-1", "inertial.noise=1", "inertial.misalignment_tolerance_rad=1"])
def test_a_wrong_setting_is_one_line(override):
    with pytest.raises(BadInput, match="inertial") as refused:
        scenario.load(None, [override])
    assert "\n" not in str(refused.value)


def test_a_fault_is_named_by_its_quantity():
    fault = PARSE.validate_python({"kind": "hardover", "signal": "inertial.pitch_rate_rad_s", "start_s": 1.0})
    assert fault.label == "hardover inertial.pitch_rate_rad_s"
