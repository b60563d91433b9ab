"""A campaign that stops when a proportion is known: the interval holds at every look, the flights are the same."""

import os
import signal
import subprocess
import sys
import time
from itertools import takewhile
from math import log
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tools.until_coverage import ever_excluded

from rig.core.errors import BadInput
from rig.studies.campaign.campaign_file import from_what, read
from rig.studies.campaign.confidence_sequence import (
    fixed_trials,
    is_known,
    log_ratio,
    sequence_interval,
    sequence_trials,
)
from rig.studies.campaign.folder import Folder, open_folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import Result, run
from rig.studies.campaign.trials_of_runs import trials
from rig.studies.campaign.until import Until, kept, read_until

CAMPAIGN = """
base = "f16_pitch_rate_offset_in_manoeuvre"
sampling = "random"
runs = 120
seed = 17
[set]
duration_s = 2.6
"pilot.manoeuvres" = []
"faults.0" = { kind = "offset", signal = "pitch_rate", channels = [1], start_s = 2.2, offset_thresholds = 1.0 }
[vary]
"faults.0.offset_thresholds" = { low = 0.5, high = 8.0, log = true }
"faults.0.signal" = ["pitch_rate", "roll_rate"]
[run]
batch = 4
"""
ASKED: tuple[str, str, str] = ("half-width=0.2", "detected_of_all", "signal")


@given(st.integers(1, 3000), st.floats(0.001, 0.499))
def test_without_a_true_trial_the_upper_end_has_a_closed_form(n: int, h: float):
    """(1 - p + h) / (1 - p) = 40^(1 / n), where 40 = 2 / 0.05; the end is not below h."""
    found = sequence_interval(0, n, h)
    assert found.low == 0.0 and found.high == pytest.approx(max(h, 1.0 - h / (40.0 ** (1.0 / n) - 1.0)), abs=1e-9)


@given(st.integers(1, 2000), st.floats(0.0, 1.0), st.floats(0.01, 0.4), st.floats(0.01, 0.99))
def test_the_interval_holds_the_proportions_that_no_ratio_excludes(n: int, share: float, h: float, p: float):
    k = round(share * n)
    found = sequence_interval(k, n, h)
    assert found.low is not None and found.high is not None
    ratios = [log_ratio(k, n, q, p) for q in (p + h, p - h) if 0.0 < q < 1.0]
    excluded = any(ratio >= log(40.0) for ratio in ratios)
    if min(abs(p - found.low), abs(p - found.high)) > 1e-6:
        assert excluded == (not found.low <= p <= found.high)


@given(st.integers(0, 500), st.integers(1, 500), st.floats(0.01, 0.4))
def test_yes_and_no_have_mirrored_intervals(k: int, more: int, h: float):
    one, other = sequence_interval(k, k + more, h), sequence_interval(more, k + more, h)
    assert one.low == pytest.approx(1.0 - (other.high or 0.0), abs=1e-9)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.9])
def test_the_truth_is_excluded_at_any_flight_in_at_most_a_twentieth_of_the_runs(share: float):
    # 1,000 runs: 70 are 2.9 standard deviations above 50.  tests/tools/until_coverage.py has 10,000.
    assert ever_excluded(share, 0.05, 1000, 4 * sequence_trials(0.05, share)) <= 70


def test_the_flights_that_a_width_takes_are_the_first_that_are_enough():
    for share in (0.0, 0.25, 0.5):
        need = sequence_trials(0.05, share)
        narrow = [is_known(sequence_interval(round(share * n), n, 0.05), 0.05) for n in (need + 2, need - 4)]
        assert narrow == [True, False]
    assert fixed_trials(0.05) == pytest.approx(
        0.25 * (1.96 / 0.05) ** 2, rel=0.06
    )  # Wald's, with a correction of 1 / h
    assert 1.5 < sequence_trials(0.05) / fixed_trials(0.05) < 2.0


def test_looks_are_after_whole_rounds_and_the_limit_is_the_last():
    what = {"base": {}, "sampling": "stratified", "runs": 500, "cases": {"a": [{"name": n} for n in "xyz"]}}
    until = Until(half_width=0.1, of="survived", runs=500)
    looks = list(until.looks(from_what(what, "x")))
    assert looks[0] == 33 and looks[-1] == 500  # 32 flights of one outcome are enough, and 33 are whole rounds
    assert all(look % 3 == 0 for look in looks[:-1]) and looks == sorted(set(looks))


