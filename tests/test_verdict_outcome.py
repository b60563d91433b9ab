"""One kernel decides what became of a fault: block by block as at once, and the same to everybody who asks."""

import re
from pathlib import Path

import numpy as np
import pytest
from test_verdict_parts import flight, offset

from rig.core.frame import CHANNELS, State, Table
from rig.flight.fly import fly
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.studies.campaign.flying import fly as fly_in_memory
from rig.studies.campaign.tables import OUTCOMES
from rig.studies.campaign.tables import rows as campaign_rows
from rig.verdict.conclusion import conclusion
from rig.verdict.flight_tally import FlightOutcome
from rig.verdict.of_log import FlightConclusion
from rig.verdict.scoring import score, score_of
from rig.verdict.signal_kernels import LEVELS, NEVER, SIGNAL, all_out, count_healthy, mark_failed, mark_wrong
from rig.verdict.unfaulted import MeasuredAgain
from rig.verdict.words import PUBLIC, Cause, fault_word, fault_words, vote_flags

RIG = Path(__file__).parent.parent / "rig"
CASES = ["f16_split_2_2_wrong_ilm", "f16_weight_on_wheels_split", "b747_vane_icing", "f16_reference_drift"]


def test_one_kernel_decides_what_became_of_a_fault():
    """No module but its room compares rows with faults; others read the words."""
    written = re.compile(r'\["(failed_at|exceeded_at|executed|cause)"\]\s*(\[[a-z]\])?\s*=[^=]|, \w+\["failed_at"\] = ')
    writers = {path.relative_to(RIG).as_posix() for path in RIG.rglob("*.py") if written.search(path.read_text())}
    trials = {
        path for path in writers if path.startswith(("bench/", "studies/benchmark/"))
    }  # the latter of a user's class
    assert writers - trials <= {
        f"{name}.py"
        for name in (
            "verdict/signal_kernels",
            "verdict/servo_kernels",
            "verdict/fault_kernels",
            "verdict/row_kernel",
            "verdict/monitored_places",
        )
    }
    words = re.compile(r'"(detected|undetectable|correct|annunciated loss)" if ')
    assert [path.name for path in RIG.rglob("*.py") if words.search(path.read_text())] == ["patterns.py"]  # a rule


def test_every_word_has_its_public_names():
    every = list(np.ndindex(2, 2, 2, 2))
    words = {fault_word(*flags) for flags in every}
    assert fault_words(*np.transpose(every)).tolist() == [fault_word(*flags) for flags in every]
    assert words == set(PUBLIC["campaign"]) and words - {"wrong channel"} == set(PUBLIC["score"])
    assert set(PUBLIC["score"].values()) == set(OUTCOMES)
    lost, off = np.array([[False, False], [True, False], [False, True], [True, True]]).T
    votes = vote_flags(lost, off)
    assert list(votes) == list(PUBLIC["reliability"])
    assert np.array(list(votes.values())).T.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0]]
    assert {cause.kind for cause in Cause if cause.by_design} == {"failed with its box", "failed by rule"}


@pytest.mark.parametrize("size", [1, 7, 100])
def test_rows_added_in_parts_give_the_score_of_all_at_once(size: int):
    which, rows = flight([offset([2], 0.2, 0.3), offset([3, 4], 0.4, 0.2, 0.7), offset([2], 0.6, 0.1)], 100)
    (whole,) = MeasuredAgain(which).of(Table(rows))
    outcome = FlightOutcome(which, 2.0)
    for first in range(0, len(rows), size):
        outcome.add(whole[first : first + size])
    in_parts, at_once = score_of(outcome), score(which, Table(rows))
    assert in_parts == at_once and in_parts.as_dict() == at_once.as_dict()
    assert conclusion(which, in_parts) == conclusion(which, at_once)


def test_more_failures_than_the_list_has_room_for_are_all_listed():
    which, rows = flight([], 400)
    rows["state"][1::2, :, :2] = State.FAILED
    assert len(score(which, Table(rows)).false_alarms) == 200 * rows["state"].shape[1] * 2


@pytest.mark.parametrize("name", CASES)
def test_flight_score_campaign_and_log_say_the_same_of_each_fault(name: str, tmp_path: Path):
    which = scenario.load(name)
    flown = fly(which, out=tmp_path, outcome=FlightConclusion())
    scored = score(which, Table(flown.rows))
    assert flown.conclusion == conclusion(which, scored)
    in_memory = fly_in_memory(which)
    kept = score(which, in_memory.table)
    assert kept.faults == scored.faults and kept.as_dict() == scored.as_dict()
    rows = campaign_rows("faults", 0, which, kept)
    assert [row["outcome"] for row in rows] == [fault.outcome for fault in scored.faults]
    for row, fault in zip(rows, scored.faults, strict=True):
        assert row["isolation"] in {"wrong", PUBLIC["campaign"][_word(fault.outcome)]}


def _word(public: str) -> str:
    return next(word for word, name in PUBLIC["score"].items() if name == public)


def test_a_flight_with_a_manager_that_fails_and_takes_back_is_gathered_as_it_is_scored():
    which = scenario.load(None, ["duration_s=3", "redundancy.manager=selection"])
    rows = fly_rows(which)
    outcome = FlightOutcome(which, 2.0)
    for part in MeasuredAgain(which).of(Table(rows)):
        outcome.add(part)
    assert score_of(outcome) == score(which, Table(rows))


def blank() -> np.ndarray:
    signal = np.zeros(1, SIGNAL)
    signal["fitted"], signal["level"], signal["linger"], signal["failed_at"] = CHANNELS, CHANNELS, 10, NEVER
    signal["disturbed"] = -1000
    return signal


def test_one_signal_alone_is_done_when_its_faulty_channels_have_been_out_for_the_linger():
    signal = blank()[0]
    mark_wrong(0b0101, 20, signal)
    assert mark_failed(0b0001, 25, signal) == 0b0001 and not all_out(40, signal)
    assert mark_failed(0b0101, 30, signal) == 0b0100
    assert not all_out(39, signal) and all_out(40, signal)
    assert signal["disturbed"] == 20 and signal["failed_at"].tolist() == [25, NEVER, 30, NEVER]


def test_healthy_channels_of_one_signal_are_counted_by_the_level_before():
    signal, healthy, isolations = blank()[0], np.zeros(LEVELS, np.int64), np.zeros(LEVELS, np.int64)
    mark_wrong(0b1000, 20, signal)
    before = int(signal["failed"])
    became = mark_failed(0b0001, 40, signal)
    count_healthy(became, before, 4, signal, healthy, isolations)
    assert healthy.tolist() == [0, 0, 0, 0, 3] and isolations.tolist() == [0, 0, 0, 0, 1]
