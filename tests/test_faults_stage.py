"""The stage as a whole: order, randomness, what was executed, in flight and compiled."""

import json

import numpy as np
import pytest
from faulted import PARSE, acts, executed, faulted, healthy, x
from interpreted import printed

import rig
from rig.core.frame import FLIGHT_INDEX, INDEX, MOST_FAULTS, State, new_block
from rig.flight.fly import fly
from rig.flight.loop import Rig, frames
from rig.scenario import scenario

Q = INDEX["pitch_rate"]
HERE = {"signal": "pitch_rate", "channels": [2], "start_s": 0.2}
NEVER = [
    {"kind": "noise", "std": 0.3, "signal": "pitch_rate", "channels": [1, 2], "when": "true.mach > 90"},
    {"kind": "spikes", "amplitude": 1.0, "rate_per_s": 50.0, "signal": "roll_rate", "channels": [3], "start_s": 9e4},
    {"kind": "offset", "offset": 1.0, "signal": "heading", "channels": [1], "rate_per_hour": 1e-9},
    {"kind": "stuck", "signal": "surface.elevator", "on": {"signal": "pedal", "level": 1}},
    {"kind": "hardover", "signal": "reference.pitch_rate", "direction": "either", "when": "roll_rate > 90"},
    {"kind": "delay", "signal": "inertial.pitch_rate_rad_s", "latency_s": 0.5, "start_s": 9e4},
    {"kind": "pitot_icing", "start_s": 9e4},
]


def flown(which: scenario.Scenario) -> np.ndarray:
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return all(a[name].tobytes() == b[name].tobytes() for name in a.dtype.names or ())


def with_faults(*faults: dict, **keys) -> scenario.Scenario:
    data = {**scenario.load(None, ["duration_s=2", "turbulence=light"]).resolved(), "faults": list(faults), **keys}
    return scenario.from_resolved(data, "test")


def test_what_one_fault_leaves_is_what_the_next_finds():
    offset, stuck = {"kind": "offset", "offset": 0.2, **HERE}, {"kind": "stuck", **HERE, "start_s": 0.3}
    clean = x()
    assert (faulted(offset, stuck)["channels"][30:, Q, 1] == clean[29] + 0.2).all()
    assert np.allclose(faulted(stuck, offset)["channels"][30:, Q, 1], clean[29] + 0.2)
    scale = {"kind": "scale", "factor": 0.5, **HERE}
    assert np.allclose(faulted(offset, scale)["channels"][20:, Q, 1], 0.5 * (clean + 0.2)[20:])
    assert np.allclose(faulted(scale, offset)["channels"][20:, Q, 1], 0.5 * clean[20:] + 0.2)
    late = {"kind": "delay", "latency_s": 0.05, **HERE}
    jump = {"kind": "offset", "offset": 0.2, **HERE, "start_s": 0.4}
    assert np.allclose(faulted(jump, late)["channels"][40:45, Q, 1], clean[35:40])
    assert np.allclose(faulted(late, jump)["channels"][40:45, Q, 1], clean[35:40] + 0.2)


def test_every_fault_has_its_bit_up_to_the_last():
    faults = [{"kind": "offset", "offset": 0.01, **HERE, "start_s": i / 100} for i in range(MOST_FAULTS)]
    rows = faulted(*faults, block=healthy(80))
    assert all(acts(rows, i) == list(range(i, 80)) for i in range(MOST_FAULTS))


def test_faults_draw_by_their_name_alone():
    """Neither their place in the list, nor other faults, nor the seed of another stage matter."""
    noise = {"kind": "noise", "std": 0.1, **HERE}
    other = {"kind": "noise", "std": 0.1, "signal": "roll_rate", "channels": [2], "start_s": 0.0}
    alone = faulted(noise)["channels"][:, Q]
    assert np.array_equal(alone, faulted(other, noise)["channels"][:, Q])
    assert np.array_equal(alone, faulted(noise, other)["channels"][:, Q])
    assert not np.array_equal(alone, faulted({**noise, "id": "another"})["channels"][:, Q])
    assert not np.array_equal(alone, faulted(noise, seed=8)["channels"][:, Q])


def test_two_faults_of_one_name_draw_differently():
    rows = faulted({"kind": "noise", "std": 0.1, **HERE}, {"kind": "noise", "std": 0.1, **HERE})
    once = faulted({"kind": "noise", "std": 0.1, **HERE})
    added = rows["channels"][20:, Q, 1] - x()[20:]
    assert not np.allclose(added, 2.0 * (once["channels"][20:, Q, 1] - x()[20:]))


