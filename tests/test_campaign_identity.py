"""What was flown is in a campaign's identity: own code, the unit; what could not fly is told."""

from __future__ import annotations

import json
import re
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from unit_files import library, needs_a_compiler

from rig.cli.show_campaign import progress
from rig.core.errors import BadInput, RigError
from rig.studies.campaign.folder import open_folder
from rig.studies.campaign.manager_source import first_sources, sources
from rig.studies.campaign.run_campaign import Progress
from rig.studies.campaign.worker import Orders, check_rig
from rig.unit.unit_file import read_unit

Command = Callable[..., tuple[int, str, str]]
CAMPAIGN = """
base = "f16_pitch_rate_offset_in_manoeuvre"
seed = 7
runs = 4
[set]
duration_s = 1.5
"pilot.manoeuvres" = []
"faults.0.start_s" = 0.5
"faults.0.offset" = 0.3
[vary]
turbulence = ["none", "light"]
[run]
workers = 1
batch = 2
"""
VOTER = """
import numpy as np
from PART import LIMIT


class Mid:
    def __init__(self, params):
        self.frames = 0

    def step(self, bus, fcc, k):
        self.frames += 1
        fcc["voted"][k] = np.median(bus["channels"][k], axis=-1)
        if self.frames == LIMIT:
            raise ValueError("no more votes")
"""


def voter(module: str, limit: int = -1, part: str = "part_of_it") -> None:
    Path(f"{module}.py").write_text(VOTER.replace("PART", part))
    Path(f"{part}.py").write_text(f"LIMIT = {limit}\n")


def campaign(text: str = CAMPAIGN) -> str:
    Path("c.toml").write_text(text)
    return "c.toml"


def test_an_edited_class_or_a_module_that_it_imports_is_refused(rig_command: Command):
    voter("edited_voter", part="edited_part")
    run = ("campaign", "run", campaign(), "--out", "E", "--set", "redundancy.manager=edited_voter:Mid")
    code, _, err = rig_command(*run, "--runs", "2")
    assert code == 0, err
    before = open_folder(Path("E")).tables["runs"]
    Path("edited_part.py").write_text("LIMIT = -2\n")
    code, _, err = rig_command(*run)
    assert code == 2 and "sources.edited_voter:Mid.edited_part.py was " in err and ", is " in err
    voter("edited_voter", part="edited_part")
    Path("edited_voter.py").write_text(Path("edited_voter.py").read_text() + "# longer\n")
    code, _, err = rig_command(*run)
    assert code == 2 and "sources.edited_voter:Mid.edited_voter.py was " in err
    assert open_folder(Path("E")).tables["runs"].equals(before)
    voter("edited_voter", part="edited_part")
    assert rig_command(*run)[0] == 0


def test_a_class_that_the_file_names_is_in_the_identity_too(rig_command: Command):
    voter("named_voter", part="named_part")
    text = CAMPAIGN.replace("[set]\n", '[set]\n"redundancy.manager" = "named_voter:Mid"\n')
    run = ("campaign", "run", campaign(text), "--out", "E", "--allow-code")
    assert rig_command(*run, "--runs", "1")[0] == 0
    voter("named_voter", limit=-5, part="named_part")
    code, _, err = rig_command(*run)
    assert code == 2 and "sources.named_voter:Mid.named_part.py was " in err


@pytest.mark.parametrize(
    ("manager", "why"),
    [
        ("no_such_voter:Mid", "ModuleNotFoundError: No module named 'no_such_voter'"),
        ("there_voter:Md", "AttributeError: module 'there_voter' has no attribute 'Md'"),
        ("broken_voter:Mid", "ZeroDivisionError: division by zero"),
        ("ending_voter:Mid", "its import ended a process with code 3"),
    ],
)
def test_a_class_that_cannot_be_imported_is_refused_before_the_first_flight(
    rig_command: Command, manager: str, why: str
):
    voter("there_voter", part="there_part")
    Path("broken_voter.py").write_text("1 / 0\n")
    Path("ending_voter.py").write_text("import os\nos._exit(3)\n")
    code, _, err = rig_command("campaign", "run", campaign(), "--out", "E", "--set", f"redundancy.manager={manager}")
    assert code == 2 and err.count("\n") == 1 and why in err and manager in err
    assert not Path("E").exists()


