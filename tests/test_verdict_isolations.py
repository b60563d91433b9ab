"""Healthy channels that are failed: with a failed LRU, by the rule of common mode, or wrongly."""

from typing import Any

import pytest
from test_verdict_parts import Q, flight, offset

from rig.core.frame import INDEX, Block, DecidedBy, State, Table
from rig.flight.conclusion_rows import Conclusion
from rig.scenario.scenario import Scenario
from rig.studies.campaign.tables import RUNS
from rig.studies.campaign.tables import rows as campaign_rows
from rig.verdict.conclusion import conclusion
from rig.verdict.context import listed, named
from rig.verdict.score_records import ISOLATIONS, Score
from rig.verdict.score_tables import tables
from rig.verdict.scoring import score

SICK = (
    *("pitch_rate", "roll_rate", "yaw_rate"),
    *("normal_load_factor", "lateral_load_factor", "longitudinal_load_factor"),
)
OTHERS = ["pitch_angle", "roll_angle", "heading"]  # of the same box
REFERENCES = [{**offset([], 0.1, 0.2), "signal": "reference.pitch_rate"}]
for fault in REFERENCES:
    del fault["channels"]


def dead_box(channel: int = 3, signals: tuple[str, ...] = SICK) -> list[dict[str, Any]]:
    """At 0.2 s all the named signals of a channel go to their range's end."""
    fault = {"kind": "hardover", "channels": [channel], "start_s": 0.2, "direction": "high"}
    return [{**fault, "signal": signal} for signal in signals]


def lists(found: Score) -> dict[str, int]:
    return {field: len(getattr(found, field)) for field in ISOLATIONS.values()}


def told(which: Scenario, rows: Block) -> Conclusion:
    return conclusion(which, score(which, Table(rows)))


def reported(rows: Block, decided_by: DecidedBy, signals: list[str], channels: list[int], frame: int = 60) -> None:
    """Write that ``channels``, from 0, of the signals were failed in ``frame``, and who says so."""
    for name in signals:
        rows["state"][frame:, INDEX[name], channels] = State.FAILED
        rows["decided_by"][frame, INDEX[name]] = decided_by


def test_healthy_signals_of_a_dead_box_are_failed_with_it_and_are_no_false_alarm():
    which, rows = flight(dead_box(), exact=True)
    found = score(which, Table(rows))
    assert lists(found) == {"false_alarms": 0, "wrong_isolations": 0, "failed_with_box": 3, "failed_by_rule": 0}
    assert {(each.signal, each.channel, each.frame, each.decided_by) for each in found.failed_with_box} == {
        (name, 3, 27, "box") for name in OTHERS
    }
    assert [fault.outcome for fault in found.faults] == ["detected"] * 6
    assert all(signal.false_isolations == (0, 0, 0, 0) for signal in found.signals.values())
    assert {row.name for row in tables(found, 100.0)["isolations"].rows} == {"failed with its box"}


def test_the_conclusion_tells_the_box_in_one_sentence_and_calls_nothing_wrong():
    sentences = told(*flight(dead_box(), exact=True))
    assert (
        f"{listed([named(name) for name in OTHERS])}, channel 3: isolated at 0.27 s with its LRU, which was faulty on "
        "other signals"
    ) in sentences
    assert not any("healthy, isolated" in sentence for sentence in sentences)
    assert sentences[0].endswith("no healthy channel isolated by mistake, 3 by design")


def test_a_campaign_keeps_them_apart_and_no_fault_is_wrongly_isolated_for_them():
    which, rows = flight([*dead_box(), {**offset([1], 0.2, 0.01), "signal": "heading"}], exact=True)
    found = score(which, Table(rows))
    assert {row["kind"] for row in campaign_rows("alarms", 0, which, found)} == {"failed with its box"}
    assert [row["isolation"] for row in campaign_rows("faults", 0, which, found)] == ["correct"] * 6 + ["none"]
    of_signals = campaign_rows("signals", 0, which, found)
    assert not any(row[f"false_isolations_level_{level}"] for row in of_signals for level in (4, 3, 2, 1))
    by_design = {field for kind, field in ISOLATIONS.items() if kind.startswith("failed")}
    assert {name for name in RUNS if name.startswith("failed_")} == by_design


@pytest.mark.parametrize("signals", [(), SICK[:3]])
def test_a_box_that_was_not_faulty_on_enough_signals_was_failed_for_nothing(signals: tuple[str, ...]):
    which, rows = flight(dead_box(signals=signals), exact=True)
    reported(rows, DecidedBy.BOX, OTHERS, [2])
    found = score(which, Table(rows))
    assert lists(found) == {"false_alarms": 3, "wrong_isolations": 0, "failed_with_box": 0, "failed_by_rule": 0}
    assert found.signals["heading"].false_isolations == (1, 0, 0, 0)


def test_the_box_of_another_channel_excuses_nothing_nor_does_a_comparison():
    which, rows = flight(dead_box(), exact=True)
    reported(rows, DecidedBy.BOX, ["heading"], [0])
    reported(rows, DecidedBy.NONE, ["pitch_angle"], [1])
    found = score(which, Table(rows))
    assert [(each.signal, each.channel) for each in found.false_alarms] == [("pitch_angle", 2), ("heading", 1)]


