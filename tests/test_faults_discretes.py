"""Faults on discretes: every kind that suits one against its equation, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from faulted import PARSE, acts, executed, faulted, healthy
from pydantic import ValidationError

from rig.core.errors import BadInput
from rig.core.frame import DISCRETE_INDEX, Block, Ilm, State
from rig.scenario import scenario

GEAR, WHEELS = DISCRETE_INDEX["gear_down"], DISCRETE_INDEX["weight_on_wheels"]
ON, N = 20, 60
K = np.arange(N)
X = ((K // 7) % 2).astype(np.uint8)  # goes to and fro, and stands at 0 in the frame before the onset
SINCE = K - ON


def on_gear(**keys: Any) -> Block:
    """The gear's four switches at X; a fault on channel 2 from frame ON on."""
    block = healthy()
    block["discrete_channels"][:, GEAR] = X[:, None]
    return faulted({"signal": "gear_down", "channels": [2], "start_s": ON / 100, **keys}, block=block)


@pytest.mark.parametrize(
    ("keys", "expected", "frames"),
    [
        ({"kind": "stuck"}, np.zeros(N), SINCE >= 0),
        ({"kind": "stuck", "value": 1}, np.ones(N), SINCE >= 0),
        ({"kind": "inverted"}, 1 - X, SINCE >= 0),
        ({"kind": "toggling", "period_s": 0.1}, np.where(SINCE % 10 < 5, 1 - X, X), SINCE % 10 < 5),
        ({"kind": "toggling", "period_s": 0.001}, np.where(SINCE % 2 < 1, 1 - X, X), SINCE % 2 < 1),
        (
            {"kind": "intermittent", "gap_s": 0.1, "contact_s": 0.05, "in_gaps": "high"},
            np.where(SINCE % 15 < 10, 1, X),
            SINCE % 15 < 10,
        ),
        ({"kind": "dropout"}, X, SINCE >= 0),
        ({"kind": "ilm", "says": "bad"}, X, SINCE >= 0),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_a_kind_follows_its_equation_on_one_channel(keys, expected, frames):
    rows = on_gear(**keys)
    assert rows["discrete_channels"][ON:, GEAR, 1].tolist() == np.asarray(expected)[ON:].tolist()
    assert (rows["discrete_channels"][:ON, GEAR, 1] == X[:ON]).all()
    assert acts(rows) == [k for k in range(ON, N) if frames[k]]
    assert (rows["discrete_channels"][:, GEAR, [0, 2, 3]] == X[:, None]).all()
    assert not rows["discrete_channels"][:, WHEELS].any()


def test_validity_and_monitor_are_those_of_the_channel_while_the_fault_acts():
    rows = on_gear(kind="dropout", duration_s=0.1)
    assert np.flatnonzero(rows["discrete_valid"][:, GEAR, 1] == 0).tolist() == list(range(ON, ON + 10))
    assert (rows["discrete_valid"][:, GEAR, [0, 2, 3]] == 1).all() and (rows["discrete_ilm"] == Ilm.GOOD).all()
    seen = on_gear(kind="inverted", seen_by_ilm=True, duration_s=0.1)
    assert np.flatnonzero(seen["discrete_ilm"][:, GEAR, 1] == Ilm.BAD).tolist() == list(range(ON, ON + 10))
    assert (seen["discrete_valid"] == 1).all()
    assert (on_gear(kind="ilm", says="inverted")["discrete_ilm"][ON:, GEAR, 1] == Ilm.BAD).all()
    gaps = on_gear(kind="intermittent", gap_s=1.0, contact_s=1.0, in_gaps="invalid")
    assert (gaps["discrete_valid"][ON:, GEAR] == [1, 0, 1, 1]).all()


def test_random_toggling_is_wrong_half_of_the_time_in_runs_of_its_mean():
    keys = {"kind": "toggling", "signal": "gear_down", "channels": [2], "period_s": 0.2, "random": True}
    rows = faulted({**keys, "start_s": 0.0}, block=healthy(6000), size=6000)
    wrong = rows["discrete_channels"][:, GEAR, 1]
    assert wrong.mean() == pytest.approx(0.5, abs=0.06)
    assert len(wrong) / np.count_nonzero(np.diff(wrong)) == pytest.approx(10.0, rel=0.15)


def test_faults_on_one_discrete_act_in_the_order_of_the_file():
    stuck = {"kind": "stuck", "value": 1, "signal": "gear_down", "channels": [2], "start_s": 0.2}
    inverted = {"kind": "inverted", "signal": "gear_down", "channels": [2], "start_s": 0.2}
    assert faulted(stuck, inverted)["discrete_channels"][-1, GEAR, 1] == 0
    assert faulted(inverted, stuck)["discrete_channels"][-1, GEAR, 1] == 1


def test_a_fault_is_triggered_by_levels_and_states_of_a_discrete():
    block = healthy()
    block["discrete_state"][30:, WHEELS, 2], block["discrete_level"][40:, WHEELS] = State.SUSPECT, 3
    stuck = {"kind": "stuck", "value": 1, "signal": "gear_down", "channels": [2]}
    state = {"signal": "weight_on_wheels", "channel": 3, "state": "suspect"}
    assert acts(faulted({**stuck, "on": state}, block=block.copy()))[0] == 31
    assert acts(faulted({**stuck, "on": {"signal": "weight_on_wheels", "level": 3}}, block=block.copy()))[0] == 41
    assert acts(faulted({**stuck, "on": {**state, "channel": 2}}, block=block.copy())) == []


def test_a_fault_on_a_channel_that_is_out_is_not_executed():
    fault = {"kind": "inverted", "signal": "gear_down", "channels": [2], "start_s": ON / 100}
    rows = on_gear(**fault)
    assert executed([PARSE.validate_python(fault)], rows) == [True]
    rows["discrete_state"][ON - 1 :, GEAR, 1] = State.FAILED
    assert executed([PARSE.validate_python(fault)], rows) == [False]
    rows["discrete_state"][:, GEAR, 1] = State.ABSENT
    assert executed([PARSE.validate_python(fault)], rows) == [False]


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"kind": "offset", "offset": 1.0}, "offset cannot act on gear_down, a discrete, allowed: channel, inertial"),
        ({"kind": "hardover"}, "hardover cannot act on gear_down, a discrete"),
        ({"kind": "delay", "latency_s": 0.1}, "delay cannot act on gear_down, a discrete"),
        ({"kind": "inverted", "signal": "pitch_rate"}, "inverted cannot act on pitch_rate, allowed: discrete"),
        ({"kind": "toggling", "period_s": 0.1, "signal": "pitch_rate"}, "toggling cannot act on pitch_rate"),
        ({"kind": "toggling"}, "Field required"),
        ({"kind": "stuck", "value": 0.5}, "value: gear_down is a discrete, allowed: 0, 1; got 0.5"),
        ({"kind": "stuck", "ramp_s": 1.0}, "ramp_s: gear_down is a discrete"),
        ({"kind": "dropout", "flagged": False}, "flagged: gear_down is a discrete"),
        ({"kind": "intermittent", "gap_s": 1.0, "contact_s": 1.0, "in_gaps": "no number"}, "in_gaps: gear_down is a"),
        ({"kind": "stuck", "channels": []}, "channels: at least 1 is needed"),
        ({"kind": "inverted", "on": {"signal": "gear_down", "pattern": "2:2"}}, "pattern: gear_down is a discrete"),
    ],
)
def test_what_a_discrete_cannot_have_is_refused(bad, says):
    start = {} if "on" in bad else {"start_s": 0.2}
    with pytest.raises(ValidationError, match=says):
        PARSE.validate_python({"signal": "gear_down", "channels": [2], **start, **bad})


def test_a_channel_that_is_not_fitted_is_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[[faults]]\nkind = "inverted"\nsignal = "gear_down"\nchannels = [4]\nstart_s = 1.0\n')
    assert scenario.load(path).faults[0].points == [("gear_down", 4)]
    with pytest.raises(BadInput, match=r"faults.0.channels: gear_down has 3 channels, got \[4\]"):
        scenario.load(path, ["sensors.gear_down.channels=3"])
    path.write_text(
        '[[faults]]\nkind = "inverted"\nsignal = "gear_down"\nchannels = [1]\n'
        'on = { signal = "heading", channel = 3, state = "failed" }\n'
    )
    with pytest.raises(BadInput, match=r"faults.0.on.channel: heading has 2 channels, got 3"):
        scenario.load(path, ["sensors.heading.channels=2"])


def test_a_fault_on_a_discrete_leaves_every_signal_as_it_was():
    rows, clean = on_gear(kind="inverted"), healthy()
    for field in ("channels", "valid", "ilm", "inertial", "reference", "surface_command"):
        assert np.array_equal(rows[field], clean[field]), field