@pytest.mark.long
def test_runs_that_could_not_be_flown_are_told_and_flown_again(rig_command: Command):
    """Three of four: with turbulence, and the second of a part without; then none, as what failed them is gone."""
    Path("switch").write_text("2\n")
    Path("flaky_voter.py").write_text(
        "from pathlib import Path\n"
        + VOTER.replace("from PART import LIMIT", "LIMIT = -1").replace(
            "self.frames = 0", 'self.frames = 0\n        if Path("sw" + "itch").exists(): raise OSError("no switch")'
        )
    )
    run = ("campaign", "run", campaign(), "--out", "E", "--set", "redundancy.manager=flaky_voter:Mid")
    code, out, err = rig_command(*run)
    assert code == 1 and "0 of 4 done, 4 failed" in out
    assert "failed: 4 runs could not be flown; run 0: failed: BadInput: redundancy.manager" in err
    assert "OSError: no switch; the same command flies them again" in err
    code, out, _ = rig_command("campaign", "status", "E", "--json")
    assert (json.loads(out)["done"], json.loads(out)["not_flown"]) == (0, 4) and "no switch" in json.loads(out)[
        "first_reason"
    ]
    assert "4 runs could not be flown; run 0" in rig_command("campaign", "report", "E")[1]
    Path("switch").unlink()
    code, out, err = rig_command(*run, "--json")
    found = json.loads(out)
    assert code == 0, err
    assert (found["done"], found["flown_now"], found["not_flown"], found["first_reason"]) == (4, 4, 0, None)
    whole = rig_command(*run[:4], "W", *run[5:], "--json")
    assert json.loads(whole[1])["table_sha256"] == found["table_sha256"]


def test_of_a_part_the_runs_that_were_flown_are_kept(rig_command: Command):
    Path("half_voter.py").write_text(VOTER.replace("from PART import LIMIT", "LIMIT = 100"))
    text = CAMPAIGN.replace("turbulence =", '"redundancy.manager" = ["mean", "half_voter:Mid", "mean"]\nturbulence =')
    run = ("campaign", "run", campaign(text.replace("runs = 4\n", "").replace("batch = 2", "batch = 6")), "--out", "E")
    code, out, _ = rig_command(*run, "--allow-code", "--json")
    assert code == 1 and [json.loads(out)[key] for key in ("done", "flown_now", "failed")] == [4, 4, 2]
    before = open_folder(Path("E")).tables["faults"]
    code, out, _ = rig_command(*run, "--allow-code", "--json")
    assert code == 1 and [json.loads(out)[key] for key in ("done", "flown_now", "failed")] == [4, 0, 2]
    runs = open_folder(Path("E")).tables["runs"]
    assert runs["run"].to_list() == list(range(6)) and before.equals(open_folder(Path("E")).tables["faults"])


@needs_a_compiler
def test_a_unit_and_its_build_are_named_and_one_manager_is_compared_with_it(rig_command: Command):
    Path("u.toml").write_text(f'name = "mvs"\npath = "{library("monitor")}"\n')
    assert rig_command("campaign", "run", campaign(), "--out", "U", "--unit", "u.toml", "--runs", "2")[0] == 0
    assert rig_command("campaign", "run", campaign(), "--out", "O", "--runs", "2")[0] == 0
    build = read_unit("u.toml").build()[:12]
    assert set(open_folder(Path("U")).tables["runs"]["manager"]) == {f"unit mvs {build}"}
    assert f"unit mvs {build}" in rig_command("campaign", "status", "U")[1]
    rig_command("campaign", "report", "U")
    assert f"Unit mvs {build}." in Path("U/report.html").read_text()
    code, out, err = rig_command("campaign", "compare", "U", "O")
    assert code == 0, err
    assert f"voted by unit mvs {build}; in the second by manager cross-channel" in out
    assert f'unit was "unit mvs {build}", is not there' in out and "nothing" not in out
    same = rig_command("campaign", "compare", "U", "U")[1]
    assert f"voted by unit mvs {build}, in both" in same and "nothing" in same
    Path("u.toml").write_text(Path("u.toml").read_text() + "latency_frames = 1\n")
    code, _, err = rig_command("campaign", "run", "c.toml", "--out", "U", "--unit", "u.toml")
    assert code == 2 and "unit.latency_frames was 0, is 1" in err


def test_a_script_that_a_command_names_is_part_of_its_build(tmp_path: Path):
    (tmp_path / "u.py").write_text("1\n")
    (tmp_path / "u.toml").write_text(
        f'name = "s"\ntransport = "udp"\ncommand = ["{sys.executable}", "u.py", "{{address}}"]\n'
    )
    before = read_unit(tmp_path / "u.toml")
    was, logged = before.build(), before.about()
    (tmp_path / "u.py").write_text("2\n")
    after = read_unit(tmp_path / "u.toml")
    assert after.build() != was and after.identity()["sha256"] == after.build()
    was_read, is_read = logged.pop("read_sha256"), (now := after.about()).pop("read_sha256")
    assert now == logged and [name for name in is_read if is_read[name] != was_read[name]] == ["u.py"]


