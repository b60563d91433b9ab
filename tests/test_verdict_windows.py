"""What followed each fault, and how each signal stood: constructed rows with values worked out by hand."""

from typing import Any

import numpy as np
import pytest
from test_verdict_parts import Q, flight, offset, scored

from rig.core.frame import State, Table
from rig.studies.campaign.tables import rows as campaign_rows
from rig.verdict.score_records import Window
from rig.verdict.scoring import _above_before_loss, score
from rig.verdict.tally_records import SPAN

MEAN = "redundancy.manager=mean"
HARD = {"kind": "hardover", "signal": "pitch_rate", "channels": [2], "start_s": 0.2}
HOUR = 360_000.0  # frames at 100 Hz


def window(found: Any, i: int = 0) -> Window:
    assert found.faults[i].window is not None
    return found.faults[i].window


def test_a_window_ends_at_the_next_onset_on_the_signal_and_counts_who_is_good():
    elsewhere = {**offset([1], 0.3, 0.2), "signal": "roll_rate"}
    found = scored([offset([2], 0.2, 0.2), offset([3], 0.6, 0.2), elsewhere])
    ends, good = zip(*((window(found, i).end_frame, window(found, i).good_before) for i in range(3)), strict=True)
    assert (ends, good) == ((60, 100, 100), (4, 3, 4))


def test_a_fault_that_was_not_isolated_is_latent_before_the_next():
    found = scored([offset([1], 0.1, 0.03), offset([2], 0.4, 0.2)])
    assert (window(found, 1).good_before, window(found, 1).latent_before) == (3, 1)
    assert (window(found, 0).good_before, window(found, 0).latent_before) == (4, 0)


def test_an_isolated_fault_is_neither_good_nor_latent():
    found = scored([offset([1], 0.1, 0.2), offset([2], 0.4, 0.2)])
    assert (window(found, 1).good_before, window(found, 1).latent_before) == (3, 0)


def test_two_channels_at_once_share_one_window_with_all_good_before():
    found = scored([offset([1, 2], 0.3, 0.2)])
    assert window(found, 0) == window(found, 1) and window(found).good_before == 4


def test_the_error_of_a_mean_is_a_quarter_of_the_hardover():
    found = scored([HARD], 100, MEAN, exact=True)
    assert window(found).error_max == pytest.approx(1.5 / 4, rel=1e-12)
    assert window(found).above_threshold_s == pytest.approx(0.80) and not window(found).correct


@pytest.mark.parametrize(("frames", "kept"), [(28, True), (29, False)])
def test_a_vote_is_kept_that_was_off_for_no_longer_than_a_monitor_may_take(frames: int, kept: bool):
    found = scored([{**HARD, "end_s": 0.2 + frames / 100}], 100, MEAN, exact=True)
    assert window(found).above_threshold_s == pytest.approx(frames / 100) and window(found).correct == kept


def test_a_vote_that_is_off_in_the_last_frame_is_not_correct():
    assert not window(scored([{**HARD, "start_s": 0.97}], 100, MEAN, exact=True)).correct


def test_time_at_level_0_is_lost():
    found = scored([{"kind": "dropout", "signal": "pitch_rate", "channels": [1, 2, 3, 4], "start_s": 0.5}])
    assert window(found).lost_s == found.signals["pitch_rate"].lost_s == pytest.approx(0.43)  # from frame 57 on
    assert found.signals["pitch_rate"].level_at_end == 0 and found.signals["roll_rate"].lost_s == 0.0


@pytest.mark.parametrize(
    ("spans", "before"),
    [
        ([(30, 0, 0)], 0),  # never lost
        ([(30, 5, 20)], 20),  # lost after 20 frames off, 10 more after it
        ([(12, 0, 0), (30, 5, 20)], 32),  # off before the span in which it was lost
        ([(3, 9, 0), (30, 5, 20)], 0),  # lost at once
    ],
)
def test_frames_off_count_up_to_the_first_at_level_0(spans: list[tuple[int, int, int]], before: int):
    made = np.zeros(len(spans), SPAN)
    for name, column in zip(("above", "lost", "above_lost"), zip(*spans, strict=True), strict=True):
        made[name] = column
    assert _above_before_loss(made) == before


def test_a_loss_whose_vote_was_kept_until_then_has_no_wrong_vote_first():
    found = scored([{"kind": "dropout", "signal": "pitch_rate", "channels": [1, 2, 3, 4], "start_s": 0.5}])
    assert window(found).lost_s > 0.0 and not window(found).wrong_vote_first


def test_a_fault_on_no_channel_of_a_signal_has_no_window():
    found = scored([{"kind": "offset", "signal": "reference.pitch_rate", "start_s": 0.2, "offset": 0.2}])
    assert found.faults[0].window is None


def test_hours_of_healthy_channels_go_on_at_the_next_level_once_the_fault_is_out():
    found = scored([offset([3], 0.2, 0.2)])
    # Four for 20 frames; disturbed up to frame 27, in which it is failed, and the linger of 10 after; then three.
    assert found.signals["pitch_rate"].channel_hours == pytest.approx((20 * 4 / HOUR, (100 - 38) * 3 / HOUR, 0, 0))
    assert found.signals["roll_rate"].channel_hours == pytest.approx((400 / HOUR, 0, 0, 0))


def test_a_latent_fault_ends_the_hours_of_its_signal():
    assert scored([offset([3], 0.2, 0.03)]).signals["pitch_rate"].channel_hours == pytest.approx((80 / HOUR, 0, 0, 0))


def test_a_healthy_channel_failed_at_level_3_is_a_false_isolation_there():
    which, rows = flight([offset([3], 0.2, 0.2)])
    rows["state"][70:, Q, 0] = State.FAILED
    assert score(which, Table(rows)).signals["pitch_rate"].false_isolations == (0, 1, 0, 0)
    row = campaign_rows("signals", 5, which, score(which, Table(rows)))[Q]
    assert (row["run"], row["signal"], row["false_isolations_level_3"], row["false_isolations_level_4"]) == (
        5,
        "pitch_rate",
        1,
        0,
    )


def test_a_healthy_channel_failed_while_a_fault_is_fresh_is_that_faults():
    which, rows = flight([offset([3], 0.2, 0.2)])
    rows["state"][30:, Q, 0] = State.FAILED
    found = score(which, Table(rows))
    assert found.signals["pitch_rate"].false_isolations == (0, 0, 0, 0) and len(found.wrong_isolations) == 1


def test_a_wrong_isolation_is_booked_on_the_fault_in_whose_window_it_is():
    which, rows = flight([offset([2], 0.1, 0.2), offset([3], 0.6, 0.2)])
    rows["state"][30:, Q, 0] = State.FAILED
    told = campaign_rows("faults", 0, which, score(which, Table(rows)))
    assert [row["isolation"] for row in told] == ["wrong", "correct"]


def test_a_manager_that_takes_its_failures_back_counts_by_its_vote():
    which, rows = flight([HARD], 300, "redundancy.manager=selection", exact=True)
    rows["state"][60:90, Q, 0] = State.FAILED  # a healthy channel, distrusted for a while
    found = score(which, Table(rows))
    (row,) = campaign_rows("faults", 0, which, found)
    assert found.wrong_isolations
    assert (row["isolation"], row["vote_correct"]) == ("correct", True)
