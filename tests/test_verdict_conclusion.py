"""The conclusion of a flight: sentences that follow from times, thresholds and persistences of constructed rows."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_verdict_parts import Q, flight, offset

from rig.core.frame import INDEX, Ilm, State, Table, UnitStatus
from rig.verdict.conclusion import conclusion, next_commands
from rig.verdict.context import agreement, channels, longest_run
from rig.verdict.flight_tally import columns
from rig.verdict.of_log import FlightConclusion
from rig.verdict.score_records import Yardstick
from rig.verdict.scoring import monitor, score
from rig.verdict.tally_records import EPISODE
from rig.world.faults import CLEAN


def said(faults: list[dict[str, Any]], *overrides: str, frames: int = 100) -> list[str]:
    which, rows = flight(faults, frames, *overrides, exact=True)
    return conclusion(which, score(which, Table(rows)))


def test_a_detected_fault_is_told_with_value_time_count_delay_and_vote():
    fault, end = said([{"kind": "hardover", "signal": "pitch_rate", "channels": [3], "start_s": 0.2}])
    assert fault == (
        "pitch_rate channel 3 ran to +85.9 deg/s (+1.50 rad/s) at 0.20 s; it miscompared for 8 frames and was failed "
        "70 ms later; the vote stayed within 0 deg/s of the truth"
    )
    assert end == (
        "the aircraft survived (duration flown, 1.00 s); 1 of 1 detectable faults detected, no healthy channel failed"
    )


def against(faults: list[dict[str, Any]], load_factor: float, window_s: float = 2.0) -> list[str]:
    """Return what is told of a flight whose baseline, in the same climb, has so much less load factor from 0.3 s on."""
    (which, rows), (_, baseline) = (flight(each, 100, exact=True) for each in (faults, []))
    clean = np.zeros(100, CLEAN)
    clean["channels"], clean["valid"] = baseline["channels"], baseline["valid"]
    for block in (rows, baseline):
        block["truth"][:, INDEX["normal_load_factor"]] = np.linspace(1.0, 2.0, 100)  # the manoeuvre: 1 g
    rows["truth"][30:, INDEX["normal_load_factor"]] += load_factor
    return conclusion(which, score(which, Table(rows, clean=clean), baseline, Yardstick(window_s=window_s)))


def test_the_transient_of_a_fault_is_measured_against_the_fault_free_flight():
    for window_s, looked_at_s in ((0.5, 0.5), (2.0, 0.79)):  # or to the end of the flight
        told = against([offset([2], 0.2, 0.03)], 0.02, window_s)[0]
        assert f"the load factor stayed within 0.02 g of the fault-free flight's for {looked_at_s} s;" in told
    assert "within 0 g of the fault-free flight's for 0.05 s;" in against([offset([2], 0.2, 0.03)], 0.02, 0.05)[0]


def test_a_transient_in_which_other_faults_had_a_part_is_told_as_that():
    told = against([offset([2], 0.2, 0.03), {**offset([3], 0.4, 0.03), "signal": "roll_rate"}], 0.02)
    assert all(
        "within 0.02 g of the fault-free flight's" in line and "(other faults included)" in line for line in told[:2]
    )
    first, second = against([offset([2], 0.2, 0.03), {**offset([3], 0.4, 0.03), "signal": "roll_rate"}], 0.02, 0.1)[:2]
    assert "included" not in first and "(other faults included)" in second


def test_without_the_fault_free_flight_no_transient_is_told():
    which, rows = flight([offset([2], 0.2, 0.2)], 100, exact=True)
    clean = np.zeros(100, CLEAN)
    unfaulted = flight([], 100, exact=True)[1]
    clean["channels"], clean["valid"] = unfaulted["channels"], unfaulted["valid"]
    rows["truth"][:, INDEX["normal_load_factor"]] = np.linspace(1.0, 2.0, 100)
    scored = score(which, Table(rows, clean=clean))
    assert scored.faults[0].load_factor_change == pytest.approx(0.8, abs=0.01)
    assert not any("load factor" in line for line in conclusion(which, scored))


def test_a_fault_in_the_last_frame_has_nothing_behind_it_to_look_at():
    assert "load factor" not in said([offset([2], 0.99, 0.03)])[0]


def test_an_error_below_the_threshold_is_said_to_be_undetectable_with_the_threshold():
    fault, end = said([offset([2], 0.2, 0.03)])
    assert "it could not be found: its error stayed below the threshold of 2.86 deg/s" in fault  # 0.05 rad/s
    assert "offset of 1.72 deg/s from 0.20 s on" in fault and "no fault could be detected" in end


def test_a_fault_shorter_than_the_persistence_is_missed_for_that():
    fault, end = said([offset([2], 0.2, 0.2, 0.25)])
    assert "was not found: its error was above the threshold of 2.86 deg/s for 50 ms at most, shorter than the" in fault
    assert "0 of 1 detectable faults detected" in end


def test_a_drift_that_keeps_a_partner_is_explained_by_the_partner():
    """Channel 1 is off by 0.0395 (below 0.05): channel 2 leaves the threshold after 0.50 s, channel 1 after 0.895 s."""
    faults = [
        offset([1], 0.0, 0.0395),
        {"kind": "drift", "signal": "pitch_rate", "channels": [2], "start_s": 0.0, "rate_per_s": 0.1},
    ]
    drift = said(faults, frames=120)[1]
    assert (
        "it left its threshold of 2.86 deg/s at 0.51 s, but stayed within 2.84 deg/s of channel 1 until 0.90 s, then "
        "miscompared for 8 frames and was failed at 0.97 s"
    ) in drift


def test_two_alike_that_are_not_found_name_each_other():
    """Two channels of four agree on a wrong value, nobody answers: each has the other as its partner."""
    told = said([offset([3, 4], 0.2, 0.2)], 'redundancy.signals.pitch_rate.tie_break=["trend"]', frames=28)
    assert "and stayed within 0 deg/s of channel 4" in told[0] and "of channel 3" in told[1]


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (State.ABSENT, "the unit under test says nothing of channels"),
        (State.OK, "the unit under test did not fail the channel"),
    ],
)
def test_what_a_unit_does_not_fail_is_not_explained_by_our_comparison(state: State, expected: str):
    which, rows = flight([offset([2], 0.2, 0.2)], 100, exact=True)
    rows["unit"], rows["state"] = UnitStatus.ANSWERED, state
    rows["level"] = 0 if state == State.ABSENT else rows["level"]
    fault, end = conclusion(which, score(which, Table(rows)))
    assert f"above the threshold of 2.86 deg/s for 800 ms at most, and {expected}" in fault
    assert "lost" not in fault and "no channel left" not in end


def test_a_channel_that_a_unit_fails_is_told_without_a_count():
    which, rows = flight([offset([2], 0.2, 0.2)], 100, exact=True)
    rows["unit"] = UnitStatus.ANSWERED
    fault = conclusion(which, score(which, Table(rows)))[0]
    assert "; it was failed 70 ms later;" in fault and "miscompared" not in fault


def test_channels_that_fare_alike_share_a_sentence():
    told = said([offset([3, 4], 0.2, 0.2)], 'redundancy.signals.pitch_rate.tie_break=["ilm"]')
    assert len(said([offset([3], 0.2, 0.2)])) == 2
    faults = {"kind": "inverted", "signal": "gear_down", "channels": [1, 2], "start_s": 0.2}
    assert said([faults])[0].startswith("gear_down channels 1 and 2 had a fault (inverted) from 0.20 s on")
    assert "nobody settled it: the vote was held" in told[2]


@pytest.mark.parametrize("source", ["none", "attitude"])
def test_a_pattern_says_who_was_asked_and_what_each_answered(source):
    order = 'redundancy.signals.pitch_rate.tie_break=["ilm","reference","trend"]'
    told = said([offset([3, 4], 0.2, 0.2)], order, f"redundancy.references.pitch_rate={source}")
    (pattern,) = (line for line in told if "no majority" in line)
    who, begins = ("trend", "reference: no answer (there is none); trend: answered (neither half rose for 8 frames")
    if source != "none":
        who, begins = "reference", "reference: answered ("
    assert pattern.startswith("pitch_rate had no majority (2:2) from 0.20 s for ")
    assert f"in-line monitors: no answer (no channel bad, channels 1, 2, 3 and 4 good); {begins}" in pattern
    assert pattern.endswith(f"settled by {who}: channels 3 and 4 failed, correctly")


def test_in_line_monitors_that_answer_are_told_by_channel_and_a_wrong_answer_is_called_wrong():
    faults = [
        offset([3, 4], 0.2, 0.2),
        {"kind": "ilm", "signal": "pitch_rate", "channels": [1, 2], "start_s": 0.0, "says": "bad"},
    ]
    told = said(faults)
    (pattern,) = (line for line in told if "no majority" in line)
    assert "in-line monitors: answered (channels 1 and 2 bad, channels 3 and 4 good)" in pattern
    assert pattern.endswith("channels 1 and 2 failed, wrongly: channels 1 and 2 were healthy")
    healthy = [
        line
        for line in told
        if " was healthy and was failed at 0.29 s by ilm, although channels 3 and 4 were faulty" in line
    ]
    assert len(healthy) == 2 and told[-1].endswith("2 healthy channels failed")


def test_where_the_reference_lies_follows_from_the_samples():
    from rig.verdict.conclusion import _reference

    which, rows = flight([offset([3, 4], 0.2, 0.2)], 30, exact=True)
    p, used = monitor(which)[Q], np.arange(4)
    row = score(which, Table(rows)).episodes[0].last
    row["channels"], row["reference_usable"] = rows["channels"][25, Q], 1
    for value, says in (
        (-0.1, "side of channels 1 and 2, below channels 3 and 4"),
        (0.3, "side of channels 3 and 4, "),
    ):
        row["reference"] = value
        assert says in _reference(row, used, p)
    row["reference"] = 0.03
    limit = p["reference_threshold"]
    near = "channels 1 and 2" if limit < 0.17 else "channels 1, 2, 3 and 4"
    assert _reference(row, used, p).endswith(f"of {near}") and "between the halves" in _reference(row, used, p)
    row["reference_usable"] = 0
    assert _reference(row, used, p) == "not usable"


def test_in_line_monitors_that_are_not_fitted_are_said_to_be():
    from rig.verdict.conclusion import _ilm

    episode = np.zeros(1, EPISODE)
    episode["ilm"] = Ilm.ABSENT
    assert _ilm(episode[0], np.arange(4), monitor(flight([], 1)[0])[0]) == "none fitted"


def test_a_fault_that_never_acts_says_why():
    late = offset([2], 5.0, 0.2)
    again = [offset([2], 0.1, 0.2), offset([2], 0.5, 0.2)]
    assert said([late])[0].endswith("was not executed: its trigger never fired")
    assert said(again)[1].endswith("was not executed: the channel had been failed before")


def test_the_agreement_names_the_closest_channel_in_use_over_the_turn():
    which, rows = flight([], 5, exact=True)
    s = INDEX["heading"]
    p = monitor(which)[s]
    rows["channels"][:, s] = [6.27, 0.01, 0.5, 3.0]
    found = agreement(columns(rows, s), 0, 0, 5, p)
    assert (found.nearest == 1).all() and found.distance == pytest.approx(0.01 + 2 * np.pi - 6.27)
    assert agreement(columns(rows, s), 3, 0, 5, p).alone.all()
    rows["valid"][:, s, 1] = 0
    assert (agreement(columns(rows, s), 0, 0, 5, p).nearest == 2).all()
    assert agreement(columns(rows, s), 1, 0, 5, p).alone.all()  # an invalid sample always miscompares


@pytest.mark.parametrize(
    ("samples", "alone"),
    [
        ((0.0, 0.0, 0.02, 0.0), True),
        ((0.0, 0.0, 0.01, 0.0), False),
        ((0.0, 0.0, 0.02, 0.02), False),  # with a partner
        ((0.0, -0.02, 0.02, 0.04), False),  # nobody is close to anybody
        ((0.0, 0.0, 0.02, 0.2), False),  # somebody is off by more than the threshold
        ((0.0, 0.0, 0.02, np.nan), False),  # of three it takes 0.03
        ((0.0, 0.0, 0.04, np.nan), True),
    ],
)
def test_an_outlier_is_alone_where_all_agree_and_two_are_close(samples: tuple[float, ...], alone: bool):
    limits = ["redundancy.signals.pitch_rate.outlier_threshold=0.015"]
    limits += ["redundancy.signals.pitch_rate.outlier_threshold_triplex=0.03"]
    which, rows = flight([], 3, *limits, exact=True)
    rows["channels"][:, Q] = samples
    assert agreement(columns(rows, Q), 2, 0, 3, monitor(which)[Q]).alone.tolist() == [alone] * 3


def test_the_longest_run_of_flags_is_counted():
    flags = ([], [0], [0, 1, 1], [1, 1, 0, 1], [1, 0, 1, 1, 1])
    assert [longest_run(np.array(some, bool)) for some in flags] == [0, 0, 2, 2, 3]


def test_channels_are_listed_as_in_a_sentence():
    assert [channels(n) for n in ([], [3], [1, 2], [1, 2, 4])] == [
        "no channel",
        "channel 3",
        "channels 1 and 2",
        "channels 1, 2 and 4",
    ]


@pytest.mark.parametrize(
    ("manager", "unit_file", "again"),
    [("mean", "", ""), ("mine:Mid", "", " --allow-code"), ("mean", "my units/u.toml", " --unit 'my units/u.toml'")],
)
def test_the_next_commands_can_be_pasted(manager: str, unit_file: str, again: str):
    scenario: Any = SimpleNamespace(redundancy=SimpleNamespace(manager=manager))
    unit = {"name": "u"} if unit_file else None
    flight: Any = SimpleNamespace(log=Path("my logs/x.mcap"), unit_file=unit_file, unit=unit, scenario=scenario)
    log = "'my logs/x.mcap'"
    assert next_commands(flight) == [f"rig score {log}{again}", f"rig view {log}", f"rig replay {log}{again}"]


def test_a_flight_that_cannot_be_scored_ends_in_one_sentence(tmp_path: Path):
    none = FlightConclusion()
    assert none.sentences(tmp_path / "none.mcap", 10)[0].startswith("not scored: ")


def test_fly_and_score_print_the_conclusion_and_the_next_commands(rig_command):
    short = ["--set", "duration_s=3", "--set", "faults.0.start_s=2.0"]
    code, out, _ = rig_command("fly", *short)
    assert code == 0 and "  pitch_rate channel 3 ran to +85.9 deg/s" in out
    log = next(line.split()[1] for line in out.splitlines() if line.startswith("log "))
    assert f"next     rig score {log} " in out and f"rig view {log} " in out and f"rig replay {log} " in out
    found = json.loads(rig_command("fly", "--json", *short)[1])
    assert found["conclusion"] == [line[2:] for line in out.splitlines() if line.startswith("  ") and ";" in line]
    assert [command.split()[1] for command in found["next"]] == ["score", "view", "replay"]
    assert found["conclusion"][1] in rig_command("score", log)[1]
    told = json.loads(rig_command("score", log, "--json")[1])["conclusion"]  # the transient needs the fault-free flight
    moved = r" the load factor stayed within [\d.e-]+ g of the fault-free flight's for 0.99 s;"
    assert re.search(moved, told[0]) and [re.sub(moved, "", told[0]), *told[1:]] == found["conclusion"]
    for command in (["score", log, "--no-baseline"], ["report", log, "--out", f"{log}.html"]):
        assert json.loads(rig_command(*command, "--json")[1])["conclusion"] == found["conclusion"]
