"""FMEA lines from constructed tables: every number is that of the flights, what was not flown has none."""

import csv
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import outside
import polars as pl
import pytest
from browser import visit
from lxml import html

from rig.cli import safety
from rig.core.errors import BadInput
from rig.scenario.scenario import load
from rig.studies.reliability.rates_file import Rates, read_rates
from rig.studies.safety import fmea
from rig.studies.safety.confirm_sets import write_sets
from rig.studies.safety.cutset_plan import STUDY, Asked
from rig.studies.safety.fmea import COLUMNS, NOT_FLOWN, Row, groups, lines

RATES = """
[pitch_rate]
per_hour = [1e-3]
source = "a test"
kinds = { stuck = 0.25, offset = 0.75 }

[[layers]]
name = "computers"
channels = 4
per_hour = 3e-5
not_covered = [1e-4, 1e-3, 0.5, 1.0]
source = "another"

[[severity]]
name = "minor"
beyond_limits_s = 0.0
source = "mine"

[[severity]]
name = "major"
beyond_limits_s = 0.5
source = "mine"

[causes]
stuck = "frozen gyro"
"""
THRESHOLD = 0.05  # rad/s, of the plan below


class Plan:
    """One run's scenario, for all tests."""

    def __init__(self) -> None:
        made = load("f16_pitch_rate_hardover", ["redundancy.signals.pitch_rate.threshold=0.05"])
        self.run = SimpleNamespace(aircraft="f16", scenario=lambda: made)

    def __len__(self) -> int:
        return 1

    def __getitem__(self, number: int) -> Any:
        return self.run


def folder(path: Path, *flown: dict[str, Any]) -> Any:
    """A campaign with a run for each of ``flown``: what differs of a stuck channel that is isolated."""
    run = {"outcome": "flown", "aircraft": "f16", "survived": True, "out_of_limits_s": 0.0, "phase": "level"}
    fault = {
        "signal": "pitch_rate",
        "kind": "stuck",
        "channel": 2,
        "fault": 0,
        "magnitude": None,
        "isolation": "correct",
    }
    fault |= {
        "pattern": "3:1",
        "decided_by": "comparison",
        "delay_from_onset_s": 0.1,
        "vote_correct": True,
        "outcome": "detected",
    }
    fault |= {"vote_error_max": 0.0, "lost_s": 0.0}
    signal = {"signal": "pitch_rate", "level_at_end": 3, "lost_s": 0.0}
    rows: dict[str, list[dict[str, Any]]] = {"runs": [], "faults": [], "signals": []}
    for number, given in enumerate(flown):
        for name, base in (("runs", run), ("faults", fault), ("signals", signal)):
            row = {"run": number, **base, **{k: v for k, v in given.items() if k in base}}
            rows[name].append(row)
        rows["faults"] += [{**rows["faults"][-1], **one} for one in given.get("more", [])]
    types = {"magnitude": pl.Float64, "delay_from_onset_s": pl.Float64, "out_of_limits_s": pl.Float64}
    made = {
        name: pl.DataFrame(of, schema_overrides={k: t for k, t in types.items() if k in of[0]})
        for name, of in rows.items()
    }
    return SimpleNamespace(path=path, tables=made, plan=Plan())


@pytest.fixture
def rates(tmp_path: Path) -> Path:
    path = tmp_path / "rates.toml"
    path.write_text(RATES)
    return path


@pytest.fixture
def gathered(monkeypatch: pytest.MonkeyPatch, rates: Path):
    """Return the lines of a campaign with so many flights."""

    def of(*flown: dict[str, Any], given: Rates | None = None) -> list[Row]:
        monkeypatch.setattr(fmea, "open_folder", lambda path: folder(path, *flown))
        return lines([Path("C")], given or read_rates(rates), str(rates))

    return of


MISSED = {"isolation": "none", "delay_from_onset_s": None}


def test_a_line_has_the_counts_of_its_flights(gathered):
    first = gathered({}, {"delay_from_onset_s": 0.3}, MISSED, {"vote_correct": False, "out_of_limits_s": 0.2})[0]
    assert (first["id"], first["item"], first["mode"], first["phase"], first["flights"]) == (
        "F0001",
        "pitch_rate",
        "stuck",
        "level",
        "4",
    )
    assert first["rate"] == "0.001 x 0.25 = 0.00025/h" and first["source"] == "a test; kinds: assumed"
    assert first["detection"].startswith("3 of 4 (") and first["latent_share"].startswith("1 of 4 (")
    assert first["time_to_detection"] == "0.1 s, 95 % 0.3 s"
    assert first["not_correct"].startswith("1 of 4 (0.631 to 80.6 %)")
    assert first["exposure"] == "to the next manoeuvre" and first["cause"] == "frozen gyro"
    assert first["local_effect"] == "pattern 3:1, rule comparison"
    assert first["next_effect"] == "level 3 at the end; beyond transient limits in 1 of 4"
    assert first["worst_flight"] == "rig campaign fly C --run 3"


