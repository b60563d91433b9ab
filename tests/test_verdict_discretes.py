"""Scores of faults on discretes, over constructed rows."""

from typing import Any

import numpy as np
import pytest
from test_verdict_parts import flight, offset, outcomes, scored

from rig.core.frame import DISCRETE_INDEX, DISCRETES, INDEX, SIGNALS, State, Table
from rig.studies.campaign.tables import channel_hours, magnitude
from rig.verdict.scoring import score

GEAR, WHEELS = DISCRETE_INDEX["gear_down"], DISCRETE_INDEX["weight_on_wheels"]


def fault(kind: str, channels: list[int], start_s: float, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "signal": "gear_down", "channels": channels, "start_s": start_s, **more}


def test_a_discrete_channel_is_failed_for_its_fault_after_the_persistence():
    found = scored([fault("inverted", [2], 0.2)], 60)
    assert outcomes(found) == [("detected", 20, 20, 27)]
    entry = found.faults[0]
    assert (entry.signal, entry.channel, entry.peak_error, entry.decided_by) == ("gear_down", 2, 1.0, "comparison")
    assert entry.delay_from_onset_frames == 7 and found.false_alarms == found.wrong_isolations == []


def test_a_channel_that_is_stuck_where_the_truth_is_has_no_error():
    assert outcomes(scored([fault("stuck", [2], 0.2)], 60)) == [("undetectable", 20, None, None)]


@pytest.mark.parametrize(
    "lost", [fault("dropout", [3], 0.2), fault("stuck", [3], 0.2, seen_by_ilm=True), fault("ilm", [3], 0.2, says="bad")]
)
def test_a_sample_that_is_flagged_or_that_its_monitor_declares_bad_is_lost(lost):
    found = scored([lost], 60)
    assert outcomes(found) == [("detected", 20, 20, 27)]
    assert found.faults[0].peak_error is None


def test_faults_shorter_than_the_persistence_of_the_discrete_are_tolerated():
    toggling = fault("toggling", [1], 0.2, period_s=0.1)
    found = scored([toggling], 60)
    assert outcomes(found) == [("missed", 20, 20, None)]
    assert (found.faults[0].exceeded_run_frames, found.faults[0].tolerated) == (5, True)
    assert outcomes(scored([toggling], 60, "redundancy.discretes.gear_down.persistence=5")) == [
        ("detected", 20, 20, 24)
    ]


def test_a_split_fails_the_good_pair_of_a_discrete_whose_fail_safe_value_is_the_wrong_one():
    """Gear up, two switches say down: the vote is the fail-safe value, down, and the good two are failed."""
    found = scored([fault("inverted", [3, 4], 0.2)], 60)
    assert outcomes(found) == [("missed", 20, 20, None)] * 2
    assert [(a.signal, a.channel, a.frame) for a in found.wrong_isolations] == [("gear_down", c, 27) for c in (1, 2)]
    assert found.wrong_votes_s == {"weight_on_wheels": 0.0, "gear_down": 0.4, "autopilot_engaged": 0.0}


def test_a_discrete_channel_failed_for_nothing_is_a_false_alarm_and_beside_a_faulty_one_a_wrong_isolation():
    which, rows = flight([fault("stuck", [2], 0.5, value=1, end_s=0.52)], 90)
    rows["discrete_state"][30:, WHEELS, 0] = State.FAILED
    rows["discrete_state"][59:, GEAR, 3] = State.FAILED  # eight frames after the last one of the fault
    rows["discrete_state"][60:, GEAR, 0] = State.FAILED
    found = score(which, Table(rows))
    assert [(a.signal, a.channel, a.frame) for a in found.false_alarms] == [
        ("weight_on_wheels", 1, 30),
        ("gear_down", 1, 60),
    ]
    assert [(a.signal, a.channel, a.frame) for a in found.wrong_isolations] == [("gear_down", 4, 59)]


def test_hours_of_signal_channels_do_not_count_faults_on_discretes():
    hours = {}
    for name, faults in (("none", []), ("gear", [fault("inverted", [2], 0.2)]), ("rate", [offset([2], 0.2, 0.3)])):
        which, rows = flight(faults, 60)
        hours[name] = channel_hours(which, len(rows), score(which, Table(rows)))
    assert hours["gear"] == hours["none"] == pytest.approx(len(SIGNALS) * 4 * 0.6 / 3600)
    assert hours["rate"] == pytest.approx(hours["none"] - 0.4 / 3600)


def test_a_magnitude_in_thresholds_is_told_in_the_unit_of_the_signal():
    which, rows = flight(
        [{k: v for k, v in offset([2], 0.2, 0.0).items() if k != "offset"} | {"offset_thresholds": -3.0}], 60
    )
    assert magnitude(which.faults[0], which) == pytest.approx(3 * which.redundancy.signals.pitch_rate.threshold)
    assert rows["channels"][30, INDEX["pitch_rate"], 1] < -0.1


def test_an_unfitted_switch_is_no_error():
    found = scored([], 60, "sensors.gear_down.channels=2")
    assert found.false_alarms == [] and set(found.wrong_votes_s) == {discrete.name for discrete in DISCRETES}
    assert not np.any(list(found.wrong_votes_s.values()))
