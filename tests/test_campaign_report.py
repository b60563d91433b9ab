"""What the tables say: a constructed table with known answers, the report, the paired comparison."""

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import outside
import polars as pl
import pytest
from browser import visit

from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.core.frame import SIGNALS
from rig.flight.time_histogram import BINS
from rig.studies.campaign.campaign_file import from_what
from rig.studies.campaign.campaign_page import delay_curves, level_shown, magnitude_shown, magnitude_unit, report
from rig.studies.campaign.campaign_summary import compare, summary
from rig.studies.campaign.folder import Folder, open_folder
from rig.studies.campaign.group_rates import acted, smallest
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.tables import OF, Rows

QUIET = {"patterns": ["normal"], "levels": [4], "pattern_transitions": [], "level_transitions": []}
POSSIBLE = {"patterns_possible": 7, "levels_possible": 5, "pattern_transitions_possible": 42}
QUIET |= POSSIBLE | {"level_transitions_possible": 20}
SPLIT = {**QUIET, "patterns": ["normal", "2:2"], "pattern_transitions": ["normal>2:2"]}
LOST = {**QUIET, "patterns": ["normal", "lost"], "levels": [4, 0], "level_transitions": ["4>0"]}


def made(path: Path, rows: Rows, title: str = "constructed", **what: Any) -> Folder:
    """A campaign's folder that holds ``rows``."""
    data = {"title": title, "base": {"aircraft": "f16"}, "runs": 40, "vary": {"turbulence": ["none", "light"]}, **what}
    folder = Folder.of(path, Plan(from_what(data, "constructed"), "constructed"))
    with folder.held():
        folder.write({**rows, "runs": [counting(run, rows) for run in rows["runs"]], "signals": signals(rows)})
    return open_folder(path)


def signals(rows: Rows) -> list[dict[str, Any]]:
    """A row for each signal of every run that was flown."""
    flown_runs = [run["run"] for run in rows["runs"] if run["outcome"] == "flown"]
    return [{"run": number, "signal": signal.name} for number in flown_runs for signal in SIGNALS]


def counting(run: dict[str, Any], rows: Rows) -> dict[str, Any]:
    """A run that counts its rows in the other tables, as the rig's own do."""
    own = {name: [row for row in rows[name] if row["run"] == run["run"]] for name in ("faults", "alarms", "episodes")}
    outcomes = ("detected", "missed", "undetectable", "not executed")
    counts = {name.replace(" ", "_"): sum(f["outcome"] == name for f in own["faults"]) for name in outcomes}
    kinds = {"false alarm": "false_alarms", "wrong isolation": "wrong_isolations"}
    counts |= {column: sum(a["kind"] == kind for a in own["alarms"]) for kind, column in kinds.items()}
    counts["unresolved"] = sum(e["decided_by"] == "unresolved" for e in own["episodes"])
    return {**run, **counts}


def covered(**by_signal: Any) -> str:
    return json.dumps(by_signal)


def flown(number: int, **more: Any) -> dict[str, Any]:
    plain = {"outcome": "flown", "survived": True, "end_reason": "duration flown", "duration_s": 36.0, "frames": 3600}
    counts = dict.fromkeys(("detected", "missed", "undetectable", "not_executed", "false_alarms"), 0)
    place = {"aircraft": "f16", "flight_point": "20000ft_m06", "manager": "cross-channel", "digest": "0"}
    row = {"run": number, "seed": 1000 + number, **place, **plain, **counts, "wrong_isolations": 0}
    return {
        **row,
        "channel_hours": 0.5,
        "vote_above_threshold_s": 0.0,
        "coverage": json.dumps({"overall": QUIET}),
        **more,
    }