def test_a_kind_of_a_campaigns_own_has_its_line_and_its_rate(monkeypatch: pytest.MonkeyPatch, rates: Path):
    rates.write_text(RATES.replace("stuck = 0.25", '"slow drift" = 0.25'))
    made = folder(Path("C"), {"kind": "drift"}, {"kind": "drift"}, {"kind": "stuck"})
    made.tables["runs"] = made.tables["runs"].with_columns(kind=pl.Series(["slow drift", "up", "stuck"]))
    monkeypatch.setattr(fmea, "open_folder", lambda path: made)
    made = lines([Path("C")], read_rates(rates), str(rates))
    found = {line["mode"]: line["rate"] for line in made if line["flights"] == "1"}
    assert found == {"slow drift": "0.001 x 0.25 = 0.00025/h", "drift": "not given", "stuck": "not given"}


@pytest.mark.parametrize(
    ("given", "severity"),
    [
        ({}, "within transient limits"),
        ({"out_of_limits_s": 0.2}, "minor"),
        ({"out_of_limits_s": 0.9}, "major"),
        ({"survived": False, "out_of_limits_s": 0.9}, "aircraft lost"),
        ({"out_of_limits_s": None}, "to be assigned"),
    ],
)
def test_severity_is_measured_at_its_ends_and_the_users_between(gathered, given, severity):
    assert gathered(given)[0]["severity"] == severity


def test_without_the_users_words_severity_is_to_be_assigned(gathered, rates: Path):
    plain = read_rates(rates).model_copy(update={"severity": [], "causes": {}})
    first = gathered({"out_of_limits_s": 0.9}, given=plain)[0]
    assert (first["severity"], first["cause"]) == ("to be assigned", "to be assigned")


def test_sizes_make_bands_and_phases_lines_of_their_own(gathered):
    offset = {"kind": "offset"}
    made = gathered(
        {**offset, "magnitude": 3.9 * THRESHOLD},
        {**offset, "magnitude": 4.1 * THRESHOLD},
        {**offset, "magnitude": 4.1 * THRESHOLD, "phase": "manoeuvre"},
    )
    assert [(line["mode"], line["phase"]) for line in made if line["flights"] != "0"] == [
        ("offset, large", "level"),
        ("offset, large", "manoeuvre"),
        ("offset, small", "level"),
    ]


def test_flights_of_several_faults_are_no_evidence(gathered):
    made = gathered({}, {"more": [{"fault": 1, "channel": 3}]})
    assert made[0]["flights"] == "1"


def test_what_was_not_flown_says_so_in_every_measured_column(gathered):
    made = gathered({})
    absent = [line for line in made if line["flights"] == "0"]
    heads = {line["item"].partition(".")[0] for line in absent}
    assert {"computer", "ccdl", "bus", "actuator", "hydraulics", "inertial", "reference", "roll_rate"} <= heads
    measured = (
        "local_effect",
        "next_effect",
        "end_effect",
        "detection",
        "time_to_detection",
        "latent_share",
        "not_correct",
    )
    assert all(line[name] == NOT_FLOWN for line in absent for name in (*measured, "worst_flight", "phase"))
    assert not any(line["item"] == "pitch_rate" and line["mode"] == "stuck" for line in absent)
    assert next(line for line in absent if line["item"] == "computer")["rate"] == "3e-05/h, all kinds"
    assert next(line for line in absent if line["item"] == "roll_rate")["rate"] == "not given"
    assert len({line["id"] for line in made}) == len(made)


def test_the_lines_do_not_depend_on_the_order_of_the_rows(monkeypatch, rates: Path):
    flown = [{"isolation": word} for word in ("correct", "none", "wrong")] + [{"kind": "dropout"}]
    made = []
    for seed in (1, 2):
        one = folder(Path("C"), *flown)
        one.tables = {name: table.sample(fraction=1.0, shuffle=True, seed=seed) for name, table in one.tables.items()}
        monkeypatch.setattr(fmea, "open_folder", lambda path, one=one: one)
        made.append(lines([Path("C")], read_rates(rates), "r"))
    assert made[0] == made[1]


