"""The pictures of the pages have what the pages promise: colours, titles."""

import re
from pathlib import Path

import numpy as np
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
