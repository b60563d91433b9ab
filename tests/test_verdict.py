"""Bundled scenarios flown and scored: every frame below follows from the scenario's times and the settings."""

from functools import cache

import numpy as np
import pytest

from rig.computer.analytic.reference_sources import FROM_UNIT
from rig.core.errors import BadInput
from rig.core.frame import SIGNALS, Table
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.verdict.score_records import FaultScore, Score
from rig.verdict.scoring import score
from rig.verdict.transients import fly_baseline

PERSISTENCE, SPLITS = 8, 10  # frames, aircraft/defaults.toml


@cache
def scored(name: str, *overrides: str) -> Score:
    which = scenario.load(name, overrides)
    return score(which, Table(fly_rows(which)))


def frames_of(fault: FaultScore) -> tuple[int | None, int | None, int | None]:
    return fault.onset_frame, fault.exceeded_frame, fault.failed_frame


def places(found: Score) -> list[tuple[str, int | None, str]]:
    return [(fault.signal, fault.channel, fault.outcome) for fault in found.faults]


def failed(found: list) -> list[tuple[str, int, int, str]]:
    return [(each.signal, each.channel, each.frame, each.decided_by) for each in found]


def test_a_hardover_is_detected_at_its_eighth_frame():
    found = scored("f16_pitch_rate_hardover", "duration_s=25")
    (fault,) = found.faults
    assert frames_of(fault) == (2000, 2000, 2000 + PERSISTENCE - 1)
    assert (fault.id, fault.signal, fault.channel) == ("hardover pitch_rate.3", "pitch_rate", 3)
    assert (fault.kind, fault.outcome, fault.decided_by) == ("hardover", "detected", "comparison")
    assert (fault.delay_from_onset_frames, fault.delay_from_exceeded_frames) == (7, 7)
    assert fault.exceeded_run_frames == 500 and not fault.tolerated
    assert fault.peak_error == pytest.approx(1.5, abs=0.01)  # to the end of the range from nearly nothing
    assert found.false_alarms == found.wrong_isolations == found.episodes == []
    assert found.coverage["pitch_rate"].levels == (4, 3)
    assert found.coverage["overall"].pattern_transitions == ("normal>isolated", "isolated>normal")


def test_two_failures_in_a_row_are_both_detected():
    found = scored("f16_two_pitch_rate_failures", "duration_s=40")
    assert [frames_of(fault) for fault in found.faults] == [(1500, 1500, 1507), (3500, 3500, 3507)]
    assert found.coverage["pitch_rate"].levels == (4, 3, 2)


def test_a_drift_exceeds_the_threshold_when_its_rate_says():
    found = scored(
        "f16_angle_of_attack_drift",
        "faults.0.rate_per_s=0.003",
        "duration_s=25",
        "redundancy.signals.angle_of_attack.slow_tests=false",
    )
    (fault,) = found.faults
    # 0.003 rad/s (t - 10 s) > 0.035 rad, the threshold: the first frame after 21.6667 s
    assert (fault.onset_frame, fault.exceeded_frame) == (1000, 2167)
    assert fault.outcome == "detected" and fault.failed_frame is not None
    assert fault.delay_from_exceeded_frames == fault.failed_frame - 2167


def test_a_transient_shorter_than_the_persistence_is_missed_and_said_to_be_tolerated():
    found = scored("f16_roll_rate_transient", "duration_s=12")
    (fault,) = found.faults
    assert frames_of(fault) == (1000, 1000, None)
    assert (fault.outcome, fault.exceeded_run_frames, fault.tolerated) == ("missed", 5, True)
    assert found.vote_error["roll_rate"].above_threshold_s == 0.0


def test_a_channel_after_the_other_is_lost_until_none_is_left():
    found = scored("f16_lost_pitch_rate", "duration_s=26")
    onsets = [1000, 1500, 2000, 2500]
    assert [frames_of(fault) for fault in found.faults] == [(k, k, k + 7) for k in onsets]
    assert found.faults[2].peak_error is None  # a dropout has no size
    assert found.coverage["pitch_rate"].level_transitions == ("1>0", "2>1", "3>2", "4>3")
    assert "lost" in found.coverage["pitch_rate"].patterns


def test_in_line_monitors_settle_a_split_rightly():
    found = scored("f16_split_2_2_ilm", "duration_s=12")
    assert [frames_of(fault) for fault in found.faults] == [(1000, 1000, 1000 + SPLITS - 1)] * 2
    assert {fault.decided_by for fault in found.faults} == {"ilm"}
    (episode,) = found.episodes
    assert (episode.pattern, episode.first_frame, episode.frames) == ("2:2", 1000, SPLITS)
    assert (episode.decided_by, episode.failed, episode.verdict, episode.asked) == ("ilm", (3, 4), "correct", ("ilm",))
    assert (found.tie_break["ilm"].answered, found.tie_break["ilm"].correct, found.tie_break["ilm"].wrong) == (1, 1, 0)
    assert found.tie_break_by_pattern["2:2"]["ilm"].correct == 1


