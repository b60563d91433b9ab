"""Code that a file names runs only with permission: a module that leaves a mark when it is imported."""

import json
import os
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import rig
from rig.cli import main as cli
from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.own import load_manager
from rig.core.errors import BadInput
from rig.core.trust import Trust
from rig.flight.loop import Rig
from rig.scenario import scenario
from rig.scenario.overrides import named_manager
from rig.scenario.scenario import from_resolved
from rig.studies.campaign import compile_ahead

OWN = """
import numpy as np
from pathlib import Path

with Path("mark").open("a") as file:
    file.write("imported")

class Largest:
    def __init__(self, params): pass

    frames = 0

    def step(self, bus, fcc, k):
        self.frames += 1
        fcc[k]["voted"][:] = np.fmax.reduce(bus[k]["channels"], axis=1)
        fcc[k]["level"][:] = 4

class Raises(Largest):
    def step(self, bus, fcc, k):
        super().step(bus, fcc, k)
        if self.frames == 131:
            raise ValueError("first\\nsecond")

class Exits(Largest):
    def step(self, bus, fcc, k): raise SystemExit("enough")
"""
SCENARIO = 'duration_s = 2.0\n[redundancy]\nmanager = "strange:Largest"\n'
CONFIG = '[signal.gyro]\nthreshold = 0.1\nmanager = "strange:Largest"\n'

Command = Callable[..., tuple[int, str]]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a strange module in it, and files that name its class."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [part for part in sys.path if part])
    (tmp_path / "strange.py").write_text(OWN)
    (tmp_path / "named.toml").write_text(SCENARIO)
    (tmp_path / "plain.toml").write_text("duration_s = 2.0\n")
    (tmp_path / "config.toml").write_text(CONFIG)
    rows = "\n".join(f"{k / 100},{k},{k},{k}" for k in range(20))
    (tmp_path / "gyro.csv").write_text(f"time_s,gyro.1,gyro.2,gyro.3\n{rows}\n")
    yield tmp_path
    sys.modules.pop("strange", None)


@pytest.fixture
def command(place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """command(arguments): exit code and standard error."""

    def run(*arguments: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["rig", *arguments])
        sys.modules.pop("strange", None)
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0), capsys.readouterr().err

    return run


def marked(place: Path) -> bool:
    """Whether the module was imported; forgets it."""
    mark = place / "mark"
    there = mark.exists()
    mark.unlink(missing_ok=True)
    return there


def files(place: Path) -> set[Path]:
    return {path for path in place.rglob("*") if "__pycache__" not in path.parts}


@pytest.fixture
def log(place: Path) -> Path:
    """A log whose scenario names the class."""
    flown = rig.fly("named.toml", out="logs", allow_code=True)
    assert marked(place)
    sys.modules.pop("strange", None)
    sys.path[:] = [part for part in sys.path if part]
    return flown.log


def refused(place: Path, command: Command, file: str, *arguments: str) -> None:
    """Without the option: one line, exit code 2, nothing written, nothing run; with it the code runs."""
    before, path = files(place), list(sys.path)
    code, said = command(*arguments)
    assert code == 2 and said.count("\n") == 1, said
    assert file in said and "'strange:Largest'" in said and "--allow-code" in said
    assert not marked(place) and files(place) == before and sys.path == path and "strange" not in sys.modules
    code, said = command(*arguments, "--allow-code")
    assert code == 0, said
    assert marked(place)


def test_a_scenario_that_names_a_class_flies_only_with_permission(place: Path, command: Command):
    refused(place, command, "named.toml", "fly", "named.toml", "--out", "logs")


def test_a_log_that_names_a_class_is_replayed_and_scored_only_with_permission(place: Path, command: Command, log: Path):
    for arguments in (["replay", str(log)], ["replay", str(log), "--fly"], ["score", str(log)]):
        refused(place, command, log.name, *arguments)


def test_a_what_if_runs_the_class_of_the_log_or_of_a_file_only_with_permission(
    place: Path, command: Command, log: Path
):
    level = "redundancy.discrete_persistence=9"
    refused(place, command, log.name, "replay", str(log), "--set", level)
    (place / "other.toml").write_text('manager = "strange:Largest"\n')
    plain = rig.fly("plain.toml", out="logs").log
    refused(place, command, "other.toml", "replay", str(plain), "--redundancy", "other.toml")
    assert command("replay", str(plain), "--set", "redundancy.manager=strange:Largest")[0] == 0 and marked(place)
    assert command("replay", str(log), "--set", "redundancy.manager=mean")[0] == 0 and not marked(place)