def fault(number: int, magnitude: float | None, outcome: str, **more: Any) -> dict[str, Any]:
    detected = outcome == "detected"
    row = {"run": number, "fault": 0, "id": "f", "signal": "pitch_rate", "channel": 1, "kind": "offset"}
    row |= {"magnitude": magnitude, "outcome": outcome, "isolation": "correct" if detected else "none"}
    delays = {"delay_from_onset_s": 0.08, "delay_from_exceeded_s": 0.07, "decided_by": "comparison"} if detected else {}
    return {**row, **delays, "pattern": "isolated" if detected else "normal", **more}


def episode(number: int, decided_by: str, verdict: str, asked: list[str]) -> dict[str, Any]:
    place = {"run": number, "signal": "pitch_rate", "pattern": "2:2", "begin_s": 1.0, "frames": 10, "failed": []}
    return {**place, "asked": asked, "decided_by": decided_by, "verdict": verdict}


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Forty runs: 10 undetectable faults, 30 above the threshold of which 24 are detected, one aircraft lost."""
    runs = [flown(n) for n in range(40)]
    runs[7] |= {"survived": False, "end_reason": "departure rate", "coverage": covered(overall=LOST)}
    runs[9] |= {"wrong_isolations": 1, "coverage": covered(overall=SPLIT, pitch_rate=SPLIT)}
    runs[11] |= {"false_alarms": 2}
    runs[39] = {"run": 39, "seed": 1039, "outcome": "crashed", "reason": "killed by signal 6 (SIGABRT)"}
    faults = [fault(n, 0.01, "undetectable") for n in range(10)]
    faults += [fault(min(n, 38), 0.1, "detected" if n % 5 else "missed") for n in range(10, 40)]
    faults[12] |= {"isolation": "wrong"}
    faults.append(fault(3, None, "detected", kind="dropout", channel=2, delay_from_onset_s=0.2))
    faults.append(fault(4, 0.5, "not executed", channel=3))
    alarms = [
        {
            "run": 9,
            "kind": "wrong isolation",
            "signal": "pitch_rate",
            "channel": 4,
            "time_s": 2.0,
            "decided_by": "trend",
        },
        *({"run": 11, "kind": "false alarm", "signal": "heading", "channel": c, "time_s": 2.0} for c in (1, 2)),
    ]
    order = ["ilm", "trend", "reference"]
    episodes = [episode(n, "trend", "wrong" if n < 2 else "correct", order[:2]) for n in range(10)]
    episodes += [episode(n, "reference", "correct", order) for n in range(10, 15)]
    episodes += [episode(15, "unresolved", "open", order), episode(16, "trend", "open", order[:2])]
    return made(tmp_path / "campaign", {"runs": runs, "faults": faults, "alarms": alarms, "episodes": episodes})


def counted(found: dict[str, Any]) -> tuple[int, float]:
    return found["count"], found["of"]


def test_the_headline_counts_what_the_table_was_made_of(folder: Folder):
    head = summary(folder)["headline"]
    assert (head["done"], head["outcomes"]) == (39, {"crashed": 1, "flown": 39})
    assert (head["not_flown"], head["first_reason"]) == (1, "run 39: crashed: killed by signal 6 (SIGABRT)")
    assert counted(head["survival"]) == (38, 39)
    assert (head["undetectable"], head["not_executed"], head["faults"]) == (10, 1, 42)
    assert counted(head["detection"]) == (25, 31)  # 24 offsets and the dropout
    assert counted(head["correct_isolation"]) == (24, 31) and counted(head["wrong_isolation"]) == (1, 31)
    assert counted(head["false_alarms"]) == (2, 39 * 0.5)
    assert head["false_alarms"]["value"] == pytest.approx(2 / 19.5)
    assert head["detection"]["low"] == pytest.approx(0.6254, abs=2e-4)  # Clopper-Pearson, 25 of 31
    assert head["detection"]["high"] == pytest.approx(0.9255, abs=2e-4)


def test_for_people_the_counts_of_the_faults_add_up(folder: Folder, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    from rig.cli.show_campaign import report as show

    show(summary(folder), tmp_path / "report.html")
    said = " ".join(capsys.readouterr().out.split())
    undetectable = "10 undetectable (error below the isolation threshold)"
    assert f"faults 42, counted by channel: 31 detectable, {undetectable}, 1 not" in said
    assert "detection 25 of 31: " in said and "correct isolation 24 of 31: " in said


def test_rates_are_those_of_each_magnitude_pattern_and_rule(folder: Folder):
    found = summary(folder)
    by_size = {row["size"]: row for row in found["by_magnitude"]}
    assert counted(by_size[0.01]["detection_of_all"]) == (0, 10) and by_size[0.01]["detection"]["value"] is None
    assert counted(by_size[0.1]["detection"]) == (24, 30)
    assert {row["pattern"]: row["acted"] for row in found["by_pattern"]} == {"isolated": 25, "normal": 16}
    by = {row["decided_by"]: (row["faulty"], row["healthy"]) for row in found["by_rule"]}
    assert by == {"comparison": (25, 0), "trend": (0, 1)}
    levels = {(row["key"], row["level"]): row["runs"] for row in found["by_varied"]}
    assert levels == {("turbulence", "none"): 20, ("turbulence", "light"): 19}


def test_the_truth_table_of_the_rules_counts_who_was_asked_and_right(folder: Folder):
    found = {row["decided_by"]: row for row in summary(folder)["tie_break"] if row["pattern"] == "2:2"}
    counts = {
        name: [row[key] for key in ("asked", "answered", "correct", "wrong", "open")] for name, row in found.items()
    }
    assert counts == {"ilm": [17, 0, 0, 0, 0], "trend": [17, 11, 8, 2, 1], "reference": [6, 5, 5, 0, 0]}
    assert counted(found["trend"]["correct_share"]) == (8, 10)
    assert found["trend"]["correct_share"]["low"] == pytest.approx(0.4439, abs=1e-4)  # Clopper-Pearson, 8 of 10


def test_the_smallest_magnitude_and_the_delays(folder: Folder):
    found = summary(folder)
    assert [row["of"] for row in found["detectable"] if row["kind"] == "offset"] == ["light", "none"]  # never pooled
    (row,) = [row for row in smallest(acted(folder.tables)) if row["kind"] == "offset"]
    assert (row["acted"], row["detected"], row["fit"]["separated"]) == (40, 24, True)
    assert [m["value"] for m in row["fit"]["magnitudes"]] == pytest.approx([0.1, 0.1])  # all that is known
    delays = {row["kind"]: row for row in found["delays"]}
    assert delays["offset"]["delay_from_exceeded_s"]["median"] == 0.07
    assert delays["dropout"]["delay_from_onset_s"]["max"] == 0.2


def test_coverage_is_that_of_all_flights_together_and_the_worst_come_first(folder: Folder):
    found = summary(folder)
    overall = next(row for row in found["coverage"] if row["signal"] == "overall")
    assert overall["patterns"] == ["2:2", "lost", "normal"] and overall["level_transitions"] == ["4>0"]
    assert [row["run"] for row in found["worst"]][:4] == [39, 7, 9, 11]
    assert found["worst"][0]["fly"] == f"rig campaign fly {folder.path} --run 39"


def test_many_magnitudes_are_put_into_bins(tmp_path: Path):
    sizes = [0.01 * (n + 1) for n in range(40)]
    faults = [fault(n, size, "detected" if size > 0.2 else "undetectable") for n, size in enumerate(sizes)]
    rows: Rows = {"runs": [flown(n) for n in range(40)], "faults": faults, "alarms": [], "episodes": []}
    found = summary(made(tmp_path / "c", rows))["by_magnitude"]
    assert [row["acted"] for row in found] == [5] * 8
    assert [row["detection_of_all"]["count"] for row in found] == [0, 0, 0, 0, 5, 5, 5, 5]


def test_a_report_holds_everything_and_asks_for_nothing(folder: Folder, tmp_path: Path):
    out = tmp_path / "report.html"
    report(folder, out)
    text = out.read_text()
    assert not re.search(r"<(script|link|img|iframe)[^>]*\s(src|href)=[\"']?(https?:|//)", text)
    assert "constructed" in text and "killed by signal 6 (SIGABRT)" in text
    figures = json.loads(re.search(r'id="figures">(.*?)</script>', text, re.DOTALL).group(1))  # type: ignore[union-attr]
    assert set(figures) == {"map-0", "delay-0", "delay-1"}
    detected, never, counts = figures["map-0"]["data"]
    assert detected["x"] == never["x"] == ["0.573", "5.73"]  # 0.01 and 0.1 rad/s
    assert (detected["z"], never["z"], never["showscale"]) == ([[None, 0.8]], [[0.0, None]], False)
    assert dict(zip(counts["x"], counts["text"], strict=True)) == {"0.573": "(10)", "5.73": "24/30"}
    assert figures["map-0"]["layout"]["xaxis"]["title"]["text"] == "magnitude, deg/s"


def test_a_delay_below_zero_and_equal_delays_are_in_the_picture(tmp_path: Path):
    faults = [fault(0, 0.1, "detected", delay_from_exceeded_s=-0.05), fault(1, 0.1, "detected")]
    rows: Rows = {"runs": [flown(0), flown(1)], "faults": faults, "alarms": [], "episodes": []}
    from_threshold, from_onset = delay_curves(acted(made(tmp_path / "c", rows).tables))
    assert list(from_threshold.to_dict()["layout"]["xaxis"]["range"]) == pytest.approx([-0.055, 0.077])
    (line,) = from_threshold.to_dict()["data"]
    assert list(line["x"]) == pytest.approx([-0.055, -0.05, 0.07, 0.077]) and list(line["y"]) == [0.0, 0.5, 1.0, 1.0]
    assert list(from_onset.to_dict()["layout"]["xaxis"]["range"]) == pytest.approx([0.0, 0.088])  # both 0.08 s


def test_a_report_names_the_manager_and_what_was_set_and_varied(tmp_path: Path):
    rows: Rows = {"runs": [flown(0, manager="mean")], "faults": [], "alarms": [], "episodes": []}
    out = tmp_path / "report.html"
    found = report(made(tmp_path / "c", rows, set={"redundancy.manager": "mean", "duration_s": 36.0}), out)
    assert (found["managers"], found["varied"]) == (["mean"], ["turbulence"])
    assert "Manager mean." in out.read_text()
    assert "<code>redundancy.manager=mean</code>, <code>duration_s=36.0</code>" in out.read_text()


@pytest.mark.parametrize(
    ("signal", "kind", "shown"),
    [
        ("pitch_rate", "offset", ("11.5", "deg/s")),
        ("pitch_rate", "drift", ("11.5", "deg/s²")),
        ("pitch_rate", "intermittent", ("0.2", "s")),
        ("pitch_rate", "scale", ("0.2", "")),
        ("normal_load_factor", "offset", ("0.2", "g")),
        ("stick_pitch", "drift", ("0.2", "1/s")),
    ],
)
def test_a_magnitude_is_shown_with_the_unit_of_its_setting(signal: str, kind: str, shown: tuple[str, str]):
    assert (magnitude_shown(0.2, signal, kind), magnitude_unit(signal, kind)) == shown


@pytest.mark.parametrize(
    ("key", "level", "shown"),
    [
        ("faults.0.offset", 0.01261914688960386, "0.723 deg/s"),
        ("faults.0.rate_per_s", 0.2, "11.5 deg/s²"),
        ("faults.1.offset", 0.01261914688960386, "0.0126"),  # acted on two signals
        ("faults.0.start_s", 3.14159, "3.14"),
        ("flight_point", "20000ft_m06", "20000ft_m06"),
    ],
)
def test_what_varies_is_rounded_and_in_the_unit_of_the_map(key: str, level: float | str, shown: str):
    acted_on = {"fault": [0, 0, 1, 1], "signal": ["pitch_rate", "pitch_rate", "pitch_rate", "heading"]}
    assert level_shown(key, level, pl.DataFrame(acted_on)) == shown


def test_a_title_cannot_end_the_page(tmp_path: Path):
    rows: Rows = {"runs": [flown(0)], "faults": [], "alarms": [], "episodes": []}
    out = tmp_path / "report.html"
    report(made(tmp_path / "c", rows, title="</script><b>x"), out)
    assert "</script><b>x" not in out.read_text() and "No fault was active" in out.read_text()


def test_nothing_flown_is_nothing_to_report(tmp_path: Path):
    folder = Folder.of(tmp_path / "c", Plan(from_what({"base": {}}, "c"), "c"))
    with folder.held():
        pass
    with pytest.raises(BadInput, match="no run is done yet"):
        report(folder, tmp_path / "report.html")
    assert not (tmp_path / "report.html").exists()


@outside.needs("chromium")
@pytest.mark.long
def test_in_a_browser_each_count_of_a_map_stands_on_its_cell(tmp_path: Path):
    detected = {0.01: None, 0.02: None, 0.1: 1, 0.2: 4, 0.4: 7, 0.8: 10}  # of ten; none could be of the first two
    faults = [
        fault(n, size, "undetectable" if count is None else "detected" if n < count else "missed")
        for size, count in detected.items()
        for n in range(10)
    ]
    rows: Rows = {"runs": [flown(n) for n in range(10)], "faults": faults, "alarms": [], "episodes": []}
    out = tmp_path / "report.html"
    report(made(tmp_path / "campaign", rows), out)
    shown = [magnitude_shown(size, "pitch_rate", "offset") for size in detected]
    for width, seen in zip((1280, 390), visit(out, tmp_path, 1280, 390), strict=True):
        assert seen.console == [] and seen.right <= width
        ticks, points = seen.of("map-0", "xtick"), seen.of("map-0", "textpoint")
        nearest = [min(ticks, key=lambda tick, at=text: abs(tick.middle[0] - at.middle[0])) for text in points]
        counts = {tick.text: text.text for tick, text in zip(nearest, points, strict=True)}
        assert counts == dict(zip(shown, ["(10)", "(10)", "1/10", "4/10", "7/10", "10/10"], strict=True))
        apart = min(b - a for a, b in pairwise(sorted(tick.middle[0] for tick in ticks)))
        for tick, text in zip(nearest, points, strict=True):
            assert abs(text.middle[0] - tick.middle[0]) < 0.25 * apart


def test_reply_times_of_a_unit_are_added_up_over_the_runs(tmp_path: Path):
    counts = [0, 5, 3590, 4, *[0] * (BINS - 5), 1]
    runs = [flown(0, replies=counts), flown(1, replies=counts), {"run": 2, "seed": 2, "outcome": "unit dead"}]
    empty: Rows = {"faults": [], "alarms": [], "episodes": []}
    tested = made(tmp_path / "unit", {"runs": runs, **empty})
    found = summary(tested)["replies"]
    assert (found["runs"], found["frames"]) == (2, 7200) and found["counts"] == [2 * count for count in counts]
    assert dict(zip(found["bins_us"], found["counts"], strict=True))["2 to 5"] == 7180
    report(tested, tmp_path / "unit.html")
    assert 'id="replies-0"' in (tmp_path / "unit.html").read_text()
    ours = made(tmp_path / "ours", {"runs": [flown(0)], **empty})
    report(ours, tmp_path / "ours.html")
    assert summary(ours)["replies"] is None and "Reply times" not in (tmp_path / "ours.html").read_text()


def test_pairs_of_two_managers_on_the_same_seeds(tmp_path: Path):
    first = {"runs": [flown(n) for n in range(20)], "faults": [fault(n, 0.1, "detected") for n in range(20)]}
    second = {
        "runs": [flown(n, survived=n >= 6) for n in range(20)],
        "faults": [fault(n, 0.1, "missed" if n < 9 else "detected") for n in range(20)],
    }
    empty: Rows = {"alarms": [], "episodes": []}
    a = made(tmp_path / "a", {**first, **empty})
    b = made(tmp_path / "b", {**second, **empty}, set={"redundancy.manager": "mean"})
    found = compare(a, b)
    assert found["differs"] == ['campaign.set.redundancy.manager was not there, is "mean"']
    assert (found["detectable"], found["runs_with_faults"]) == ({"first": 20, "second": 20, "both": 20}, 20)
    by = {row["outcome"]: row["pairs"] for row in found["outcomes"]}
    assert (by["survived"]["only_first"], by["survived"]["only_second"]) == (6, 0)
    assert by["survived"]["p_value"] == pytest.approx(2 * 0.5**6)
    assert by["fault detected"]["p_value"] == pytest.approx(2 * 0.5**9)
    assert by["every fault detected"] == by["fault detected"]


def test_delays_are_paired_and_every_share_of_faults_is_of_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """Ten faults: nine that both find, 30 ms apart; one that the second manager cannot see, which is none it missed."""
    from rig.cli.show_campaign import compare as show

    monkeypatch.delenv("COLUMNS", raising=False)
    late = [fault(n, 0.1, "detected", delay_from_onset_s=0.04 + 0.001 * n) for n in range(10)]
    later = [fault(n, 0.1, "detected", delay_from_onset_s=0.07 + 0.001 * n) for n in range(9)]
    runs, empty = [flown(n) for n in range(10)], {"alarms": [], "episodes": []}
    a = made(tmp_path / "a", {"runs": runs, "faults": late, **empty})
    b = made(tmp_path / "b", {"runs": runs, "faults": [*later, fault(9, 0.1, "undetectable")], **empty})
    found = compare(a, b)
    onset, exceeded = found["delays"]
    assert (onset["faults"], onset["sooner_first"], onset["sooner_second"]) == (9, 9, 0)
    assert (onset["first_median_s"], onset["second_median_s"]) == pytest.approx((0.044, 0.074))
    assert list(onset["difference_s"].values()) == pytest.approx([-0.03] * 3)
    assert exceeded["difference_s"]["value"] == 0.0
    shares = {
        row["outcome"]: (row["first"]["count"], row["second"]["count"], row["second"]["of"])
        for row in found["outcomes"]
    }
    assert shares["every fault detected"] == shares["fault detected"] == (10, 9, 10)
    assert found["detectable"] == {"first": 10, "second": 9, "both": 9}
    show(found)
    said = capsys.readouterr().out
    left_out = " ".join(text for text in said.split("\n") if "hidden columns" in text)
    assert not any(title in left_out for title in ("only first", "only second", "p,", "difference"))
    assert "the 10 that acted in both" in said and "-0.030 (-0.030 to -0.030)" in said


def test_campaigns_of_other_seeds_are_not_paired(tmp_path: Path):
    empty: Rows = {"faults": [], "alarms": [], "episodes": []}
    a = made(tmp_path / "a", {"runs": [flown(0)], **empty})
    b = made(tmp_path / "b", {"runs": [flown(0, seed=5)], **empty})
    with pytest.raises(BadInput, match="not flown on the same seeds"):
        compare(a, b)


def test_the_page_names_every_column():
    page = (Path(__file__).parent.parent / "docs" / "reference" / "scores-and-tables.md").read_text()
    named = set(re.findall(r"`([\w-]+)`", page.partition("## Columns")[2]))
    assert {column for table in OF.values() for column in table.columns} <= named


def test_the_page_names_every_bundled_campaign():
    page = (Path(__file__).parent.parent / "docs" / "how-to" / "campaigns-and-worst-case.md").read_text()
    named = set(re.findall(r"`([\w-]+)`", page))
    assert {path.stem for path in (bundled("faults") / "campaigns").glob("*.toml")} <= named
