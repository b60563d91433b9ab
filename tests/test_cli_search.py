"""``rig search``: bad input is one line and writes nothing; the command from nothing to the scenario file."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from unit_files import needs_a_compiler, unit

from rig.cli.search import SearchOptions, _plan

Command = Callable[..., tuple[int, str, str]]
FILE = """
base = "base.toml"
sampling = "random"
runs = 1
"""
BASE = """
duration_s = 1.5
redundancy.manager = "mean"
[[faults]]
kind = "offset"
signal = "pitch_rate"
channels = [1]
start_s = 0.5
offset = 0.1
"""
OFFSET = """
[vary]
"faults.0.offset" = { low = 0.05, high = 1.0, log = true }
"""


def space(folder: Path, varied: str = OFFSET) -> str:
    (folder / "base.toml").write_text(BASE)
    (folder / "space.toml").write_text(FILE + varied)
    return str(folder / "space.toml")


@pytest.mark.parametrize(
    ("varied", "options", "told"),
    [
        ('[vary]\nturbulence = ["none", "light"]\n', (), "vary: no number varies with none; a search needs a range"),
        (OFFSET, ("--trials-first", "--bench"), "--trials-first: not with --bench"),
        (OFFSET, ("--trials-first", "--method", "cma"), "--trials-first: not with --method cma"),
        (OFFSET, ("--trials-first", "--requirement", "departure"), "--trials-first: "),
        (OFFSET, ("--requirement", "vot"), "--requirement 'vot': unknown, "),
        (OFFSET, ("--requirements", "redundanc"), "redundanc: no such requirements file; bundled: "),
        (OFFSET, ("--against", "redundancy.managr=median"), "--against redundancy.managr=median: redundancy.managr: "),
        (OFFSET, ("--against", "faults.0.offset=1"), "--against faults.0.offset: varies in the campaign"),
        (OFFSET, ("--against", "median"), "--against median: must be key=value"),
        (OFFSET, ("--method", "best"), "--method 'best': must be one of regions, cma, random"),
        (OFFSET, ("--set", "redundancy.manager=rig.none:Other", "--bench"), "redundancy.manager: "),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    rig_command: Command, tmp_path: Path, varied: str, options: tuple[str, ...], told: str
):
    given = () if "--requirement" in options else ("--requirement", "vote")
    code, out, err = rig_command("search", space(tmp_path, varied), *given, "--flights", "60", "--out", "s", *options)
    assert (code, out) == (2, "") and told in err and err.count("\n") == 1
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(
    ("more", "first"),
    [
        ({}, True),
        ({"trials_first": False}, False),
        ({"requirement": ["departure"]}, False),  # needs the plant
        ({"method": "cma"}, False),
        ({"bench": True}, False),
        ({"unit": Path("unit.toml")}, False),
        ({"sets": ["redundancy.manager=rig.none:Other"]}, False),
    ],
)
def test_trials_come_first_where_open_loop_can_have_the_settings(tmp_path: Path, more: dict[str, Any], first: bool):
    options = {"campaign": space(tmp_path), "flights": 60, "out": tmp_path / "s", "requirement": ["vote"], **more}
    assert _plan(SearchOptions(**options)).asked.trials_first == first


def test_a_folder_of_something_else_is_refused(rig_command: Command, tmp_path: Path):
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "mine.txt").write_text("mine")
    code, _, err = rig_command("search", space(tmp_path), "--requirement", "vote", "--flights", "60", "--out", "s")
    assert code == 2 and err == "error: --out s: is not empty and not a campaign's folder\n"
    assert [path.name for path in (tmp_path / "s").iterdir()] == ["mine.txt"]


@pytest.mark.long
def test_from_nothing_to_a_scenario_that_violates(
    rig_command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("rig.studies.search.shrink.TRIES", 2)
    monkeypatch.setattr("rig.studies.search.confirm_worst.SEEDS", 3)
    monkeypatch.setattr("rig.studies.search.worst_cases.MOST", 1)
    arguments = ("search", space(tmp_path), "--requirement", "vote", "--flights", "36", "--bench", "--workers", "1")
    code, out, err = rig_command(*arguments, "--out", "s")
    labels = [line.split()[0] for line in out.splitlines() if not line.startswith(" ")]
    assert code == 0 and labels == ["flights", "cluster", "at", "ended", "folder"] and "least robustness" in err
    code, again, _ = rig_command(*arguments, "--out", "s", "--json")
    figures = json.loads(again)
    assert figures == json.loads((tmp_path / "s" / "search.json").read_text())
    assert figures["violated"] > 0 and figures["clusters"][0]["scenario"] == "s/worst.toml"
    code, out, _ = rig_command("fly", "s/worst.toml", "--requirements", "redundancy", "--strict", "--json")
    assert code == 1


@needs_a_compiler
@pytest.mark.long
def test_a_unit_is_searched_and_the_search_does_not_go_on_with_another_environment(
    rig_command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("rig.studies.search.shrink.TRIES", 2)
    monkeypatch.setattr("rig.studies.search.confirm_worst.SEEDS", 3)
    monkeypatch.setattr("rig.studies.search.worst_cases.MOST", 1)
    tested = unit(tmp_path, "reads", environment={"VOTER": "a"})  # it votes channel 1, which has the fault
    asked = ("--requirement", "vote", "--flights", "36", "--workers", "1", "--unit", tested.unit_file)
    code, out, err = rig_command("search", space(tmp_path), *asked, "--out", "s", "--json")
    assert code == 0 and json.loads(out)["violated"] > 0, err
    assert "environment VOTER=a" in rig_command("campaign", "status", "s")[1]
    unit(tmp_path, "reads", environment={"VOTER": "b"})
    code, out, err = rig_command("search", space(tmp_path), *asked, "--out", "s")
    assert (code, out) == (2, "") and 'unit.environment.VOTER was "a", is "b"' in err
    code, out, err = rig_command("search", space(tmp_path), *asked, "--bench", "--out", "b")
    assert (code, out) == (2, "") and "--unit: not with --bench, which votes without a flight" in err
    assert not Path("b").exists()
