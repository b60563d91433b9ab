"""The small kernels one by one: tie-break rules, trend, weights, settings."""

from typing import Any

import numpy as np
import pytest
from conftest import constant, vote_samples
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.computer.redundancy import median_vote as vote
from rig.computer.redundancy import opinions
from rig.computer.redundancy.manager_config import (
    MANAGERS,
    PARAMS,
    Config,
    SignalConfig,
    SignalConfigs,
    fill,
    parameters,
    refuse_short_wait,
)
from rig.computer.redundancy.resets import Reset, command
from rig.computer.redundancy.slow_tests_config import OFF
from rig.computer.redundancy.state import STATE
from rig.core.frame import SIGNALS, DecidedBy, Ilm, State, new_block

LOW, HIGH, NONE = opinions.LOW_SIDE, opinions.HIGH_SIDE, opinions.NO_ANSWER
ORDER = np.array([2, 0, 3, 1])  # channels by ascending value: 3 and 1 below, 4 and 2 above
GOOD, BAD, ABSENT = int(Ilm.GOOD), int(Ilm.BAD), int(Ilm.ABSENT)


@pytest.mark.parametrize(
    ("flags", "n", "sides"),
    [
        ([GOOD, BAD, GOOD, BAD], 4, HIGH),
        ([BAD, GOOD, BAD, GOOD], 4, LOW),
        ([GOOD, GOOD, GOOD, BAD], 4, NONE),
        ([GOOD, BAD, BAD, BAD], 4, NONE),
        ([BAD, GOOD, GOOD, GOOD], 4, NONE),
        ([BAD, BAD, BAD, GOOD], 4, NONE),
        ([GOOD, ABSENT, GOOD, ABSENT], 4, NONE),
        ([ABSENT, GOOD, ABSENT, GOOD], 4, NONE),
        ([ABSENT, BAD, GOOD, BAD], 4, NONE),
        ([GOOD, BAD, ABSENT, BAD], 4, NONE),
        ([BAD, GOOD, BAD, ABSENT], 4, NONE),
        ([BAD, ABSENT, BAD, GOOD], 4, NONE),
        ([BAD, ABSENT, GOOD, ABSENT], 2, HIGH),
        ([GOOD, ABSENT, BAD, ABSENT], 2, LOW),
        ([GOOD, ABSENT, GOOD, ABSENT], 2, NONE),
        ([BAD, ABSENT, BAD, ABSENT], 2, NONE),
    ],
)
def test_in_line_monitors_decide_only_when_they_follow_the_pairing(flags, n, sides):
    assert opinions.by_ilm(np.array(flags, np.uint8), ORDER, n) == sides


@pytest.mark.parametrize(
    ("high", "low", "reference", "sides", "middle"),
    [
        (5.0, 0.0, 6.0, LOW, 5.0),
        (5.0, 0.0, 5.0, LOW, 5.0),
        (5.0, 0.0, -1.0, HIGH, 0.0),
        (5.0, 0.0, 0.0, HIGH, 0.0),
        (5.0, 0.0, 2.5, HIGH | LOW, 2.5),
        (5.0, 0.0, 4.5, LOW, 4.5),
        (5.0, 0.0, 0.5, HIGH, 0.5),
        (5.0, 0.0, 1.0, HIGH, 1.0),
        (5.0, 0.0, 4.0, LOW, 4.0),
        (-3.0, -8.0, -7.5, HIGH, -7.5),
        (105.0, 100.0, 104.5, LOW, 104.5),
        (1.5, 0.0, 0.75, 0, 0.75),
    ],
)
def test_a_reference_makes_a_triplex_with_the_two_ranks(high, low, reference, sides, middle):
    assert opinions.by_reference(high, low, reference, 1.0) == sides
    assert opinions.middle(high, low, reference) == middle
    assert opinions.by_reference(high, low, np.nan, 1.0) == NONE


def test_a_split_around_a_reference_that_is_near_neither_fails_all_four():
    out = vote_samples(constant(0, 0.1, 5, 5.1), reference=2.5, tie_break=["reference"])
    assert out.failed_at() == [10, 10, 10, 10]
    assert (out.voted == 2.5).all() and out.level[9] == 0


def test_a_split_around_a_reference_that_is_near_both_fails_no_channel():
    out = vote_samples(constant(0, 0.1, 1.6, 1.7), reference=0.8, tie_break=["reference"])
    assert out.failed_at() == [None] * 4
    assert (out.decided_by == DecidedBy.REFERENCE).all() and (out.voted == 0.8).all()


