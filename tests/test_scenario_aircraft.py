"""A wrong value in the file of a user's aircraft: every command names that file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rig.core.errors import BadInput
from rig.scenario import aircraft
from rig.scenario.scenario import Scenario, load
from rig.scenario.shared_parts import build_shared

Command = Callable[..., tuple[int, str, str]]
SLOW_TESTS = "pitch_rate = { slow_tests = { factor = "
WRONG = "mine/aircraft.toml: redundancy.signals.pitch_rate.slow_tests.factor: must be 1 or more, got 0.5"


@pytest.fixture(autouse=True)
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make ``mine`` in the folder of the command, as the F-16 but for one wrong value; return the folder."""
    monkeypatch.chdir(tmp_path)
    home = tmp_path / "mine"
    home.mkdir()
    for path in aircraft.folder("f16").glob("*.toml"):
        shutil.copy(path, home)
    lines = (home / "aircraft.toml").read_text().splitlines()
    wrong = [f"{SLOW_TESTS}0.5 }} }}" if line.startswith("pitch_rate = { slow_tests") else line for line in lines]
    assert wrong != lines
    (home / "aircraft.toml").write_text("\n".join(wrong))
    return home


@pytest.mark.parametrize(
    "words",
    [
        ("aircraft", "show", "mine"),
        ("aircraft", "check", "mine"),
        ("fly", "--set", "aircraft=mine", "--set", "duration_s=1"),
        ("fly", "s.toml"),
    ],
    ids=" ".join,
)
def test_a_wrong_value_of_an_aircraft_is_refused_in_one_line_with_its_file(
    words: tuple[str, ...], mine: Path, rig_command: Command
):
    (mine.parent / "s.toml").write_text('aircraft = "mine"\nduration_s = 1.0\n')
    code, out, said = rig_command(*words)
    assert (code, out, said) == (2, "", f"error: {WRONG}\n")


def test_a_run_of_a_campaign_names_the_file_of_the_aircraft():
    with pytest.raises(BadInput, match=f"^{WRONG}$"):
        build_shared(aircraft.tables("mine"), {"aircraft": "mine"}, "run 0")


def test_a_wrong_value_of_the_design_is_refused_with_the_file_of_the_design(mine: Path, rig_command: Command):
    for name in ("aircraft.toml", "references.toml"):
        shutil.copy(aircraft.folder("f16") / name, mine)
    (mine / "references.toml").write_text("unheard_of = 1\n" + (mine / "references.toml").read_text())
    code, _, said = rig_command("aircraft", "show", "mine")
    assert code == 2 and said.startswith("error: mine/references.toml: unheard_of: unknown key")


def test_a_scenario_that_gives_another_value_flies(mine: Path):
    made = load(None, ["aircraft=mine", "redundancy.signals.pitch_rate.slow_tests.factor=1.5"])
    tests = made.redundancy.signals.pitch_rate.slow_tests
    assert tests is not None and tests.factor == 1.5


def test_a_wrong_value_of_the_scenario_is_not_blamed_on_a_sound_aircraft(mine: Path):
    shutil.copy(aircraft.folder("f16") / "aircraft.toml", mine)
    with pytest.raises(BadInput, match=r"^f16_pitch_rate_hardover with --set: seed: "):
        load(None, ["aircraft=mine", "seed=-1"])


@pytest.mark.parametrize("name", aircraft.names())
def test_a_bundled_aircraft_is_sound(name: str):
    aircraft.refuse_bad(name, Scenario)
    aircraft.refuse_bad(name, Scenario, designed=False)