ALL = [0, 1, 2, 3]


def given_up(faults: list[Any], channels: list[int] = ALL) -> tuple[Scenario, Block, Score]:
    """A flight in which all ``channels`` of the pitch rate, from 0, are failed in frame 60 by two references."""
    which, rows = flight(faults, 100, exact=True)
    rows["state"][:, Q], rows["decided_by"][:, Q], rows["level"][:, Q] = State.OK, DecidedBy.NONE, 4
    reported(rows, DecidedBy.COMMON, ["pitch_rate"], channels)
    return which, rows, score(which, Table(rows))


@pytest.mark.parametrize(
    "faults",
    [
        [],
        REFERENCES,
        [{**REFERENCES[0], "end_s": 0.4}],
        [{**REFERENCES[0], "signal": "inertial.pitch_rate_rad_s"}],  # the second reference
        [{**REFERENCES[0], "signal": "reference.roll_rate"}],
        [REFERENCES[0], {**REFERENCES[0], "signal": "inertial.pitch_rate_rad_s"}],  # both
        [{**offset([1, 2, 3, 4], 0.2, 0.2), "signal": "roll_rate"}],  # which a reference may read
    ],
)
def test_a_healthy_signal_that_is_given_up_is_four_healthy_channels_failed(faults: list[Any]):
    which, rows, found = given_up(faults)
    assert lists(found) == {**dict.fromkeys(ISOLATIONS.values(), 0), "false_alarms": 4}
    assert found.signals["pitch_rate"].false_isolations == (4, 0, 0, 0)
    said = told(which, rows)
    assert said[0].endswith(", 4 healthy channels isolated") and "disagreed with them" not in " ".join(said[2:])
    assert said[1] == (
        "pitch rate, channels 1, 2, 3 and 4: healthy, isolated by mistake at 0.60 s with all channels: two references "
        "disagreed with them (faulty: no channel)"
    )


@pytest.mark.parametrize("kind", ["offset", "stuck"])
def test_a_signal_whose_channels_are_off_alike_is_given_up_rightly(kind: str):
    size = {"offset": 0.2} if kind == "offset" else {"value": 0.2}
    which, rows, found = given_up(
        [{"kind": kind, "signal": "pitch_rate", "channels": [1, 2, 3, 4], "start_s": 0.2, **size}]
    )
    assert lists(found) == dict.fromkeys(ISOLATIONS.values(), 0)
    assert [(fault.outcome, fault.decided_by) for fault in found.faults] == [("detected", "common")] * 4
    assert told(which, rows)[0].endswith("4 of 4 faults detected, no healthy channel isolated")


@pytest.mark.parametrize(
    ("faulty", "kinds"),
    [
        ([2], {"wrong_isolations": 3}),  # the vote is that of three healthy ones
        ([2, 4], {"failed_by_rule": 2}),  # no majority is healthy
        ([1, 2, 3], {"failed_by_rule": 1}),
    ],
)
def test_a_healthy_channel_goes_by_rule_where_no_majority_of_those_in_use_is_healthy(faulty: list[int], kinds: Any):
    which, rows, found = given_up([offset(faulty, 0.2, 0.03)])
    assert lists(found) == {**dict.fromkeys(ISOLATIONS.values(), 0), **kinds}
    first = told(which, rows)[0]
    if "failed_by_rule" in kinds:
        assert first.endswith(f"no healthy channel isolated by mistake, {kinds['failed_by_rule']} by design")
        assert ": isolated at 0.60 s with all channels: two references disagreed with them" in " ".join(
            told(which, rows)
        )
    else:
        assert first.endswith("3 healthy channels isolated")


def test_of_two_channels_in_use_one_that_is_off_is_no_majority():
    which, rows, _ = given_up([offset([2], 0.2, 0.03)], [1, 2])
    rows["state"][10:, Q, [0, 3]] = State.FAILED  # before
    found = score(which, Table(rows))
    assert lists(found) == {"false_alarms": 2, "wrong_isolations": 0, "failed_with_box": 0, "failed_by_rule": 1}


def test_an_error_that_is_over_for_longer_than_the_linger_excuses_nothing():
    found = given_up([offset([1, 2, 3], 0.2, 0.03, 0.4)])[2]
    assert lists(found) == {"false_alarms": 4, "wrong_isolations": 0, "failed_with_box": 0, "failed_by_rule": 0}


def test_a_healthy_channel_that_common_mode_fails_with_faulty_ones_in_use_is_failed_by_rule():
    """A channel that was failed before has no part in the vote: its fault is no cause."""
    which, rows = flight([offset([1, 2, 3], 0.2, 0.03)], 100, exact=True)
    reported(rows, DecidedBy.COMMON, ["pitch_rate"], [0, 1, 2, 3])
    assert lists(score(which, Table(rows)))["failed_by_rule"] == 1
    which, rows = flight([offset([1], 0.2, 0.3)], 100, exact=True)
    reported(rows, DecidedBy.COMMON, ["pitch_rate"], [1, 2, 3])
    found = score(which, Table(rows))
    assert lists(found)["failed_by_rule"] == 0 and len(found.wrong_isolations) == 3
