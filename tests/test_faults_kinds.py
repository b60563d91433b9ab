"""What every kind makes of the samples, against equations of our own."""

from pathlib import Path

import numpy as np
import pytest
from faulted import RANGES, acts, column, faulted, healthy, x
from pydantic import ValidationError

from rig.core.frame import FLIGHT_INDEX, INDEX, SIGNALS, Ilm
from rig.world.faults import KINDS

ON = 20  # frame of the onset
N = 60
T = np.maximum(np.arange(N) - ON, 0) / 100.0  # s since the onset
X = x()
Q, ALPHA = INDEX["pitch_rate"], INDEX["angle_of_attack"]
PLACES = ["pitch_rate", "inertial.pitch_rate_rad_s", "reference.pitch_rate"]


def held(value: float, length: int = N) -> np.ndarray:
    return np.full(length, value)


# kind, its keys, what the value becomes from the onset on
EQUATIONS = [
    ({"kind": "offset", "offset": 0.2}, X + 0.2),
    ({"kind": "offset", "offset": 0.2, "ramp_s": 0.1}, X + 0.2 * np.minimum(T / 0.1, 1.0)),
    ({"kind": "drift", "rate_per_s": 0.5}, X + 0.5 * T),
    ({"kind": "drift", "settles_at": 0.4, "time_constant_s": 0.2}, X + 0.4 * (1.0 - np.exp(-T / 0.2))),
    ({"kind": "scale", "factor": 0.5}, 0.5 * X),
    ({"kind": "scale", "factor": 0.5, "ramp_s": 0.2}, X * (1.0 - 0.5 * np.minimum(T / 0.2, 1.0))),
    ({"kind": "sign_reversal"}, -X),
    ({"kind": "stuck"}, held(X[ON - 1])),
    ({"kind": "stuck", "value": 0.123}, held(0.123)),
    ({"kind": "oscillation", "amplitude": 0.1, "frequency_hz": 7.0}, X + 0.1 * np.sin(2.0 * np.pi * 7.0 * T)),
    (
        {"kind": "oscillation", "amplitude": 0.1, "frequency_hz": 7.0, "replacing": True},
        X[ON - 1] + 0.1 * np.sin(2.0 * np.pi * 7.0 * T),
    ),
    ({"kind": "delay", "latency_s": 0.05}, np.roll(X, 5)),
    ({"kind": "quantisation", "step": 0.05}, 0.05 * np.floor(X / 0.05 + 0.5)),
    ({"kind": "dropout", "flagged": False}, held(np.nan)),
]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(("keys", "expected"), EQUATIONS, ids=lambda v: v["kind"] if isinstance(v, dict) else "")
def test_a_kind_follows_its_equation_wherever_it_sits(place, keys, expected):
    where = {"signal": place, **({"channels": [2]} if place == "pitch_rate" else {})}
    rows = faulted({**keys, **where, "start_s": ON / 100})
    out = column(rows, place)
    assert np.allclose(out[ON:], expected[ON:], rtol=0, atol=1e-12, equal_nan=True)
    assert (out[:ON] == X[:ON]).all() and acts(rows) == list(range(ON, N))


@pytest.mark.parametrize("place", PLACES)
def test_nothing_else_is_touched(place):
    where = {"signal": place, **({"channels": [2]} if place == "pitch_rate" else {})}
    rows, clean = faulted({"kind": "sign_reversal", **where, "start_s": 0.2}), healthy()
    for name in clean.dtype.names or ():
        different = (rows[name] != clean[name]).reshape(N, -1)
        expected = {"channels": N - ON, "inertial": N - ON, "reference": N - ON, "acting": N - ON}
        hit = {"pitch_rate": "channels"}.get(place, place.partition(".")[0])
        assert different.sum() == (expected[name] if name in (hit, "acting") else 0), name


def on_channel(**keys):
    return faulted({"signal": "pitch_rate", "channels": [2], "start_s": ON / 100, **keys})


@pytest.mark.parametrize("direction", ["high", "low", "either"])
def test_a_hardover_stands_at_an_end_of_the_range(direction):
    out = on_channel(kind="hardover", direction=direction)["channels"][ON:, Q, 1]
    allowed = {"high": (1.5,), "low": (-1.5,), "either": (-1.5, 1.5)}[direction]
    assert len(set(out)) == 1 and out[0] in allowed


