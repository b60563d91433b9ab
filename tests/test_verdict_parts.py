"""The score of constructed rows: truth made up, the stages between sensors and manager as in flight."""

from typing import Any

import numpy as np
import pytest
from conftest import FEWER
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.computer.redundancy.manager_config import PARAMS
from rig.core.errors import BadInput
from rig.core.frame import (
    CHANNELS,
    FLAT,
    INDEX,
    SIGNALS,
    Block,
    DecidedBy,
    End,
    Pattern,
    State,
    Table,
    nested,
    new_block,
)
from rig.flight.loop import Rig
from rig.scenario import scenario
from rig.scenario.scenario import Scenario
from rig.verdict.patterns import POSSIBLE
from rig.verdict.score_records import Score
from rig.verdict.score_tables import VOTES, tables
from rig.verdict.scoring import score
from rig.verdict.unfaulted import middle

Q = INDEX["pitch_rate"]
EXACT = [f"sensors.{s.name}.{key}=0.0" for s in SIGNALS for key in ("noise_std", "bias_tolerance", "scale_tolerance")]
EXACT += [f"sensors.{s.name}.{key}=0.0" for s in SIGNALS for key in ("lag_s", "quantum", "skew_frames")]


def offset(channels: list[int], start_s: float, size: float, end_s: float | None = None, **more: Any) -> dict[str, Any]:
    fault = {"kind": "offset", "signal": "pitch_rate", "channels": channels, "start_s": start_s, "offset": size, **more}
    return fault if end_s is None else {**fault, "end_s": end_s}


def flight(
    faults: list[dict[str, Any]], frames: int = 100, *overrides: str, exact: bool = False
) -> tuple[Scenario, Block]:
    """Rows of ``frames`` frames at a constant truth, through every stage but the aircraft."""
    plain = "redundancy.signals.*.slow_tests=false"  # nothing but the comparison
    which = scenario.load(
        None, [f"duration_s={frames / 100}", "faults=[]", plain, *(EXACT if exact else ()), *overrides]
    )
    which = scenario.from_resolved({**which.resolved(), "faults": faults}, "test")
    rig, rows = Rig(which), new_block(frames)
    truth = np.zeros(len(SIGNALS))
    truth[INDEX["static_pressure"]], truth[INDEX["dynamic_pressure"]], truth[INDEX["heading"]] = 50_000.0, 9_000.0, 3.0
    rows["reference"] = np.nan
    rig.prepare(rows)
    rows["truth"] = truth
    for k in range(frames):
        rig.computer_step(nested(rows), k, rig.data)
    return which, rows


def scored(faults: list[dict[str, Any]], frames: int = 100, *overrides: str, exact: bool = False) -> Score:
    which, rows = flight(faults, frames, *overrides, exact=exact)
    return score(which, Table(rows))


def outcomes(found: Score) -> list[tuple[str, int | None, int | None, int | None]]:
    return [(f.outcome, f.onset_frame, f.exceeded_frame, f.failed_frame) for f in found.faults]


def test_the_clean_channels_are_the_recorded_ones_bit_for_bit_where_no_fault_acts():
    which, rows = flight([offset([3], 0.5, 0.2)])
    from rig.verdict.unfaulted import MeasuredAgain

    clean = np.concatenate([part.clean["channels"].copy() for part in MeasuredAgain(which).of(Table(rows))])
    error = rows["channels"] - clean
    corrupted = np.zeros_like(error, bool)
    corrupted[50:, Q, 2] = True
    assert not error[~corrupted].any()
    np.testing.assert_allclose(error[corrupted], 0.2, rtol=1e-12)


def test_rows_of_other_sensors_are_refused_with_the_first_difference():
    which, rows = flight([])
    rows["channels"][7, Q, 1] += 1e-9
    with pytest.raises(BadInput, match="first difference at pitch_rate channel 2 in frame 7"):
        score(which, Table(rows))
    with pytest.raises(BadInput, match="from its frame 0 on"):
        score(which, Table(rows[1:]))