def test_the_table_and_the_page_have_every_line(rig_command, gathered, rates: Path, tmp_path: Path):
    count = len(gathered({}, {"kind": "offset", "magnitude": 1.0}))
    for name in ("fmea.csv", "fmea.html"):
        code, out, _ = rig_command(
            "reliability", "fmea", "C", "--rates", str(rates), "--out", str(tmp_path / name), "--json"
        )
        assert code == 0 and len(json.loads(out)["lines"]) == count
    with (tmp_path / "fmea.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == count and table[0]["worst_flight"].startswith("rig campaign fly C --run")
    page = html.parse(str(tmp_path / "fmea.html"))
    items = {row["item"] for row in table}
    assert [len(page.xpath(f"//table//tr[{where}]")) for where in ("@class='item'", "td")] == [len(items), count]
    assert not page.xpath("//*[@src]")
    texts = page.xpath("string(//body)")
    (remark,) = {row["remarks"] for row in table if row["remarks"]}
    assert texts.count(remark) == 1 and f"(1) {remark}" in texts


def test_the_columns_of_the_page_have_every_text_of_a_line_once():
    names = [name for of in groups().values() for name in of]
    assert sorted(names) == sorted(column.key for column in COLUMNS)


@outside.needs("chromium")
@pytest.mark.long
def test_in_a_browser_no_column_of_the_page_is_cut(rig_command, gathered, rates: Path, tmp_path: Path):
    gathered({}, {"kind": "offset", "magnitude": 1.0})
    page = tmp_path / "fmea.html"
    rig_command("reliability", "fmea", "C", "--rates", str(rates), "--out", str(page))
    widths = (1400, 1030, 700, 390)  # a screen; A4 across; a tablet; a phone
    for width, seen in zip(widths, visit(page, tmp_path, *widths), strict=True):
        assert (seen.console, seen.hidden) == ([], 0) and seen.right <= width


def test_what_is_wrong_is_one_line_and_nothing_is_written(rig_command, gathered, rates: Path, tmp_path: Path):
    gathered({})
    out = tmp_path / "fmea.txt"
    code, _, err = rig_command("reliability", "fmea", "C", "--rates", str(rates), "--out", str(out))
    assert code == 2 and "must end with .csv or .html" in err and not out.exists()
    rates.write_text(RATES.replace("[1e-3]", "[1e-3, 2e-3]"))
    out = tmp_path / "fmea.csv"
    code, _, err = rig_command("reliability", "fmea", "C", "--rates", str(rates), "--out", str(out))
    assert code == 2 and "an FMEA line needs one rate, got 2" in err and not out.exists()


def test_a_campaign_without_single_faults_and_a_foreign_folder_are_refused(
    gathered, rig_command, rates: Path, tmp_path: Path
):
    with pytest.raises(BadInput, match="C: no flight has a single fault"):
        gathered({"outcome": "crashed"})
    code, _, err = rig_command("reliability", "run", str(tmp_path), "--rates", str(rates))
    assert code == 2 and "not a campaign's folder" in err


def test_the_report_closes_the_circle(monkeypatch, rig_command, gathered, rates: Path, tmp_path: Path):
    from test_reliability_result import NO_ALARMS, table

    from rig.studies.reliability import compute_results as run_module
    from rig.studies.reliability.tally import Cells

    gathered({})
    counts = table(bad=1, kinds=("stuck", "offset"))
    monkeypatch.setattr(run_module, "cells", lambda path: Cells("cross-channel", counts, NO_ALARMS))
    sets, page = tmp_path / "sets", tmp_path / "case.html"
    with STUDY.held(sets, Asked("f16", "pitch_rate", 1, 2, ("manoeuvre-near",), 0, {}).as_dict()):
        pass
    arguments = (
        "reliability",
        "report",
        str(sets),
        "--cells",
        "a",
        "--faults",
        "C",
        "--rates",
        str(rates),
        "--out",
        str(page),
    )
    code, _, err = rig_command(*arguments)
    assert code == 2 and "sets.json is missing" in err and not page.exists()
    order = {"modes": ["stuck"], "lost": [2, 2]}
    found = {**order, "condition": "manoeuvre", "gap": "near", "interval": [0.4, 1.0], "wrong_vote_first": 2}
    found |= {"announced_first": 0, "aircraft_lost": 1, "orders": [order], "subsets": []}
    flown = {"manoeuvre-near": {"sequences": 7, "flights": 14}}
    write_sets(sets, {"format": 1, "flown": flown, "sets": [found]})
    code, out, err = rig_command(*arguments)
    assert (code, err) == (0, "") and str(page) in out
    text = " ".join(html.parse(str(page)).getroot().text_content().split())
    assert "14 flights of 7 sequences" in text and "Static tree: exact" in text and "rig reliability confirm" in text
    assert html.parse(str(page)).xpath("//svg//text")
    called: list[Any] = []
    monkeypatch.setattr(safety, "_fly_campaign", lambda name, out, *more: called.append((name, str(out))))
    monkeypatch.setattr(safety, "cutsets", lambda options: called.append((options.signal, options.flights)))
    monkeypatch.setattr(safety, "confirm", lambda folder, **more: called.append(folder))
    code, _, _ = rig_command(*arguments, "--fly", "--flights", "2")
    assert code == 0 and called == [("reliability", "a"), ("fmea", "C"), ("pitch_rate", 2), sets]
    other = tmp_path / "other"
    with STUDY.held(other, Asked("f16", "roll_rate", 1, 2, ("manoeuvre-near",), 0, {}).as_dict()):
        pass
    code, _, err = rig_command(*arguments[:2], str(other), *arguments[3:])
    assert code == 2 and "cut sets of roll_rate, but the tree is of pitch_rate" in err