def test_in_line_monitors_that_lie_make_a_wrong_isolation():
    found = scored("f16_split_2_2_wrong_ilm", "duration_s=12", 'redundancy.common_mode="report"')
    assert failed(found.wrong_isolations) == [("pitch_rate", 1, 1009, "ilm"), ("pitch_rate", 2, 1009, "ilm")]
    assert found.false_alarms == []
    assert places(found) == [
        ("pitch_rate", 3, "missed"),
        ("pitch_rate", 4, "missed"),
        ("pitch_rate", 1, "undetectable"),  # a wrong monitor spoils no sample
        ("pitch_rate", 2, "undetectable"),
    ]
    assert (found.tie_break["ilm"].correct, found.tie_break["ilm"].wrong, found.unresolved) == (0, 1, 0)
    # From the frame of the split to the end the vote is that of the wrong pair: an offset of 0.15 rad/s.
    error = found.vote_error["pitch_rate"]
    assert error.above_threshold_s == error.above_threshold_after_onset_s == 2.0
    assert error.peak == pytest.approx(0.15, abs=0.01) and error.clean_peak == pytest.approx(0.15, abs=0.01)


def test_the_trend_alone_fails_the_good_pair_of_a_common_offset():
    found = scored("f16_common_offset_trend", "duration_s=12")
    assert failed(found.wrong_isolations) == [
        ("normal_load_factor", 1, 1026, "trend"),
        ("normal_load_factor", 2, 1026, "trend"),
    ]
    assert [fault.outcome for fault in found.faults] == ["missed", "missed"]
    assert (found.tie_break["trend"].asked, found.tie_break["trend"].wrong) == (1, 1)
    (split,) = (e for e in found.episodes if e.signal == "normal_load_factor")
    assert split.asked == ("trend",)  # no other is among its tie-break rules


def test_extremes_and_reference_settle_four_ways_apart():
    wide = "redundancy.references.pitch_rate=angle_of_attack"  # by the default one a single sample is near
    found = scored("f16_split_1_1_1_1", "duration_s=12", wide)
    by_channel = {fault.channel: fault for fault in found.faults}
    assert {c: fault.decided_by for c, fault in by_channel.items()} == {2: "reference", 3: "extremes", 4: "extremes"}
    assert by_channel[3].failed_frame == by_channel[4].failed_frame == 1009
    assert [(e.pattern, e.verdict) for e in found.episodes] == [("1:1:1:1", "correct"), ("1:1", "correct")]
    assert found.episodes[1].first_frame == 1010


def test_brisk_manoeuvres_without_a_fault_score_clean():
    found = scored("f16_identification_3211")
    assert found.faults == found.false_alarms == found.wrong_isolations == []
    assert all(error.clean_peak < 1e-12 for error in found.vote_error.values())


@pytest.mark.parametrize(("aircraft", "seed"), [("f16", 7260032431716226580), ("b737", 6196744445890322056)])
def test_full_deflections_without_a_fault_isolate_no_stick(aircraft: str, seed: int):
    """Samples are cut off at a stop: with these tolerances a healthy stick channel was once isolated after it."""
    doublet = '{{kind="doublet",axis="{}",start_s={},amplitude=1.0,duration_s={}}}'
    manoeuvres = ",".join(
        doublet.format(*each) for each in (("stick_pitch", 8, 4), ("stick_roll", 3, 3), ("pedal", 12, 5))
    )
    given = (f"aircraft={aircraft}", "flight_point=20000ft_m06", "duration_s=20", f"seed={seed}", "turbulence=light")
    pilot = ("pilot.autopilot_engaged=false", f"pilot.manoeuvres=[{manoeuvres}]")
    found = scored("f16_altitude_step_turbulence", *given, *pilot)
    assert found.false_alarms == []


@pytest.mark.parametrize("signal", ["stick_pitch", "stick_roll", "pedal"])
def test_levers_that_stand_still_hide_no_stuck_sensor(signal: str):
    """Neither two of four, nor a third of the last two: the healthy one moves by its noise alone."""
    stuck = '{{kind="stuck",signal="{}",channels=[{}],start_s={}}}'
    faults = ",".join(stuck.format(signal, *each) for each in (("1,2", 5), ("3", 8)))
    found = scored("f16_altitude_step_turbulence", "duration_s=10", f"faults=[{faults}]")
    assert places(found) == [(signal, c, "detected") for c in (1, 2, 3)]
    assert found.false_alarms == found.wrong_isolations == []


