"""What became of faults of computers and links: who found them, and lanes and channels that were failed without one."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rig.core.frame import Block, Table
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.verdict.conclusion import conclusion
from rig.verdict.lane_tally import columns_of
from rig.verdict.score_records import Score
from rig.verdict.scoring import score

ONSET = 100


@cache
def scored(fault: str, *sets: str) -> Score:
    """Score two seconds of four computers with one fault, which begins at frame ONSET."""
    faults = f"faults=[{{{fault}, start_s=1.0}}]" if fault else "faults=[]"
    given = scenario.load(None, ["computers.count=4", "duration_s=2", faults, *sets])
    lanes: list[Block] = []
    rows = fly_rows(given, beside=lanes)
    return score(given, Table(rows, np.concatenate(lanes)))


WRONG = 'kind="wrong_command", signal="computer.B", surface="elevator", does="hardover"'


@pytest.mark.parametrize(
    ("fault", "by", "frames"),
    [
        (WRONG, "vote of commands", 5),  # 0.05 s, and a frame until accusations count
        ('kind="computer_stop", signal="computer.A"', "watchdog", 1),  # 0.02 s
        ('kind="link_frozen", signal="ccdl.D"', "link", 4),  # 0.05 s
        ('kind="link_byzantine", signal="ccdl.A-B", offset_thresholds=3.0', "relays", 0),
    ],
)
def test_a_fault_of_a_lane_or_of_a_link_has_who_found_it_and_when(fault: str, by: str, frames: int):
    found = scored(fault).faults[0]
    assert (found.outcome, found.decided_by, found.delay_from_onset_frames) == ("detected", by, frames)
    assert found.failed_frame == ONSET + frames and found.onset_frame == ONSET


@pytest.mark.parametrize(
    "fault", ['kind="computer_stop", signal="computer.A"', 'kind="link_loss", signal="ccdl.C"', WRONG]
)
def test_channels_that_are_failed_with_their_lane_are_no_false_alarms(fault: str):
    of = scored(fault)
    assert not of.false_alarms and not of.wrong_isolations


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ('kind="link_byzantine", signal="ccdl.B", offset_thresholds=1.5', ["computer B: voted out at"]),
        ('kind="power_loss", signal="bus.1"', ["computers A and C: lost at", "detected by their own watchdog"]),
        (WRONG, []),  # the row of its fault says so
    ],
)
def test_a_lane_that_is_lost_to_a_fault_elsewhere_has_a_row(fault: str, told: list[str]):
    given = scenario.load(None, ["computers.count=4", "duration_s=2", f"faults=[{{{fault}, start_s=1.0}}]"])
    rows = [line for line in conclusion(given, scored(fault)) if ": voted out at " in line or ": lost at " in line]
    assert len(rows) == bool(told) and all(text in rows[0] for text in told)


UNSEEN = ("computers.wrap_around.coverage=0", 'actuators.model="servo"')


@pytest.mark.parametrize(("surface", "by"), [("elevator", "spool"), ("throttle", None)])
def test_an_output_that_its_lane_does_not_see_is_found_by_the_servo_it_drives(surface: str, by: str | None):
    """The monitor of the spool waits for 0.1 s; its channel is no healthy one.  The throttle has no servo."""
    of = scored(f'kind="dac", signal="computer.B", surface="{surface}", does="hardover"', *UNSEEN)
    found = of.faults[0]
    assert (found.outcome, found.decided_by) == ("detected" if by else "missed", by)
    assert found.delay_from_onset_frames == (10 if by else None)
    assert not of.false_alarms and not of.wrong_isolations
    assert [(one.channel, one.cause) for one in of.actuators["elevator"].failures] == [(2, "own fault")] * bool(by)
    sentences = conclusion(of_flight(surface), of)
    assert ("detected after 100 ms by the spool monitor of its servo channel" in sentences[1]) == bool(by)


def of_flight(surface: str) -> scenario.Scenario:
    fault = f'{{kind="dac", signal="computer.B", surface="{surface}", does="hardover", start_s=1.0}}'
    return scenario.load(None, ["computers.count=4", "duration_s=2", f"faults=[{fault}]", *UNSEEN])


def test_what_all_lanes_compute_alike_is_missed():
    software = 'kind="software", signal="computer.all", surface="elevator", does="offset", offset=-0.02'
    assert scored(software).faults[0].outcome == "missed"


def test_a_lane_that_fails_itself_without_a_fault_is_a_false_alarm_and_beside_one_a_wrong_isolation():
    """At 100 alarms a second all lanes are failed in the first frames; in the other flight A is, after B."""
    of = scored("", "computers.false_alarm_per_hour=360000")
    assert {(one.signal, one.decided_by) for one in of.false_alarms} >= {("computer.A", "wrap-around")}
    tight = ("computers.commands=[]", "computers.false_alarm_per_hour=3600")
    both = scored(WRONG, *tight)
    lanes = [one for one in (*both.false_alarms, *both.wrong_isolations) if one.signal.startswith("computer.")]
    assert all((one.frame > ONSET) == (one in both.wrong_isolations) for one in lanes) and lanes


def test_a_fault_takes_the_columns_of_the_lanes_that_say_nothing_or_lie():
    def columns(fault: str) -> int:
        given = scenario.load(None, ["computers.count=4", f"faults=[{{{fault}, start_s=1.0}}]"])
        return columns_of(given.faults[0])

    assert columns('kind="computer_stop", signal="computer.C"') == 0b0100
    assert columns('kind="link_loss", signal="ccdl.D-A"') == 0b1000
    assert columns(WRONG) == 0
