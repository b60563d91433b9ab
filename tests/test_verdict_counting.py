"""What is told of a channel that comes and goes: the frames that its monitor counted, and which fault it was for."""

from typing import Any

import pytest
from test_verdict_conclusion import row, said
from test_verdict_parts import flight, offset

from rig.core.frame import Table
from rig.verdict.context import Context
from rig.verdict.counting import another, climb
from rig.verdict.scoring import score

COUNTED = ("redundancy.signals.pitch_rate.persistence=8", "redundancy.signals.pitch_rate.count_down=1.0")
MONITORS_ALONE = 'redundancy.signals.pitch_rate.tie_break=["ilm"]'


def bursts(*starts_s: float, width_s: float = 0.04) -> dict[str, Any]:
    times = {"times_s": [round(at - starts_s[0], 3) for at in starts_s], "width_s": width_s, "amplitude": 0.5}
    return {"kind": "spikes", "signal": "pitch_rate", "channels": [4], "start_s": starts_s[0], **times}


def dropout(channel: int, start_s: float) -> dict[str, Any]:
    return {"kind": "dropout", "signal": "pitch_rate", "channels": [channel], "start_s": start_s}


def test_a_count_that_runs_down_is_told_with_the_frames_that_miscompared_and_all_between():
    """Four frames out, two in: the count is 4, 2, 6, 4, 8 after 4, 6, 10, 12, 16 frames."""
    told = row([bursts(0.2, 0.26, 0.32, 0.38)], *COUNTED)
    assert "isolated after 150 ms by comparison; it miscompared in 12 of 16 frames before that" in told


def test_what_takes_next_to_nothing_off_is_told_with_all_nine_frames():
    told = row([bursts(0.2, 0.26, 0.32)], COUNTED[0], "redundancy.signals.pitch_rate.count_down=0.001")
    assert "isolated after 120 ms by comparison; it miscompared in 9 of 13 frames before that" in told


def test_one_frame_is_one_frame():
    told = row([offset([4], 0.2, 0.2)], "redundancy.signals.pitch_rate.persistence=1")
    assert told.endswith("isolated at once by comparison")


def test_bursts_that_were_not_counted_stand_beside_the_run_that_was():
    """Four frames of every six, three times, then a run of eight from 0.38 s on."""
    told = row([bursts(0.2, 0.26, 0.32), offset([4], 0.38, 0.5)], number=1)
    assert told.endswith("isolated after 70 ms by comparison")
    once = {**bursts(0.2, 0.26, 0.32, 0.38, 0.42), "width_s": 0.04}
    told = row([once])
    assert "from 0.20 s on, but until 0.38 s it miscompared in 12 of 18 frames, at most 4 in a row" in told


def test_a_missed_fault_that_comes_and_goes_is_told_with_all_its_frames():
    """Apart from two that are apart for 20 frames, alike with one for 10, apart for 20: no count moves in 1:1:1."""
    faults = [
        offset([2], 0.2, 0.2),
        offset([3], 0.2, -0.2, 0.4),
        offset([3], 0.4, 0.2, 0.5),
        offset([3], 0.5, -0.2, 0.7),
    ]
    told = row(faults, "sensors.pitch_rate.channels=3", MONITORS_ALONE, frames=70)
    assert told.endswith("it miscompared in 40 of 50 frames, at most 20 in a row")


def test_an_offset_that_no_count_saw_is_not_told_to_have_been_found_for_a_dropout_behind_it():
    faults = [offset([2], 0.2, 0.2), offset([3], 0.2, -0.2), dropout(3, 0.5)]
    told = said(faults, "sensors.pitch_rate.channels=3", MONITORS_ALONE)
    assert "not isolated for it: the channel was isolated at 0.57 s for its dropout that began at 0.50 s" in told[2]
    assert told.rows[2].texts[0] == "no valid sample from 0.50 s on"
    assert told.rows[2].texts[-1] == "isolated after 70 ms by comparison"
    assert "1 of 3 faults detected, 1 more on channels isolated for another fault" in told.summary


@pytest.mark.parametrize(("first_s", "is_another"), [(0.2, True), (0.47, False)])
def test_a_fault_whose_frames_were_counted_is_found_with_the_later_one(first_s: float, is_another: bool):
    """Below its threshold of 0.05 from 0.2 s on, nothing counts; above it three frames before the dropout, they do."""
    early = offset([3], first_s, 0.03 if is_another else 0.2)
    which, rows = flight([early, dropout(3, 0.5)], 100, exact=True)
    context = Context(which, score(which, Table(rows)))
    fault = context.score.faults[0]
    found = another(fault, context)
    assert (found is not None) == is_another and fault.outcome == "detected"
    assert climb(fault, context).first == (50 if is_another else 47)


def test_counts_that_stood_still_are_told_as_such():
    """1:1:1 from frame 20 to 39, then still for ten frames, then eight count."""
    faults = [offset([2], 0.2, 0.2, 0.4), offset([3], 0.2, -0.2)]
    told = row(faults, "sensors.pitch_rate.channels=3", MONITORS_ALONE, number=1)
    assert "but until 0.50 s the miscompare counts were frozen or began again" in told
    assert "isolated after 370 ms by comparison" in told
