"""The conclusion of a flight: rows that follow from times, thresholds and persistences of constructed rows."""

import dataclasses
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_verdict_parts import Q, flight, offset

from rig.core.frame import INDEX, End, Ilm, State, Table, UnitStatus
from rig.flight.conclusion_rows import Conclusion, Row
from rig.flight.flight_result import Flight
from rig.flight.fly import fly
from rig.verdict.conclusion import conclusion, next_commands
from rig.verdict.context import agreement, channels, longest_run
from rig.verdict.flight_tally import columns
from rig.verdict.of_log import FlightConclusion, score_log
from rig.verdict.score_records import Yardstick
from rig.verdict.scoring import monitor, score
from rig.verdict.tally_records import EPISODE
from rig.world.faults import CLEAN

OWN = """
import numpy as np

class Mean:
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k):
        fcc[k]["voted"][:] = np.nanmean(bus[k]["channels"], axis=1)
        fcc[k]["level"][:] = 4
"""


def said(faults: list[dict[str, Any]], *overrides: str, frames: int = 100) -> Conclusion:
    which, rows = flight(faults, frames, *overrides, exact=True)
    return conclusion(which, score(which, Table(rows)))


def row(faults: list[dict[str, Any]], *overrides: str, frames: int = 100, number: int = 0) -> str:
    """Return one row of the conclusion as a sentence."""
    return str(said(faults, *overrides, frames=frames).rows[number])


HARDOVER = {"kind": "hardover", "signal": "pitch_rate", "channels": [3], "start_s": 0.2}


def test_a_detected_fault_is_told_with_time_delay_vote_and_aircraft():
    told = said([HARDOVER])
    assert told == Conclusion(
        "SURVIVED",
        "1 s flown, 1 of 1 faults detected, no healthy channel isolated",
        (Row("pitch rate, channel 3", ("hardover at 0.20 s, isolated after 70 ms by comparison",)),),
        (
            Row("voted pitch rate", ("at most 0 deg/s from the true value",)),
            Row("aircraft", ("load factor 0.00 to 0.00 g, not compared with a fault-free flight",)),
        ),
    )


def test_a_conclusion_is_the_sequence_of_its_sentences():
    told = said([HARDOVER])
    assert list(told) == told.sentences and len(told) == 4 and told[-1] == told.sentences[-1]
    assert told[0] == "SURVIVED: 1 s flown, 1 of 1 faults detected, no healthy channel isolated"
    assert told[1] == "pitch rate, channel 3: hardover at 0.20 s, isolated after 70 ms by comparison"


def many(rows: int, texts: int = 1) -> Conclusion:
    some = tuple(Row(f"r{i}", tuple(f"{i}.{k}" for k in range(texts))) for i in range(rows))
    return Conclusion("SURVIVED", "", some, (Row("voted", ("v",)), Row("aircraft", ("a",))))


@pytest.mark.parametrize(
    ("rows", "texts", "shown"), [(7, 1, 7), (8, 1, 6), (30, 1, 6), (4, 3, 2), (2, 3, 2), (1, 9, 1)]
)
def test_ten_lines_hold_the_first_rows_what_is_left_out_and_the_flight(rows: int, texts: int, shown: int):
    lines = many(rows, texts).lines(more="rig score x.mcap")
    assert len(lines) <= 9 and lines[-2:] == [("voted", "v"), ("aircraft", "a")]
    assert [label for label, _ in lines if label.startswith("r")] == [f"r{i}" for i in range(shown)]
    left = [text for _, text in lines if text.startswith("and ")]
    assert left == ([f"and {rows - shown} more: rig score x.mcap"] if shown < rows else [])


def test_reasons_are_left_out_before_rows():
    told = many(4, 1)
    told = dataclasses.replace(told, rows=tuple(row._replace(why=("why",)) for row in told.rows))
    assert ("", "why") not in told.lines() and len(told.lines(most=11)) == 10 and told[1] == "r0: 0.0; why"


def test_a_row_of_several_texts_has_its_label_once():
    assert many(1, 3).lines()[:3] == [("r0", "0.0"), ("", "0.1"), ("", "0.2")]


def against(faults: list[dict[str, Any]], load_factor: float, window_s: float = 2.0) -> str:
    """Return the aircraft's row of a flight whose baseline has that much less load factor from 0.3 s on."""
    (which, rows), (_, baseline) = (flight(each, 100, exact=True) for each in (faults, []))
    clean = np.zeros(100, CLEAN)
    clean["channels"], clean["valid"] = baseline["channels"], baseline["valid"]
    for block in (rows, baseline):
        block["truth"][:, INDEX["normal_load_factor"]] = np.linspace(1.0, 2.0, 100)  # the manoeuvre: 1 g
    rows["truth"][30:, INDEX["normal_load_factor"]] += load_factor
    return conclusion(which, score(which, Table(rows, clean=clean), baseline, Yardstick(window_s=window_s)))[-1]