def test_an_error_below_the_threshold_is_undetectable():
    found = scored([offset([2], 0.2, 0.03)])
    assert outcomes(found) == [("undetectable", 20, None, None)]
    assert found.faults[0].peak_error == pytest.approx(0.03) and not found.faults[0].tolerated


def test_an_error_at_the_threshold_has_not_exceeded_it():
    assert outcomes(scored([offset([2], 0.2, 0.05)], exact=True)) == [("undetectable", 20, None, None)]
    assert outcomes(scored([offset([2], 0.2, 0.0500001)], exact=True)) == [("detected", 20, 20, 27)]


def test_an_error_below_the_threshold_that_the_slow_tests_find_is_detected_without_a_frame_above_it():
    tests = "redundancy.signals.pitch_rate.slow_tests={}"
    (fault,) = scored([offset([2], 3.0, 0.03)], 400, tests).faults
    assert (fault.outcome, fault.onset_frame, fault.exceeded_frame) == ("detected", 300, None)
    assert fault.decided_by == "slow_means" and 300 < (fault.failed_frame or 0) < 350
    assert fault.delay_from_onset_frames == (fault.failed_frame or 0) - 300 and fault.delay_from_exceeded_frames is None
    mean = scored([offset([2], 0.2, 0.16)], 100, "redundancy.manager=mean", exact=True)
    assert outcomes(mean) == [("missed", 20, 20, None)] and mean.vote_error["pitch_rate"].above_threshold_s == 0.0


def test_faults_on_one_channel_after_each_other_are_scored_each_for_itself():
    found = scored([offset([2], 0.1, 0.3, 0.15), offset([2], 0.4, 0.2)], 80)
    assert outcomes(found) == [("missed", 10, 10, None), ("detected", 40, 40, 47)]
    assert [fault.tolerated for fault in found.faults] == [True, False]


def test_faults_together_on_one_channel_share_its_failure():
    found = scored([offset([2], 0.1, 0.03, id="small"), offset([2], 0.4, 0.2, id="large")], 80)
    assert [(fault.id, *frames) for fault, (_, *frames) in zip(found.faults, outcomes(found), strict=True)] == [
        ("small", 10, 40, 47),  # the channel's error is that of both
        ("large", 40, 40, 47),
    ]
    assert found.faults[0].delay_from_onset_frames == 37


def test_a_fault_on_a_channel_that_is_out_already_is_not_executed():
    found = scored([offset([2], 0.1, 0.3), offset([2], 0.4, 0.2, 0.5), offset([2, 3], 0.6, 0.2)], 90)
    assert outcomes(found) == [
        ("detected", 10, 10, 17),
        ("not executed", 40, None, None),
        ("not executed", 60, None, None),
        ("detected", 60, 60, 67),
    ]


def test_a_failure_belongs_to_a_fault_that_ceased_no_longer_ago_than_the_longer_persistence():
    which, rows = flight([offset([2], 0.1, 0.3, 0.15)], 60)
    for at, outcome, alarms in ((24, "detected", 0), (25, "missed", 1)):  # last acting frame 14, persistence 10
        late = rows.copy()
        late["state"][at:, Q, 1] = State.FAILED
        found = score(which, Table(late))
        assert (found.faults[0].outcome, len(found.false_alarms)) == (outcome, alarms)
        assert found.faults[0].failed_frame == (at if outcome == "detected" else None)