@pytest.mark.parametrize("manager", ["mean", "median"])
def test_a_manager_that_fails_no_channel_misses(manager: str):
    found = scored("f16_pitch_rate_hardover", "duration_s=21", f"redundancy.manager={manager}")
    assert [fault.outcome for fault in found.faults] == ["missed"]
    error = found.vote_error["pitch_rate"]
    if manager == "mean":  # a quarter of 1.5 rad/s
        assert error.above_threshold_after_onset_s > 0 and error.clean_peak > 0.3


def test_a_fault_whose_time_never_comes_or_whose_channel_is_out_is_not_executed():
    found = scored(
        "f16_two_pitch_rate_failures",
        "duration_s=17",
        'faults.1={kind="offset",signal="pitch_rate",channels=[1],start_s=16,offset=0.3}',
    )
    assert [fault.outcome for fault in found.faults] == ["detected", "not executed"]
    assert frames_of(found.faults[1]) == (1600, None, None)
    found = scored("f16_two_pitch_rate_failures", "duration_s=17")
    assert (found.faults[1].outcome, found.faults[1].onset_frame) == ("not executed", None)


def test_a_fault_on_the_inertial_unit_is_seen_by_the_monitor_of_the_references():
    place = 'faults=[{kind="offset",signal="inertial.pitch_rate_rad_s",start_s=2,offset=0.5}]'
    found = scored("f16_pitch_rate_hardover", "duration_s=4", place, "redundancy.references.pitch_rate=inertial")
    (fault,) = found.faults
    assert (fault.signal, fault.channel, fault.outcome) == ("inertial.pitch_rate_rad_s", None, "detected")
    assert frames_of(fault) == (200, 200, 207)
    reading = [name for name, read in FROM_UNIT.items() if "pitch_rate_rad_s" in read]
    off = [f"redundancy.references.{name}=none" for name in reading]
    unread = scored("f16_pitch_rate_hardover", "duration_s=4", place, *off)
    assert (unread.faults[0].outcome, unread.faults[0].onset_frame) == ("undetectable", 200)
    assert unread.false_alarms == found.false_alarms == []


@pytest.fixture(scope="module")
def baseline_of_hardover():
    which = scenario.load("f16_pitch_rate_hardover", ["duration_s=6", "faults.0.start_s=3", "redundancy.manager=mean"])
    rows, baseline = fly_rows(which), fly_baseline(which)
    return which, rows, baseline


def test_transients_are_the_largest_differences_from_the_baseline_within_the_window(baseline_of_hardover):
    which, rows, baseline = baseline_of_hardover
    transients = score(which, Table(rows), baseline).flight.transients
    assert transients is not None
    (window,) = transients.windows
    n = min(len(rows), len(baseline))
    nz = [s.name for s in SIGNALS].index("normal_load_factor")
    off = np.abs(rows["truth"][:n, nz] - baseline["truth"][:n, nz])
    assert window.onset_frame == 300 and window.faults == ("hardover pitch_rate.3",)
    assert window.peaks.load_factor == off[300:501].max()
    assert transients.overall.load_factor == off.max()
    assert transients.first_difference_frame == 301  # the aircraft moves a frame after its surfaces
    assert not window.within_limits and transients.out_of_limits_s > 0  # the mean flies the fault


def test_without_a_fault_the_baseline_is_the_flight(baseline_of_hardover):
    which, _, baseline = baseline_of_hardover
    healthy = which.model_copy(update={"faults": []})
    rows = fly_rows(healthy)
    for name in rows.dtype.names or ():  # fields: padding does not survive a copy
        assert rows[name].tobytes() == baseline[name].tobytes(), name
    transients = score(healthy, Table(rows), fly_baseline(healthy)).flight.transients
    assert transients is not None
    assert transients.first_difference_frame is None and transients.windows == () and transients.within_limits
    assert transients.overall.load_factor == 0.0 == transients.out_of_limits_s


def test_the_baseline_of_another_flight_is_refused(baseline_of_hardover):
    which, rows, baseline = baseline_of_hardover
    other = baseline.copy()
    other["truth"][300, 0] += 1e-12  # no fault can have moved the aircraft in the frame of its onset
    with pytest.raises(BadInput, match="differs from the flight in frame 300"):
        score(which, Table(rows), other)


def test_a_score_is_the_same_every_time(baseline_of_hardover):
    which, rows, baseline = baseline_of_hardover
    assert score(which, Table(rows), baseline).as_dict() == score(which, Table(rows.copy()), baseline.copy()).as_dict()
