import numpy as np
import pytest
from one_stage import step_stage
from pydantic import TypeAdapter, ValidationError

from rig.core.frame import INDEX, SIGNALS, Ilm, new_block
from rig.world.faults import Fault, Faults

RATE = 100.0
RANGES = np.array([(signal.low, signal.high) for signal in SIGNALS])
Q, PSI = INDEX["pitch_rate"], INDEX["heading"]
BASE = {"signal": "pitch_rate", "channels": [2], "start_s": 0.1}
PARSE = TypeAdapter(Fault)


def corrupted(*faults: dict, healthy: float = 0.25, frames: int = 40, ilm: int = Ilm.GOOD) -> np.ndarray:
    block = new_block(frames)
    block["channels"], block["valid"], block["ilm"] = healthy, 1, ilm
    stage = Faults([PARSE.validate_python({**BASE, **fault}) for fault in faults], RANGES, RATE)
    for k in range(frames):
        step_stage(stage, block, k)
    return block


def test_an_offset_moves_its_channel_alone_between_start_and_end():
    block = corrupted({"kind": "offset", "offset": 0.5, "end_s": 0.2})
    channels = block["channels"]
    assert np.array_equal(np.flatnonzero(channels[:, Q, 1] != 0.25), np.arange(10, 20))
    assert (channels[10:20, Q, 1] == 0.75).all()
    channels[:, Q, 1] = 0.25
    assert (channels == 0.25).all()
    assert (block["acting"][10:20, 0] == 1).all() and block["acting"].sum() == 10


def test_a_drift_grows_from_its_onset():
    out = corrupted({"kind": "drift", "rate_per_s": 2.0})["channels"][:, Q, 1]
    elapsed = np.maximum(np.arange(40) - 10, 0) / RATE
    assert np.allclose(out, 0.25 + 2.0 * elapsed, atol=1e-12)


@pytest.mark.parametrize(("direction", "end"), [("high", 1.5), ("low", -1.5)])
def test_a_hardover_goes_to_the_end_of_the_range(direction, end):
    out = corrupted({"kind": "hardover", "direction": direction})["channels"][:, Q, 1]
    assert (out[10:] == end).all()


def test_a_sample_cannot_leave_the_range():
    out = corrupted({"kind": "offset", "offset": 9.0})["channels"][:, Q, 1]
    assert (out[10:] == 1.5).all()


def test_an_offset_of_a_heading_goes_round():
    out = corrupted({"kind": "offset", "signal": "heading", "offset": 0.5}, healthy=6.0)["channels"][:, PSI, 1]
    assert np.allclose(out[10:], 6.5 - 2 * np.pi)


def test_several_faults_act_in_the_order_of_the_schedule():
    offset, hard = {"kind": "offset", "offset": -0.5}, {"kind": "hardover"}
    assert corrupted(offset, hard)["channels"][30, Q, 1] == 1.5
    assert corrupted(hard, offset)["channels"][30, Q, 1] == 1.0
    assert corrupted(offset, hard)["acting"][30, 0] == 0b11


def test_one_fault_may_sit_on_several_channels():
    out = corrupted({"kind": "offset", "offset": 0.5, "channels": [1, 4]})["channels"][30, Q]
    assert out.tolist() == [0.75, 0.25, 0.25, 0.75]


def test_nan_stays_nan():
    assert np.isnan(corrupted({"kind": "offset", "offset": 0.5}, healthy=np.nan)["channels"][30, Q, 1])


def test_a_dropout_is_flagged_or_is_no_number():
    flagged = corrupted({"kind": "dropout", "end_s": 0.2})
    silent = corrupted({"kind": "dropout", "flagged": False, "end_s": 0.2})
    assert (flagged["valid"][10:20, Q, 1] == 0).all() and flagged["valid"].sum() == flagged["valid"].size - 10
    assert (flagged["channels"] == 0.25).all()
    assert np.isnan(silent["channels"][10:20, Q, 1]).all() and np.isnan(silent["channels"]).sum() == 10
    assert (silent["valid"] == 1).all()


@pytest.mark.parametrize(
    ("fault", "before", "within"),
    [
        ({"kind": "offset", "offset": 0.5, "seen_by_ilm": True}, Ilm.GOOD, Ilm.BAD),
        ({"kind": "offset", "offset": 0.5}, Ilm.GOOD, Ilm.GOOD),
        ({"kind": "ilm", "says": "bad"}, Ilm.GOOD, Ilm.BAD),
        ({"kind": "ilm", "says": "good"}, Ilm.BAD, Ilm.GOOD),
        ({"kind": "ilm", "says": "inverted"}, Ilm.GOOD, Ilm.BAD),
        ({"kind": "ilm", "says": "inverted"}, Ilm.BAD, Ilm.GOOD),
        ({"kind": "ilm", "says": "bad"}, Ilm.ABSENT, Ilm.ABSENT),
    ],
)
def test_an_in_line_monitor_sees_a_fault_sticks_or_lies(fault, before, within):
    block = corrupted(fault, ilm=before)
    assert (block["ilm"][10:, Q, 1] == within).all()
    block["ilm"][10:, Q, 1] = before
    assert (block["ilm"] == before).all()


def test_a_lie_after_a_seen_fault_hides_it():
    seen, wrong = {"kind": "hardover", "seen_by_ilm": True}, {"kind": "ilm", "says": "inverted"}
    assert corrupted(seen, wrong)["ilm"][30, Q, 1] == Ilm.GOOD


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"signal": "pitchrate"}, "unknown signal"),
        ({"channels": [5]}, "from 1 to 4"),
        ({"channels": [1, 1]}, "different"),
        ({"channels": []}, "at least 1"),
        ({"end_s": 0.1}, "must be after"),
        ({"kind": "explode"}, "offset"),
        ({"offset": float("inf")}, "finite"),
        ({"start_s": -1.0}, "greater than or equal"),
    ],
)
def test_bad_faults_are_refused_with_what_is_allowed(bad, says):
    with pytest.raises(ValidationError, match=says):
        PARSE.validate_python({"kind": "offset", "offset": 0.5, **BASE, **bad})