def test_the_files_of_a_manager_are_those_that_it_imports_or_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    package = tmp_path / "own_pack"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "vote.py").write_text(
        "import json\nimport numpy\nfrom . import sub\nfrom rig.core import errors\nW = 'w.json'\n"
    )
    (package / "sub.py").write_text("def late():\n    import own_beside\n")
    (package / "w.json").write_text("1")
    (package / "other.py").write_text("")
    (tmp_path / "own_beside.py").write_text("from own_pack.vote import W\n")
    found = sources(["own_pack.vote:Mid", "mean"])
    names = ["own_beside.py", "own_pack/__init__.py", "own_pack/sub.py", "own_pack/vote.py", "own_pack/w.json"]
    assert list(found) == ["own_pack.vote:Mid"] and list(found["own_pack.vote:Mid"]) == names
    (package / "w.json").write_text("2")
    changed = sources(["own_pack.vote:Mid"])["own_pack.vote:Mid"]
    assert [name for name in names if changed[name] != found["own_pack.vote:Mid"][name]] == ["own_pack/w.json"]
    with pytest.raises(BadInput, match=r"no module 'no_such_pack\.vote'"):
        sources(["no_such_pack.vote:Mid"])


def test_a_worker_that_has_another_source_or_none_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from rig.studies.campaign.plan import rig_identity

    monkeypatch.chdir(tmp_path)
    (tmp_path / "worker_voter.py").write_text("1\n")
    first_sources.cache_clear()
    files = sources(["worker_voter:Mid"])

    def orders(of: dict[str, Any]) -> Orders:
        return Orders("none", 1, "", 1.0, False, rig_identity(), sources=of)

    check_rig(orders(files))
    (tmp_path / "worker_voter.py").write_text("2\n")  # it has imported the one before, and goes on with it
    check_rig(orders(files))
    with pytest.raises(RigError, match=r"another worker_voter\.py of 'worker_voter:Mid'.*start the workers again"):
        check_rig(orders(sources(["worker_voter:Mid"])))
    with pytest.raises(RigError, match=r"a worker cannot fly it: .*no module 'absent_voter'"):
        check_rig(orders({"absent_voter:Mid": {"absent_voter.py": "0"}}))


def test_a_line_tells_in_a_pipe_how_far_a_campaign_is(rig_command: Command):
    _, _, err = rig_command("campaign", "run", campaign(), "--out", "E")
    assert re.match(r"(2 of 4 runs, [\d.]+ per second, about .+ left|4 of 4 runs, [\d.]+ per second)\n", err)
    assert rig_command("campaign", "run", campaign(), "--out", "J", "--json")[2] == ""


def test_a_line_gives_the_runs_done_the_rate_and_the_time_left(capsys: pytest.CaptureFixture[str]):
    with progress(enabled=True) as report:
        assert report is not None
        report(Progress(runs=4, done=2, flown=2, outcomes=Counter(flown=2, lost=1), began=time.perf_counter() - 10))
        report(Progress(runs=4, done=3, flown=3))  # sooner after the first than a line is due
    assert capsys.readouterr().err == "2 of 4 runs, 1 lost, 0.2 per second, about 10 s left\n"


@pytest.mark.long
def test_two_managers_in_one_campaign_are_told_apart(rig_command: Command):
    text = CAMPAIGN.replace('"faults.0.offset" = 0.3\n', "").replace("runs = 4\n", "")
    text = text.replace("duration_s = 1.5", "duration_s = 4.0").replace('start_s" = 0.5', 'start_s" = 3.0')
    text = text.replace(
        'turbulence = ["none", "light"]',
        '"redundancy.manager" = ["cross-channel", "cross-voter"]\n"faults.0.offset" = [0.0005, 0.03, 0.3]',
    )
    assert rig_command("campaign", "run", campaign(text), "--out", "E")[0] == 0
    code, out, err = rig_command("campaign", "report", "E", "--json")
    assert code == 0, err
    found = json.loads(out)
    smallest = {row["of"]: row["fit"]["magnitudes"][0]["value"] for row in found["detectable"]}
    assert smallest["cross-channel"] < 0.03 < smallest["cross-voter"]
    rows = {row["level"]: row for row in found["by_varied"] if row["key"] == "manager"}
    counts = {name: (row["detection_of_all"]["count"], row["detection_of_all"]["of"]) for name, row in rows.items()}
    assert counts == {"cross-channel": (2, 3), "cross-voter": (1, 3)}
    delays = {name: row["delay_from_onset_s"]["median"] for name, row in rows.items()}
    assert (
        delays["cross-voter"] == pytest.approx(0.07) and 0.07 < delays["cross-channel"] < 0.15
    )  # a test needs 14 frames
    said = rig_command("campaign", "report", "E")[1]
    assert "vary by name" in said and "offset of pitch_rate  cross-voter" in said
    page = Path("E/report.html").read_text()
    assert "cross-channel, cross-voter" in page and "These figures pool all runs" in page
    assert found["by"] == "manager cross-channel, cross-voter"
    assert pl.DataFrame(found["by_kind"])["of"].to_list() == ["cross-channel", "cross-voter"]
