"""``rig reliability run`` and ``plan`` on constructed counts; the rates file."""

import json
import re
from itertools import combinations
from pathlib import Path

import outside
import polars as pl
import pytest
from browser import visit
from test_reliability_result import NO_ALARMS, table

from rig.core.errors import BadInput
from rig.studies.campaign.worker import fly_batch
from rig.studies.reliability import compute_results as module
from rig.studies.reliability.rates_file import read_rates
from rig.studies.reliability.tally import Cells

BUNDLED = Path(__file__).parent.parent / "faults" / "rates" / "zhang2023.toml"
RATES = """
[pitch_rate]
per_hour = [1e-3]
source = "a test"
kinds = { hardover = 0.5, drift = 0.5 }
"""


@pytest.fixture
def rates(tmp_path: Path) -> Path:
    path = tmp_path / "rates.toml"
    path.write_text(RATES)
    return path


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> dict[str, Cells]:
    """Folders by name."""
    found: dict[str, Cells] = {}
    monkeypatch.setattr(module, "cells", lambda folder: found[str(folder)])
    return found


def test_every_manager_and_number_of_channels_has_its_row(rig_command, counted, rates: Path):
    counted["a"] = Cells("cross-channel", table(bad=1), NO_ALARMS)
    counted["b"] = Cells("mean", table(bad=500), NO_ALARMS)
    code, out, err = rig_command("reliability", "run", "a", "b", "--rates", str(rates), "--json")
    assert (code, err) == (0, "")
    results = json.loads(out)["results"]
    assert {(one["manager"], one["case"]["channels"]) for one in results} == {
        (manager, n) for manager in ("cross-channel", "mean") for n in (1, 2, 3, 4)
    }
    of_mean = [one for one in results if one["manager"] == "mean" and one["case"]["flights_between_checks"] == 1]
    # Half of all faults are fatal, however many channels there are: four channels fail four times as often as one.
    worst = {one["case"]["channels"]: one["estimates"]["undetected_error"]["median"] for one in of_mean}
    assert worst[4] == pytest.approx(4 * 0.5e-3, rel=0.1) and not any(of_mean[-1]["requirement"].values())


def test_folders_of_one_manager_are_added_up(counted, rates: Path):
    counted["a"] = counted["b"] = Cells("cross-channel", table(bad=1), NO_ALARMS)
    both = module.run([Path("a"), Path("b")], read_rates(rates), "pitch_rate", [4], 1.0, 1)
    assert len(both) == 1 and both[0].contributions[0].trials == 8000


def test_the_assumptions_come_first(rig_command, counted, rates: Path):
    counted["a"] = Cells("cross-channel", table(bad=1), NO_ALARMS)
    code, out, _ = rig_command("reliability", "run", "a", "--rates", str(rates))
    assert code == 0 and out.startswith("This holds if:\n  - a channel fails 0.001 times an hour (a test)")
    assert "decided by" in out and "single, 4 good" in out


def test_a_missing_cell_is_named(rig_command, counted, rates: Path):
    counted["a"] = Cells("cross-channel", table().filter(pl.col("good_before") != 2), NO_ALARMS)
    code, _, err = rig_command("reliability", "run", "a", "--rates", str(rates))
    assert code == 2
    assert err == "error: a: cross-channel: no single fault of pitch_rate with 2 good channels was flown\n"
    code, _, _ = rig_command("reliability", "run", "a", "--rates", str(rates), "--channels", "1")
    assert code == 0


def test_a_missing_kind_is_named(rig_command, counted, rates: Path):
    counted["a"] = Cells("cross-channel", table(kinds=("hardover",)), NO_ALARMS)
    code, _, err = rig_command("reliability", "run", "a", "--rates", str(rates))
    assert code == 2 and "no trial of drift, a kind of the rates file, with" in err