def test_the_transient_of_a_fault_is_measured_against_the_fault_free_flight():
    fault = offset([2], 0.2, 0.03)
    assert against([fault], 0.02) == "aircraft: load factor within 0.020 g of the flight without the fault"
    assert against([fault], 0.0) == "aircraft: load factor within 0.001 g of the flight without the fault"
    assert against([fault, {**fault, "signal": "roll_rate"}], 0.02).endswith("of the flight without the faults")
    assert against([fault], 0.7) == (
        "aircraft: load factor up to 0.70 g from the flight without the fault, beyond the transient limits for 0.7 s"
    )


def test_without_the_fault_free_flight_no_transient_is_told():
    which, rows = flight([offset([2], 0.2, 0.2)], 100, exact=True)
    clean = np.zeros(100, CLEAN)
    unfaulted = flight([], 100, exact=True)[1]
    clean["channels"], clean["valid"] = unfaulted["channels"], unfaulted["valid"]
    rows["truth"][:, INDEX["normal_load_factor"]] = np.linspace(1.0, 2.0, 100)
    scored = score(which, Table(rows, clean=clean))
    assert scored.faults[0].load_factor_change == pytest.approx(0.8, abs=0.01)
    told = conclusion(which, scored)
    assert told[-1] == "aircraft: load factor 1.00 to 2.00 g, not compared with a fault-free flight"
    assert said([])[-1] == "aircraft: load factor 0.00 to 0.00 g"


def test_an_error_below_the_threshold_is_said_to_be_undetectable_with_the_threshold():
    told = said([offset([2], 0.2, 0.03)])
    assert told[1] == (  # 0.05 rad/s
        "pitch rate, channel 2: offset of 1.72 deg/s at 0.20 s; not detectable: its error stayed below the isolation "
        "threshold of 2.86 deg/s"
    )
    assert "no detectable fault, no healthy" in told.summary


def test_a_manager_that_isolates_nothing_has_no_isolation_threshold():
    told = said([offset([2], 0.2, 0.2)], "redundancy.manager=mean")
    assert told[1] == (
        "pitch rate, channel 2: offset of 11.5 deg/s at 0.20 s; not isolated, although its error exceeded the error "
        "limit of 2.86 deg/s for 800 ms; the manager mean isolates no channel"
    )
    below = said([offset([2], 0.2, 0.03)], "redundancy.manager=mean")[1]
    assert below.endswith("not detectable: its error stayed below the error limit of 2.86 deg/s")


def test_a_fault_shorter_than_the_persistence_is_missed_for_that():
    told = said([offset([2], 0.2, 0.2, 0.25)])
    assert (
        "not isolated: its error exceeded the isolation threshold of 2.86 deg/s for 50 ms, shorter than the persistence"
    ) in told[1]
    assert "0 of 1 faults detected" in told.summary


def test_a_drift_that_keeps_a_partner_is_explained_by_the_partner():
    """Channel 1 is off by 0.0395 (below 0.05): channel 2 leaves the threshold after 0.50 s, channel 1 after 0.895 s."""
    faults = [
        offset([1], 0.0, 0.0395),
        {"kind": "drift", "signal": "pitch_rate", "channels": [2], "start_s": 0.0, "rate_per_s": 0.1},
    ]
    drift = said(faults, frames=120).rows[0]  # before the one that is not detectable
    assert drift.label == "pitch rate, channel 2" and drift.texts[0].endswith("isolated after 970 ms by comparison")
    assert drift.why == (
        "its error exceeded the isolation threshold of 2.86 deg/s from 0.51 s on, but until 0.90 s it stayed within "
        "2.84 deg/s of channel 1",
    )


