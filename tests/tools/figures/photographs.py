"""Photographs for the docs: the viewer, which needs a Vulkan driver, and reports, which need Chromium."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import outside
from PIL import Image

import rig
from rig.core.errors import RigError
from rig.show.viewer.opened import read
from rig.show.viewer.screenshot import screenshot

EXAMPLE: Final = Path(__file__).parents[3] / "docs/examples/campaign.toml"
HEAD, FOOT = 37, 30  # px of the viewer: its menu with notices about the machine, its time bar
WIDTH: Final = 1440
PAGE: Final = (1100, 1480)  # px of a report


class Viewer(NamedTuple):
    """Scenario, overrides of each flight, the tab."""

    scenario: str
    flights: Sequence[Sequence[str]] = ((),)
    tab: str = "overview"


VIEWER: Final = {
    "viewer": Viewer("f16_split_2_2_level"),
    "viewer_actuators": Viewer("f16_elevator_coil_hardover", tab="actuators"),
    "viewer_computers": Viewer("f16_four_lanes_lost", tab="computers"),
    "viewer_two_flights": Viewer(
        "f16_pitch_rate_hardover", [["redundancy.manager=median"], ["redundancy.manager=mean"]]
    ),
}


def _viewer(name: str, out: Path) -> str:
    """Fly and photograph the viewer; return the reason if it is impossible."""
    if not outside.vulkan():
        return "needs a Vulkan driver: make test-all installs one"
    picture = VIEWER[name]
    with tempfile.TemporaryDirectory() as folder:
        logs = [
            rig.fly(picture.scenario, overrides=list(sets), out=Path(folder) / f"{i}").log
            for i, sets in enumerate(picture.flights)
        ]
        try:
            screenshot(read(logs, tab=picture.tab), Path(folder) / "shot.png")
        except RigError as error:
            return str(error)
        _keep(Path(folder) / "shot.png", out, HEAD, FOOT, WIDTH)
    return ""


def _report(out: Path) -> str:
    """Photograph the report of a flight."""
    with tempfile.TemporaryDirectory() as folder:
        page = rig.report(rig.fly("f16_split_2_2_level", out=folder), Path(folder) / "page.html")
        return _page(page, out)


def _campaign(out: Path) -> str:
    """Photograph the report of the example campaign."""
    with tempfile.TemporaryDirectory() as folder:
        rig_command = (sys.executable, "-m", "rig", "campaign")
        subprocess.run([*rig_command, "run", str(EXAMPLE), "--out", f"{folder}/C"], check=True, capture_output=True)
        page = Path(folder) / "page.html"
        subprocess.run([*rig_command, "report", f"{folder}/C", "--out", str(page)], check=True, capture_output=True)
        return _page(page, out)


def _page(page: Path, out: Path) -> str:
    """Photograph a page in the light setting; return the reason if it is impossible."""
    browser = outside.chromium()
    if browser is None:
        return "needs Chromium: make test-all installs it"
    shot = page.with_suffix(".png")
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=10000")
    size = f"--window-size={PAGE[0]},{PAGE[1]}"
    command = [
        browser,
        *flags,
        size,
        f"--user-data-dir={page.parent / 'profile'}",
        f"--screenshot={shot}",
        page.as_uri(),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    _keep(shot, out, 0, 0, PAGE[0])
    return ""


def _keep(shot: Path, out: Path, head: int, foot: int, width: int) -> None:
    """Crop ``head`` and ``foot``, px, and write the picture in full colour."""
    with Image.open(shot) as opened:
        seen = opened.convert("RGB")
    seen = seen.crop((0, head, seen.width, seen.height - foot))
    if seen.width != width:
        seen = seen.resize((width, round(width * seen.height / seen.width)), Image.Resampling.LANCZOS)
    seen.save(out, optimize=True)


PICTURES: Final[dict[str, Callable[[Path], str]]] = {
    **{name: lambda out, name=name: _viewer(name, out) for name in VIEWER},
    "report": _report,
    "campaign_report": _campaign,
}


def make(name: str, folder: Path) -> str:
    """Make a photograph in ``folder``; return a line with its size, or with the reason why it was not made."""
    out = folder / f"{name}.png"
    reason = PICTURES[name](out)
    return f"{out.name}: not made: {reason}" if reason else f"{out.name}: {out.stat().st_size} B"