def test_a_kind_of_a_campaigns_own_is_named_by_the_rates_and_asked_of_the_folders(rig_command, counted, rates: Path):
    rates.write_text(RATES.replace("drift", '"slow drift"'))
    counted["a"] = Cells("cross-channel", table(), NO_ALARMS)
    counted["b"] = Cells("cross-channel", table(bad=100, kinds=("slow drift",)), NO_ALARMS)
    code, _, err = rig_command("reliability", "run", "a", "--rates", str(rates))
    assert code == 2 and "no trial of slow drift, a kind of the rates file, with 1 good channels" in err
    code, out, err = rig_command("reliability", "run", "a", "b", "--rates", str(rates))
    assert code == 0, err
    assert "hardover 50 %, slow drift 50 %" in out


def test_common_mode_needs_its_cell(counted, rates: Path):
    rates.write_text(RATES + "beta = [0.01]\n")
    counted["a"] = Cells("cross-channel", table(), NO_ALARMS)
    with pytest.raises(BadInput, match="no alike fault of pitch_rate with 4 good channels"):
        module.run([Path("a")], read_rates(rates), "pitch_rate", [4], 1.0, 1)


def test_the_report_has_the_assumptions_before_the_numbers_and_needs_no_network(
    rig_command, counted, rates: Path, tmp_path: Path
):
    counted["a"] = Cells("cross-channel", table(bad=1), NO_ALARMS)
    path = tmp_path / "report.html"
    code, _, _ = rig_command("reliability", "run", "a", "--rates", str(rates), "--report", str(path))
    page = path.read_text()
    assert code == 0 and "cross-channel" in page and "perfect isolation" in page and "military" in page
    assert [page.count(f'id="picture-{i}"') for i in range(4)] == [
        1,
        1,
        1,
        0,
    ]  # undetected errors, annunciated losses, lost aircraft
    drawn = json.loads(page.partition('id="figures">')[2].partition("</script>")[0])["picture-0"]
    notes = {note["text"]: note["y"] for note in drawn["layout"]["annotations"]}
    assert notes == {"military, 1e-7": pytest.approx(-7.0), "civil, 1e-9": pytest.approx(-9.0)}  # of a log axis
    assert page.index("a channel fails 0.001 times an hour (a test)") < page.index("<table class=")
    assert not re.findall("<(?:script|link|img)[^>]*https?:", page)


def test_without_a_failure_the_picture_has_the_upper_end_as_a_triangle(
    rig_command, counted, rates: Path, tmp_path: Path
):
    counted["a"] = Cells("cross-channel", table(bad=0), NO_ALARMS)
    arguments = ("reliability", "run", "a", "--rates", str(rates), "--report", str(tmp_path / "report.html"), "--json")
    results = json.loads(rig_command(*arguments)[1])["results"]
    page = (tmp_path / "report.html").read_text()
    line = json.loads(page.partition('id="figures">')[2].partition("</script>")[0])["picture-0"]["data"][0]
    drawn = [one for one in results if one["case"]["flights_between_checks"] == 1]
    drawn = [one for one in drawn if one["case"]["per_hour"] == results[0]["case"]["per_hour"]]
    ends = {one["case"]["channels"]: one["estimates"]["undetected_error"] for one in drawn}
    assert line["marker"]["symbol"] == ["triangle-down" if ends[n]["low"] is None else "circle" for n in line["x"]]
    assert line["y"] == [ends[n]["median" if ends[n]["low"] is not None else "high"] for n in line["x"]]
    assert line["error_y"]["arrayminus"][-1] == 0.0 and ends[4]["low"] is None
    assert "A triangle in a picture is an upper end" in page


