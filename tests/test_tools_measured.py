"""The commands of the measured pages exist: a page takes minutes to hours, so a wrong one is noticed late."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import measured
import pytest

from rig.studies.campaign.campaign_file import names

ROOT = Path(__file__).parent.parent
COMMANDS = [command for page in measured.PAGES.values() for section in page.sections for command in section.commands]
SHOWN = [command.removeprefix(measured.SHOW).split() for command in COMMANDS if command.startswith(measured.SHOW)]


@pytest.mark.parametrize("name", sorted({words[0] for words in SHOWN} | measured.FIGURES.keys()))
def test_a_figure_is_a_function_of_its_module_and_on_a_page(name: str):
    assert callable(getattr(import_module(f"figures.{measured.FIGURES[name]}"), name))
    assert name in {words[0] for words in SHOWN}


def test_scripts_are_files_and_campaigns_have_these_names():
    scripts = [command.split()[1] for command in COMMANDS if command.startswith("python ")]
    flown = {command.split()[3] for command in COMMANDS if command.startswith("rig campaign run ")}
    assert scripts and [script for script in scripts if not (ROOT / script).is_file()] == []
    assert flown and flown <= {*names(), f"{measured.EXAMPLES}/campaign.toml"}
