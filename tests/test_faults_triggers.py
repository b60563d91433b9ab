"""When faults act: times, conditions, transitions, other faults, chance; how long and how often."""

import numpy as np
import pytest
from faulted import PARSE, acts, faulted, healthy
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.core.errors import BadInput
from rig.core.frame import DISCRETE_INDEX, FLIGHT_INDEX, INDEX, new_block
from rig.scenario import scenario
from rig.world.faults.expression import DEEPEST, holds, parse, reads_votes
from rig.world.faults.fault_records import SEEN

Q, P, DYNAMIC = INDEX["pitch_rate"], INDEX["roll_rate"], INDEX["dynamic_pressure"]
ENGAGED = DISCRETE_INDEX["autopilot_engaged"]


def offset(**keys):
    return {"kind": "offset", "offset": 0.1, "signal": "pitch_rate", "channels": [2], **keys}


def voted(**columns) -> np.ndarray:
    """``healthy`` with these votes."""
    block = healthy()
    for name, values in columns.items():
        block["voted"][:, INDEX[name]] = values
    return block


def step_at(frame: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    return np.where(np.arange(60) >= frame, high, low)


@pytest.mark.parametrize(
    ("keys", "due"),
    [
        ({"start_s": 0.1}, range(10, 60)),
        ({"start_s": 0.1, "end_s": 0.2}, range(10, 20)),
        ({"start_s": 0.1, "duration_s": 0.05}, range(10, 15)),
        ({"start_s": 0.1, "duration_s": 0.05, "end_s": 0.12}, range(10, 12)),
        (
            {"start_s": 0.1, "duration_s": 0.02, "repeat_every_s": 0.1},
            [f for s in range(10, 60, 10) for f in (s, s + 1)],
        ),
        ({"start_s": 0.1, "duration_s": 0.02, "repeat_every_s": 0.1, "repeats": 1}, [10, 11, 20, 21]),
        ({"start_s": 0.1, "duration_s": 0.02, "repeat_every_s": 0.1, "end_s": 0.305}, [10, 11, 20, 21, 30]),
    ],
)
def test_times_durations_and_repetition(keys, due):
    assert acts(faulted(offset(**keys))) == list(due)


def test_an_episode_begins_anew_when_a_fault_repeats():
    rows = faulted(
        {"kind": "drift", "rate_per_s": 1.0, "signal": "pitch_rate", "channels": [2], "start_s": 0.1}
        | {"duration_s": 0.1, "repeat_every_s": 0.2}
    )
    error = rows["channels"][:, Q, 1] - healthy()["channels"][:, Q, 1]
    assert np.allclose(error[[10, 19, 20, 30, 39, 50]], [0.0, 0.09, 0.0, 0.0, 0.09, 0.0], atol=1e-12)
    stuck = faulted(
        {"kind": "stuck", "signal": "pitch_rate", "channels": [2], "start_s": 0.1}
        | {"duration_s": 0.1, "repeat_every_s": 0.2}
    )["channels"][:, Q, 1]
    clean = healthy()["channels"][:, Q, 1]
    assert (stuck[10:20] == clean[9]).all() and (stuck[30:40] == clean[29]).all() and stuck[25] == clean[25]


def test_a_condition_over_votes_is_seen_in_the_next_frame_and_fires_once():
    block = voted(dynamic_pressure=step_at(20, 7000.0, 9000.0), roll_rate=step_at(30, 0.1, 0.3))
    block["voted"][40:, P] = 0.0
    when = "dynamic_pressure > 8000 and roll_rate > 0.2"
    assert acts(faulted(offset(when=when), block=block)) == list(range(31, 60))


def test_a_condition_over_the_truth_is_seen_in_its_frame():
    block = healthy()
    block["flight"][25:, FLIGHT_INDEX["mach"]] = 0.9
    assert acts(faulted(offset(when="true.mach > 0.8", duration_s=0.1), block=block)) == list(range(25, 35))


def test_a_condition_must_hold_for_its_time_without_a_break():
    pulses = np.zeros(60)
    pulses[10:14] = pulses[20:40] = 1.0
    rows = faulted(offset(when="roll_rate > 0.5", for_s=0.05), block=voted(roll_rate=pulses))
    assert acts(rows)[0] == 21 + 5


def test_a_condition_waits_until_it_is_armed_and_the_onset_until_its_delay_is_over():
    block = voted(roll_rate=np.ones(60))
    keys = offset(when="roll_rate > 0.5", start_s=0.2, delay_s=0.1)
    assert acts(faulted(keys, block=block))[0] == 30


def test_before_the_first_vote_a_condition_over_votes_does_not_hold():
    assert acts(faulted(offset(when="roll_rate < 0.5")))[0] == 1
    assert acts(faulted(offset(when="true.roll_rate < 0.5")))[0] == 0


def test_votes_are_seen_across_the_border_of_two_blocks():
    block = voted(roll_rate=step_at(19))
    assert acts(faulted(offset(when="roll_rate > 0.5"), block=block, size=20))[0] == 20


@pytest.mark.parametrize(("way", "values"), [("engaged", (0, 1)), ("disengaged", (1, 0))])
def test_a_transition_of_the_autopilot_fires_and_its_standing_does_not(way, values):
    block = healthy()
    block["discrete_voted"][:, ENGAGED] = step_at(30, *values)
    keys = offset(on={"autopilot": way})
    assert acts(faulted(keys, block=block))[0] == 31
    standing = healthy()
    standing["discrete_voted"][:, ENGAGED] = values[1]
    assert acts(faulted(keys, block=standing)) == []


def test_the_second_fault_comes_when_the_level_changes():
    block = healthy()
    block["level"][:, Q] = step_at(25, 4, 3)
    block["level"][40:, Q] = 2
    assert acts(faulted(offset(on={"signal": "pitch_rate", "level": 3}), block=block.copy()))[0] == 26
    assert acts(faulted(offset(on={"signal": "pitch_rate", "level": 2}, delay_s=0.05), block=block.copy()))[0] == 46
    assert acts(faulted(offset(on={"signal": "pitch_rate", "level": 1}), block=block.copy())) == []


def test_a_fault_comes_after_another_wherever_it_stands_in_the_file():
    parent = {"kind": "sign_reversal", "signal": "roll_rate", "channels": [1], "start_s": 0.15, "id": "first"}
    for order in (1, -1):
        pair = [parent, offset(after="first", delay_s=0.1)][::order]
        rows = faulted(*pair)
        assert acts(rows, 0 if order == -1 else 1) == list(range(25, 60))
    chain = [offset(after="b", id="c", signal="heading"), offset(after="a", id="b", signal="roll_angle")]
    rows = faulted(*chain, offset(id="a", when="true.mach > 0.5"), block=fast(33))
    assert [acts(rows, i)[0] for i in range(3)] == [33, 33, 33]


def fast(frame: int) -> np.ndarray:
    block = healthy()
    block["flight"][frame:, FLIGHT_INDEX["mach"]] = 0.9
    return block


def test_random_onsets_are_memoryless_with_their_rate():
    """720 an hour is one in 500 frames: mean and deviation of the first onset are that of an exponential time."""
    keys = offset(rate_per_hour=720.0)
    first = np.array(
        [acts(faulted(keys, block=new_block(4000), seed=seed, size=4000))[:1] for seed in range(60)], float
    )
    assert 500 * (1 - 4 / np.sqrt(60)) < first.mean() < 500 * (1 + 4 / np.sqrt(60))
    assert 250 < first.std() < 850


def test_a_random_fault_with_a_duration_comes_again():
    rows = faulted(offset(rate_per_hour=36_000.0, duration_s=0.02), block=new_block(20_000), size=100)
    on = np.isin(np.arange(len(rows)), acts(rows))
    onsets = np.count_nonzero(on[1:] & ~on[:-1])
    assert on.sum() == pytest.approx(2 * onsets, abs=2)
    assert onsets == pytest.approx(20_000 / (2 + 1 / (1 - np.exp(-0.1))), rel=0.15)


BAD = [
    ({}, "a trigger is missing"),
    ({"start_s": 1.0, "after": "x"}, "does not go with after"),
    ({"when": "roll_rate > 1", "after": "x"}, "when and after: a fault has one trigger"),
    ({"start_s": 1.0, "for_s": 1.0}, "for_s: goes with when"),
    ({"start_s": 1.0, "delay_s": 1.0}, "delay_s: goes with"),
    ({"start_s": 1.0, "repeats": 2}, "repeats: goes with repeat_every_s"),
    ({"start_s": 1.0, "repeat_every_s": 2.0}, "needs a duration_s that is shorter"),
    ({"start_s": 1.0, "repeat_every_s": 2.0, "duration_s": 2.0}, "needs a duration_s that is shorter"),
    ({"rate_per_hour": -1.0}, "greater than 0"),
    ({"rate_per_hour": 1.0, "repeat_every_s": 2.0, "duration_s": 1.0}, "repeats by itself"),
    ({"on": {"autopilot": "off"}}, "'engaged' or 'disengaged'"),
    ({"on": {}}, "must be"),
    ({"on": {"signal": "pitch_rate"}}, "must be"),
    ({"on": {"signal": "canard", "level": 3}}, "unknown signal 'canard'"),
    ({"when": "canard > 1"}, "unknown name 'canard', nearest: gear_down, "),
    ({"when": "true.canard > 1"}, r"unknown name 'true.canard', nearest: true\..* allowed, see docs/faults.md"),
    ({"when": "sqrt(roll_rate) > 1"}, r"sqrt\(\) cannot be called, allowed: abs"),
    ({"when": "max(roll_rate) > 1"}, r"max\(\) cannot be called, allowed: abs"),
    ({"when": "always[0, 1] roll_rate > 1"}, "not a condition"),
    ({"when": "__import__('os').system('true')"}, "not a condition"),
    ({"when": "__import__('os').system('true') > 1"}, "cannot be called"),
    ({"when": "().__class__ > 1"}, "is not a number"),
    ({"when": "abs(roll_rate, 1) > 1"}, "cannot be called"),
    ({"when": "roll_rate"}, "not a condition; compare it"),
    ({"when": "roll_rate > 1 +"}, "not a condition, such as"),
    ({"when": "roll_rate > 1e999"}, "not a finite number"),
    ({"when": "roll_rate > True"}, "not a finite number"),
    ({"when": "roll_rate > 'a'"}, "not a finite number"),
    ({"when": "roll_rate ** 2 > 1"}, "is not a number"),
    ({"when": "roll_rate in (1, 2)"}, "is not a number"),
    ({"when": "roll_rate is 1"}, "compare with"),
    ({"when": "[roll_rate for roll_rate in ()] > 1"}, "is not a number"),
    ({"when": "(lambda: 1)() > 1"}, "cannot be called"),
    ({"when": "true > 1"}, "unknown name 'true'"),
    ({"when": ""}, "not a condition"),
    ({"when": "(" * 150 + "1" + ")" * 150}, "not a condition"),
    ({"when": "+".join("1" * 300) + " > 1"}, "at most 400 characters"),
    ({"when": "1+(" * (DEEPEST + 2) + "1" + ")" * (DEEPEST + 2) + "> 1"}, "nested too deeply"),
]


@pytest.mark.parametrize(("keys", "says"), BAD)
def test_a_trigger_that_makes_no_sense_is_refused(keys, says):
    with pytest.raises(ValidationError, match=says):
        PARSE.validate_python(offset(**keys))


def write(folder, *faults: str):
    path = folder / "mine.toml"
    head = '[[faults]]\nkind = "sign_reversal"\nsignal = "pitch_rate"\nchannels = [1]\n'
    path.write_text("".join(f"{head}{fault}\n" for fault in faults))
    return path


@pytest.mark.parametrize(
    ("faults", "says"),
    [
        (['when = "canard > 1"'], "unknown name 'canard'"),
        (['when = "exit() > 1"'], r"exit\(\) cannot be called"),
        (["rate_per_hour = -3.0"], "rate_per_hour.*must be above 0, got -3"),
        (['id = "a"\nstart_s = 1.0'] * 2, "faults.1.id: 'a' is used twice"),
        (['after = "b"', 'id = "a"\nstart_s = 1.0'], "faults.0.after: no fault 'b', allowed: 'a'"),
        (['id = "a"\nafter = "b"', 'id = "b"\nafter = "a"'], "wait for each other"),
        (['id = "a"\nafter = "a"'], "wait for each other"),
        (['after = "sign_reversal pitch_rate.1"', "start_s = 1.0", "start_s = 2.0"], "the name of several faults"),
        (["start_s = 1.0"] * 65, "at most 64"),
    ],
)
def test_what_a_scenario_cannot_have_is_one_line(tmp_path, faults, says):
    with pytest.raises(BadInput, match=says) as refused:
        scenario.load(write(tmp_path, *faults))
    assert "\n" not in str(refused.value) and str(refused.value).startswith(str(tmp_path))


def test_cross_talk_needs_a_channel_that_is_fitted(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        '[[faults]]\nkind = "cross_talk"\nsignal = "pitch_rate"\nchannels = [4]\nstart_s = 1.0\ngain = 1.0\n'
        'source = "yaw_rate"\n[sensors.yaw_rate]\nchannels = 3\n'
    )
    with pytest.raises(BadInput, match=r"faults.0.source: yaw_rate has 3 channels"):
        scenario.load(path)
    with pytest.raises(BadInput, match="must be another place"):
        scenario.load(path, ["faults.0.source=surface.elevator"])


NAMES = {"a": "roll_rate", "b": "true.yaw_rate", "c": "true.mach"}
numbers = st.one_of(
    st.sampled_from(sorted(NAMES.values())), st.floats(-3, 3).map(lambda v: f"{v:.3f}"), st.integers(0, 9).map(str)
)
terms = st.recursive(
    numbers,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        inner.map(lambda t: f"abs({t})"),
        inner.map(lambda t: f"(-{t})"),
    ),
    max_leaves=4,
)
comparisons = st.tuples(terms, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), terms).map(" ".join)
conditions = st.recursive(
    comparisons,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["and", "or"]), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        inner.map(lambda t: f"(not {t})"),
    ),
    max_leaves=4,
).filter(lambda text: len(text) <= 400)


