"""Make the pictures that the code of a page draws readable on light and dark pages: for tests/tools/pages.py."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from rig.core.palette import CHANNELS, INK, LINE, SOFT

WIDTH: Final = 700  # px
FIGURE: Final[dict[str, Any]] = {
    "svg.hashsalt": "pages",
    "svg.fonttype": "none",
    "savefig.transparent": True,
    "font.size": 11.5,
    "figure.figsize": (9.0, 3.6),
    "path.simplify_threshold": 0.3,
    **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.color", "ytick.color"), INK),
    "axes.edgecolor": SOFT,
    "grid.color": LINE,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
_IMAGE: Final = re.compile(r"!\[([^\]]*)\]\(([^)\s]+\.svg)\)")


@contextmanager
def style(wanted: bool) -> Iterator[None]:
    """Let figures of matplotlib be drawn alike on every machine, in the colours of the pages."""
    if not wanted:
        yield
        return
    import matplotlib
    from cycler import cycler

    os.environ["SOURCE_DATE_EPOCH"] = "0"
    settings: Any = {**FIGURE, "axes.prop_cycle": cycler(color=CHANNELS), "backend": "agg"}
    with matplotlib.rc_context(settings):
        yield


def drawn(text: str, page: Path, folder: Path) -> dict[Path, str]:
    """Return the pictures of a page that its code has drawn in ``folder``, by their files."""
    found = {}
    for words, link in _IMAGE.findall(text):
        file = folder / Path(link).name
        if file.exists():
            found[(page.parent / link).resolve()] = finished(file.read_text(encoding="utf-8"), file.stem, words)
    return found


def finished(svg: str, name: str, words: str) -> str:
    """Return a figure of matplotlib 700 px wide, with title, description, ground and colours for dark pages.

    A picture with a title is returned as it is.
    """
    if re.search(r"<title [^>]*>", svg):
        return svg
    width, height = map(float, re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg).groups())  # type: ignore[union-attr]
    inside = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<defs>") : svg.rindex("</svg>")], flags=re.DOTALL)
    inside = re.sub(r' d="([^"]*)"', lambda path: f' d="{_short(path[1], width)}"', inside)
    inside = re.sub(r"font: ([\d.]+)px 'sans-serif'[^;\"]*", r"font: \1px system-ui, sans-serif", inside)
    inside = re.sub(r"[ \t]+\n", "\n", inside)
    scale = WIDTH / width
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
        f' viewBox="0 0 {WIDTH} {height * scale:.0f}" width="{WIDTH}" height="{height * scale:.0f}" role="img"'
        f' aria-labelledby="{name}-title {name}-desc" font-family="system-ui, sans-serif" font-size="13">\n'
        f'<title id="{name}-title">{escape(words.split(":")[0])}</title>\n'
        f'<desc id="{name}-desc">{escape(words)}</desc>\n'
        f"<style>{_rules(inside)}</style>\n"
        f'<rect class="ground" width="{WIDTH}" height="{height * scale:.0f}" rx="6"/>\n'
        f'<g transform="scale({scale:.4f})">\n{inside.strip()}\n</g>\n</svg>\n'
    )


def _short(path: str, width: float) -> str:
    """Return a path to a tenth, of straight lines without the points that are far left or right of the figure."""
    path = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), path)
    points = re.findall(r"([ML]) (\S+) (\S+)", path)
    if re.search("[CQHVA]", path) or len(points) < 3:
        return path.strip()
    sides = [int(float(x) > width + 20) - int(float(x) < -20) for _, x, _ in points]
    kept = [
        point
        for i, point in enumerate(points)
        if i in {0, len(points) - 1} or point[0] == "M" or sides[i] == 0 or not sides[i - 1] == sides[i] == sides[i + 1]
    ]
    lines = [kept[0], *(point for before, point in pairwise(kept) if point[0] == "M" or point[1:] != before[1:])]
    return " ".join(f"{letter}{x} {y}" for letter, x, y in lines) + ("z" if path.rstrip().endswith("z") else "")


def _rules(inside: str) -> str:
    """Return the colours of a dark page for those that the figure has."""
    from figures.svg import DARK, LIGHT

    pairs = dict(reversed(list(zip(LIGHT[1:], DARK[1:], strict=True))))  # of equal light colours the first
    rules = [
        f'[style*="{part}: {light}"]{{{part}:{dark}!important}}'
        for light, dark in sorted(pairs.items())
        for part in ("fill", "stroke")
        if f"{part}: {light}" in inside
    ]
    return f".ground{{fill:{LIGHT[0]}}}@media (prefers-color-scheme: dark){{.ground{{fill:{DARK[0]}}}{''.join(rules)}}}"