def test_a_bench_of_a_scenario_that_names_a_class_needs_permission(place: Path, command: Command):
    refused(place, command, "named.toml", "cost", "named.toml", "--set", "duration_s=0.1", "--repeats", "1")


def test_a_vote_configuration_that_names_a_class_needs_permission(place: Path, command: Command):
    refused(place, command, "config.toml", "vote", "gyro.csv", "--config", "config.toml", "--out", "out.csv")


LOOKS = (
    ["scenario", "check", "named.toml"],
    ["scenario", "show", "named.toml"],
    ["info", "LOG"],
    ["export", "LOG", "--to", "csv"],
    ["diff", "LOG", "LOG"],
    ["recover", "LOG"],
    ["score", "LOG", "--no-baseline"],
    ["report", "LOG"],
    ["view", "LOG", "--save", "flight.rrd"],
    ["faults", "list"],
)


def test_looking_at_a_file_runs_nothing_and_needs_no_permission(place: Path, command: Command, log: Path):
    for arguments in LOOKS:
        code, said = command(*(str(log) if part == "LOG" else part for part in arguments))
        assert code == 0, (arguments, said)
        assert not marked(place), arguments


def test_a_class_named_on_the_command_line_needs_no_other_permission(place: Path, command: Command):
    for given in ("redundancy.manager=strange:Largest", 'redundancy={ manager = "strange:Largest" }'):
        assert command("fly", "plain.toml", "--set", given)[0] == 0
        assert marked(place)
    code, said = command("fly", "named.toml", "--set", "redundancy.manager=strange:Exits", "--set", "duration_s=0.1")
    assert (code, marked(place)) == (1, True), said  # that one, although the file names another


def test_permission_for_one_class_is_none_for_another():
    trust = Trust("x.toml", named="strange:Largest")
    trust.require("strange:Largest")
    trust.require("median")
    with pytest.raises(BadInput, match=r"x.toml: redundancy.manager: 'strange:Exits' is code.* --allow-code"):
        trust.require("strange:Exits")
    trust.allowing(True).require("strange:Exits")
    assert named_manager([("duration_s", 1), ("redundancy.manager", "a:B")]) == "a:B"
    assert named_manager([("redundancy", {"manager": "a:B"}), ("redundancy.manager", "c:D")]) == "c:D"
    assert named_manager([("redundancy", 5), ("x.redundancy.manager", "a:B")]) is None


def test_no_file_can_grant_itself_permission(place: Path):
    for key in ("allow_code", "_trust", "trust"):
        with pytest.raises(BadInput, match=f"{key}: unknown key"):
            scenario.load("plain.toml", [f"{key}=true"])


def test_in_python_permission_is_a_keyword(place: Path):
    loaded = rig.load("named.toml")
    made = from_resolved(loaded.resolved(), "x")
    assert made == loaded == rig.load("named.toml", allow_code=True)
    for refused_one in (loaded, made):
        with pytest.raises(BadInput, match="allow_code=True"):
            rig.fly(refused_one, out="logs")
    with pytest.raises(BadInput, match="allow_code=True"):
        Rig(made)
    assert not marked(place) and not (place / "logs").exists()
    assert rig.fly(loaded, out="logs", allow_code=True).survived
    assert rig.fly(rig.load("plain.toml", ["redundancy.manager=strange:Largest"]), out="logs").survived


@pytest.mark.parametrize("name", ["strange:Largest", "sys:exit", "antigravity:x"])
def test_whatever_a_class_raises_while_it_is_made_is_one_line(name: str, place: Path):
    with pytest.raises(BadInput):
        load_manager(name, np.zeros(1, PARAMS), Trust())
    assert "antigravity" not in sys.modules and not marked(place)
    if name == "sys:exit":
        with pytest.raises(BadInput, match="neither a class nor a function") as caught:
            load_manager(name, np.zeros(1, PARAMS), Trust(allow_code=True))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "frame", "says"), [("Raises", 130, "ValueError: first second"), ("Exits", 0, "SystemExit: enough")]
)
def test_a_class_that_raises_in_flight_is_one_line_and_leaves_a_finished_log(name, frame, says, place, command):
    code, said = command("fly", "plain.toml", "--set", f"redundancy.manager=strange:{name}")
    assert code == 1 and said.count("\n") == 1
    assert said.startswith(f"failed: redundancy.manager: 'strange:{name}' raised in frame {frame}: {says}; the log")
    log = next(place.rglob("*.mcap"))
    flown = rig.read_log(log)
    assert str(log.relative_to(place)) in said
    assert len(flown.rows) == frame
    assert flown.result is not None and flown.result["end_reason"] == "the manager class raised"
    assert command("info", str(log))[0] == 0


