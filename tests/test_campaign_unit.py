"""Campaigns of a unit under test: the same table by any worker, its deaths no losses of the aircraft."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from unit_files import SOURCES, library, needs_a_compiler, unit, written

from rig.core.errors import BadInput
from rig.core.trust import Trust
from rig.studies.campaign import worker
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.folder import Folder, open_folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import Progress, Result, again, orders_of, run
from rig.unit.unit_file import Unit, read_unit

pytestmark = needs_a_compiler
CAMPAIGN = """
base = "f16_pitch_rate_hardover"
seed = 7
runs = 12
baseline = true
[set]
duration_s = 2.0
"faults.0.start_s" = 0.5
[vary]
"faults.0.signal" = ["pitch_rate", "roll_rate"]
turbulence = ["none", "light"]
[run]
workers = 2
batch = 2
"""


def fly(folder: Path, tested: Unit | None, out: str, **how: Any) -> Result:
    path = folder / "campaign.toml"
    path.write_text(CAMPAIGN)
    return run(Plan(read(path), str(path), Trust(str(path))), folder / out, unit=tested, **how)


def faulty(folder: Path, fault: str, **keys: str) -> Unit:
    """A library of its own: workers are forked from a process with an environment of its own."""
    (folder / "fault").write_text(fault)
    shutil.copy(library("faulty"), folder)
    return written(folder, {"name": "faulty", "path": "libfaulty.so", **keys})


@pytest.mark.long
def test_a_table_does_not_depend_on_how_many_units_fly_it(tmp_path: Path):
    tested = unit(tmp_path, "monitor")
    one, four = fly(tmp_path, tested, "one", workers=1), fly(tmp_path, tested, "four", workers=4)
    assert one.outcomes == four.outcomes == {"flown": 12}
    assert one.table_sha256 == four.table_sha256
    flight, digest = again(open_folder(one.out), 3, tmp_path, tested)
    assert flight.digest == digest
    runs = open_folder(one.out).tables["runs"]
    assert [sum(counts) for counts in runs["replies"]] == runs["frames"].to_list()
    ours = open_folder(fly(tmp_path, None, "ours").out).tables["runs"]
    assert ours["replies"].null_count() == 12
    assert runs["detected"].to_list() == ours["detected"].to_list() == [1] * 12
    assert set(runs["digest"]).isdisjoint(ours["digest"]), "the frame says who voted"


def test_a_unit_that_dies_costs_one_flight_which_is_no_loss_of_the_aircraft(tmp_path: Path):
    found = fly(tmp_path, faulty(tmp_path, "segv once"), "out")
    assert found.outcomes == {"flown": 11, "unit dead": 1}
    assert found.as_dict()["unit_dead"] == 1 and found.as_dict()["unit_refused"] == 0
    runs = open_folder(found.out).tables["runs"]
    (dead,) = runs.filter(runs["outcome"] == "unit dead").to_dicts()
    assert "frame 50: killed by signal 11 (SIGSEGV)" in dead["reason"] and dead["survived"] is None


def test_a_unit_whose_place_another_takes_is_dead_all_the_same(tmp_path: Path):
    found = fly(tmp_path, faulty(tmp_path, "segv", on_dead="hold"), "out", runs=2)
    assert found.outcomes == {"unit dead": 2}


def test_a_unit_that_refuses_is_an_outcome_of_its_own(tmp_path: Path):
    assert fly(tmp_path, faulty(tmp_path, "open"), "out", runs=2).outcomes == {"unit refused": 2}


def test_a_campaign_goes_on_only_with_the_build_that_it_was_begun_with(tmp_path: Path):
    begun = fly(tmp_path, unit(tmp_path, "first_valid"), "out", runs=2).out
    other = written(tmp_path, {"name": "first_valid", "path": str(library("monitor"))})
    with pytest.raises(BadInput, match=r"contains runs of another campaign: unit\.path was .*|unit\.sha256 was"):
        fly(tmp_path, other, "out")
    with pytest.raises(BadInput, match="contains runs of another campaign: unit"):
        fly(tmp_path, None, "out")
    with pytest.raises(BadInput, match="was flown with the unit under test 'first_valid': give its file by --unit"):
        again(open_folder(begun), 0, tmp_path)
    with pytest.raises(BadInput, match=r"is another build: read_sha256\..*first_valid.* was .*, is not there"):
        again(open_folder(begun), 0, tmp_path, other)


def with_gains(folder: Path, text: str, **environment: str) -> Unit:
    (folder / "gains.txt").write_text(text)
    keys = {"name": "u", "path": str(library("reads")), "files": ["gains.txt"], "environment": environment}
    return written(folder, keys)


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of which two runs are flown, with its unit."""
    folder = tmp_path_factory.mktemp("begun")
    assert fly(folder, with_gains(folder, "1", VOTER="mean"), "out", runs=2, workers=1).outcomes == {"flown": 2}
    return folder


CHANGED = {
    "environment": ("1", {"VOTER": "median"}, 'unit.environment.VOTER was "mean", is "median"'),
    "a new variable": ("1", {"VOTER": "mean", "A": ""}, 'unit.environment.A was not there, is ""'),
    "no variable": ("1", {}, 'unit.environment.VOTER was "mean", is not there'),
    "file": ("2", {"VOTER": "mean"}, "unit.read_sha256.gains.txt was "),
}