def test_an_unusable_reference_is_not_asked():
    reference = np.zeros(60)
    samples = constant(0, 0, 0, 0, frames=60)
    reference[:20] = 9.0  # off a healthy vote for long enough
    samples[20:, 2:] = 5.0
    out = vote_samples(samples, reference=reference, tie_break=["reference"])
    assert (out.decided_by[20:] == DecidedBy.UNRESOLVED).all() and out.failed_at() == [None] * 4


@pytest.mark.parametrize(
    ("tie_break", "first"), [(["trend", "ilm"], DecidedBy.TREND), (["ilm", "trend"], DecidedBy.ILM)]
)
def test_the_rules_are_asked_in_their_order(tie_break, first):
    ilm = np.tile([BAD, BAD, GOOD, GOOD], (30, 1))
    out = vote_samples(constant(0, 0.1, 5, 5.1), ilm=ilm, tie_break=tie_break)
    assert out.decided_by[8] == first


def test_a_duplex_split_is_settled_like_a_quadruplex_one():
    pair = np.column_stack([constant(0, 5), np.full((30, 2), np.nan)])
    still = vote_samples(pair, channels=2)
    rising = vote_samples(pair + np.arange(30.0)[:, None], channels=2)
    ilm = vote_samples(pair, channels=2, ilm=np.tile([BAD, GOOD, ABSENT, ABSENT], (30, 1)))
    assert still.failed_at() == [None, 10, None, None]
    assert rising.failed_at() == [10, None, None, None]
    assert ilm.failed_at() == [10, None, None, None]


@pytest.mark.parametrize("moving", [0, 1])
def test_two_samples_of_which_one_moves_have_no_trend(moving):
    samples = np.column_stack([constant(0, 5), np.full((30, 2), np.nan)])
    samples[:, moving] += 0.1 * np.arange(30)
    out = vote_samples(samples, channels=2, tie_break=["trend"], trend_frames=3)
    assert (out.decided_by == DecidedBy.UNRESOLVED).all()
    assert out.trend_high.max() == 7 * moving and out.trend_low.max() == 7 * (1 - moving)


@pytest.mark.parametrize("frames", range(1, 9))
def test_a_trend_byte_of_any_length_answers_after_as_many_changes(frames):
    out = vote_samples(constant(0, 0.1, 5, 5.1), trend_frames=frames)
    asked = np.flatnonzero(out.decided_by == DecidedBy.TREND)
    assert asked[0] == frames
    rising = vote_samples(constant(0, 0.1, 5, 5.1) + np.arange(30.0)[:, None], trend_frames=frames)
    assert rising.trend_high[frames] == 2**frames - 1 == rising.trend_high.max()


def test_a_trend_byte_shifts_left_and_keeps_the_last_bits():
    steps = np.cumsum([0, 1, -1, 1, 1, 0, 1])
    out = vote_samples(np.tile(steps[:, None], (1, 4)).astype(float), trend_frames=3, threshold=0.5)
    assert out.trend_high.tolist() == [0, 0b1, 0b10, 0b101, 0b011, 0b110, 0b101]
    assert out.trend_low.tolist() == out.trend_high.tolist()


def test_a_trend_byte_starts_anew_when_the_number_of_valid_samples_changes():
    samples = constant(0, 0.1, 5, 5.1, frames=20)
    samples[6, 0] = np.nan
    out = vote_samples(samples, tie_break=["trend"], trend_frames=3)
    assert (out.decided_by[3:6] == DecidedBy.TREND).all()
    assert (out.decided_by[7:10] == DecidedBy.UNRESOLVED).all() and (out.decided_by[10:16] == DecidedBy.TREND).all()


@pytest.mark.parametrize(
    ("high", "low", "seen", "still", "says"),
    [
        (7, 7, 3, (0, 0), opinions.LARGER_TRUE),
        (0, 0, 3, (0, 0), opinions.SMALLER_TRUE),
        (0, 0, 3, (3, 9), opinions.SMALLER_TRUE),
        (0, 0, 3, (3, 2), NONE),
        (0, 0, 3, (0, 3), NONE),
        (7, 0, 3, (0, 0), NONE),
        (0, 7, 3, (0, 0), opinions.BOTH_FALSE),
        (0, 7, 3, (3, 0), NONE),
        (5, 5, 3, (0, 0), NONE),
        (7, 7, 2, (0, 0), NONE),
        (0, 0, 2, (0, 0), NONE),
        (0b1111, 0b0111, 4, (0, 0), opinions.LARGER_TRUE),  # the newest three
        (0b1000, 0b0000, 4, (0, 0), opinions.SMALLER_TRUE),
    ],
)
def test_a_verdict_needs_both_bytes_whole(high: int, low: int, seen: int, still: tuple[int, int], says: int):
    track = np.zeros(1, STATE)
    track["trend_high"], track["trend_low"], track["trend_seen"] = high, low, seen
    track["still_high"], track["still_low"] = still
    assert opinions.trend_verdict(track[0], 3) == says