def test_a_class_that_raises_in_a_replay_or_a_vote_is_one_line(place: Path, command: Command):
    log = rig.fly("plain.toml", out="logs").log
    code, said = command("replay", str(log), "--set", "redundancy.manager=strange:Raises")
    assert code == 1 and said.count("\n") == 1 and "raised in frame 130" in said
    (place / "config.toml").write_text(CONFIG.replace("Largest", "Exits"))
    marked(place)
    before = files(place)
    code, said = command("vote", "gyro.csv", "--config", "config.toml", "--out", "out.csv", "--allow-code")
    assert code == 1 and said.count("\n") == 1 and "raised in frame 0: SystemExit" in said
    assert files(place) - before == {place / "mark"}


NAMES = {
    "set": 'sampling = "grid"\n[set]\n"redundancy.manager" = "strange:Largest"',
    "vary": '[vary]\n"redundancy.manager" = ["median", "strange:Largest"]',
    "cases": '[[cases.manager]]\nname = "a"\nset = { "redundancy.manager" = "strange:Largest" }',
}


@pytest.mark.parametrize("where", ["set", "vary", "cases", "base"])
def test_a_campaign_that_names_a_class_anywhere_is_refused(where: str, place: Path, command: Command):
    campaign(place, where)
    before = files(place)
    for arguments in (["plan", "c.toml"], ["run", "c.toml", "--out", "out"]):
        code, said = command("campaign", *arguments)
        assert code == 2 and said.count("\n") == 1, said
        assert "c.toml" in said and "'strange:Largest' is code" in said and "--allow-code" in said
    assert not marked(place) and files(place) == before


def campaign(place: Path, where: str) -> None:
    """Write c.toml, which names the class in ``where``."""
    lines = ['base = "named.toml"' if where == "base" else 'base = "plain.toml"']
    lines += [NAMES[where]] if where != "base" else []
    (place / "c.toml").write_text("\n".join([*lines, "[run]", "workers = 1", ""]))


def test_workers_have_the_permission_of_the_command_and_a_folder_grants_none(place: Path, command: Command):
    campaign(place, "vary")
    code, said = command("campaign", "run", "c.toml", "--out", "out", "--set", "duration_s=0.1", "--allow-code")
    assert code == 0, said
    assert marked(place)
    for look in ("status", "report"):
        assert command("campaign", look, "out")[0] == 0 and not marked(place)
    assert command("campaign", "compare", "out", "out")[0] == 0 and not marked(place)
    code, said = command("campaign", "run", "c.toml", "--out", "out", "--set", "duration_s=0.1")
    assert code == 2 and "--allow-code" in said and not marked(place)
    refused(place, command, "campaign.json", "campaign", "fly", "out", "--run", "1")


def test_a_run_whose_class_raises_is_recorded_as_failed_and_the_command_ends_with_1(place: Path, command: Command):
    campaign(place, "base")
    sets = ["--set", "duration_s=1.5", "--set", "redundancy.manager=strange:Raises"]
    assert command("campaign", "run", "c.toml", "--out", "out", *sets)[0] == 1
    import polars as pl

    rows = pl.read_parquet(next((place / "out" / "runs").glob("*.parquet")))
    assert rows["outcome"].to_list() == ["failed"] and "raised in frame 130" in rows["reason"][0]


def test_a_child_that_compiles_never_finds_a_module_of_the_present_folder(place: Path, monkeypatch: pytest.MonkeyPatch):
    (place / "zlib.py").write_text('open("mark", "w").close()\n')
    program = "import os, sys, zlib; os.write(int(sys.argv[2]), zlib.compress(sys.argv[1].encode()))"
    monkeypatch.setattr(compile_ahead, "_CHILD", program)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as said, compile_ahead._child("part", writing):
        os.close(writing)
        assert zlib.decompress(said.read()) == b"part"
    assert not marked(place)


@pytest.mark.long
@pytest.mark.parametrize(
    "arguments", [["plan", "c.toml", "--json"], ["run", "c.toml", "--out", "out", "--json"]], ids=["plan", "run"]
)
def test_a_childs_import_never_finds_a_module_of_the_present_folder(arguments: list[str], place: Path):
    for name in ("numpy", "polars", "zlib", "pickle", "selectors"):
        (place / f"{name}.py").write_text('open("mark", "w").close()\n')
    (place / "c.toml").write_text('base = "plain.toml"\nset = { "duration_s" = 0.1 }\n[run]\nworkers = 1\n')
    program = [sys.executable, "-P", "-c", "from rig.cli.main import main; main()"]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"}
    done = subprocess.run([*program, "campaign", *arguments], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["runs"] == 1
    assert not marked(place)
