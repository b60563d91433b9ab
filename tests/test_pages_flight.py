"""``rig report``: the page of one flight, what it shows and when, and what it refuses."""

import base64
import json
import re
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import outside
import pytest
from browser import visit

from rig.core.frame import INDEX, State, Table, new_block
from rig.core.palette import RED
from rig.flight.fly import Flight, fly
from rig.show.pages.course import Course
from rig.show.pages.decision_figure import squeezed
from rig.show.pages.flight_figures import of_flight, spanned, surfaces, vote_errors
from rig.show.pages.flight_page import report
from rig.show.pages.lines import MOST_POINTS, errors, line, of_signal, of_surface, thinned
from rig.show.pages.timeline import spans
from rig.show.pages.timeline_looks import LOOKS

OLD = Path(__file__).parent / "logs"
SHORT = ["duration_s=6", "faults.0.start_s=3", "redundancy.signals.pitch_rate.persistence=6"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return fly("f16_pitch_rate_hardover", overrides=SHORT, out=tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def page(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str]:
    out = tmp_path_factory.mktemp("report") / "report.html"
    return report(flight.log, out), out.read_text()


def figures(text: str) -> dict[str, Any]:
    return json.loads(re.search(r'id="figures">(.*?)</script>', text, re.DOTALL).group(1))  # type: ignore[union-attr]


def numbers(data: dict[str, Any]) -> np.ndarray:
    """An array as plotly writes it."""
    return np.frombuffer(base64.b64decode(data["bdata"]), data["dtype"])


def test_the_page_says_what_happened_and_what_was_flown(page: tuple[dict[str, Any], str], flight: Flight):
    found, text = page
    head = re.sub(r"<[^>]+>|\s+", " ", text[text.index("<h1>") : text.index("<h2>Timeline")])
    assert "Survived : F-16 pitch-rate hardover" in head and "manager cross-channel" in head
    for override in SHORT:
        assert override.replace("=6", "=6.0") in head or override.replace("=3", "=3.0") in head or override in head
    assert "1 of 1" in head and "50 ms" in head  # 6 frames of miscompare
    for sentence in found["conclusion"]:
        assert sentence in text
    assert flight.digest in text and "jsbsim-rig" in text and "seed 1" in head


def test_the_decision_is_shown_from_half_a_second_before_to_a_second_after(page: tuple[dict[str, Any], str]):
    found, text = page
    (one,) = found["moments"]
    assert one == {"signal": "pitch_rate", "first": 300, "isolated": 305, "begin": 250, "end": 406}
    drawn = figures(text)["moment-pitch_rate"]
    truth = next(trace for trace in drawn["data"] if trace.get("name") == "true value")
    assert numbers(truth["x"])[[0, -1]] == pytest.approx([2.5, 4.05])


def test_a_hardover_does_not_flatten_the_others(page: tuple[dict[str, Any], str]):
    _, text = page
    drawn = figures(text)["signal-pitch_rate"]
    low, high = drawn["layout"]["yaxis"]["range"]
    assert -10.0 < low < 0.0 < high < 10.0  # deg/s; the hardover is at 85.9
    assert any(trace.get("name") == "channel 3 (to +85.9 deg/s)" for trace in drawn["data"])
    assert drawn["layout"]["yaxis"]["title"]["text"] == "pitch_rate, deg/s"


def test_the_decision_has_the_faulty_channel_the_active_fault_and_the_isolation(page: tuple[dict[str, Any], str]):
    drawn = figures(page[1])["moment-pitch_rate"]
    said = [note["text"].strip() for note in drawn["layout"]["annotations"]]
    assert said == [
        *("peak of channel 3: +30", "± isolation threshold 2.86 deg/s", "limit (persistence): 6"),
        *("fault active: 3.00 to 4.05 s", "first miscompare at 3.00 s", "isolated at 3.05 s"),
    ]
    lines = {trace["name"]: trace for trace in drawn["data"]}
    assert "reference" not in lines  # it decided nothing
    values, (low, high) = numbers(lines["channel 3"]["y"]), drawn["layout"]["yaxis"]["range"]
    assert (
        low < values.min()
        and values.max() < high
        and squeezed(np.array([30.0]))[0] == pytest.approx(values.max(), rel=0.01)
    )
    counted = numbers(lines["miscompares of channel 3"]["y"])
    assert counted[49:57].tolist() == [0, 1, 2, 3, 4, 5, 6, 0]


def test_each_heading_of_a_legend_has_one_variable_and_no_two_of_its_states_look_alike(split: Path):
    found: dict[str, dict[str, Any]] = {}
    for trace in figures(split.read_text())["timeline"]["data"]:
        found.setdefault(trace["legendgrouptitle"]["text"], {})[trace["name"]] = trace["marker"]
    assert set(found["channel"]) == {"ok", "suspect", "failed"} and set(found["pattern"]) == {"normal", "2:2"}
    for states in found.values():
        looks = {(look["color"], look.get("pattern", {}).get("shape", "")) for look in states.values()}
        assert len(looks) == len(states) and sum(not shape for _, shape in looks) <= 1
    assert all(looks[name].hatch for looks in LOOKS.values() for name in ("suspect", "failed") if name in looks)


def test_the_axis_of_a_decision_is_linear_to_one_threshold_and_logarithmic_beyond():
    values = np.array([-100.0, -1.0, -0.5, 0.0, 0.5, 1.0, 10.0, np.nan])
    assert squeezed(values) == pytest.approx([-3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, np.nan], nan_ok=True)


def test_the_lanes_change_when_the_fault_begins_and_when_the_channel_is_failed(flight: Flight):
    course = Course(Table(flight.rows), 1)
    found = spans(course, 100.0, ["pitch_rate"], ["hardover pitch_rate.3"])
    by = {(span.row, span.label): (span.begin_s, span.end_s) for span in found}
    assert by["fault hardover pitch_rate.3", "acting"] == (3.0, 6.0)
    assert by["pitch_rate channel 3", "failed"] == (3.05, 6.0)
    assert by["pitch_rate level", "4 channels"] == (0.0, 3.05) and by["pitch_rate level", "3 channels"] == (3.05, 6.0)
    assert {lane for lane, _ in by if lane.startswith("roll_rate")} == set()


def test_the_page_asks_nothing_of_a_network(page: tuple[dict[str, Any], str]):
    _, text = page
    assert not re.search(r"<(script|link|img|iframe)[^>]*\s(src|href)=[\"']?(https?:|//)", text)
    assert text.count("plotly.js v") == 1 and "@media print" in text


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a 2:2 that the reference settles."""
    folder = tmp_path_factory.mktemp("split")
    flown = fly("f16_split_2_2_level", overrides=["duration_s=12"], out=folder)
    report(flown.log, folder / "split.html")
    return folder / "split.html"


def test_the_decision_draws_the_reference_that_decided_and_the_frames_that_it_took(split: Path):
    drawn = figures(split.read_text())["moment-pitch_rate"]
    lines = {trace["name"]: trace for trace in drawn["data"] if "name" in trace}
    assert len(numbers(lines["reference"]["y"])) == 160  # 9.5 to 11.09 s
    counted = numbers(lines["split 2:2"]["y"])
    assert counted.max() == 10.0 and counted[50:60].tolist() == list(range(1, 11))
    said = [note["text"] for note in drawn["layout"]["annotations"]]
    assert [text for text in said if "limit" in text] == ["limit (split persistence): 10"]


def test_thresholds_and_who_decided_are_named_with_their_figures(split: Path):
    text = split.read_text()
    cards = re.findall(r'<div class="card"><b[^>]*>(.*?)</b><span>(.*?)</span>', text)
    assert ("reference", "detected the faults or isolated the channels") in cards
    assert "pitch_rate: error limit 2.86 deg/s" in text and "The error limit of a signal is also its isolation" in text
    drawn = figures(text)["moment-pitch_rate"]["layout"]
    assert "± isolation threshold 2.86 deg/s" in [note["text"] for note in drawn["annotations"]]
    assert drawn["yaxis"]["title"]["text"] == "isolation thresholds"
    assert figures(text)["votes"]["data"][0]["name"] == "pitch_rate, error limit 2.86 deg/s"


def test_channels_differ_by_colour_and_dash_and_no_line_is_red(split: Path):
    drawn = figures(split.read_text())
    lines = [trace for trace in drawn["moment-pitch_rate"]["data"] if trace.get("name", "").startswith("channel")]
    assert len({trace["line"]["color"] for trace in lines}) == len({trace["line"]["dash"] for trace in lines}) == 4
    every = [trace for name, figure in drawn.items() if name != "timeline" for trace in figure["data"]]
    assert RED not in {trace["line"].get("color") for trace in every}
    failed = next(trace for trace in drawn["timeline"]["data"] if trace["name"] == "failed")
    assert failed["marker"]["color"] == RED


@pytest.mark.parametrize(
    ("manager", "threshold", "counted", "said"),
    [
        ("mean", False, False, "the manager mean isolates no channel"),
        ("cusum", False, False, "isolated at"),
        ("cross-voter", True, True, "isolated at"),
    ],
)
def test_a_threshold_and_counts_are_shown_only_of_a_manager_that_has_them(
    tmp_path: Path, manager: str, threshold: bool, counted: bool, said: str
):
    overrides = ["duration_s=4", "faults.0.start_s=2", f"redundancy.manager={manager}"]
    flown = fly("f16_pitch_rate_hardover", overrides=overrides, out=tmp_path)
    report(flown.log, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    drawn = figures(text)["moment-pitch_rate"]["layout"]
    notes = [note["text"] for note in drawn["annotations"]]
    bands = [shape for shape in drawn["shapes"] if shape["type"] == "rect" and (shape["y0"], shape["y1"]) == (-1, 1)]
    assert [bool(bands), "± isolation threshold 2.86 deg/s" in notes] == [threshold, threshold]
    assert ("1 error limit: 2.86 deg/s" in notes) is not threshold
    assert ["yaxis2" in drawn, "limit (persistence): 8" in notes] == [counted, counted]
    body = text[text.index("<h1>") : text.index('id="figures"')]
    assert said in body and ("isolation thresholds." in body) is threshold
    assert ("The decision" in body) is (manager != "mean")


@outside.needs("chromium")
@pytest.mark.long
def test_in_a_browser_every_lane_has_its_name_and_nothing_lies_on_it(split: Path, tmp_path: Path):
    named = {f"pitch_rate {of}" for of in ("channel 1", "channel 2", "channel 3", "channel 4", "pattern", "level")}
    for width, seen in zip((1280, 390), visit(split, tmp_path, 1280, 390), strict=True):
        assert seen.console == [] and seen.right <= width
        assert seen.drawn >= len(figures(split.read_text()))
        assert named < {text.text for text in seen.of("timeline", "ytick")}
        for figure in ("timeline", "votes", "moment-pitch_rate"):
            texts = [text for text in seen.texts if text.figure == figure]
            covered = [(a.text, b.text) for a, b in combinations(texts, 2) if a.covers(b)]
            assert [pair for pair in covered if "time, s" in pair] == []
            assert seen.of(figure, "legendtext") == []  # the legend is below the figure, not on it


def test_a_quiet_flight_has_no_decision_and_its_title_cannot_end_the_page(tmp_path: Path):
    overrides = ["duration_s=1", "faults=[]", "title='</script><b>x'"]
    flown = fly("f16_pitch_rate_hardover", overrides=overrides, out=tmp_path)
    found = report(flown.log, tmp_path / "quiet.html")
    text = (tmp_path / "quiet.html").read_text()
    assert found["shown"] == [] and found["moments"] == []
    assert "</script><b>x" not in text and "No fault acted" in text
    assert {"votes", "surfaces"} == set(figures(text))


def test_the_command_writes_beside_the_log_and_prints_one_object(rig_command: Any, flight: Flight):
    code, out, _ = rig_command("report", str(flight.log), "--json")
    found = json.loads(out)
    assert code == 0 and found["report"] == str(flight.log.with_suffix(".html"))
    assert Path(found["report"]).stat().st_size > 1e6 and found["faults"][0]["outcome"] == "detected"


@pytest.mark.parametrize(("name", "why"), [("vote_schema_2.mcap", ""), ("missing.mcap", "no such file")])
def test_what_is_no_log_of_a_flight_is_refused_in_one_line(rig_command: Any, tmp_path: Path, name: str, why: str):
    code, out, err = rig_command("report", str(OLD / name), "--out", str(tmp_path / "report.html"))
    assert (code, out) == (2, "") and err.count("\n") == 1 and name in err and why in err
    assert not (tmp_path / "report.html").exists()


def test_a_thinned_line_keeps_its_extremes():
    values = np.zeros(50_000)
    values[[17, 33_333]] = -7.0, 9.0
    values[100:200] = np.nan
    chosen = thinned(values)
    assert len(chosen) <= MOST_POINTS and {17, 33_333} <= set(chosen.tolist())
    assert np.array_equal(thinned(values[:MOST_POINTS]), np.arange(MOST_POINTS))


def test_an_angle_goes_on_through_north_from_block_to_block():
    rows, s = new_block(400), INDEX["heading"]
    rows["frame"] = np.arange(400)
    turned = 5.0 + 0.02 * np.arange(400)  # rad
    for field in ("truth", "voted"):
        rows[field][:, s] = turned % (2.0 * np.pi)
    rows["channels"][:, s] = turned[:, None] % (2.0 * np.pi)
    shown = of_signal(Table(rows), 100.0, "heading", 0.1)
    for drawn in (shown.truth, shown.voted, *shown.channels):
        assert drawn.values == pytest.approx(np.degrees(turned))


def test_small_motion_is_not_blown_up():
    def drawn(*values: float):
        return line(np.arange(len(values)) / 100.0, np.array(values))

    assert spanned([drawn(0.10, 0.12)], 2.0) == pytest.approx([-0.89, 1.11])
    assert spanned([drawn(-10.0, 10.0), drawn(np.nan)], 2.0) == pytest.approx([-11.0, 11.0])


def test_what_reaches_an_actuator_is_drawn_where_a_fault_changed_it():
    rows = new_block(3)
    rows["frame"], rows["surface_command"][:, 1] = np.arange(3), np.radians(4.0)  # of the aileron
    drawn = surfaces([of_surface(Table(rows), 100.0, i) for i in range(4)]).to_dict()
    changed = [trace["yaxis"] for trace in drawn["data"] if trace["name"] == "command at the actuator"]
    assert changed == ["y2"]
    assert drawn["layout"]["yaxis"]["range"] == [-1.0, 1.0]
    assert drawn["layout"]["yaxis2"]["range"] == pytest.approx([-0.2, 4.2])


def test_a_flight_that_ends_not_finite_can_be_drawn():
    rows, s = new_block(4), INDEX["roll_angle"]
    rows["frame"], rows["truth"][:, s] = np.arange(4), [0.0, 1.0, np.inf, np.nan]
    rows["voted"][:, s], rows["surface_command"][:, 0] = [0.0, 1e300, np.nan, 0.0], [0.0, 1e300, np.inf, np.nan]
    drawn = [of_flight(of_signal(Table(rows), 100.0, "roll_angle", 0.1), 100.0, "roll_angle", np.ones(4, bool))]
    off = line(rows["frame"] / 100.0, errors(Table(rows), "roll_angle") / 0.1)
    drawn += [vote_errors({"roll_angle": off}, {"roll_angle": 0.1})]
    drawn += [surfaces([of_surface(Table(rows), 100.0, i) for i in range(4)])]
    for figure in drawn:
        assert "NaN" not in json.dumps(json.loads(figure.to_json() or ""))


def test_the_error_of_a_vote_of_an_angle_is_the_short_way_round():
    rows, s = new_block(2), INDEX["heading"]
    rows["voted"][:, s], rows["truth"][:, s] = [0.01, 6.28], [6.28, 0.01]
    off = 0.01 - 6.28 + 2.0 * np.pi
    assert errors(Table(rows), "heading") == pytest.approx([off, -off])
    assert (rows["state"] == State.OK).all()