@outside.needs("chromium")
@pytest.mark.long
def test_in_a_browser_no_column_is_cut_and_no_two_labels_of_a_picture_overlap(
    rig_command, counted, rates: Path, tmp_path: Path
):
    counted["a"] = Cells("cross-channel", table(bad=1), NO_ALARMS)
    rig_command("reliability", "run", "a", "--rates", str(rates), "--report", str(tmp_path / "report.html"))
    seen, tablet, phone = visit(tmp_path / "report.html", tmp_path, 1400, 700, 390)
    assert [(each.console, each.hidden) for each in (tablet, phone)] == [([], 0)] * 2
    assert seen.console == [] and seen.right <= 1400 and seen.hidden == 0 and seen.drawn >= 3
    for figure in ("picture-0", "picture-1", "picture-2"):
        texts = [text for text in seen.texts if text.figure == figure]
        assert {"military, 1e-7", "civil, 1e-9"} < {text.text for text in texts}
        assert [(a.text, b.text) for a, b in combinations(texts, 2) if a.covers(b) and a.text != b.text] == []


def test_the_bundled_rates_say_what_is_assumed():
    found = read_rates(BUNDLED)
    assert set(found.signals) == {"pitch_rate", "normal_load_factor", "static_pressure"}
    assert all("assumed" in one.kinds_source and "Zhang 2023" in one.source for one in found.signals.values())


def test_the_bundled_rates_of_slow_drifts_take_half_of_the_drifts_for_slow():
    slow, whole = read_rates(BUNDLED.with_name("slow_drift.toml")), read_rates(BUNDLED)
    for name, given in whole.signals.items():
        half = {"drift": given.kinds["drift"] / 2, "slow drift": given.kinds["drift"] / 2}
        expected = given.model_copy(update={"kinds": {**given.kinds, **half}, "per_hour": given.per_hour[:1]})
        assert slow.signals[name] == expected


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('source = "a test"\n', "", "pitch_rate: source: missing"),
        ("[1e-3]", "[-1e-3]", "pitch_rate: per_hour: rates per hour must be above 0 and at most 1, got [-0.001]"),
        ("drift = 0.5", "drift = 0.6", "pitch_rate: kinds: the shares of the kinds must add up to 1, got 1.1"),
        ("drift", "drfit", "pitch_rate: kinds: unknown kind 'drfit'"),
        ("drift", "'slow drfit'", "pitch_rate: kinds: unknown kind 'slow drfit'"),
        ("drift", "'drift, slow'", "pitch_rate: kinds: unknown kind 'drift, slow'"),
        ("[pitch_rate]", "[pitch_rat]", "signals: unknown signal 'pitch_rat'"),
        ("[1e-3]", "[]", "pitch_rate: per_hour: list should have at least 1 item"),
    ],
)
def test_bad_rates_are_one_line(rig_command, rates: Path, old: str, new: str, said: str):
    rates.write_text(RATES.replace(old, new))
    code, out, err = rig_command("reliability", "plan", "--target", "1e-7", "--rates", str(rates), "--no-cost")
    assert (code, out) == (2, "") and err.startswith(f"error: {rates}: ") and said in err and err.count("\n") == 1


def test_the_plan_has_a_row_for_each_number_of_good_channels(rig_command, rates: Path):
    code, out, _ = rig_command("reliability", "plan", "--target", "1e-9", "--rates", str(rates), "--json", "--no-cost")
    assert code == 0 and [one["trials"] for one in json.loads(out)["cells"]] == [23_965_859, 35_949, 24]


def test_the_plan_says_what_it_takes_here(rig_command, rates: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("rig.studies.campaign.estimate.fly_alone", fly_batch)  # here, not in a process of its own
    code, out, err = rig_command("reliability", "plan", "--target", "1e-9", "--rates", str(rates), "--json")
    assert code == 0, err
    cells = json.loads(out)["cells"]
    a_trial, a_flight = cells[0]["seconds"] / cells[0]["trials"], cells[2]["seconds"] / cells[2]["trials"]
    assert cells[1]["seconds"] / cells[1]["trials"] == pytest.approx(a_trial)
    assert 0.0 < a_trial < a_flight  # a trial is a part of a flight, of one signal


def test_a_wrong_number_of_channels_is_refused(rig_command, rates: Path):
    code, _, err = rig_command("reliability", "run", "a", "--rates", str(rates), "--channels", "1,5")
    assert code == 2 and err == "error: --channels: must be numbers from 1 to 4, separated by commas, got 1,5\n"