def test_either_end_is_drawn_from_the_seed():
    keys = {"kind": "hardover", "direction": "either", "signal": "pitch_rate", "channels": [2], "start_s": 0.2}
    ends = [faulted(keys, seed=seed)["channels"][-1, Q, 1] for seed in range(40)]
    assert 8 < sum(end > 0 for end in ends) < 32


def test_a_hardover_with_a_ramp_runs_there():
    out = on_channel(kind="hardover", ramp_s=0.2)["channels"][:, Q, 1]
    share = np.minimum(T / 0.2, 1.0)
    assert np.allclose(out[ON:], (X + share * (1.5 - X))[ON:]) and (out[ON + 20 :] == 1.5).all()


def test_noise_has_its_deviation_on_every_channel_of_its_own():
    block = healthy(20_000)
    block["channels"] = 0.0
    keys = {"kind": "noise", "signal": "pitch_rate", "channels": [1, 3], "start_s": 0.0, "std": 0.05}
    noise = faulted(keys, block=block, size=100)["channels"][:, Q]
    # six sigma of the estimates over 20 000 samples
    assert noise[:, 0].std() == pytest.approx(0.05, abs=6 * 0.05 / np.sqrt(40_000))
    assert abs(noise[:, 0].mean()) < 6 * 0.05 / np.sqrt(20_000)
    assert abs(np.corrcoef(noise[:, 0], noise[:, 2])[0, 1]) < 6 / np.sqrt(20_000)
    assert abs(np.corrcoef(noise[:-1, 0], noise[1:, 0])[0, 1]) < 6 / np.sqrt(20_000)
    assert not noise[:, [1, 3]].any()


def test_an_unstable_bias_is_a_gauss_markov_process_from_zero_on_every_channel_of_its_own():
    std, constant, runs, on = 0.02, 1.0, 400, 10
    keys = {"kind": "bias_instability", "signal": "pitch_rate", "channels": [1, 3], "start_s": on / 100}
    block = healthy(311)
    block["channels"] = 0.0
    keys |= {"std": std, "time_constant_s": constant}
    flown = [faulted(keys, block=block.copy(), size=100, seed=seed)["channels"][:, Q] for seed in range(runs)]
    bias = np.array(flown)
    assert not bias[:, : on + 1].any() and not bias[:, :, [1, 3]].any()
    for t in (0.05, 0.5, 3.0):  # as if at once, then as long as its constant, then for good
        at, expected = bias[:, on + round(100 * t)], std**2 * (1.0 - np.exp(-2.0 * t / constant))
        both = np.concatenate([at[:, 0], at[:, 2]])
        assert both.var() == pytest.approx(expected, rel=5.0 * np.sqrt(2.0 / len(both)))
        assert abs(np.corrcoef(at[:, 0], at[:, 2])[0, 1]) < 5.0 / np.sqrt(runs)
    later, now = bias[:, on + 300, [0, 2]].ravel(), bias[:, on + 250, [0, 2]].ravel()
    assert np.corrcoef(later, now)[0, 1] == pytest.approx(np.exp(-0.5 / constant), abs=0.12)


def test_an_unstable_bias_begins_at_zero_in_each_of_its_times():
    bias = on_channel(kind="bias_instability", std=0.02, time_constant_s=0.1, duration_s=0.1, repeat_every_s=0.25)
    off = bias["channels"][:, Q, 1] - X
    assert [off[k] for k in (ON, ON + 25)] == [0.0, 0.0] and off[ON + 9] != 0.0 != off[ON + 34]


def test_spikes_come_at_their_times_and_last_their_width():
    rows = on_channel(kind="spikes", amplitude=0.4, times_s=[0.2, 0.0], width_s=0.03)
    due = [20, 21, 22, 40, 41, 42]
    expected = X.copy()
    expected[due] += 0.4
    assert np.allclose(rows["channels"][:, Q, 1], expected, atol=1e-15) and acts(rows) == due


def test_a_spike_without_width_is_one_frame_and_may_take_the_place_of_the_sample():
    rows = on_channel(kind="spikes", value=1.25, times_s=[0.1])
    assert acts(rows) == [30] and rows["channels"][30, Q, 1] == 1.25