@pytest.mark.parametrize("what", CHANGED)
def test_a_campaign_does_not_go_on_with_another_environment_or_file(begun: Path, what: str):
    text, environment, differs = CHANGED[what]
    other = with_gains(begun, text, **environment)
    with pytest.raises(BadInput) as error:
        fly(begun, other, "out", runs=3)
    assert f"contains runs of another campaign: {differs}" in str(error.value)
    with pytest.raises(BadInput, match="is another build: " + re.escape(differs.removeprefix("unit."))):
        again(open_folder(begun / "out"), 0, begun / "logs", other)
    same = with_gains(begun, "1", VOTER="mean")
    assert again(open_folder(begun / "out"), 0, begun / "logs", same)[0].digest


@pytest.mark.long
def test_a_plan_has_the_identity_of_what_it_flies(begun: Path, rig_command, monkeypatch):
    unit_file = with_gains(begun, "1", VOTER="mean").unit_file
    code, out, _ = rig_command("campaign", "status", begun / "out", "--json")
    identity = json.loads(out)["identity"]
    assert code == 0 and "environment VOTER=mean" in rig_command("campaign", "status", begun / "out")[1]
    code, out, err = rig_command("campaign", "plan", begun / "campaign.toml", "--unit", unit_file, "--json")
    found = json.loads(out)
    assert code == 0 and found["identity"] == identity, err
    assert found["unit"]["environment"] == {"VOTER": "mean"} and "gains.txt" in found["unit"]["read_sha256"]
    with_gains(begun, "1", VOTER="median")
    monkeypatch.setattr("rig.studies.campaign.estimate._probe", lambda *_: (1.0, 0))  # which has flown once
    code, out, _ = rig_command("campaign", "plan", begun / "campaign.toml", "--unit", unit_file)
    assert code == 0 and identity not in out and "environment VOTER=median" in out


@pytest.mark.long
def test_a_file_that_changes_while_a_campaign_flies_ends_it_and_no_run_of_it_counts(tmp_path: Path):
    tested = with_gains(tmp_path, "1")

    def change(state: Progress) -> None:
        if state.flown:
            (tmp_path / "gains.txt").write_text("2")

    with pytest.raises(BadInput, match=r"gains\.txt: is not the file .*; \d+ of 12 runs done$"):
        fly(tmp_path, tested, "out", workers=1, report=change)
    done = open_folder(tmp_path / "out").status()["done"]
    assert 2 <= done <= 8
    whole = fly(tmp_path, with_gains(tmp_path, "1"), "whole", workers=2)
    assert fly(tmp_path, with_gains(tmp_path, "1"), "out", workers=2).table_sha256 == whole.table_sha256


@pytest.mark.long
def test_a_batch_in_which_a_file_has_changed_returns_no_rows(tmp_path: Path, monkeypatch):
    tested = with_gains(tmp_path, "1")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    plan = Plan(read(tmp_path / "campaign.toml"), "campaign.toml")
    orders = orders_of(Folder(tmp_path / "out", plan, tested))
    flown = worker.fly_run

    def changes(*arguments: Any) -> Any:
        rows = flown(*arguments)
        (tmp_path / "gains.txt").write_text("2")
        return rows

    monkeypatch.setattr(worker, "fly_run", changes)
    with pytest.raises(BadInput, match=r"gains\.txt: is not the file"):
        worker.fly_batch([plan[0]], orders)
    worker._end_units()


def test_a_box_is_one_worker(tmp_path: Path):
    box = written(tmp_path, {"name": "box", "transport": "udp", "address": "127.0.0.1:9", "start_s": 0.2})
    with pytest.raises(BadInput, match=r"--workers 2: must be 1; the unit at 127\.0\.0\.1:9"):
        fly(tmp_path, box, "out", workers=2)
    assert fly(tmp_path, box, "out", runs=1).outcomes == {"unit refused": 1}


@pytest.mark.long
def test_a_control_law_flies_behind_the_managers_of_a_campaign(tmp_path: Path):
    """Each manager votes and is named with the law; a law in Python flies the same, and another text is refused."""
    vary = '"redundancy.manager" = ["cross-channel", "mean"]\n"faults.0.signal"'
    library_of = unit(tmp_path, "pid", role="control-law")
    tables = []
    (tmp_path / "python").mkdir()
    for name in ("pid.py", "pid_python.toml"):
        shutil.copy(SOURCES / name, tmp_path / "python")
    in_python = read_unit(tmp_path / "python" / "pid_python.toml")
    for out, tested in (("c", library_of), ("python", in_python)):
        path = tmp_path / "campaign.toml"
        path.write_text(CAMPAIGN.replace('"faults.0.signal"', vary))
        done = run(Plan(read(path), str(path), Trust(str(path))), tmp_path / f"{out}_campaign", unit=tested)
        assert done.outcomes == {"flown": 12}
        runs = open_folder(done.out).tables["runs"].sort("run")
        tables.append(runs["digest"].to_list())
        named = f"law {tested.name} {tested.build()[:12]}"
        assert set(runs["manager"].unique()) == {f"manager {one}, {named}" for one in ("cross-channel", "mean")}
        assert set(runs.filter(pl.col("manager").str.contains("mean"))["detected"]) == {0}
        assert set(runs.filter(pl.col("manager").str.contains("cross"))["detected"]) == {1}
    assert tables[0] == tables[1]
    (tmp_path / "python" / "pid.py").write_text((SOURCES / "pid.py").read_text() + "\n")
    changed = tmp_path / "python" / "pid_python.toml"
    with pytest.raises(BadInput, match="unit"):
        run(Plan(read(path), str(path), Trust(str(path))), tmp_path / "python_campaign", unit=read_unit(changed))
