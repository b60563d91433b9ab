"""Two references against all channels: what they must agree on, for how long, and what becomes of the signal."""

import numpy as np
import pytest
from conftest import constant, rows, vote_samples
from hypothesis import given
from hypothesis import strategies as st

from rig.computer.analytic.reference_sources import FROM_UNIT, PARTNERS, SECOND, Config, second
from rig.core.frame import INDEX, DecidedBy, Source, State
from rig.flight.stages import redundancy
from rig.scenario import scenario
from rig.studies.campaign.flying import fly

TEN = constant(10, 10.1, 9.9, 10)


def contradicted(reference, other, samples=TEN, frames=5, fails=False, **more):
    more = {"threshold": 1.0, "reference_threshold": 1.0, **more}
    return vote_samples(samples, reference=reference, second=other, common=(frames, fails), **more)


@pytest.mark.requirement(
    "redundancy", "two references of different physics contradict all channels: reported, or lost by choice"
)
def test_it_is_reported_in_the_frame_in_which_it_has_persisted():
    found = contradicted(0.0, 0.0)
    assert found.common_mode.tolist() == [0] * 4 + [1] * 26
    assert (found.state == State.OK).all() and (found.voted == found.voted[0]).all()


@pytest.mark.requirement(
    "redundancy", "two references of different physics contradict all channels: reported, or lost by choice"
)
def test_by_choice_the_signal_is_lost_and_its_reference_usable():
    found = contradicted(0.0, 0.0, frames=12, fails=True)  # after the reference was set aside, at frame 8
    assert found.reference_usable[10] == 0
    assert found.failed_at() == [12] * 4 and found.level.tolist() == [4] * 11 + [0] * 19
    assert found.decided_by[11] == DecidedBy.COMMON and (found.reference_usable[11:] == 1).all()


def test_after_a_readmission_the_reference_has_its_whole_persistence_to_agree():
    resets = [(20, channel) for channel in (1, 2, 3, 4)]
    second = rows((12, 0.0), (18, np.nan))
    found = contradicted(0.0, second, fails=True, readmit_frames=1, resets=resets)
    assert found.level.tolist() == [4] * 4 + [0] * 16 + [4] * 10
    assert found.reference_usable.tolist() == [1] * 27 + [0] * 3


@pytest.mark.parametrize(
    ("reference", "other"),
    [
        (8.6, 8.4),  # within 1.5 thresholds of the vote
        (8.4, 8.6),
        (0.0, 2.1),  # further apart than both thresholds
        (20.0, 0.0),
        (np.nan, 0.0),
        (0.0, np.nan),
        (0.0, None),
        (np.inf, np.inf),
        (10.0, 10.0),
    ],
)
def test_two_that_do_not_agree_against_the_vote_say_nothing(reference, other):
    assert not contradicted(reference, other).common_mode.any()


def test_small_common_biases_are_below_the_monitors_own_threshold():
    assert not contradicted(9.1, 8.4, reference_threshold=0.1).common_mode.any()
    assert contradicted(8.9, 8.4, reference_threshold=0.1).common_mode.any()


def test_all_channels_must_agree():
    samples = TEN.copy()
    samples[:, 2] = 20.0  # failed at frame 8; the others are all that are in use then
    found = contradicted(0.0, 0.0, samples)
    assert found.common_mode.tolist() == [0] * 12 + [1] * 18
    samples[:, 3] = np.arange(30) * 1.0  # leaves the vote, and a frame without agreement begins the count again
    assert not contradicted(0.0, 0.0, samples, frames=3).common_mode[:8].any()


def test_two_channels_that_agree_are_a_vote_that_can_be_contradicted():
    found = contradicted(0.0, 0.0, constant(10, 10.1, np.nan, np.nan), channels=2)
    assert found.common_mode.tolist() == [0] * 4 + [1] * 26


def test_a_last_channel_is_no_common_mode():
    samples = np.full((30, 4), np.nan)
    samples[:, 0] = 10.0
    assert not contradicted(0.0, 0.0, samples).common_mode.any()


def test_nor_is_one_whose_reference_was_set_aside_before():
    samples = rows((8, (10, 10, 10, 10)), (22, (10, np.nan, np.nan, np.nan)))
    found = contradicted(0.0, rows((16, np.nan), (14, 0.0)), samples)
    assert (found.level[16:] == 1).all() and (found.reference_usable[8:] == 0).all() and (found.voted == 10).all()
    assert not found.common_mode.any()