@pytest.fixture(scope="module")
def stopped(once: Any) -> Result:
    return once("until", lambda place: flown(place / "out", place, workers=1))


def flown(out: Path, place: Path, workers: int) -> Result:
    plan = planned(place)
    return run(plan, out, workers=workers, until=read_until(*ASKED, plan, len(plan)))


def planned(place: Path, text: str = CAMPAIGN) -> Plan:
    path = place / "campaign.toml"
    path.write_text(text)
    return Plan(read(path), str(path))


def test_a_campaign_stops_at_the_first_look_at_which_every_group_is_narrow(stopped: Result):
    folder = open_folder(stopped.out)
    state, runs = kept(folder), folder.tables["runs"]
    assert state == stopped.until and state is not None and state["known"]
    assert runs["run"].to_list() == list(range(state["flights"])) and state["flights"] < stopped.runs == 120
    rows = trials(folder.tables, "detected_of_all", "signal")
    until = Until(half_width=0.2, of="detected_of_all", by="signal", runs=120)
    before = takewhile(lambda look: look < state["flights"], until.looks(folder.plan.campaign))
    for look in [*before, state["flights"]]:
        shares = rows.filter(pl.col("run") < look).group_by("group").agg(pl.col("yes").sum(), of=pl.len())
        narrow = [is_known(sequence_interval(yes, of, 0.2), 0.2) for _, yes, of in shares.iter_rows()]
        assert all(narrow) == (look == state["flights"])
    assert {row["group"] for row in state["groups"]} == {"pitch_rate", "roll_rate"}


@pytest.mark.long
def test_two_workers_and_a_kill_leave_the_same_table(stopped: Result, tmp_path: Path):
    assert flown(tmp_path / "two", tmp_path, workers=2).table_sha256 == stopped.table_sha256
    argv = [
        "campaign",
        "run",
        "campaign.toml",
        "--out",
        "killed",
        "--until",
        ASKED[0],
        "--of",
        ASKED[1],
        "--by",
        ASKED[2],
    ]
    process = subprocess.Popen([sys.executable, "-m", "rig", *argv], cwd=tmp_path, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not list((tmp_path / "killed" / "runs").glob("*.parquet")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.002)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert len(open_folder(tmp_path / "killed").tables["runs"]) < (stopped.until or {})["flights"]
    again = flown(tmp_path / "killed", tmp_path, workers=2)
    assert again.table_sha256 == stopped.table_sha256 and again.until == stopped.until


def test_status_and_report_say_after_how_many_flights_it_stopped(stopped: Result, rig_command, tmp_path: Path):
    text = (
        f"half-width 0.2 of detected_of_all by signal: stopped after {(stopped.until or {})['flights']} of 120 flights"
    )
    assert text in " ".join(rig_command("campaign", "status", str(stopped.out))[1].split())
    page = tmp_path / "page.html"
    assert text in " ".join(rig_command("campaign", "report", str(stopped.out), "--out", str(page))[1].split())
    assert text in page.read_text()


def test_a_width_that_the_limit_does_not_reach_is_told_at_the_end(rig_command, tmp_path: Path, monkeypatch):
    planned(tmp_path)
    monkeypatch.chdir(tmp_path)
    argv = ["--out", "o", "--runs", "8", "--workers", "1", "--until", "half-width=0.02", "--of", "survived"]
    code, out, _ = rig_command("campaign", "run", "campaign.toml", *argv)
    assert code == 0 and "half-width 0.02 of survived: not reached in 8 flights" in out
    code, out, _ = rig_command("campaign", "run", "campaign.toml", "--out", "o", "--runs", "9", "--workers", "1")
    assert code == 0 and "until" not in out and not (tmp_path / "o" / "until.json").exists()


def test_a_proportion_that_no_flight_has_is_told_at_the_end(tmp_path: Path):
    plan = planned(tmp_path, CAMPAIGN.replace("low = 0.5, high = 8.0", "low = 0.001, high = 0.002"))
    result = run(plan, tmp_path / "o", workers=1, runs=6, until=read_until("half-width=0.1", "detected", None, plan, 6))
    assert result.until is not None and result.until["finished"] and result.until["groups"] == []


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        (("half-width=0.1", "detekted", None), r"--of detekted: no flight has this column; nearest: detected"),
        (("half-width=0.1", "violated", None), r"--of violated: no flight has this column"),
        (("half-width=0.1", "detected", "singal_x"), r"--by singal_x: no flight has this column; allowed: signal"),
        (("half-width=0", "detected", None), r"H above 0 and below 0.5"),
        (("half-width=0.5", "detected", None), r"H above 0 and below 0.5"),
        (("half-width=nan", "detected", None), r"H above 0 and below 0.5"),
        (("width=0.1", "detected", None), r"--until width=0.1: must be half-width=H"),
        (("half-width=0.1", None, None), r"--until: needs --of COLUMN"),
        ((None, "detected", None), r"--of: needs --until half-width=0.02"),
        ((None, None, "signal"), r"--by: needs --until half-width=0.02"),
    ],
)
def test_what_cannot_be_meant_is_one_line(tmp_path: Path, asked: tuple[Any, Any, Any], line: str):
    with pytest.raises(BadInput, match=line):
        read_until(*asked, planned(tmp_path), 120)


