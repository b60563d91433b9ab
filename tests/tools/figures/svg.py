"""Parts of the pictures of the docs: SVG that follows the light or dark setting of the reader."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.palette import CHANNELS, INK, LINE, MAGENTA, ORANGE, PALE, QUIET, RED, SOFT, VIOLET, VOTE, YELLOW
from rig.show.viewer.style import CHANNEL_COLORS, VOTED, Color

WIDTH: Final = 700
Floats = NDArray[np.floating[Any]]


def _hex(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


ROLES: Final = (
    *("ground", "ink", "soft", "line", "pale", "band", "vote", "onset", "bad", "c1", "c2", "c3", "c4"),
    *("reference", "suspect", "quiet", "pattern", "on", "mark"),
)
LIGHT: Final = (
    *("#ffffff", INK, SOFT, LINE, PALE, "#cfe3e6", VOTE, ORANGE, RED, *CHANNELS),
    *(MAGENTA, YELLOW, QUIET, VIOLET, "#ffffff", INK),
)
DARK: Final = (
    *("#161b22", "#e6edf3", "#a3aeb9", "#3d4650", "#222933", "#24454b"),
    *(_hex(VOTED), "#f0a040", "#ff8078", *map(_hex, CHANNEL_COLORS)),
    *("#f050b4", "#e3b341", "#2b333c", "#a58cff", "#161b22", INK),
)
DASHES: Final = ("", "7 4", "7 3 2 3", "2 3")  # of the channels


def _rules(colours: Sequence[str]) -> str:
    named = zip(ROLES, colours, strict=True)
    return "".join(f".f-{role}{{fill:{colour}}}.s-{role}{{stroke:{colour}}}" for role, colour in named)


def svg(name: str, height: int, title: str, description: str, parts: Iterable[str], width: int = WIDTH) -> str:
    """Return the file: ``parts`` on a ground, with title and description for a screen reader."""
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
            f' role="img" aria-labelledby="{name}-title {name}-desc" font-family="system-ui, sans-serif" font-size="13"'
            ' fill="none" stroke-width="1.5">',
            f'<title id="{name}-title">{escape(title)}</title>',
            f'<desc id="{name}-desc">{escape(description)}</desc>',
            f"<style>{_rules(LIGHT)}@media (prefers-color-scheme: dark){{{_rules(DARK)}}}</style>",
            *(
                f'<defs><marker id="{name}-{role}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7"'
                f' orient="auto"><path class="f-{role}" d="M0 0L8 4L0 8z"/></marker></defs>'
                for role in ("soft", "c3")
            ),
            *(_hatch(f"{name}-{role}", role) for role in ("bad", "suspect")),
            f'<rect class="f-ground" width="{width}" height="{height}" rx="6"/>',
            *parts,
            "</svg>\n",
        ]
    )


def _hatch(name: str, role: str) -> str:
    """Return a fill of a colour with crosses or dots."""
    drawn = '<path class="s-on" stroke-opacity="0.5" d="M0 0L8 8M8 0L0 8"/>'
    if role == "suspect":
        drawn = '<path fill="#1d2630" fill-opacity="0.6" d="M2 2h2v2h-2zM6 6h2v2h-2z"/>'
    head = f'<pattern id="{name}-hatch" width="8" height="8" patternUnits="userSpaceOnUse">'
    return f'<defs>{head}<rect class="f-{role}" width="8" height="8"/>{drawn}</pattern></defs>'


def text(x: float, y: float, words: str, role: str = "ink", *, anchor: str = "start", bold: bool = False) -> str:
    """Return a line of text."""
    weight = ' font-weight="600"' if bold else ""
    return f'<text class="f-{role}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{weight}>{escape(words)}</text>'


def line(points: Iterable[tuple[float, float]], role: str, more: str = "") -> str:
    """Return a line through ``points``; more : attributes."""
    joined = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return f'<path class="s-{role}" d="M{joined}"{more and " " + more}/>'


def box(x: float, y: float, width: float, height: float, words: Sequence[str], fill: str = "f-pale") -> Iterable[str]:
    """Yield a box with a heading and lines below it."""
    yield f'<rect class="{fill} s-soft" x="{x}" y="{y}" width="{width}" height="{height}" rx="5"/>'
    first = y + height / 2 - 8.5 * (len(words) - 1) + 4.5
    for i, word in enumerate(words):
        yield text(x + width / 2, first + 17 * i, word, "soft" if i else "ink", anchor="middle", bold=not i)


class Panel(NamedTuple):
    """Where a plot is, in px, and what its axes span."""

    top: float
    bottom: float
    x: tuple[float, float]
    y: tuple[float, float]
    left: float = 52.0
    right: float = 520.0

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of a point."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return self.left + across * (self.right - self.left), self.bottom - up * (self.bottom - self.top)

    def axes(self, xs: Sequence[float], ys: Sequence[float], x_label: str = "") -> Iterable[str]:
        """Yield lines across at ``ys`` and, where there is a label, numbers below at ``xs``."""
        for y in ys:
            yield line([self.at(self.x[0], y), self.at(self.x[1], y)], "line", 'stroke-width="1"')
            yield text(self.left - 8, self.at(0, y)[1] + 4.5, f"{y:g}", "soft", anchor="end")
        if x_label:
            for x in xs:
                yield text(self.at(x, 0)[0], self.bottom + 18, f"{x:g}", "soft", anchor="middle")
            yield text(self.right + 14, self.bottom + 18, x_label, "soft")

    def steps(self, xs: Floats, ys: Floats) -> list[tuple[float, float]]:
        """Return each sample held until the next one."""
        held = [point for (x, y), (later, _) in pairwise(zip(xs, ys, strict=True)) for point in ((x, y), (later, y))]
        return [self.at(x, y) for x, y in held]
