"""The commands by name: none is imported before it is used, and the help says what each of them says itself."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from rig.cli.commands import COMMANDS
from rig.cli.main import app

LOADED = "import json, sys; print('\\n' + json.dumps([name for name in sys.modules if name.startswith('rig.cli.')]))"


def commands_loaded(*arguments: str) -> set[str]:
    """The modules of commands that ``rig`` has imported when it ends."""
    program = f"import sys\nfrom rig.cli.main import main\ntry: main()\nfinally:\n    {LOADED}"
    command = [sys.executable, "-c", program, *arguments]
    done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False)
    loaded = {name.removeprefix("rig.cli.") for name in json.loads(done.stdout.splitlines()[-1])}
    return loaded & {entry.home.partition(":")[0] for entry in COMMANDS}


@pytest.mark.parametrize(
    ("arguments", "loaded"),
    [
        (["--help"], set()),
        (["--version"], set()),
        (["nosuch"], set()),
        (["scenario", "list", "--json"], {"catalogue"}),
    ],
)
def test_a_command_line_imports_only_the_command_that_it_names(arguments: list[str], loaded: set[str]):
    assert commands_loaded(*arguments) == loaded


@pytest.mark.parametrize("entry", COMMANDS, ids=lambda entry: entry.name)
def test_the_help_of_all_says_of_a_command_what_its_own_help_says_first(entry):
    made = entry.made()
    first = re.sub(r"\s+", " ", made.help.partition("\n\n")[0])
    assert (made.name, made.rich_help_panel, first) == (entry.name, entry.panel, entry.purpose)


def test_a_group_on_demand_has_the_commands_of_its_table_in_its_order():
    group: Any = get_command(app)
    assert list(group.commands) == [entry.name for entry in COMMANDS]
    assert [name for name, made in group.commands.items() if made.name != name] == []
    assert group.commands.get("nosuch") is None and None not in group.commands.values()


def test_the_help_lists_every_command_and_makes_none(rig_command):
    code, shown, _ = rig_command("--help")
    assert code == 0
    assert [entry.name for entry in COMMANDS if not re.search(rf"^│ {entry.name} ", shown, re.M)] == []
