"""Several computers in the report of a flight: who was failed by whom for what, and what the lanes commanded."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.flight.flight_result import Flight
from rig.flight.fly import fly
from rig.show.pages import lane_figures as computers
from rig.show.pages.course import Course
from rig.show.pages.flight_page import report
from rig.show.pages.timeline import Span, used
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

ONSET, FAILED = 100, 105
WRONG = 'kind="wrong_command", signal="computer.B", surface="elevator", does="hardover", start_s=1.0'


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    sets = ["duration_s=2.5", "computers.count=4", f"faults=[{{{WRONG}}}]"]
    return fly(None, overrides=sets, out=tmp_path_factory.mktemp("logs"))


def test_the_page_says_who_failed_which_lane_for_what_and_after_how_long(flight: Flight, tmp_path: Path):
    report(flight.log, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    told = "1.05 s: lane failed, B: by lanes A, C and D in the vote of commands, 50 ms after the onset of its fault"
    assert f"<li>{told}</li>" in page
    assert 'id="computers"' in page and 'id="commands"' in page


def test_the_states_are_those_of_lanes_and_of_votes_that_were_not_normal(flight: Flight):
    log = flight.recorded
    course = Course(log.table, 1)
    spans = [span for span in computers.states(course, log.rate_hz, 4) if span.row in ("lane B", "vote elevator")]
    told = [(span.row, round(span.begin_s, 2), round(span.end_s, 2), span.label) for span in spans]
    assert told[0] == ("lane B", 0.0, 1.04, "engaged")
    assert told[1:3] == [("lane B", 1.04, 1.05, "suspect"), ("lane B", 1.05, 2.5, "failed: vote of commands")]
    assert ("vote elevator", 1.0, 1.05, "isolated") in told
    lanes = {span.row for span in computers.states(course, log.rate_hz, 4)}
    assert lanes == {"lane A", "lane B", "lane C", "lane D", "leading lane", "vote elevator"}


def test_the_picture_shows_one_command_leave_the_threshold_of_the_others(flight: Flight):
    log, scored = flight.recorded, score_log(flight.log, Yardstick(), baseline=False)
    one = computers.happened(scored, log.events)
    assert one is not None and one.begin == ONSET - 50 and log.parts is not None
    kept = log.table[one.begin : one.end]
    figure: Any = computers.commands(kept, scored, one)
    low, high = flight.scenario.airframe.surface_limits[0]
    limit = np.degrees(flight.scenario.computers.command_threshold * (high - low))
    of_elevator = {line.name: np.array(line.y) for line in figure.data if line.yaxis == "y" and line.name}
    voted = of_elevator.pop("vote of the leading lane")
    beyond = {name: int((np.abs(values - voted) > limit).sum()) for name, values in of_elevator.items()}
    frames = one.end - ONSET  # a hardover goes on in the lane that is out
    assert beyond == {"lane A": 0, "lane B": frames, "lane C": 0, "lane D": 0}


def test_a_flight_with_one_computer_has_no_such_section(tmp_path: Path):
    plain = fly(None, overrides=["duration_s=0.5"], out=tmp_path)
    report(plain.log, tmp_path / "page.html")
    assert "<h2>Computers</h2>" not in (tmp_path / "page.html").read_text()


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """A computer stops: the channels of its sensors are failed without a fault on any of them."""
    sets = ["duration_s=2.5", "faults.0.start_s=1.0", "faults.0.duration_s=10", "computers.commands=[]"]
    return fly("f16_computer_stop", overrides=sets, out=tmp_path_factory.mktemp("out"))


def test_the_time_to_a_failure_without_a_fault_counts_from_the_first_suspect_frame(out: Flight, tmp_path: Path):
    found = report(out.log, tmp_path / "page.html")
    one = next(moment for moment in found["moments"] if moment["signal"] == "pitch_rate")
    persistence = out.scenario.redundancy.signals.pitch_rate.persistence
    assert one["isolated"] - one["first"] + 1 == persistence == 8
    page = (tmp_path / "page.html").read_text()
    assert f"{10 * (persistence - 1)} ms later ({persistence} frames)" in page and " 0 ms later" not in page


def test_the_timeline_begins_with_the_lanes_and_draws_signals_that_are_alike_once(out: Flight, tmp_path: Path):
    report(out.log, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    drawn = json.loads(page.partition('id="figures">')[2].partition("</script>")[0])["timeline"]
    rows = drawn["layout"]["yaxis"]["categoryarray"]
    assert rows[1:6] == ["lane A", "lane B", "lane C", "lane D", "leading lane"]
    channels = [row for row in rows if row.endswith("channel 1")]
    assert len(rows) < 49 and any("alike)" in row for row in channels)
    assert "states are equal in every frame" in page and drawn["layout"]["xaxis"]["range"] == [0.0, 2.5]


def test_a_channel_of_a_signal_without_a_channel_is_not_said_to_be_ok():
    level = [Span("level", 0.0, 1.0, "4 channels"), Span("level", 1.0, 3.0, "no channel")]
    found = list(used(Span("channel 1", 0.0, 3.0, "ok"), level))
    assert [(span.begin_s, span.end_s, span.label) for span in found] == [(0.0, 1.0, "ok"), (1.0, 3.0, "not used")]
    failed = Span("channel 2", 0.5, 3.0, "failed")
    assert list(used(failed, level)) == [failed]
