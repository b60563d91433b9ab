"""The pictures of the pages have what the pages promise: colours, titles."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pictures
import pytest
from figures import gallery, photographs
from PIL import Image

from rig.show.viewer.style import CHANNEL_COLORS, FAILED, REFERENCE

ROOT = Path(__file__).parent.parent
PICTURES = ROOT / "docs/pictures"
DRAWN = (*CHANNEL_COLORS, REFERENCE)


@pytest.mark.parametrize("name", photographs.PICTURES)
def test_a_photograph_is_in_full_colour(name: str):
    with Image.open(PICTURES / f"{name}.png") as picture:
        assert picture.mode == "RGB"  # no palette of some colours


def test_the_actuators_have_the_colours_that_the_page_names():
    with Image.open(PICTURES / "viewer_actuators.png") as opened:
        picture = np.asarray(opened.convert("RGB")).astype(int)
    for colour, tolerance in (*((colour, 24) for colour in DRAWN), (FAILED, 60)):  # a lane is a little darker
        assert (np.abs(picture - np.array(colour)).max(axis=-1) <= tolerance).sum() > 50, colour


def some(folder: Path) -> dict[str, str]:
    """The drawings of one flight, of a decision, of a servo and of a coil's current."""
    flights = pictures.flown()
    drawn = {"architecture": pictures.architecture(flights), "fault": pictures.fault(flights)}
    drawn |= {"decision": pictures.decision(), "servo": pictures.servo()}
    (coil,) = (case for case in gallery.CASES if case.shows == "current")
    return {
        f"{name}.svg": text for name, text in {**drawn, f"gallery/{coil.name}": gallery.drawn(coil, folder)}.items()
    }


@pytest.mark.parametrize("which", [some, pytest.param(lambda _: pictures.pictures(), marks=pytest.mark.long, id="all")])
def test_the_drawings_are_what_the_tool_writes(which: Callable[[Path], dict[str, str]], tmp_path: Path):
    drawn = which(tmp_path)
    assert {name: (PICTURES / name).read_text() for name in drawn} == drawn


def test_a_page_shows_every_picture():
    """Pages draw the other ones: tests/test_docs_commands.py."""
    text = "".join(path.read_text() for path in (*(ROOT / "docs").rglob("*.md"), ROOT / "mkdocs.yml"))
    names = [str(path.relative_to(PICTURES)) for path in PICTURES.rglob("*.*")]
    assert len(names) > 30 and [name for name in names if f"pictures/{name}" not in text] == []


def test_a_picture_that_cannot_be_made_is_named_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("outside.vulkan", lambda: False)
    assert photographs.make("viewer", tmp_path).startswith("viewer.png: not made: needs a Vulkan driver")
    assert not list(tmp_path.iterdir())
    with pytest.raises(SystemExit, match=r"no picture nosuch; there are: architecture, "):
        pictures.main(["nosuch"])


@pytest.mark.parametrize("path", sorted(PICTURES.rglob("*.svg")), ids=lambda path: path.stem)
def test_a_drawing_is_read_aloud(path: Path):
    text = path.read_text()
    assert re.search(r"<title[^>]*>\w", text) and re.search(r"<desc[^>]*>\w", text)


ON_PAGES = [path for path in PICTURES.glob("*.svg") if path.stem not in ("logo", "worst")]  # the header; a wide table


@pytest.mark.parametrize("path", sorted(ON_PAGES), ids=lambda path: path.stem)
def test_a_drawing_is_readable_and_follows_the_dark_setting(path: Path):
    text, width = path.read_text(), 480 if path.stem.startswith("pattern_") else 700
    assert "prefers-color-scheme: dark" in text and 'font-family="system-ui, sans-serif"' in text
    assert min(map(int, re.findall(r'font-size="(\d+)"', text))) >= 12 and f'viewBox="0 0 {width} ' in text


@pytest.mark.parametrize("path", sorted(PICTURES.glob("pattern_*.svg")), ids=lambda path: path.stem)
def test_a_pattern_names_its_lines_and_its_states(path: Path):
    words = set(re.findall(r">([^<>]+)</t(?:ext|span)>", path.read_text()))
    assert {"ok", "isolated", "reference", "voted", "pattern", "1", "2", "3", "4"} <= words
    assert "-hatch)" in path.read_text()  # states differ by more than colour