@pytest.mark.parametrize(("sampling", "line"), [("sobol", "depend on each other"), ("latin-hypercube", "depend")])
def test_runs_that_depend_on_each_other_are_refused(tmp_path: Path, sampling: str, line: str):
    plan = planned(tmp_path, CAMPAIGN.replace('"random"', f'"{sampling}"'))
    with pytest.raises(BadInput, match=line):
        read_until("half-width=0.1", "detected", None, plan, 120)


def test_less_than_a_round_of_a_grid_is_refused(tmp_path: Path):
    grid = CAMPAIGN.replace('"random"', '"grid"').replace("log = true", "log = true, levels = 30")
    with pytest.raises(BadInput, match="a whole round of the campaign, 60 runs, and may fly 59"):
        read_until("half-width=0.1", "detected", None, planned(tmp_path, grid), 59)


def test_a_damaged_file_is_one_line_with_the_remedy(stopped: Result, tmp_path: Path):
    folder = Folder(tmp_path / "o", planned(tmp_path))
    with folder.held():
        (folder.path / "until.json").write_text('{"half_width": 0.2}')
    with pytest.raises(BadInput, match=r"until.json: is damaged.*remove it, or give --until again"):
        kept(open_folder(folder.path))


def test_the_plan_tells_the_flights_that_a_width_takes(rig_command, tmp_path: Path, monkeypatch):
    planned(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rig.studies.campaign.estimate._probe", lambda *_: (1.0, 0))  # another test flies
    argv = ["campaign", "plan", "campaign.toml", "--runs", "3", "--until", "half-width=0.1"]
    code, out, _ = rig_command(*argv, "--proportion", "0.9")
    need, worst = sequence_trials(0.1, 0.9), sequence_trials(0.1)
    assert code == 0 and f"{need} flights of each group at a proportion of 0.9, {worst} at 0.5" in " ".join(out.split())
    assert "more than the runs of the campaign" in " ".join(out.split())


def test_one_flight_is_at_most_one_trial_of_a_group():
    faults = pl.DataFrame(
        [
            {"run": 0, "fault": 0, "signal": "p", "kind": "offset", "channel": 1, "outcome": "detected"},
            {"run": 0, "fault": 1, "signal": "p", "kind": "offset", "channel": 2, "outcome": "missed"},
            {"run": 0, "fault": 2, "signal": "q", "kind": "offset", "channel": 2, "outcome": "detected"},
            {"run": 1, "fault": 0, "signal": "p", "kind": "offset", "channel": 1, "outcome": "undetectable"},
            {"run": 2, "fault": 0, "signal": "p", "kind": "offset", "channel": 1, "outcome": "detected"},
        ]
    ).with_columns(isolation=pl.lit("none"), magnitude=pl.lit(0.1))
    runs = {"run": [0, 1, 2], "outcome": ["flown", "flown", "crashed"], "aircraft": "f16", "flight_point": "x"}
    tables = {"runs": pl.DataFrame({**runs, "manager": "m", "survived": [True, False, None]}), "faults": faults}
    assert trials(tables, "detected", "signal").rows() == [(0, "p", False), (0, "q", True)]
    assert trials(tables, "detected_of_all", "signal").rows() == [(0, "p", False), (0, "q", True), (1, "p", False)]
    assert trials(tables, "survived", "signal").rows() == [(0, "p", True), (0, "q", True), (1, "p", False)]
    assert trials(tables, "survived").rows() == [(0, "", True), (1, "", False)]
    assert np.array_equal(trials(tables, "detected")["yes"].to_numpy(), [False])