@given(st.floats(-1e3, 1e3), st.floats(0, 1e3), st.floats(0, 1))
def test_a_weighted_mean_stays_between_its_two_values(low, width, weight):
    out = vote.mean(low, low + width, weight)
    assert low <= out <= low + width
    assert out == pytest.approx(low + weight * width, abs=1e-9)


@pytest.mark.parametrize(
    ("rise_high", "rise_low", "rise_vote", "share"),
    [
        (1.0, 3.0, 1.0, 1.0),
        (1.0, 3.0, 3.0, 0.0),
        (1.0, 3.0, 2.0, 0.5),
        (2.0, 6.0, 3.0, 0.75),
        (-2.0, -6.0, -3.0, 0.75),
        (1.0, -3.0, 1.0, 0.5),
        (0.0, 3.0, 0.0, 0.5),
        (3.0, 0.0, 0.0, 0.5),
        (2.0, 2.0, 2.0, 0.5),
    ],
)
def test_the_value_that_moves_like_the_vote_weighs_more(rise_high, rise_low, rise_vote, share):
    assert vote.trend_weight(rise_high, rise_low, rise_vote) == share


def test_the_trend_weighted_mean_follows_the_rank_that_moved_like_the_vote():
    samples = np.array([[0.0, 0.0, 0.5, 0.5], [0.1, 0.1, 0.6, 0.6], [0.2, 0.2, 0.9, 0.9]])
    plain, weighted = vote_samples(samples), vote_samples(samples, mean="trend-weighted")
    assert plain.voted.tolist() == pytest.approx([0.25, 0.35, 0.55])
    assert weighted.voted.tolist() == pytest.approx([0.25, 0.35, 0.2])


def test_settings_become_a_record_in_frames_with_their_defaults():
    row = np.zeros(1, PARAMS)
    fill(row[0], SignalConfig(threshold=0.5, fade_s=0.25), (-1.0, 2.0), 3, True, 100.0)
    plain = {name: row[name][0].tolist() for name in PARAMS.names or ()}
    assert plain == {
        **dict.fromkeys(OFF, 0.0),
        "threshold": 0.5,
        "threshold_triplex": 0.5,
        "threshold_duplex": 0.5,
        "filter_gain": 0.0,
        "slow_allowance": 0.0,
        "slow_limit": 0.0,
        "stale_frames": 0,
        "reference_threshold": 0.5,
        "reference_airspeed_m_s": 0.0,
        "second_threshold": 0.5,
        "common_persistence": 1,
        "common_fails": 0,
        "low": -1.0,
        "high": 2.0,
        "deviation": 1.25,
        "deviation_frames": 250.0,
        "persistence": 8,
        "split_persistence": 10,
        "trend_frames": 8,
        "readmit_frames": 100,
        "fade_frames": 25,
        "fitted": 3,
        "tie_break": [1, 10, 3, 2, 4, 5],
        "wraps": 1,
        "weighted": 0,
        "count_down": 0.0,
        "unresolved_frames": 0,
        "trend_small": -1.0,
        "trend_tumbles": 0,
        "trend_beside_reference": 0,
        "referred": 0,
        "tells": 0,
        "sources": 0,
        "box": 1,
    }
    chosen = SignalConfig(
        threshold=0.5,
        threshold_triplex=0.6,
        threshold_duplex=0.8,
        filter_s=0.02,
        reference_threshold=0.7,
        mean="trend-weighted",
        tie_break=["reference"],
        selection_deviation=2.0,
        selection_integral_s=0.5,
    )
    fill(row[0], chosen, (-1.0, 2.0), 4, False, 100.0)
    assert (row["reference_threshold"][0], row["weighted"][0], row["wraps"][0]) == (0.7, 1, 0)
    assert (row["threshold_triplex"][0], row["threshold_duplex"][0]) == (0.6, 0.8)
    assert row["filter_gain"][0] == pytest.approx(1.0 - np.exp(-0.5))
    assert (row["deviation"][0], row["deviation_frames"][0]) == (2.0, 50.0)
    row = np.zeros(1, PARAMS)
    fill(row[0], chosen, (-1.0, 2.0), 4, False, 100.0)
    assert row["tie_break"][0].tolist() == [3, 0, 0, 0, 0, 0]