def test_faults_that_never_trigger_change_no_byte():
    hard = {"kind": "hardover", "signal": "pitch_rate", "channels": [3], "start_s": 1.0}
    noise = {"kind": "noise", "std": 0.02, "signal": "roll_rate", "channels": [1], "start_s": 0.5}
    plain = flown(with_faults(hard, noise))
    for count in (1, len(NEVER)):
        assert same(plain, flown(with_faults(hard, noise, *NEVER[:count])))
    many = [{**NEVER[0], "id": f"never {i}"} for i in range(MOST_FAULTS - 2)]
    assert same(plain, flown(with_faults(hard, noise, *many)))


def test_a_reference_goes_wrong_between_its_making_and_its_use():
    keys = {"signal": "reference.pitch_rate", "start_s": 0.5}
    rows, clean = flown(with_faults({"kind": "offset", "offset": 0.4, **keys})), flown(with_faults())
    moved = rows["reference"][:, Q] - clean["reference"][:, Q]
    assert (moved[:50] == 0).all() and np.allclose(moved[50:], 0.4, atol=1e-9)
    assert rows["reference_usable"][-1, Q] == 0 and clean["reference_usable"][-1, Q] == 1
    assert np.array_equal(rows["voted"], clean["voted"]) and acts(rows) == list(range(50, 200))


def test_a_reference_that_is_not_there_cannot_fail():
    which = with_faults({"kind": "hardover", "signal": "reference.stick_roll", "start_s": 0.5})
    rows = flown(which)
    assert np.isnan(rows["reference"][:, INDEX["stick_roll"]]).all()
    assert acts(rows) == [] and executed(which.faults, rows) == [False]


def test_a_reference_comes_back_after_no_number():
    keys = {"signal": "inertial.pitch_rate_rad_s", "start_s": 0.5, "duration_s": 0.1}
    data = with_faults({"kind": "dropout", **keys}).resolved()
    data["redundancy"]["references"]["pitch_rate"] = "inertial"
    rows = flown(scenario.from_resolved(data, "test"))
    missing = np.flatnonzero(np.isnan(rows["reference"][:, Q]))
    assert missing.tolist()[:10] == list(range(50, 60)) and len(missing) <= 11


def test_a_jammed_surface_stays_where_it_was_while_the_law_commands_on():
    rows = flown(with_faults({"kind": "stuck", "signal": "surface.elevator", "start_s": 1.0}))
    elevator = rows["flight"][:, FLIGHT_INDEX["elevator_rad"]]
    at = elevator[100]
    moved = np.abs(elevator[100:] - at)
    assert (rows["surface_command"][100:, 0] == at).all()
    assert moved.max() < 2e-4 and moved[-1] < 1e-9  # the servo's lag swings out
    assert np.ptp(rows["surface"][100:, 0]) > 1e-4 and np.array_equal(
        rows["surface_command"][:, 1:], rows["surface"][:, 1:]
    )


@pytest.mark.long
def test_compiled_and_interpreted_faults_leave_the_same_bits():
    program = (
        "import hashlib, json, sys\nfrom rig.scenario import scenario\nfrom rig.flight.loop import Rig, frames\n"
        "s = scenario.from_resolved(json.load(sys.stdin), 'test')\n"
        "fields = (r[n] for r, _ in frames(Rig(s), s) for n in r.dtype.names)\n"
        "print(hashlib.sha256(b''.join(f.tobytes() for f in fields)).hexdigest())\n"
    )
    text = json.dumps(with_faults(*EVERY, duration_s=1.0).resolved())

    assert printed(program, interpreted=True, given=text) == printed(program, interpreted=False, given=text)