def test_a_healthy_channel_failed_alone_is_a_false_alarm_and_beside_a_faulty_one_a_wrong_isolation():
    which, rows = flight([offset([2], 0.5, 0.03)], 90)
    rows["state"][30:, Q, 0] = State.FAILED  # before any fault
    rows["state"][60:, Q, 3] = State.FAILED  # channel 2 is off, if only a little
    rows["state"][70:, INDEX["heading"], 1] = State.FAILED  # of another signal
    rows["discrete_state"][80:, 1, 2] = State.FAILED
    found = score(which, Table(rows))
    assert [(a.signal, a.channel, a.frame) for a in found.false_alarms] == [
        ("pitch_rate", 1, 30),
        ("heading", 2, 70),
        ("gear_down", 3, 80),
    ]
    assert [(a.signal, a.channel, a.frame) for a in found.wrong_isolations] == [("pitch_rate", 4, 60)]
    assert found.faults[0].outcome == "undetectable"


def test_a_channel_failed_readmitted_and_failed_again_is_two_alarms():
    which, rows = flight([], 60)
    rows["state"][[*range(10, 20), *range(30, 40)], Q, 0] = State.FAILED
    assert [alarm.frame for alarm in score(which, Table(rows)).false_alarms] == [10, 30]


def test_two_faulty_channels_that_are_failed_together_are_no_wrong_isolation():
    found = scored([offset([2], 0.2, 0.3), offset([4], 0.2, -0.3)], 60)
    assert [fault.outcome for fault in found.faults] == ["detected", "detected"]
    assert found.wrong_isolations == found.false_alarms == []


def test_a_monitor_without_patience_fails_a_channel_in_the_frame_of_the_onset():
    impatient = ("redundancy.signals.pitch_rate.persistence=1", "redundancy.signals.pitch_rate.split_persistence=1")
    assert outcomes(scored([offset([2], 0.2, 0.3)], 40, *impatient)) == [("detected", 20, 20, 20)]
    assert outcomes(scored([offset([2], 0.0, 0.3)], 40, *impatient)) == [("detected", 0, 0, 0)]


@pytest.mark.parametrize(("frames", "tolerated"), [(7, True), (8, False), (9, False)])
def test_a_missed_fault_is_tolerated_up_to_the_frame_before_the_persistence(frames: int, tolerated: bool):
    found = scored([offset([3, 4], 0.2, 0.3, 0.2 + frames / 100)], 60)  # two pairs are settled after ten frames
    assert [fault.outcome for fault in found.faults] == ["missed", "missed"]
    assert [(f.exceeded_run_frames, f.tolerated) for f in found.faults] == [(frames, tolerated)] * 2


def test_lost_samples_exceed_any_threshold():
    for flagged in (True, False):
        dropout = {"kind": "dropout", "signal": "pitch_rate", "channels": [1], "start_s": 0.2, "flagged": flagged}
        found = scored([dropout], 60)
        assert outcomes(found) == [("detected", 20, 20, 27)]
        assert found.faults[0].peak_error is None