def test_random_spikes_come_at_their_rate():
    block = healthy(50_000)
    keys = {"kind": "spikes", "signal": "pitch_rate", "channels": [2], "start_s": 0.0, "amplitude": 0.5}
    found = acts(faulted({**keys, "rate_per_s": 2.0}, block=block, size=100))
    expected = 50_000 * (1.0 - np.exp(-2.0 / 100.0))
    assert abs(len(found) - expected) < 6 * np.sqrt(expected)


def test_a_regular_intermittent_fault_opens_and_closes():
    rows = on_channel(kind="intermittent", gap_s=0.05, contact_s=0.1)
    due = [*range(20, 25), *range(35, 40), *range(50, 55)]
    expected = X.copy()
    for start in (20, 35, 50):
        expected[start : start + 5] = X[start - 1]
    assert acts(rows) == due and np.array_equal(rows["channels"][:, Q, 1], expected)


@pytest.mark.parametrize(("said", "value"), [("high", 1.5), ("low", -1.5), ("no number", np.nan), ("invalid", None)])
def test_what_is_said_in_a_gap(said, value):
    rows = on_channel(kind="intermittent", gap_s=0.05, contact_s=1.0, in_gaps=said)
    inside = rows["channels"][20:25, Q, 1]
    if value is None:
        assert np.array_equal(inside, X[20:25]) and not rows["valid"][20:25, Q, 1].any()
        assert rows["valid"].sum() == rows["valid"].size - 5
    else:
        assert np.array_equal(inside, held(value, 5), equal_nan=True) and rows["valid"].all()


def test_random_gaps_and_contacts_have_their_means():
    block = healthy(60_000)
    keys = {"kind": "intermittent", "signal": "pitch_rate", "channels": [2], "start_s": 0.0, "random": True}
    rows = faulted({**keys, "gap_s": 0.05, "contact_s": 0.2}, block=block, size=100)
    on = np.isin(np.arange(len(rows)), acts(rows))
    assert on[0]
    gaps = np.count_nonzero(on[1:] & ~on[:-1]) + 1
    leave, enter = 1.0 - np.exp(-1.0 / 5.0), 1.0 - np.exp(-1.0 / 20.0)
    assert on.mean() == pytest.approx(enter / (enter + leave), rel=0.08)
    assert on.sum() / gaps == pytest.approx(1.0 / leave, rel=0.08)


def test_a_flagged_dropout_keeps_its_sample():
    rows = on_channel(kind="dropout", end_s=0.3)
    assert np.array_equal(rows["channels"][:, Q, 1], X)
    assert np.flatnonzero(rows["valid"][:, Q, 1] == 0).tolist() == list(range(20, 30))


def test_a_place_without_a_flag_says_no_number_when_it_drops_out():
    out = faulted({"kind": "dropout", "signal": "inertial.yaw_rate_rad_s", "start_s": 0.2, "end_s": 0.3})
    assert np.flatnonzero(np.isnan(out["inertial"][:, 2])).tolist() == list(range(20, 30))


def test_a_delay_reads_what_came_before_its_onset():
    out = on_channel(kind="delay", latency_s=0.15)["channels"][:, Q, 1]
    assert np.array_equal(out[ON:], X[ON - 15 : N - 15])


def test_a_delay_from_the_first_frame_on_says_the_first_sample_until_there_is_an_older_one():
    keys = {"kind": "delay", "signal": "pitch_rate", "channels": [2], "start_s": 0.0, "latency_s": 0.1}
    out = faulted(keys)["channels"][:, Q, 1]
    assert (out[:10] == X[0]).all() and np.array_equal(out[10:], X[: N - 10])


@pytest.mark.parametrize("skew_s", [0.004, 0.01, 0.025])
def test_frame_skew_reads_between_two_frames(skew_s):
    out = on_channel(kind="frame_skew", skew_s=skew_s)["channels"][:, Q, 1]
    expected = np.interp(np.arange(N) - skew_s * 100.0, np.arange(N), X)
    assert np.allclose(out[ON:], expected[ON:], atol=1e-12)


def test_frame_skew_of_a_heading_goes_the_short_way_round():
    block = healthy()
    block["channels"][:, INDEX["heading"]] = ((6.2 + 0.01 * np.arange(N)) % (2 * np.pi))[:, None]
    keys = {"kind": "frame_skew", "signal": "heading", "channels": [2], "start_s": 0.0, "skew_s": 0.005}
    out = faulted(keys, block=block)["channels"][1:, INDEX["heading"], 1]
    assert np.allclose(out, (6.2 + 0.01 * (np.arange(1, N) - 0.5)) % (2 * np.pi), atol=1e-12)