def test_two_alike_that_are_not_isolated_name_each_other():
    """Two channels of four agree on a wrong value, no rule settles it: each has the other as its partner."""
    told = said([offset([3, 4], 0.2, 0.2)], 'redundancy.signals.pitch_rate.tie_break=["trend"]', frames=28).rows
    assert told[0].why[-1] == "it stayed within 0 deg/s of channel 4"
    assert told[1].why[-1] == "it stayed within 0 deg/s of channel 3"


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (State.ABSENT, "the unit under test reports no channel states"),
        (State.OK, "the unit under test did not isolate the channel"),
    ],
)
def test_what_a_unit_does_not_isolate_is_not_explained_by_the_built_in_comparison(state: State, expected: str):
    which, rows = flight([offset([2], 0.2, 0.2)], 100, exact=True)
    rows["unit"], rows["state"] = UnitStatus.ANSWERED, state
    rows["level"] = 0 if state == State.ABSENT else rows["level"]
    told = conclusion(which, score(which, Table(rows)))
    (fault,) = told.rows
    assert fault.texts[1:] == (
        "not isolated, although its error exceeded the isolation threshold of 2.86 deg/s for 800 ms",
    )
    assert fault.why == (expected,)
    assert not any("no channel left" in sentence for sentence in told)


def test_a_channel_that_a_unit_isolates_is_told_without_a_count():
    which, rows = flight([offset([2], 0.2, 0.2)], 100, exact=True)
    rows["unit"] = UnitStatus.ANSWERED
    (fault,) = conclusion(which, score(which, Table(rows))).rows
    assert fault.texts == ("offset of 11.5 deg/s at 0.20 s, isolated after 70 ms by the unit under test",)


def test_channels_and_signals_that_fare_alike_share_a_row():
    order = 'redundancy.signals.pitch_rate.tie_break=["ilm"]'
    assert len(said([offset([3], 0.2, 0.2)]).rows) == 1
    inverted = {"kind": "inverted", "signal": "gear_down", "channels": [1, 2], "start_s": 0.2}
    assert row([inverted], number=1).startswith("gear down, channels 1 and 2: inverted from 0.20 s on")
    lost = {"kind": "dropout", "channels": [3, 4], "start_s": 0.2}
    assert said([{**lost, "signal": name} for name in ("heading", "roll_rate")]).rows == (
        Row(
            "heading and roll rate, channels 3 and 4",
            ("no valid sample from 0.20 s on, isolated after 70 ms by comparison",),
        ),
    )
    told = said([offset([3, 4], 0.2, 0.2)], order)
    assert "no tie-break rule settled it" in told[1] and told[1].count("the voted value was held") == 1


@pytest.mark.parametrize("source", ["none", "attitude"])
def test_a_split_is_told_with_its_length_and_what_settled_it(source: str):
    order = 'redundancy.signals.pitch_rate.tie_break=["ilm","reference","trend"]'
    (told,) = said([offset([3, 4], 0.2, 0.2)], order, f"redundancy.references.pitch_rate={source}").rows
    assert told.label == "pitch rate, channels 3 and 4" and told.texts[0] == "offset of 11.5 deg/s at 0.20 s"
    rule = "reference" if source != "none" else "trend"
    answers = {
        "reference": "the reference agreed with channels 1 and 2",
        "trend": "the trend decided for the lower side, as neither side rose for 8 frames",
    }
    assert re.fullmatch(rf"no majority \(2:2\) for \d+ ms; {answers[rule]}", told.texts[1])
    assert re.fullmatch(rf"both isolated after \d+ ms by the {rule}", told.texts[2])


def test_in_line_monitors_that_answer_are_told_by_channel_and_a_wrong_answer_stands_first():
    faults = [
        offset([3, 4], 0.2, 0.2),
        {"kind": "ilm", "signal": "pitch_rate", "channels": [1, 2], "start_s": 0.0, "says": "bad"},
    ]
    told = said(faults)
    assert str(told.rows[0]) == (
        "pitch rate, channels 1 and 2: healthy, isolated by mistake at 0.29 s by the in-line monitors (faulty: 3, 4)"
    )
    assert "settled wrongly: the in-line monitors reported channels 1 and 2 faulty" in told[2]
    assert told.summary.endswith("2 healthy channels isolated")


def test_the_side_that_the_reference_took_follows_from_the_samples():
    from rig.verdict.split_rows import _by_reference, _reference

    which, rows = flight([offset([3, 4], 0.2, 0.2)], 30, exact=True)
    p, used = monitor(which)[Q], np.arange(4)
    last = score(which, Table(rows)).episodes[0].last
    last["channels"], last["reference_usable"] = rows["channels"][25, Q], 1
    for value, told in (
        (-0.1, "the reference was on the side of channels 1 and 2"),
        (0.01, "the reference agreed with channels 1 and 2"),
        (0.19, "the reference agreed with channels 3 and 4"),
        (0.3, "the reference was on the side of channels 3 and 4"),
        (0.1, "the reference agreed with no side"),
    ):
        last["reference"] = value
        assert _by_reference(last, used, p) == told, value
    assert _reference(last, used, p).endswith("of no channel")
    last["reference_usable"] = 0
    assert _reference(last, used, p) == "not usable"