def test_every_signal_has_its_own_settings_range_and_channels():
    configs = SignalConfigs.model_validate({s.name: {"threshold": 1.0 + i} for i, s in enumerate(SIGNALS)})
    ranges = np.array([(-10.0 - i, 20.0 + i) for i in range(len(SIGNALS))])
    table = parameters(configs, ranges, np.array([4, 3] + [2] * (len(SIGNALS) - 2)), 50.0)
    assert table["threshold"].tolist() == [1.0 + i for i in range(len(SIGNALS))]
    assert np.array_equal(np.column_stack([table["low"], table["high"]]), ranges)
    assert table["fitted"].tolist()[:3] == [4, 3, 2]
    assert table["wraps"].tolist() == [int(s.wraps) for s in SIGNALS]
    assert (table["deviation_frames"] == 5.0 * table["threshold"] * 50.0).all()


def test_the_smallest_settings_are_one_frame():
    least = SignalConfig(threshold=1.0, persistence=1, split_persistence=1, trend_frames=1, readmit_frames=1)
    assert least.fade_s == 0.0 and Reset(at_s=0.0, signal="heading").channels == [1, 2, 3, 4]
    with pytest.raises(ValidationError):
        Reset(at_s=0.0, signal="heading", channels=[0])


def test_a_reset_is_commanded_in_the_first_frame_not_before_it():
    rows = new_block(20, 5)
    command(rows, [Reset(at_s=0.105, signal="heading", channels=[2, 4])], 100.0)
    assert np.argwhere(rows["reset"]).tolist() == [[6, 15]] and rows["reset"][6, 15] == 0b1010


@pytest.mark.parametrize(
    "bad",
    [
        {"threshold": 0.0},
        {"persistence": 0},
        {"trend_frames": 0},
        {"trend_frames": 9},
        {"tie_break": ["ilm", "ilm"]},
        {"tie_break": ["oracle"]},
        {"mean": "mode"},
    ],
)
def test_impossible_settings_of_a_signal_are_refused(bad):
    with pytest.raises(ValidationError):
        SignalConfig.model_validate({"threshold": 1.0, **bad})


@pytest.mark.parametrize("bad", [{"signal": "pitchrate"}, {"channels": [5]}, {"channels": []}, {"at_s": -1.0}])
def test_impossible_resets_are_refused(bad):
    with pytest.raises(ValidationError):
        Reset.model_validate({"at_s": 1.0, "signal": "heading", **bad})


@pytest.mark.parametrize("name", ["average", "module.Class", "a b:C"])
def test_an_unknown_manager_is_refused(name):
    with pytest.raises(ValidationError, match="unknown manager"):
        Config.model_validate({"manager": name, "signals": {}})


@pytest.mark.parametrize(("high", "low", "reference", "sides"), [(5.0, 0.0, 6.0, LOW), (5.0, 0.0, -1.0, HIGH)])
def test_a_reference_outside_the_ranks_decides_however_wide_its_threshold(high, low, reference, sides):
    assert opinions.by_reference(high, low, reference, 50.0) == sides


@pytest.mark.parametrize("manager", [*MANAGERS, "mine:Class", "a.b.c:D"])
def test_every_manager_of_the_house_and_any_class_may_be_named(manager):
    signals = {s.name: {"threshold": 1.0} for s in SIGNALS}
    assert Config.model_validate({"manager": manager, "signals": signals}).manager == manager


@pytest.mark.parametrize("key", ["readmit_frames", "split_persistence", "selection_deviation", "selection_integral_s"])
def test_nothing_is_counted_to_zero(key):
    with pytest.raises(ValidationError):
        SignalConfig.model_validate({"threshold": 1.0, key: 0})


def test_a_sample_at_the_end_of_the_range_is_valid():
    out = vote_samples(constant(2.0, -2.0, 1.9, 1.8), limits=(-2.0, 2.0), threshold=10.0)
    assert (out.state == State.OK).all()


def test_the_first_change_is_weighed_against_a_vote_that_stood_still():
    out = vote_samples([[0.0, 0.0, 0.5, 0.5], [0.1, 0.1, 0.7, 0.7]], mean="trend-weighted")
    assert out.voted[1] == pytest.approx(0.1 + 0.6 / 3)


def test_discretes_persist_eight_frames_unless_told():
    signals = {s.name: {"threshold": 1.0} for s in SIGNALS}
    assert Config.model_validate({"signals": signals}).discrete_persistence == 8
    assert Config.model_validate({"signals": signals, "discrete_persistence": 1}).discrete_persistence == 1
    for bad in ({"discrete_persistence": 0}, {"resets": [{"at_s": -0.5, "signal": "heading"}]}):
        with pytest.raises(ValidationError):
            Config.model_validate({"signals": signals, **bad})
    for key in ("reference_threshold", "fade_s"):
        with pytest.raises(ValidationError):
            SignalConfig.model_validate({"threshold": 1.0, key: -0.5})


