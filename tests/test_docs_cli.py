"""docs/reference/cli.md: the commands as they are, on a page."""

import re
from pathlib import Path

import pytest
from tools import cli_page
from typer.main import get_command

from rig.cli.main import app


def test_the_page_is_what_the_tool_writes():
    assert cli_page.PAGE.read_text() == cli_page.written()


def test_the_page_depends_on_no_terminal_and_names_no_path(monkeypatch: pytest.MonkeyPatch):
    page = cli_page.written()
    monkeypatch.setenv("COLUMNS", "40")
    assert cli_page.written() == page and str(cli_page.ROOT) not in page and str(Path.home()) not in page


def test_every_command_has_a_section_and_every_option_a_meaning():
    page = cli_page.written()
    for one in cli_page.commands(get_command(app)):
        assert f"\n### {one.name}\n" in page
        for param in one.command.params:
            assert param.help and param.help.rstrip(")").endswith("."), (one.name, param.name)


def test_the_help_of_a_command_is_sentences_of_25_words_at_most():
    for one in cli_page.commands(get_command(app)):
        texts = [one.command.callback.__doc__ or "", *(param.help for param in one.command.params)]
        for sentence in (part for text in texts for part in re.split(r"\.\s|\n\n", text)):
            assert len(sentence.split()) <= 25, (one.name, sentence)