def test_a_rule_that_spoke_but_did_not_stand_is_asked_and_has_not_answered():
    order = 'redundancy.signals.pitch_rate.tie_break=["ilm", "trend", "reference", "extremes"]'
    which, rows = flight([offset([3, 4], 0.2, 0.3)], 60, "redundancy.signals.pitch_rate.split_persistence=30", order)
    rows["pattern"][:, Q], rows["decided_by"][:, Q] = Pattern.NORMAL, DecidedBy.NONE
    rows["state"][:, Q] = State.OK
    rows["pattern"][20:26, Q], rows["decided_by"][20:26, Q] = Pattern.P2_2, DecidedBy.TREND
    rows["decided_by"][20, Q] = DecidedBy.ILM
    rows["pattern"][30:35, Q], rows["decided_by"][30:35, Q] = Pattern.P2_2, DecidedBy.REFERENCE
    rows["decided_by"][34, Q] = DecidedBy.UNRESOLVED
    rows["pattern"][40:50, Q], rows["decided_by"][40:50, Q] = Pattern.P1_1_1_1, DecidedBy.EXTREMES
    rows["state"][49:, Q, 0] = rows["state"][49:, Q, 3] = State.FAILED
    found = score(which, Table(rows))
    assert [
        (e.pattern, e.first_frame, e.frames, e.asked, e.decided_by, e.failed, e.verdict) for e in found.episodes
    ] == [
        ("2:2", 20, 6, ("ilm", "trend"), "trend", (), "open"),
        ("2:2", 30, 5, ("ilm", "trend", "reference"), "unresolved", (), "open"),
        ("1:1:1:1", 40, 10, ("ilm", "reference", "extremes"), "extremes", (1, 4), "wrong"),
    ]
    counts = {name: (r.asked, r.answered, r.correct, r.wrong, r.open) for name, r in found.tie_break.items()}
    assert counts == {
        "ilm": (3, 0, 0, 0, 0),
        "lane": (0, 0, 0, 0, 0),
        "trend": (2, 1, 0, 0, 1),
        "reference": (2, 0, 0, 0, 0),
        "extremes": (1, 1, 0, 1, 0),
        "middle": (0, 0, 0, 0, 0),
        "box": (0, 0, 0, 0, 0),
    }
    assert found.unresolved == 1 and set(found.tie_break_by_pattern) == {"2:2", "1:1:1:1"}
    assert [fault.failed_frame for fault in found.faults] == [None, 49]


def test_a_split_that_no_rule_settles_is_unresolved():
    found = scored([offset([3, 4], 0.2, 0.3)], 60, "redundancy.signals.pitch_rate.tie_break=[]")
    (episode,) = found.episodes
    assert (episode.asked, episode.decided_by, episode.verdict, episode.frames) == ((), "unresolved", "open", 40)
    assert found.unresolved == 1 and [f.outcome for f in found.faults] == ["missed", "missed"]


def test_vote_errors_are_those_of_their_definition():
    which, rows = flight([offset([1], 0.4, 0.01)], 80, exact=True)
    rows["voted"][:, Q] = 0.0
    rows["voted"][20:25, Q] = -0.06
    rows["voted"][40:50, Q] = 0.1
    rows["voted"][50, Q] = np.nan  # a manager of the user's own may say anything
    error = score(which, Table(rows)).vote_error["pitch_rate"]
    assert (error.peak, error.peak_frame) == (0.1, 40)
    assert error.rms == pytest.approx(np.sqrt((5 * 0.06**2 + 10 * 0.1**2) / 79))
    assert (error.above_threshold_s, error.above_threshold_after_onset_s) == (0.16, 0.11)
    assert error.clean_peak == pytest.approx(0.1)  # truth and clean vote are the same without sensor errors


def test_a_signal_without_a_vote_has_no_peak():
    which, rows = flight([], 50, exact=True)
    rows["voted"][:, Q] = np.nan
    found = score(which, Table(rows))
    assert found.vote_error["pitch_rate"].peak_frame is None
    (row,) = tables(found, which.rate_hz)["votes"].rows
    assert [column.of(row) for column in VOTES] == ["pitch_rate", "deg/s", "no vote", "", "", "0.5 s", "0 s", ""]


def test_an_angle_is_off_the_short_way_round():
    which, rows = flight([], 50, exact=True)
    heading = INDEX["heading"]
    rows["voted"][:, heading] = 3.0 + 2 * np.pi - 0.01
    assert score(which, Table(rows)).vote_error["heading"].peak == pytest.approx(0.01)


def test_a_lost_flight_is_lost_and_its_last_row_may_hold_no_numbers():
    which, rows = flight([], 50)
    rows["end"][-1] = End.NOT_FINITE
    rows["truth"][-1] = rows["voted"][-1] = np.nan
    rows["channels"][-1, :, :] = np.nan
    found = score(which, Table(rows))
    assert (found.flight.survived, found.flight.end_reason, found.flight.frames) == (False, "not finite", 50)
    assert np.isfinite(found.flight.load_factor_max)


