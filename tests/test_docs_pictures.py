"""The pictures of the pages have what the pages promise: colours, titles."""

import re
from pathlib import Path

import numpy as np
import pictures
import pytest
from PIL import Image

from rig.show.viewer.style import CHANNEL_COLORS, FAILED, REFERENCE

DOCS = Path(__file__).parent.parent / "docs"
DRAWN = (*CHANNEL_COLORS, REFERENCE)


@pytest.mark.parametrize("name", ["viewer_actuators", "viewer_computers", "viewer_two_flights"])
def test_a_picture_of_the_viewer_is_in_full_colour(name: str):
    with Image.open(DOCS / f"{name}.png") as picture:
        assert picture.mode == "RGB"  # no palette of some colours


def test_the_actuators_have_the_colours_that_the_page_names():
    with Image.open(DOCS / "viewer_actuators.png") as opened:
        picture = np.asarray(opened.convert("RGB")).astype(int)
    for colour, tolerance in (*((colour, 24) for colour in DRAWN), (FAILED, 60)):  # a lane is a little darker
        assert (np.abs(picture - np.array(colour)).max(axis=-1) <= tolerance).sum() > 50, colour


@pytest.mark.parametrize("path", sorted(DOCS.glob("patterns/[!d]*.svg")), ids=lambda path: path.stem)
def test_a_pattern_has_a_title_and_names_its_states(path: Path):
    text = path.read_text()
    assert "<dc:title>Pattern" in text
    assert {"ok", "suspect", "failed", "reference"} <= set(re.findall(r">([a-z ]+)</text>", text))


def test_the_pictures_are_what_the_tool_writes():
    drawn = pictures.pictures()
    assert {name: (DOCS / "pictures" / name).read_text() for name in drawn} == drawn


def test_a_page_shows_every_picture():
    """Pages draw the other ones: tests/test_docs_commands.py."""
    text = "".join(path.read_text() for path in DOCS.rglob("*.md"))
    assert [path.name for path in (DOCS / "pictures").glob("*.svg") if f"pictures/{path.name})" not in text] == []


@pytest.mark.parametrize("path", sorted(DOCS.glob("pictures/*.svg")), ids=lambda path: path.stem)
def test_a_picture_is_read_aloud_and_in_the_dark(path: Path):
    text = path.read_text()
    assert re.search(r"<title [^>]*>\w", text) and re.search(r"<desc [^>]*>\w", text)
    assert "prefers-color-scheme: dark" in text and 'font-family="system-ui, sans-serif"' in text
    assert min(map(int, re.findall(r'font-size="(\d+)"', text))) >= 12 and 'viewBox="0 0 700 ' in text