def test_angles_are_compared_the_short_way_round():
    near_the_turn = constant(3.1, 3.1, 3.1, 3.1)
    limits = {"wraps": True, "limits": (-np.pi, np.pi), "threshold": 0.2, "reference_threshold": 0.2}
    assert not contradicted(-3.1, -3.1, near_the_turn, **limits).common_mode.any()
    assert contradicted(-1.0, -1.0, near_the_turn, **limits).common_mode.any()


@pytest.mark.requirement(
    "redundancy", "two references of different physics contradict all channels: reported, or lost by choice"
)
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.1, 5), st.floats(0.1, 5))
def test_it_is_the_rule_of_the_page(reference, other, threshold, own):
    found = contradicted(reference, other, threshold=own, reference_threshold=threshold, samples=constant(*[10.0] * 4))
    off = abs(10.0 - reference) > max(1.5 * threshold, own)
    second_off = abs(10.0 - other) > 1.5 * own  # the second has the monitor's threshold here
    assert bool(found.common_mode[-1]) == (off and second_off and abs(reference - other) <= threshold + own)


def test_a_second_reference_reads_nothing_that_the_first_reads():
    for (signal, chosen), other in SECOND.items():
        read = [set(PARTNERS[signal, s]) | set(FROM_UNIT[signal] if s == "inertial" else ()) for s in (chosen, other)]
        assert not read[0] & read[1] and signal not in read[0] | read[1], (signal, chosen)


def test_both_references_of_a_signal_are_those_that_it_has_alone():
    """In one flight: the second reference is what the same source says as the first."""
    flown = {}
    for chosen in ("load_factor", "inertial"):
        sets = [f"redundancy.references.angle_of_attack={chosen}", "duration_s=5", "faults=[]"]
        flown[chosen] = fly(scenario.load(None, sets)).rows
    s = INDEX["angle_of_attack"]
    for one, other in (("load_factor", "inertial"), ("inertial", "load_factor")):
        assert (flown[one]["second_reference"][:, s] == flown[other]["reference"][:, s]).all()


def test_a_signal_without_a_reference_has_no_second():
    config = Config(pitch_rate="none")
    assert second(config, "pitch_rate") == "none" and second(Config(), "heading") == "none"
    assert second(Config(), "pitch_rate") == "inertial"


@pytest.mark.parametrize("signal", ["pitch_rate", "angle_of_attack"])
def test_gyros_and_vanes_that_run_away_together_lose_the_aircraft_or_the_signal(signal):
    fault = f'faults=[{{kind="hardover", signal="{signal}", channels=[1,2,3,4], start_s=3.0}}]'
    reported = fly(scenario.load(None, [fault, "duration_s=20", 'redundancy.common_mode="report"']))
    assert not reported.verdict.survived and (reported.rows["common_mode"][:, INDEX[signal]] == 1).any()
    failed = fly(scenario.load(None, [fault, "duration_s=20"]))
    assert failed.verdict.survived and failed.verdict.failed == {signal: [1, 2, 3, 4]}
    assert failed.rows["source"][-1, INDEX[signal]] == Source.REFERENCE
    names = {event.name for event in failed.events}
    assert "common mode" in names


@pytest.mark.parametrize(
    ("sets", "reported"),
    [
        ([], set()),
        (["control.law=fault-tolerant"], {"pitch_angle"}),
        (["control.law=fault-tolerant", "redundancy.signals.pitch_angle.common_mode=fail"], set()),
        (["redundancy.signals.heading.common_mode=report"], {"heading"}),
        (["redundancy.common_mode=report", "redundancy.signals.heading.common_mode=fail"], {*INDEX} - {"heading"}),
    ],
)
def test_a_common_mode_fails_all_but_what_the_law_tests_itself_unless_the_signal_says_otherwise(sets, reported):
    fails = redundancy(scenario.load(None, sets)).manager.params["common_fails"]
    assert {name for name, s in INDEX.items() if not fails[s]} == reported


def test_a_log_from_before_the_rule_is_flown_as_it_was():
    data = scenario.load().resolved()
    del data["redundancy"]["common_mode"]
    assert scenario.from_resolved(data, "log").redundancy.common_mode == "report"


def test_a_wrong_pair_that_in_line_monitors_keep_is_failed_by_both_references():
    found = fly(scenario.load("f16_split_2_2_wrong_ilm", ["duration_s=15"]))
    s = INDEX["pitch_rate"]
    by_ilm, by_both = (int((found.rows["state"][:, s, c] == State.FAILED).argmax()) for c in (0, 2))
    assert by_both == by_ilm + 10 and found.rows["decided_by"][by_both, s] == DecidedBy.COMMON
    assert (found.rows["source"][by_both:, s] == Source.REFERENCE).all()
