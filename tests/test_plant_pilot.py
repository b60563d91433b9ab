import numpy as np
import pytest
from pydantic import ValidationError

from rig.core.frame import DISCRETE_INDEX, INDEX, new_block
from rig.world.plant.pilot import Config, Pilot

RATE = 100.0


def flown(*manoeuvres: dict, seconds: float = 8.0, **config) -> np.ndarray:
    block = new_block(int(seconds * RATE))
    Pilot(Config.model_validate({"manoeuvres": list(manoeuvres), **config}), RATE).prepare(block)
    return block


def stick(*manoeuvres: dict) -> np.ndarray:
    return flown(*manoeuvres)["truth"][:, INDEX["stick_pitch"]]


BASE = {"axis": "stick_pitch", "start_s": 1.0, "amplitude": 0.5}


def test_a_step_begins_on_its_frame_and_stays():
    out = stick({"kind": "step", **BASE})
    assert (out[:100] == 0).all() and (out[100:] == 0.5).all()


def test_a_hold_ends_before_the_frame_of_its_end():
    out = stick({"kind": "hold", **BASE, "duration_s": 2.0})
    assert np.flatnonzero(out).tolist() == list(range(100, 300))


def test_a_doublet_is_half_up_half_down():
    out = stick({"kind": "doublet", **BASE, "duration_s": 2.0})
    assert (out[100:200] == 0.5).all() and (out[200:300] == -0.5).all() and (out[300:] == 0).all()


def test_a_3211_alternates_in_sevenths_and_leaves_one_unit_of_net_deflection():
    out = stick({"kind": "3-2-1-1", **BASE, "duration_s": 7.0 * 0.5})
    signs = [out[100 + 50 * n + 10] for n in range(7)]
    assert signs == [0.5, 0.5, 0.5, -0.5, -0.5, 0.5, -0.5]
    assert out.sum() == pytest.approx(0.5 * 50)


def test_a_sweep_ends_at_its_end_frequency():
    out = stick({"kind": "sine-sweep", **BASE, "duration_s": 6.0, "start_hz": 0.5, "end_hz": 2.0})
    t = np.arange(600) / RATE
    phase = 2 * np.pi * (0.5 * t + (2.0 - 0.5) * t**2 / 12.0)
    assert np.allclose(out[100:700], 0.5 * np.sin(phase), atol=1e-9)
    crossings = np.flatnonzero(np.diff(np.sign(out[100:700])))
    assert len(crossings) == pytest.approx(2 * 7.5, abs=1)  # 7.5 cycles: the mean of 0.5 and 2 Hz over 6 s


def test_manoeuvres_add_up_and_sticks_stop_at_full_deflection():
    out = stick({"kind": "step", **BASE}, {"kind": "step", **BASE, "start_s": 2.0, "amplitude": 0.9})
    assert out[150] == 0.5 and out[250] == 1.0


def test_an_autopilot_command_goes_to_its_own_axis_unclipped():
    block = flown({"kind": "step", "axis": "altitude", "start_s": 0.0, "amplitude": 100.0})
    assert (block["autopilot_command"][:, 2] == 100.0).all()
    assert (block["autopilot_command"][:, [0, 1, 3, 4]] == 0).all()


def test_the_engage_switch_follows_the_moments():
    block = flown(engage_s=5.0, disengage_s=2.0)
    engaged = block["discrete_truth"][:, DISCRETE_INDEX["autopilot_engaged"]]
    assert (engaged[:200] == 1).all() and (engaged[200:500] == 0).all() and (engaged[500:] == 1).all()


@pytest.mark.parametrize(
    "bad", [{"axis": "throttle"}, {"kind": "wobble"}, {"duration_s": -1.0}, {"amplitude": float("nan")}, {"size": 1}]
)
def test_bad_manoeuvres_are_refused(bad):
    with pytest.raises(ValidationError):
        Config.model_validate({"manoeuvres": [{"kind": "hold", **BASE, "duration_s": 1.0, **bad}]})
