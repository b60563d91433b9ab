"""Magnitudes in thresholds of the monitor, and the hardover of an angle on the circle."""

import numpy as np
import pytest
from faulted import PARSE, RATE, THRESHOLDS, faulted, healthy
from pydantic import ValidationError

from rig.core.frame import INDEX, SIGNALS
from rig.core.units.constants import TWO_PI
from rig.flight import loop
from rig.scenario import scenario

Q, PSI, PHI = INDEX["pitch_rate"], INDEX["heading"], INDEX["roll_angle"]
ON = 20
# A magnitude, its key in thresholds, and what else the kind needs.
FORMS = [
    ("offset", "offset", "offset_thresholds", {"ramp_s": 0.1}),
    ("drift", "rate_per_s", "rate_thresholds_per_s", {}),
    ("drift", "settles_at", "settles_at_thresholds", {"time_constant_s": 0.2}),
    ("noise", "std", "std_thresholds", {}),
    ("bias_instability", "std", "std_thresholds", {"time_constant_s": 0.2}),
    ("oscillation", "amplitude", "amplitude_thresholds", {"frequency_hz": 7.0}),
    ("oscillation", "amplitude", "amplitude_thresholds", {"frequency_hz": 7.0, "replacing": True}),
    ("spikes", "amplitude", "amplitude_thresholds", {"times_s": [0.1]}),
    ("quantisation", "step", "step_thresholds", {}),
]


@pytest.mark.parametrize("place", ["yaw_rate", "reference.yaw_rate"])
@pytest.mark.parametrize(("kind", "key", "in_thresholds", "keys"), FORMS)
def test_a_magnitude_in_thresholds_is_that_multiple_of_the_signals_own(place, kind, key, in_thresholds, keys):
    threshold = THRESHOLDS[INDEX["yaw_rate"]]
    where = {"kind": kind, "signal": place, "start_s": ON / RATE, **keys}
    where |= {"channels": [2]} if place == "yaw_rate" else {}
    one = faulted({**where, key: 4.0 * threshold})
    other = faulted({**where, in_thresholds: 4.0})
    assert one.tobytes() == other.tobytes() != healthy().tobytes()


@pytest.mark.parametrize(("kind", "key", "in_thresholds", "keys"), FORMS)
def test_exactly_one_of_the_two_forms_is_given(kind, key, in_thresholds, keys):
    base = {"kind": kind, "signal": "pitch_rate", "channels": [2], "start_s": 0.2, **keys}
    for given in ({}, {key: 1.0, in_thresholds: 1.0}):
        with pytest.raises(ValidationError, match=rf"either .*{key} or {in_thresholds}"):
            PARSE.validate_python({**base, **given})


def test_a_place_without_a_threshold_has_no_magnitudes_in_thresholds():
    base = {"kind": "drift", "rate_thresholds_per_s": 1.0, "start_s": 0.2}
    for place in ("inertial.pitch_rate_rad_s", "surface.elevator"):
        with pytest.raises(ValidationError, match=f"rate_thresholds_per_s: {place} has no threshold, give rate_per_s"):
            PARSE.validate_python({**base, "signal": place})


def test_the_thresholds_are_those_of_the_scenario(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        "duration_s = 0.1\n[[faults]]\nkind = 'offset'\nsignal = 'dynamic_pressure'\nchannels = [2]\nstart_s = 0.02\n"
        "offset_thresholds = 4\n"
    )
    for sets, threshold in (([], None), (["redundancy.signals.dynamic_pressure.threshold=125.0"], 125.0)):
        which = scenario.load(path, sets)
        if threshold is None:
            threshold = which.redundancy.signals.dynamic_pressure.threshold
        stage = loop.faults(which)
        assert stage.targets["value"].tolist() == [4 * threshold]


@pytest.mark.parametrize("direction", ["high", "low", "either"])
@pytest.mark.parametrize("s", [PSI, PHI])
def test_a_hardover_of_an_angle_is_half_a_turn_from_where_it_should_be(s, direction):
    signal = SIGNALS[s]
    truth = signal.low + 1e-9 + np.arange(60) * 0.2 % (TWO_PI - 1e-6)  # once round and more
    block = healthy()
    block["channels"][:, s] = truth[:, None]
    fault = {"kind": "hardover", "signal": signal.name, "channels": [2], "direction": direction, "start_s": ON / RATE}
    out = faulted(fault, block=block)["channels"][:, s, 1]
    assert np.abs(np.cos(out[ON:] - truth[ON:]) + 1.0).max() < 1e-12
    assert (out[:ON] == truth[:ON]).all() and out.min() >= signal.low and out.max() < signal.high


def test_an_angle_is_ramped_to_the_other_side_in_its_direction():
    turned = {}
    for direction in ("high", "low"):
        fault = {"kind": "hardover", "signal": "heading", "channels": [2], "direction": direction}
        block = healthy()
        block["channels"][:, PSI] = 0.1
        out = faulted({**fault, "start_s": ON / RATE, "ramp_s": 0.2}, block=block)["channels"][:, PSI, 1]
        turned[direction] = np.unwrap(out)[ON:] - 0.1
    ramp = np.pi * np.minimum(np.arange(40) / 20.0, 1.0)
    assert np.allclose(turned["high"], ramp, atol=1e-12) and np.allclose(turned["low"], -ramp, atol=1e-12)


def test_a_gap_of_a_loose_contact_says_the_other_side_of_an_angle_too():
    fault = {"kind": "intermittent", "gap_s": 1.0, "contact_s": 1.0, "in_gaps": "low", "signal": "roll_angle"}
    block = healthy()
    block["channels"][:, PHI] = 0.5
    out = faulted({**fault, "channels": [2], "start_s": ON / RATE}, block=block)["channels"][:, PHI, 1]
    assert np.allclose(out[ON:], 0.5 - np.pi)