def test_in_line_monitors_that_are_not_fitted_are_said_to_be():
    from rig.verdict.split_rows import _ilm

    episode = np.zeros(1, EPISODE)
    episode["ilm"] = Ilm.ABSENT
    assert _ilm(episode[0], np.arange(4), monitor(flight([], 1)[0])[0]) == "not fitted"


def test_a_fault_that_never_acts_says_why():
    late = offset([2], 5.0, 0.2)
    again = [offset([2], 0.1, 0.2), offset([2], 0.5, 0.2)]
    assert said([late])[1] == "pitch rate, channel 2: offset not executed: its trigger never fired"
    assert "no fault acted, no healthy channel isolated" in said([late]).summary
    assert said(again)[2] == "pitch rate, channel 2: offset not executed: the channel was already isolated"
    assert "1 of 1 faults detected, 1 not executed" in said(again).summary


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
    told = none.conclusion(tmp_path / "none.mcap", 10)
    assert len(told) == 1 and told[0].startswith("NOT SCORED: ") and told.lines() == []


def test_fly_and_score_print_the_conclusion_and_the_next_commands(rig_command):
    short = ["--set", "duration_s=3", "--set", "faults.0.start_s=2.0"]
    code, out, _ = rig_command("fly", *short)
    assert code == 0
    assert (
        "SURVIVED  3 s flown, 1 of 1 faults detected, no healthy channel isolated\n"
        "  pitch rate, channel 3   hardover at 2.00 s, isolated after 70 ms by comparison\n"
        "  voted pitch rate        at most 0."
    ) in out
    log = next(line.split()[1] for line in out.splitlines() if line.startswith("log "))
    assert f"next     rig score {log} " in out and f"rig view {log} " in out and f"rig replay {log} " in out
    found = json.loads(rig_command("fly", "--json", *short)[1])
    assert [command.split()[1] for command in found["next"]] == ["score", "view", "replay"]
    assert found["conclusion"][0].startswith("SURVIVED: ") and len(found["conclusion"]) == 4
    assert re.fullmatch(
        r"aircraft: load factor within 0\.0\d\d g of the flight without the fault", found["conclusion"][-1]
    )
    assert json.loads(rig_command("score", log, "--json")[1])["conclusion"] == found["conclusion"]
    assert "  pitch rate, channel 3   hardover at 2.00 s" in rig_command("score", log)[1]
    for command in (["score", log, "--no-baseline"], ["report", log, "--out", f"{log}.html"]):
        told = json.loads(rig_command(*command, "--json")[1])["conclusion"]
        assert told[:-1] == found["conclusion"][:-1] and told[-1].endswith("not compared with a fault-free flight")


def test_the_baseline_is_flown_after_a_flight_in_which_the_rig_alone_votes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "own_mean.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)

    def flown(baseline: bool, *more: str) -> Flight:
        sets = ["duration_s=3", "faults.0.start_s=2.0", *more]
        return fly(None, overrides=sets, out=tmp_path, outcome=FlightConclusion(baseline))

    alone, beside, own = flown(False), flown(True), flown(True, "redundancy.manager=own_mean:Mean")
    assert alone.digest == beside.digest
    assert beside.conclusion == score_log(beside.log, Yardstick()).conclusion != alone.conclusion
    for one in (alone, own):
        assert one.conclusion is not None and one.conclusion[-1].endswith("not compared with a fault-free flight")


@pytest.mark.parametrize(
    ("outcome", "summary", "told"),
    [
        ("LOST", "at 9.10 s: roll rate beyond its limit", "LOST at 9.10 s: roll rate beyond its limit"),
        ("SURVIVED", "9 s flown", "SURVIVED: 9 s flown"),
    ],
)
def test_the_outcome_is_the_first_sentence(outcome: str, summary: str, told: str):
    assert Conclusion(outcome, summary)[0] == told


@pytest.mark.parametrize(
    ("end", "told"),
    [
        (End.DEPARTURE_ANGLE_OF_ATTACK, "angle of attack beyond its limit"),
        (End.GROUND_CONTACT, "ground contact"),
        (End.NOT_FINITE, "its state was no longer a finite number"),
    ],
)
def test_a_lost_aircraft_is_told_with_its_reason(end: End, told: str):
    which, rows = flight([], 100, exact=True)
    rows["end"][-1] = end
    assert conclusion(which, score(which, Table(rows)))[0].startswith(f"LOST at 0.99 s: {told}; no fault injected, ")