@pytest.mark.parametrize("source", ["yaw_rate", "angle_of_attack"])
def test_cross_talk_adds_another_signal_of_the_same_channel(source):
    block = healthy()
    block["channels"][:, INDEX[source]] = np.array([0.1, 0.2, 0.3, 0.4])
    keys = {"kind": "cross_talk", "signal": "pitch_rate", "channels": [2, 4], "start_s": 0.2, "source": source}
    out = faulted({**keys, "gain": 0.5}, block=block)["channels"][ON:, Q]
    assert np.allclose(out - X[ON:, None], [0.0, 0.1, 0.0, 0.2], atol=1e-15)


def test_a_duplicate_frame_repeats_the_last_one():
    rows = on_channel(kind="duplicate_frame", every_s=0.1)
    expected = X.copy()
    expected[[20, 30, 40, 50]] = X[[19, 29, 39, 49]]
    assert np.array_equal(rows["channels"][:, Q, 1], expected) and acts(rows) == [20, 30, 40, 50]


@pytest.mark.parametrize(("word", "same"), [("blind", "good"), ("false alarm", "bad"), ("wrong", "inverted")])
def test_an_in_line_monitor_may_be_described_by_its_fault(word, same):
    block = healthy()
    block["ilm"][30:, Q] = Ilm.BAD
    baseline = block.copy()
    one = faulted({"kind": "ilm", "says": word, "signal": "pitch_rate", "channels": [1], "start_s": 0.2}, block=block)
    two = faulted(
        {"kind": "ilm", "says": same, "signal": "pitch_rate", "channels": [1], "start_s": 0.2}, block=baseline
    )
    assert np.array_equal(one["ilm"], two["ilm"]) and np.array_equal(one["channels"], healthy()["channels"])


SURFACES = [
    ({"kind": "stuck"}, lambda c, true: held(true[ON])),
    ({"kind": "stuck", "value": 0.05}, lambda c, true: held(0.05)),
    ({"kind": "hardover", "direction": "low"}, lambda c, true: held(-0.4)),
    ({"kind": "scale", "factor": 0.25}, lambda c, true: 0.25 * c),
    ({"kind": "oscillation", "amplitude": 0.02, "frequency_hz": 3.0}, lambda c, true: c + swing()),
    (
        {"kind": "oscillation", "amplitude": 0.02, "frequency_hz": 3.0, "replacing": True},
        lambda c, true: true[ON] + swing(),
    ),
    ({"kind": "delay", "latency_s": 0.05}, lambda c, true: np.roll(c, 5)),
    ({"kind": "sign_reversal"}, lambda c, true: -c),
    ({"kind": "rate_loss", "max_rate_per_s": 0.3}, lambda c, true: followed(c, true[ON], 0.003)),
]


def swing() -> np.ndarray:
    return 0.02 * np.sin(2.0 * np.pi * 3.0 * T)


def followed(command: np.ndarray, start: float, most: float) -> np.ndarray:
    out, at = np.zeros(N), start
    for k in range(ON, N):
        at += np.clip(command[k] - at, -most, most)
        out[k] = at
    return out


@pytest.mark.parametrize(("keys", "expected"), SURFACES, ids=lambda v: v["kind"] if isinstance(v, dict) else "")
def test_a_surface_fault_changes_what_reaches_the_actuator_and_not_the_command(keys, expected):
    clean = healthy()
    command, true = clean["surface"][:, 0].copy(), clean["flight"][:, FLIGHT_INDEX["elevator_rad"]].copy()
    rows = faulted({**keys, "signal": "surface.elevator", "start_s": ON / 100})
    assert np.array_equal(rows["surface"], clean["surface"])
    assert np.array_equal(rows["surface_command"][:, 1:], clean["surface_command"][:, 1:])
    assert np.array_equal(rows["surface_command"][:ON, 0], command[:ON])
    assert np.allclose(rows["surface_command"][ON:, 0], expected(command, true)[ON:], atol=1e-12)
    assert acts(rows) == list(range(ON, N))


STATIC, DYNAMIC = INDEX["static_pressure"], INDEX["dynamic_pressure"]


