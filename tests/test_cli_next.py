"""The commands that a flight prints as the next ones work as printed, by any voter; and they name it."""

import shlex
import shutil
from pathlib import Path

from unit_files import build, needs_a_compiler

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"
SHORT = ("--set", "duration_s=2", "--set", "faults.0.start_s=1")


def next_of(out: str) -> list[list[str]]:
    """The arguments of ``rig`` of each command, without its comment."""
    lines = out.partition("\nnext ")[2].splitlines()
    return [shlex.split(line, comments=True)[1:] for line in lines]


def run_all(rig_command, out: str) -> list[str]:
    said = []
    for command in next_of(out):
        also = ["--save", "flight.rrd"] if command[0] == "view" else []
        code, printed, err = rig_command(*command, *also)
        assert code == 0, (command, err)
        said.append(printed)
    return said


def test_after_a_flight_by_a_manager_class(rig_command, tmp_path: Path):
    shutil.copy(EXAMPLES / "manager" / "mine.py", tmp_path)
    code, out, _ = rig_command("fly", *SHORT, "--set", "redundancy.manager=mine:first_valid")
    assert code == 0 and "manager mine:first_valid" in out.splitlines()[0]
    assert [command[0] for command in next_of(out)] == ["score", "view", "replay"]
    score, _, replay = run_all(rig_command, out)
    assert "manager mine:first_valid" in score.splitlines()[0] and "identical" in replay


@needs_a_compiler
def test_after_a_flight_by_a_unit_which_is_named_in_the_place_of_the_manager(rig_command, tmp_path: Path):
    shutil.copytree(EXAMPLES / "unit", tmp_path / "unit", ignore=shutil.ignore_patterns("build"))
    (tmp_path / "unit" / "build").mkdir()
    shutil.copy(build("libfirst_valid.so"), tmp_path / "unit" / "build")
    code, out, _ = rig_command("fly", *SHORT, "--unit", "unit/first_valid.toml")
    assert code == 0 and ", unit first_valid, " in out.splitlines()[0] and "cross-channel" not in out
    references = [line for line in out.splitlines() if " reference " in line]
    assert not references  # it answers nothing of them: none is usable from the first frame on
    score, _, replay = run_all(rig_command, out)
    assert ", unit first_valid " in score.splitlines()[0] and "identical" in replay
    log = next_of(out)[0][1]
    assert "unit     first_valid" in rig_command("info", log)[1]
    assert rig_command("report", log)[0] == 0 and "unit first_valid" in Path(log).with_suffix(".html").read_text()


def test_many_channels_that_fail_alike_are_one_line_and_every_lane_has_its_own(rig_command, tmp_path: Path):
    fault = 'faults=[{kind="power_loss", signal="bus.1", start_s=0.2}]'
    sets = ["duration_s=0.5", "computers.count=4", fault]
    code, out, _ = rig_command("fly", "--out", str(tmp_path), *(each for text in sets for each in ("--set", text)))
    told = [" ".join(line.split()) for line in out.splitlines()]
    alike = [line.split(" channel failed ")[1] for line in told if " channel failed " in line]
    signals = "isolated by comparison: 19 signals, pitch_rate, roll_rate, yaw_rate ..."
    assert code == 0 and alike == [f"channel 1 {signals}", f"channel 3 {signals}"]
    lanes = [line for line in told if " lane failed " in line]
    assert [line.split(" lane failed ")[1][:1] for line in lanes] == ["A", "C"]
