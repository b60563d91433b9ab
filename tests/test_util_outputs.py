"""No command writes over an input, a campaign's own file or its other output, however the name is spelled."""

import os
import shutil
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import typer

import rig
from rig.cli.main import app
from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.core.outputs import require_apart
from rig.scenario.aircraft import folder as aircraft_folder

THRESHOLDS = ["thresholds", "in.csv", "--config", "c.toml", "--budget", "3", "--monitored", "m.csv"]
VOTE = ["vote", "in.csv", "--config", "c.csv", "--inject", "f.csv"]
TREE = ["reliability", "tree", "C", "--rates", "r.toml"]
CASE = ["reliability", "report", "S", "--cells", "T", "--faults", "C", "--rates", "r.toml"]
REPLAY = ["replay", "q.mcap", "--redundancy", "r.mcap"]
OWN = (
    "C/campaign.json",
    "C/lock",
    "C/runs/000000-000003.parquet",
    "C/logs/run_000000.mcap",
    "C/search.json",
    "C/until.json",
    "C/worst.toml",
    "C/worst_2.toml",
)
BENCHMARK = ("L/benchmark.json", "L/levels.json", "L/result.json", "L/lock", "L/units/000000-000000.parquet")
SETS = ("S/cutsets.json", "S/sets.json", "S/confirmed.json")
# A command without the option that names its output, that option, and what it must not be.
COMMANDS: tuple[tuple[list[str], str, tuple[str, ...]], ...] = (
    (["report", "q.mcap"], "--out", ("q.mcap", OWN[0])),
    (["report", "q.mcap", "--requirements", "c.toml"], "--out", ("c.toml",)),
    (["export", "q.mcap", "--to", "csv"], "--out", ("q.mcap", OWN[0])),
    (["export", "q.mcap", "--to", "parquet"], "--out", ("q.mcap", *BENCHMARK)),
    (["export", "q.mcap", "--to", "npz"], "--out", ("q.mcap",)),
    (["export", "q.mcap", "--layout", "foxglove"], "--out", ("q.mcap", OWN[0])),
    (["recover", "q.mcap"], "--out", ("q.mcap", *OWN)),
    (REPLAY, "--out", ("q.mcap", "r.mcap", OWN[0])),
    (VOTE, "--out", ("in.csv", "c.csv", "f.csv", OWN[2])),
    ([*VOTE, "--requirements", "m.csv"], "--out", ("m.csv",)),
    (["diagnose", "in.csv", "--config", "c.toml"], "--page", ("in.csv", "c.toml", OWN[0])),
    (["vote", "T", "--config", "c.csv"], "--out", ("T/cells.parquet",)),
    (["vote", "D", "--config", "c.csv"], "--out", ("D/in.csv",)),
    (THRESHOLDS, "--out", ("in.csv", "c.toml", "m.csv", OWN[0])),
    ([*THRESHOLDS, "--out", "o.toml"], "--plot", ("in.csv", "c.toml", "m.csv", OWN[0])),
    (["thresholds", "D", "--budget", "3"], "--out", ("D/in.csv",)),
    (["view", "q.mcap", "b.mcap"], "--save", ("q.mcap", "b.mcap", OWN[0])),
    (["view", "q.mcap", "b.mcap"], "--screenshot", ("q.mcap", "b.mcap", OWN[0])),
    (["campaign", "report", "C"], "--out", OWN),
    (["campaign", "sensitivity", "C", "--of", "delay_s"], "--out", OWN),
    (["reliability", "run", "C", "T", "--rates", "r.toml"], "--report", ("r.toml", OWN[0], "T/trials.json")),
    (["benchmark", "reliability", "--healthy", "C", "--out", "L"], "--plot", ("C/campaign.json",)),
    (["aircraft", "design", "f16_own"], "--out", ("f16_own/aircraft.toml",)),
    (["benchmark", "reliability", "--healthy", "C", "--out", "new"], "--plot", (OWN[0], BENCHMARK[2])),
    (TREE, "--out", ("r.toml", OWN[0], "S/sets.json")),
    ([*TREE, "--out", "o.xml"], "--chain", ("r.toml", OWN[0])),
    ([*TREE, "--out", "o.xml"], "--svg", ("r.toml", OWN[0])),
    (["reliability", "fmea", "C", "--rates", "r.toml"], "--out", ("r.toml", OWN[0], "S/cutsets.json")),
    (CASE, "--out", ("r.toml", OWN[0], "S/confirmed.json", "T/cells.parquet")),
)
# These write under new names in a folder.
FOLDERS: tuple[list[str], ...] = (
    ["fly", "s.toml"],
    ["campaign", "run", "s.toml"],
    ["aircraft", "new", "mine", "--base", "c172x"],
    ["reliability", "trials", "reliability", "--runs", "1"],
    ["benchmark", "reliability", "--healthy", "C"],
    ["study", "ding2015"],
    ["search", "s.toml", "--requirement", "load_factor", "--flights", "100"],
    ["reliability", "cutsets", "--order", "1", "--flights", "1"],
)
FILES = ("q.mcap", "b.mcap", "r.mcap", "in.csv", "m.csv", "c.csv", "f.csv", "c.toml", "r.toml", "D/in.csv")