@pytest.mark.parametrize("blocked", ["pitot", "static", "both"])
def test_ice_in_the_pressure_lines_traps_what_was_there(blocked):
    block = healthy()
    static, dynamic = 50_000.0 - 20.0 * np.arange(N), 9_000.0 + 5.0 * np.arange(N)
    block["channels"][:, STATIC], block["channels"][:, DYNAMIC] = static[:, None], dynamic[:, None]
    keys = {"kind": "pitot_icing", "blocked": blocked, "channels": [2, 3], "start_s": 0.2}
    out = faulted({**keys, "pitot_rate_pa_s": -300.0, "static_rate_pa_s": 100.0}, block=block)["channels"]
    total = (static + dynamic)[ON - 1] - 300.0 * T if blocked != "static" else static + dynamic
    said = static[ON - 1] + 100.0 * T if blocked != "pitot" else static
    for c in (1, 2):
        assert np.allclose(out[ON:, STATIC, c], said[ON:]) and np.allclose(out[ON:, DYNAMIC, c], (total - said)[ON:])
    for c in (0, 3):
        assert np.array_equal(out[:, STATIC, c], static) and np.array_equal(out[:, DYNAMIC, c], dynamic)
    assert np.array_equal(out[:ON, DYNAMIC, 1], dynamic[:ON])


def test_two_vanes_freeze_together():
    rows = faulted({"kind": "vane_icing", "start_s": 0.2, "vanes": ["angle_of_attack", "angle_of_sideslip"]})
    for name in ("angle_of_attack", "angle_of_sideslip"):
        out = rows["channels"][:, INDEX[name]]
        assert (out[ON:, :2] == X[ON - 1]).all() and np.array_equal(out[:, 2], X)


def test_every_kind_has_an_expectation_here():
    others = ("test_faults_discretes.py", "test_faults_actuators.py", "test_lanes_link.py", "test_faults_computers.py")
    text = "".join(Path(__file__).with_name(name).read_text() for name in (Path(__file__).name, *others))
    assert [kind for kind in KINDS if f'"{kind}"' not in text] == []


def test_what_any_kind_leaves_is_within_the_range():
    big = {"offset": {"offset": 99.0}, "scale": {"factor": -99.0}, "stuck": {"value": 99.0}, "noise": {"std": 99.0}}
    for kind, keys in big.items():
        out = on_channel(kind=kind, **keys)["channels"][:, Q, 1]
        assert out.min() >= RANGES[Q, 0] and out.max() <= RANGES[Q, 1], kind
    assert SIGNALS[Q].high == 1.5


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"kind": "spikes", "amplitude": 1.0}, "either times_s or rate_per_s"),
        ({"kind": "spikes", "times_s": [1.0]}, "either amplitude or amplitude_thresholds or value"),
        ({"kind": "spikes", "amplitude": 1.0, "times_s": [-1.0]}, "none below zero"),
        ({"kind": "spikes", "amplitude": 1.0, "rate_per_s": -1.0}, "greater than 0"),
        ({"kind": "drift"}, "either rate_per_s or rate_thresholds_per_s or settles_at or"),
        ({"kind": "drift", "settles_at": 1.0}, "time_constant_s: required with settles_at"),
        ({"kind": "drift", "rate_per_s": 1.0, "time_constant_s": 1.0}, "time_constant_s: required with settles_at"),
        ({"kind": "duplicate_frame"}, "either every_s or rate_per_s"),
        ({"kind": "rate_loss", "max_rate_per_s": 1.0}, "cannot act on pitch_rate"),
        ({"kind": "noise", "std": 1.0, "signal": "surface.elevator", "channels": []}, "cannot act on surface.elevator"),
        ({"kind": "stuck", "signal": "surface.canard", "channels": []}, "the aircraft has no such surface, allowed"),
        ({"kind": "stuck", "signal": "reference.elevator", "channels": []}, "unknown signal, nearest: reference."),
        ({"kind": "noise", "std": 0.0}, "greater than 0"),
        ({"kind": "vane_icing", "vanes": ["pitot"]}, "unexpected|extra|forbidden|Input should be"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(bad, says):
    from faulted import PARSE

    with pytest.raises(ValidationError, match=says):
        PARSE.validate_python({"signal": "pitch_rate", "channels": [2], "start_s": 0.2, **bad})