EVERY = [
    {"kind": "offset", "offset": 0.01, "signal": "pitch_rate", "channels": [1], "start_s": 0.1, "ramp_s": 0.3},
    {
        "kind": "drift",
        "settles_at": 0.02,
        "time_constant_s": 0.3,
        "signal": "roll_rate",
        "channels": [1],
        "start_s": 0.1,
    },
    {"kind": "hardover", "direction": "either", "signal": "yaw_rate", "channels": [1], "start_s": 0.4, "id": "hard"},
    {"kind": "scale", "factor": 0.9, "signal": "surface.elevator", "after": "hard", "delay_s": 0.1},
    {"kind": "sign_reversal", "signal": "stick_roll", "channels": [2], "start_s": 0.2},
    {"kind": "stuck", "signal": "heading", "channels": [4], "on": {"signal": "yaw_rate", "level": 3}},
    {"kind": "noise", "std": 0.01, "signal": "angle_of_attack", "channels": [1, 2], "start_s": 0.1},
    {"kind": "oscillation", "amplitude": 0.1, "frequency_hz": 3.3, "signal": "normal_load_factor", "channels": [3]}
    | {"when": "dynamic_pressure > 1000 and abs(true.roll_rate) < 1"},
    {"kind": "spikes", "amplitude": 0.4, "rate_per_s": 9.0, "signal": "pitch_angle", "channels": [2], "start_s": 0.0},
    {"kind": "intermittent", "gap_s": 0.05, "contact_s": 0.1, "random": True, "signal": "roll_angle", "channels": [1]}
    | {"start_s": 0.0},
    {"kind": "dropout", "signal": "pedal", "channels": [1], "rate_per_hour": 36_000.0, "duration_s": 0.05},
    {"kind": "delay", "latency_s": 0.1, "signal": "static_pressure", "channels": [2], "start_s": 0.1},
    {"kind": "frame_skew", "skew_s": 0.013, "signal": "heading", "channels": [1], "start_s": 0.1},
    {"kind": "quantisation", "step": 0.01, "signal": "reference.pitch_rate", "start_s": 0.1},
    {"kind": "cross_talk", "gain": 0.1, "source": "roll_rate", "signal": "pitch_rate", "channels": [2], "start_s": 0.1},
    {"kind": "duplicate_frame", "every_s": 0.03, "signal": "inertial.yaw_rate_rad_s", "start_s": 0.1},
    {"kind": "ilm", "says": "wrong", "signal": "pitch_rate", "channels": [1, 2], "start_s": 0.1},
    {"kind": "rate_loss", "max_rate_per_s": 0.02, "signal": "surface.aileron", "start_s": 0.3},
    {"kind": "pitot_icing", "channels": [4], "start_s": 0.2, "pitot_rate_pa_s": -50.0},
    {"kind": "vane_icing", "start_s": 0.5},
]


def rows_with(acting: dict[int, range], failed: dict[int, int]) -> np.ndarray:
    """100 rows in which faults act, and channels of the pitch rate (from 1) are failed from a frame on."""
    rows = new_block(100)
    for i, span in acting.items():
        rows["acting"][span, i >> 3] |= 1 << (i & 7)
    for channel, frame in failed.items():
        rows["state"][frame:, Q, channel - 1] = State.FAILED
    return rows


@pytest.mark.parametrize(
    ("acting", "failed", "did"),
    [
        (range(0), {}, False),  # never triggered
        (range(20, 30), {}, True),
        (range(20, 30), {2: 27}, True),  # failed because of it
        (range(20, 30), {2: 20}, True),  # its first frame is the one that fails the channel
        (range(20, 30), {2: 19}, False),  # out before it
        (range(99, 100), {2: 19}, False),
        (range(0, 1), {}, True),
    ],
)
def test_a_fault_on_a_channel_that_is_out_did_nothing(acting, failed, did):
    fault = PARSE.validate_python({"kind": "sign_reversal", **HERE})
    assert executed([fault], rows_with({0: acting}, failed)) == [did]


def test_one_channel_in_use_is_enough_and_a_surface_is_always_there():
    both = PARSE.validate_python({"kind": "sign_reversal", **HERE, "channels": [1, 2]})
    surface = PARSE.validate_python({"kind": "stuck", "signal": "surface.rudder", "start_s": 0.1})
    rows = rows_with({0: range(20, 100), 1: range(50, 60)}, {2: 0, 1: 10})
    assert executed([both, surface], rows) == [False, True]
    assert executed([both, surface], rows_with({0: range(20, 100)}, {2: 10})) == [True, False]
    assert executed([both], new_block(0)) == [False]


def test_a_readmitted_channel_is_in_use_again():
    rows = rows_with({0: range(20, 60)}, {2: 10})
    rows["state"][40:, Q, 1] = State.OK
    assert executed([PARSE.validate_python({"kind": "sign_reversal", **HERE})], rows) == [True]


def test_the_flight_says_what_was_not_executed_and_so_does_its_log(tmp_path):
    late = {"kind": "hardover", "signal": "pitch_rate", "channels": [3], "start_s": 1.5, "id": "late"}
    never = {
        "kind": "offset",
        "offset": 1.0,
        "signal": "heading",
        "channels": [1],
        "when": "roll_rate > 5",
        "id": "never",
    }
    hard = {"kind": "hardover", "signal": "pitch_rate", "channels": [3], "start_s": 0.5}
    which = with_faults(hard, late, never)
    flight = fly(which, out=tmp_path)
    assert flight.not_executed == ["late", "never"] == flight.summary()["not_executed"]
    log = rig.read_log(flight.log)
    last = [(event.frame, event.name, event.text) for event in log.events if "executed" in event.name]
    assert last == [
        (199, "fault not executed", "late: its channels were already isolated or absent"),
        (199, "fault not executed", "never: never triggered"),
    ]
    assert executed(which.faults, log.rows) == [True, False, False]