def linked(path: str) -> str:
    link = f"link{Path(path).suffix}"
    Path(link).symlink_to(Path(path).absolute())
    return link


def hard_linked(path: str) -> str:
    link = f"hard{Path(path).suffix}"
    Path(link).hardlink_to(path)
    return link


def through_a_link(path: str) -> str:
    Path("here").symlink_to(Path.cwd())
    return f"here/{path}"


SPELLINGS: dict[str, Callable[[str], str]] = {
    "same": str,
    "dot": lambda path: f"./{path}",
    "detour": lambda path: f"D/../{path}",
    "absolute": lambda path: str(Path(path).absolute()),
    "link": linked,
    "hard link": hard_linked,
    "link to the folder": through_a_link,
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with inputs: what is in them does not matter, they are not read."""
    monkeypatch.chdir(tmp_path)
    for name in (*FILES, *OWN, *BENCHMARK, *SETS, "T/trials.json", "T/cells.parquet"):
        path = Path(name)
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(f"this is {name}")
    shutil.copytree(aircraft_folder("f16"), "f16_own")
    return tmp_path


def everything(folder: Path) -> dict[str, bytes]:
    """All files below a folder, and what is in them."""
    found = (Path(at) / name for at, _, names in os.walk(folder) for name in names)
    return {str(path): path.read_bytes() for path in found}


@pytest.mark.parametrize(
    ("command", "option", "paths"), [pytest.param(*each, id=f"{' '.join(each[0])} {each[1]}") for each in COMMANDS]
)
def test_no_command_writes_over_what_it_reads(rig_command, here, command, option, paths):
    """By each of its names.

    A hard link of what a campaign keeps is replaced and not written to: where it is no input, no file is lost.
    """
    files = everything(here)
    for path, spelled in product(paths, SPELLINGS):
        read = Path(path).parts[0] in command and path not in ("C/lock", "C/worst.toml", "C/worst_2.toml")
        if spelled == "hard link" and path in OWN + BENCHMARK + SETS and not read:
            continue
        out = SPELLINGS[spelled](path)
        before = everything(here)
        code, said, error = rig_command(*command, option, out)
        assert (code, said, error.count("\n")) == (2, "", 1), (path, spelled, error)
        assert error.startswith("error: ") and option in error, (path, spelled, error)
        assert any(why in error for why in ("is the input", "is among the data", "belongs to the folder")), error
        assert everything(here) == before, (path, spelled)
        for link in before.keys() - files.keys():
            Path(link).unlink()
        Path("here").unlink(missing_ok=True)


@pytest.mark.parametrize(
    "command",
    [
        *(["report", "a.mcap", "--out"], ["campaign", "report", "C", "--out"]),
        ["reliability", "run", "C", "--rates", "rates.toml", "--report"],
        ["thresholds", "d.csv", "--config", "v.toml", "--budget", "3", "--out", "w.toml", "--plot"],
    ],
    ids=lambda command: command[0],
)
def test_a_page_for_a_browser_ends_with_html(rig_command, here, command):
    before = everything(here)
    code, out, err = rig_command(*command, "page.txt")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"{command[-1]} page.txt: must end with .html, as a page for a browser" in err
    assert everything(here) == before


@pytest.mark.parametrize(
    ("spelled", "there"),
    [(name, there) for name in SPELLINGS for there in (True, False) if there or name not in ("link", "hard link")],
)
def test_two_outputs_are_two_files(rig_command, here, spelled, there):
    if there:
        Path("both.toml").write_text("precious")
    plot = SPELLINGS[spelled]("both.toml")
    before = everything(here)
    code, _, error = rig_command(*THRESHOLDS, "--out", "both.toml", "--plot", plot)
    said = f"error: --plot {Path(plot)}: is the file of --out too\n"
    assert (code, error) == (2, said) and everything(here) == before


@pytest.mark.parametrize("out", ["references.toml", "./references.toml", "runs/../references.toml"])
def test_gains_and_references_are_two_files(rig_command, here, monkeypatch, out):
    monkeypatch.chdir("f16_own")
    Path("runs").mkdir()
    before = everything(here)
    code, _, error = rig_command("aircraft", "design", str(here / "f16_own"), "--out", out)
    assert code == 2 and "references.toml: is the file of --out too" in error and everything(here) == before


@pytest.mark.parametrize(
    ("command", "log"),
    [(["report"], "a.html"), (["export", "--to", "csv"], "a.csv"), (["export", "--layout", "foxglove"], None)],
)
def test_the_name_that_is_not_given_is_not_the_input_either(rig_command, here, command, log):
    log = log or "a.foxglove.json"
    Path(log).write_text("a log may have any name")
    if log.endswith("json"):
        Path("a").symlink_to(log)  # its layout would be a.foxglove.json
        log = "a"
    before = everything(here)
    code, _, error = rig_command(command[0], log, *command[1:])
    assert code == 2 and "is the input" in error and everything(here) == before


@pytest.mark.parametrize("command", FOLDERS, ids=lambda command: " ".join(command[:2]))
def test_a_folder_for_outputs_is_not_the_input(rig_command, here, command):
    shutil.copy(bundled("faults") / "f16_pitch_rate_hardover.toml", "s.toml")
    if command[0] in ("campaign", "search"):
        Path("s.toml").write_text('title = "two"\nruns = 2\nbase = "f16_pitch_rate_hardover"\n')
    before = everything(here)
    code, said, error = rig_command(*command, "--out", "s.toml")
    assert (code, said, error.count("\n")) == (2, "", 1) and "s.toml" in error, error
    assert everything(here) == before


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_the_recording_of_a_flight_takes_no_name_that_is_taken(rig_command, here, link):
    scenario = 'title = "short"\naircraft = "f16"\nduration_s = 0.5\n'
    Path("s.toml").write_text(scenario)
    Path("logs").mkdir()
    link(here / "s.toml", here / "logs" / "s_seed1.rrd")
    code, _, error = rig_command("fly", "s.toml", "--seed", "1", "--rerun", "save", "--json")
    assert code == 0, error
    assert Path("s.toml").read_text() == scenario and Path("logs/s_seed1.rrd").samefile("s.toml")
    assert sorted(path.name for path in Path("logs").iterdir()) == ["s_seed1.rrd", "s_seed1_2.mcap", "s_seed1_2.rrd"]


@pytest.mark.parametrize("out", ["E/real.csv", "F/inner/deep.csv", "G/linked/deep.csv", "here/E/real.csv"])
def test_what_links_in_a_folder_lead_to_is_its_data(rig_command, here, out):
    for name in ("E/real.csv", "F/inner/deep.csv"):
        Path(name).parent.mkdir(parents=True)
        Path(name).write_text("precious")
    Path("D/link.csv").symlink_to("../E/real.csv")
    Path("G").mkdir()
    Path("G/linked").symlink_to("../F/inner")
    Path("G/round").symlink_to("../G")  # which ends
    through_a_link("")
    before = everything(here)
    for command in (["thresholds", "D", "G", "--budget", "3"], ["vote", "G" if "deep" in out else "D"]):
        code, said, error = rig_command(*command, "--out", out)
        assert (code, said) == (2, "") and f"--out {out}: is among the data of the input" in error
    assert everything(here) == before


WRONG_ENDINGS = {
    ("replay", "q.mcap", "--set", "redundancy.manager=voter:Mine"): "must end with .mcap, as a log",
    ("thresholds", "in.csv", "--config", "c.toml", "--budget", "3"): "must end with .toml, as a configuration",
    ("aircraft", "design", "f16_own"): "must end with .toml, as a file of gains",
}


@pytest.mark.parametrize("command", WRONG_ENDINGS, ids=lambda command: command[0])
def test_code_that_an_input_names_is_not_an_output(rig_command, here, command):
    Path("voter.py").write_text("class Mine: ...")
    before = everything(here)
    code, said, error = rig_command(*command, "--out", "voter.py")
    assert (code, said, error) == (2, "", f"error: --out voter.py: {WRONG_ENDINGS[command]}\n")
    assert everything(here) == before


@pytest.mark.parametrize("source", ["../in.csv", "D/../../in.csv", "ABSOLUTE"])
def test_a_source_of_a_mapping_is_in_its_folder(rig_command, here, source):
    """Else it could be the output: only what is in the folder is compared with it."""
    source = source.replace("ABSOLUTE", str(here / "in.csv"))
    channels = "".join(f'"pitch_rate.{c}" = "{source}:q{c}"\n' for c in (1, 2, 3))
    Path("map.toml").write_text(f"[mapping]\n{channels}[signal.pitch_rate]\nthreshold = 1\n")
    before = everything(here)
    code, _, error = rig_command("vote", "D", "--config", "map.toml", "--out", "in.csv")
    assert code == 2 and f"[mapping] {source}: must be a file in the folder D" in error
    assert everything(here) == before


@pytest.mark.parametrize("spelled", ["same", "dot", "absolute", "link", "hard link", "link to the folder"])
def test_the_results_of_a_suite_are_none_of_its_files(rig_command, here, spelled):
    Path("a.toml").write_text('title = "short"\naircraft = "f16"\nduration_s = 0.5\n')
    shutil.copy(bundled("faults") / "requirements" / "handling.toml", "asked.toml")
    Path("suite.toml").write_text('requirements = ["asked.toml"]\n[[cases]]\nscenario = "a.toml"\n')
    Path("suite.decisions.toml").write_text("a = []\n")
    for name in ("suite.toml", "a.toml", "asked.toml", "suite.decisions.toml"):
        junit = SPELLINGS[spelled](name)
        before = everything(here)
        code, said, error = rig_command("check", "suite.toml", "--junit", junit)
        assert (code, said) == (2, "") and "is the input" in error and everything(here) == before
        for path in ("link.toml", "hard.toml", "here"):
            Path(path).unlink(missing_ok=True)
    code, _, error = rig_command("check", "suite.toml", "--junit", "voter.py")
    assert (code, error) == (2, "error: --junit voter.py: must end with .xml, as JUnit XML\n")


def test_gains_do_not_replace_what_the_aircraft_is_made_from(rig_command, here):
    Path("f16_own/gains.toml").unlink()
    Path("f16_own/gains.toml").symlink_to("aircraft.toml")
    before = everything(here)
    code, _, error = rig_command("aircraft", "check", "./f16_own", "--accept")
    assert code == 2 and "gains.toml: is the input" in error and everything(here) == before


def test_a_page_in_python_ends_with_html_too(here):
    with pytest.raises(BadInput, match=r"out page.txt: must end with .html, as a page for a browser"):
        rig.report("q.mcap", "page.txt")


def test_what_harms_nothing_is_allowed(here):
    page, table, layout = Path("C/report.html"), Path("C/logs/run_000000.csv"), Path("C/thresholds.toml")
    for path in (page, table, layout):
        path.write_text("from an earlier time")
    require_apart({"--out": page}, ["C"])
    require_apart({"--out": layout, "--plot": page}, ["C"])
    require_apart({"--out": Path("D/voted.csv")}, ["D"])
    require_apart({"--out": table}, ["C/logs/run_000000.mcap"])
    require_apart({"--out": Path("C/logs/run_000000.what-if.mcap"), "--plot": None}, ["C/logs/run_000000.mcap", None])
    require_apart({"--out": Path("runs/000000-000003.parquet")}, ["bundled_name", "n" * 300, "a\0b"])


def test_a_name_that_no_file_can_have_is_one_line():
    with pytest.raises(BadInput, match="null byte"):
        require_apart({"--out": Path("a\0b")})


def test_every_option_that_names_an_output_is_in_the_tables():
    found = {(path, option) for path, option in _outputs(typer.main.get_command(app), ())}
    listed = {(_of(command), option) for command, option, _ in COMMANDS}
    listed |= {(_of(command), "--out") for command in FOLDERS} | {(("campaign", "fly"), "--out")}  # a new log
    listed |= {(("check",), "--junit")}  # whose inputs the suite names: a test of its own
    listed |= {(("fmu", "build"), "--out")}  # a new file that ends in .fmu, as no input does
    listed |= {(("mcp",), "--out")}  # a folder, in which the commands write as they do without it
    assert found == listed


OPTIONS = ("--page", "--out", "--save", "--screenshot", "--plot", "--report", "--chain", "--svg", "--junit")
GROUPS = ("campaign", "reliability", "aircraft", "study")


def _of(command: list[str]) -> tuple[str, ...]:
    return tuple(command[: 2 if command[0] in GROUPS else 1])


def _outputs(command: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    for name, inner in getattr(command, "commands", {}).items():
        yield from _outputs(inner, (*path, name))
    for parameter in command.params:
        older = "--plot" if "--report" in parameter.opts else ""  # its older name
        yield from ((path, option) for option in parameter.opts if option in OPTIONS and option != older)