def test_boxes_and_common_modes_have_their_defaults_and_least_settings():
    every: Any = {"signals": {s.name: {"threshold": 1.0} for s in SIGNALS}}
    plain = Config.model_validate(every)
    assert (plain.box_signals, plain.box_persistence) == (None, 8)
    assert (plain.common_mode, plain.common_persistence) == ("fail", 10)
    for key, least in (("box_signals", 0), ("box_persistence", 1), ("common_persistence", 1)):
        assert getattr(Config.model_validate({**every, key: least}), key) == least
        with pytest.raises(ValidationError, match=key):
            Config.model_validate({**every, key: least - 1})


@pytest.mark.parametrize(("reference", "blamed"), [(1.0, LOW), (0.0, HIGH)])
def test_a_reference_on_one_of_two_values_makes_that_one_the_middle(reference: float, blamed: int):
    """Whatever its threshold: of three values of which two are equal, the third is an extreme."""
    for threshold in (0.1, 5.0):
        assert opinions.by_reference(1.0, 0.0, reference, threshold) == blamed


def test_resets_of_other_blocks_are_not_commanded_and_those_of_one_frame_add_up():
    rows = new_block(10, 100)
    of_two = [Reset(at_s=1.0, signal="pitch_rate", channels=[c]) for c in (2, 2, 3)]
    command(rows, [Reset(at_s=t, signal="pitch_rate") for t in (0.99, 1.1)] + of_two, 100.0)
    assert np.argwhere(rows["reset"]).tolist() == [[0, 0]] and rows["reset"][0, 0] == 0b0110


@pytest.mark.parametrize(("rate_hz", "frames"), [(25.0, 2), (100.0, 8), (400.0, 32), (110.0, 9), (1.0, 1), (1e-5, 1)])
def test_a_persistence_in_seconds_lasts_at_least_as_long_at_every_rate(rate_hz, frames):
    row = np.zeros(1, PARAMS)[0]
    fill(row, SignalConfig(threshold=1.0, persistence_s=0.08, split_persistence_s=0.08), (-1, 1), 4, False, rate_hz)
    assert (row["persistence"], row["split_persistence"]) == (frames, frames)


@pytest.mark.parametrize("name", ["persistence", "split_persistence"])
def test_a_persistence_is_in_frames_or_in_seconds(name):
    with pytest.raises(ValidationError, match=f"{name} and {name}_s are the same setting"):
        SignalConfig.model_validate({"threshold": 1.0, name: 8, f"{name}_s": 0.08})


def test_a_small_change_is_refused_beside_windows_that_tumble():
    for window in ("sliding", "tumbling"):
        told = {"threshold": 1.0, "trend_small": 0.1, "trend_window": window}
        if window == "sliding":
            assert SignalConfig.model_validate(told).trend_small == 0.1
        else:
            with pytest.raises(ValidationError, match='trend_small: not allowed with trend_window = "tumbling"'):
                SignalConfig.model_validate(told)


@pytest.mark.parametrize(
    ("rate_hz", "wait_s", "said"), [(8.0, 1.0, "1 s, the default, are 8"), (8.0, 0.5, "0.5 s are 4")]
)
def test_a_wait_that_is_too_short_is_called_the_default_where_it_is(rate_hz: float, wait_s: float, said: str):
    config = Config.model_validate({"unresolved_s": wait_s, "signals": {s.name: {"threshold": 1.0} for s in SIGNALS}})
    with pytest.raises(ValueError, match=f"redundancy.unresolved_s: {said} frames"):
        refuse_short_wait(config, rate_hz)


@pytest.mark.parametrize(("wait_s", "refused"), [(0.0, False), (0.01, True), (0.09, True), (0.1, False), (1.0, False)])
def test_a_split_cannot_be_given_up_before_it_can_be_settled(wait_s: float, refused: bool):
    """Ten frames at 100 Hz; 0 never gives up."""
    config = Config.model_validate({"unresolved_s": wait_s, "signals": {s.name: {"threshold": 1.0} for s in SIGNALS}})
    if refused:
        with pytest.raises(ValueError, match="fewer than the 10 of split_persistence of pitch_rate; 0: never"):
            refuse_short_wait(config, 100.0)
    else:
        refuse_short_wait(config, 100.0)