def test_coverage_counts_what_was_seen_and_nothing_else():
    which, rows = flight([], 20)
    rows["pattern"][5:, Q], rows["level"][8:, Q], rows["level"][12:, Q] = Pattern.P1_1, 2, 3
    seen = score(which, Table(rows)).coverage
    assert seen["pitch_rate"].patterns == ("normal", "1:1") and seen["pitch_rate"].levels == (4, 3, 2)
    assert seen["pitch_rate"].pattern_transitions == ("normal>1:1",)
    assert seen["pitch_rate"].level_transitions == ("2>3", "4>2")
    assert seen["roll_rate"].patterns == ("normal",) and seen["roll_rate"].level_transitions == ()
    assert seen["overall"].level_transitions == ("2>3", "4>2")
    assert (seen["pitch_rate"].patterns_possible, seen["pitch_rate"].pattern_transitions_possible) == (7, 42)


def test_possible_patterns_are_those_that_the_classification_can_give():
    from rig.computer.redundancy.compare import classify

    alone = np.zeros(CHANNELS, np.uint8)
    order = np.arange(CHANNELS)
    for fitted, possible in POSSIBLE.items():
        given_ = {
            Pattern(classify(np.cumsum([0, *gaps]).astype(float), order, n, 1.0, alone))
            for n in range(fitted + 1)
            for gaps in np.ndindex(*([3] * max(n - 1, 0)))
        }
        assert given_ == set(possible)


@settings(max_examples=max(2, round(12 / FEWER)), deadline=None)
@given(
    sizes=st.lists(st.sampled_from([0.0, 0.03, 0.15, 0.15, -0.15, 0.3, 0.6]), min_size=4, max_size=4),
    starts=st.lists(st.sampled_from([20, 20, 25, 40]), min_size=4, max_size=4),
    order=st.permutations(range(CHANNELS)),
)
def test_permuting_the_channels_permutes_the_score(sizes: list[float], starts: list[int], order: list[int]):
    """With sensors without errors the channels are alike, so that nothing but their numbers may change."""
    faults = [offset([c + 1], starts[c] / 100, sizes[c]) for c in range(CHANNELS)]
    moved = [offset([order[c] + 1], starts[c] / 100, sizes[c]) for c in range(CHANNELS)]
    a, b = scored(faults, 80, exact=True), scored(moved, 80, exact=True)
    assert outcomes(a) == outcomes(b)
    for field in ("false_alarms", "wrong_isolations"):
        there = sorted((i.signal, order[i.channel - 1] + 1, i.frame, i.decided_by) for i in getattr(a, field))
        assert there == sorted((i.signal, i.channel, i.frame, i.decided_by) for i in getattr(b, field))
    assert a.tie_break == b.tie_break and a.vote_error == b.vote_error and a.coverage == b.coverage


def test_rows_joined_by_numpy_score_the_same():
    which, rows = flight([offset([2], 0.2, 0.3)], 60)
    joined = np.concatenate([rows[:20], rows[20:]])
    unaligned = rows.astype(np.dtype({n: FLAT.fields[n][:2] for n in FLAT.names or ()}))  # type: ignore[index]
    whole = score(which, Table(rows)).as_dict()
    assert score(which, Table(joined)).as_dict() == score(which, Table(unaligned)).as_dict() == whole


@settings(max_examples=max(10, round(200 / FEWER)), deadline=None)
@given(st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=4))
def test_the_clean_vote_is_the_median_of_the_channels_that_are_fitted(samples: list[float]):
    record = np.zeros(1, PARAMS)
    record["fitted"], record["low"], record["high"] = len(samples), -100.0, 100.0
    channels = np.array([*samples, np.nan, np.nan][:CHANNELS])
    assert middle(channels, 0.0, record[0]) == pytest.approx(np.median(samples), abs=1e-12)
    channels[len(samples) - 1] = np.nan
    assert np.isnan(middle(channels, 0.0, record[0]))
