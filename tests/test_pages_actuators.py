"""The actuators in the report of a flight: what was shut off, when, by whom, and what its monitors compared."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_verdict_actuators import HARDOVER, ONSET, given

from rig.core.palette import RED
from rig.flight.flight_result import Flight
from rig.flight.fly import fly
from rig.show.pages.flight_page import report
from rig.show.pages.servo_figures import happened, of_actuator
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return fly(None, overrides=given((HARDOVER,)), out=tmp_path_factory.mktemp("logs"))


def test_the_page_has_the_surface_with_channel_time_and_monitor(flight: Flight, tmp_path: Path):
    report(flight.log, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "<b>elevator</b>: channel 2 shut off at 1.04 s by the current monitor." in page
    assert 'id="actuator-elevator"' in page and 'id="actuator-rudder"' not in page


def test_the_picture_shows_the_channel_leave_its_threshold_and_end(flight: Flight):
    log, scored = flight.recorded, score_log(flight.log, Yardstick(), baseline=False)
    (one,) = happened(scored)
    assert (one.surface, one.begin) == ("elevator", ONSET - 50)
    assert log.parts is not None
    kept = log.table[one.begin : one.end]
    figure: Any = of_actuator(kept, scored, one)
    currents = {line.name: np.array(line.y) for line in figure.data if line.yaxis == "y2"}
    beyond = {name: int((np.abs(values) > 0.25).sum()) for name, values in currents.items()}
    assert beyond == {"channel 1": 0, "channel 2": 5, "channel 3": 0, "channel 4": 0}
    assert np.isnan(currents["channel 2"][56:]).all() and not np.isnan(currents["channel 1"]).any()
    levels = {shape.y0 for shape in figure.layout.shapes if shape.yref == "y2"}
    assert levels == {-0.25, 0.25}


def test_a_flight_without_servos_has_no_such_section(tmp_path: Path):
    plain = fly(None, overrides=["duration_s=0.5"], out=tmp_path)
    report(plain.log, tmp_path / "page.html")
    assert "<h2>Actuators</h2>" not in (tmp_path / "page.html").read_text()


def test_the_timeline_runs_from_the_start_and_shows_the_shut_off(flight: Flight, tmp_path: Path):
    report(flight.log, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    drawn = json.loads(page.partition('id="figures">')[2].partition("</script>")[0])["timeline"]
    assert drawn["layout"]["xaxis"]["range"] == [0.0, len(flight.rows) / flight.scenario.rate_hz]
    shut = next(trace for trace in drawn["data"] if trace["name"] == "shut off: current monitor")
    assert (shut["y"], shut["marker"]["color"]) == (["elevator channel 2"], RED)
    assert shut["customdata"][0].startswith("1.04 to ")
    rows = drawn["layout"]["yaxis"]["categoryarray"]
    assert "elevator moved by" in rows and not any(row.startswith("rudder") for row in rows)


def test_what_the_monitors_compare_jumps_in_the_frame_of_the_onset(flight: Flight, tmp_path: Path):
    report(flight.log, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    drawn = json.loads(page.partition('id="figures">')[2].partition("</script>")[0])["actuator-elevator"]
    shapes = {trace["line"].get("shape") for trace in drawn["data"] if trace["yaxis"] != "y"}
    assert shapes == {"hv"}


def test_the_page_says_what_the_bundled_scenario_prints(tmp_path: Path):
    flown = fly("f16_elevator_coil_hardover", overrides=["duration_s=8"], out=tmp_path)
    page = (Path(__file__).parents[1] / "docs" / "how-to" / "computers-and-servos.md").read_text()
    label, _, told = report(flown.log, tmp_path / "page.html")["conclusion"][1].partition(": ")
    assert f"{label}   {told}" in page and "after 40 ms" in told