@settings(deadline=None)  # the first example compiles
@given(conditions, st.tuples(*[st.sampled_from([-2.0, -0.5, 0.0, 0.5, 1.0])] * 3))
def test_a_condition_means_what_python_means_by_it(text, values):
    roll_rate, yaw_rate, mach = values
    block, seen = new_block(1), np.zeros(1, SEEN)
    seen[0]["voted"][P], block["truth"][0, INDEX["yaw_rate"]] = roll_rate, yaw_rate
    block["flight"][0, FLIGHT_INDEX["mach"]] = mach
    names = {"true_yaw_rate": yaw_rate, "true_mach": mach, "roll_rate": roll_rate, "abs": abs, "__builtins__": {}}
    try:
        expected = eval(text.replace("true.", "true_"), names)  # the judge, on text of our own
    except ZeroDivisionError:
        return
    program = parse(text)
    assert holds(program, 0, len(program), block[0], seen[0], np.zeros(DEEPEST)) == int(expected)


def test_no_number_and_a_division_by_zero_hold_in_no_comparison():
    block, seen, stack = new_block(1), np.zeros(1, SEEN), np.zeros(DEEPEST)
    block["flight"][:] = np.nan
    for text in ("true.mach > 0", "true.mach != 0", "1 / roll_rate > 0", "1 / roll_rate <= 0", "0 < true.mach < 1"):
        program = parse(text)
        assert holds(program, 0, len(program), block[0], seen[0], stack) == 0
    program = parse("0 < 1 < 2 and autopilot_engaged == 0 and not true.autopilot_engaged")
    assert holds(program, 0, len(program), block[0], seen[0], stack) == 1


def test_a_program_knows_whether_it_reads_votes():
    assert reads_votes(parse("true.mach > 1 or gear_down")) and not reads_votes(parse("true.mach > 1"))
