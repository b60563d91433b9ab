"""A fault tree as an SVG picture: square boxes are gates with their kind, rounded ones events with their probability.

The top event is at the top left, and the inputs of each gate are to its right: a tree is as wide as it is deep.  Inputs
that differ only in the numbers of their channels are drawn once; a part that was drawn before is only named.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final

from rig.core.palette import BLUE, GREEN, INK, SOFT, WHITE
from rig.show.pages.themes import DARK
from rig.studies.safety.fault_tree import FaultTree

WIDTH, HEIGHT, COLUMN, ROW, GAP = 150, 64, 186, 76, 14  # of a box; from one to the next
_LINE: Final = 14  # px from one line of text to the next
_NUMBER: Final = re.compile(r"(channel|channels|and) \d")
CHARACTERS: Final = 24  # of a line in a box


def _style(colour: Mapping[str, str]) -> str:
    """Return the colours of the picture; ``colour``: of each colour of the palette, the one that is shown."""
    return (
        f".tree-box{{fill:{colour[WHITE]};stroke-width:1.5}}.tree-gate{{stroke:{colour[BLUE]}}}"
        f".tree-event{{stroke:{colour[GREEN]}}}.tree-more{{stroke:{colour[SOFT]};stroke-dasharray:4 3}}"
        f".tree-line{{fill:none;stroke:{colour[SOFT]}}}.tree-text{{fill:{colour[INK]}}}"
    )


@dataclass
class _Drawing:
    tree: FaultTree
    hours: float
    parts: list[str] = field(default_factory=list)
    drawn: set[str] = field(default_factory=set)
    rows: int = 0
    deepest: int = 0

    def draw(self, name: str, depth: int) -> float:
        """Draw ``name`` and its inputs; return the middle of its box, px from the top."""
        self.deepest = max(self.deepest, depth)
        again, gate = name in self.drawn, self.tree.gates.get(name)
        self.drawn.add(name)
        below: list[float] = []
        if gate is not None and not again:
            groups: dict[object, list[str]] = {}
            for each in gate.inputs:
                groups.setdefault(self._kind(each), []).append(each)
            for alike in groups.values():
                below.append(self.draw(alike[0], depth + 1))
                if len(alike) > 1:
                    below.append(self._box([f"and {len(alike) - 1} more like it"], depth + 1, "more"))
        return self._box(self._lines(name, again), depth, "gate" if gate else "event", below)

    def _kind(self, name: str) -> object:
        """Return the key of inputs that are drawn once: the label without channel numbers, and the rate."""
        if name in self.tree.gates:
            return _NUMBER.sub("", self.tree.gates[name].label)
        event = self.tree.events[name]
        return name if event.per_hour is None else (re.sub(r" \d+", "", event.label), event.per_hour)

    def _lines(self, name: str, again: bool) -> list[str]:
        if name in self.tree.events:
            event = self.tree.events[name]
            return [*_wrapped(event.label), f"{event.probability(self.hours):.3g}"]
        gate = self.tree.gates[name]
        kind = f"{gate.least} of {len(gate.inputs)}" if gate.kind == "atleast" else gate.kind.upper()
        return [*_wrapped(gate.label or name.replace("_", " ")), "drawn above" if again else kind]

    def _box(self, lines: list[str], depth: int, kind: str, inputs: Sequence[float] = ()) -> float:
        """Draw a box beside the first of its inputs, or in a new row."""
        if not inputs:
            self.rows += 1
        middle = inputs[0] if inputs else GAP + (self.rows - 1) * ROW + HEIGHT / 2
        left = GAP + depth * COLUMN
        bend = left + (WIDTH + COLUMN) / 2
        self.parts += [
            f'<path class="tree-line" d="M{left + WIDTH} {middle:g} H{bend:g} V{each:g} H{left + COLUMN}"/>'
            for each in inputs
        ]
        corner = 18 if kind == "event" else 2
        self.parts.append(
            f'<rect class="tree-box tree-{kind}" x="{left}" y="{middle - HEIGHT / 2:g}" width="{WIDTH}" '
            f'height="{HEIGHT}" rx="{corner}"/>'
        )
        first = middle - _LINE * (len(lines) - 1) / 2 + 4
        self.parts += [
            f'<text class="tree-text" x="{left + WIDTH / 2:g}" y="{first + _LINE * i:g}" text-anchor="middle">'
            f"{escape(text)}</text>"
            for i, text in enumerate(lines)
        ]
        return middle


def _wrapped(label: str) -> list[str]:
    """Return a label in at most three lines."""
    lines = [""]
    for word in label.split():
        if lines[-1] and len(lines[-1]) + len(word) >= CHARACTERS:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines if len(lines) <= 3 else [*lines[:2], lines[2][: CHARACTERS - 2] + " …"]


def picture(tree: FaultTree, hours: float) -> str:
    """Return the SVG of a tree, its events with their probabilities after ``hours``."""
    drawing = _Drawing(tree, hours)
    drawing.draw(tree.top, 0)
    width, height = 2 * GAP + drawing.deepest * COLUMN + WIDTH, 2 * GAP + (drawing.rows - 1) * ROW + HEIGHT
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" font-family="system-ui, sans-serif" font-size="11" role="img">'
    )
    title = f"<title>Fault tree of {escape(tree.name)}, probabilities after {hours:g} h</title>"
    gates, events = len(tree.gates), len(tree.events)
    about = f"<desc>{gates} gates and {events} basic events; the top event is {escape(_top(tree))}.</desc>"
    light = _style({each: each for each in DARK})
    style = f"{light}@media screen and (prefers-color-scheme:dark){{{_style(DARK)}}}"
    return "\n".join([head, title, about, f"<style>{style}</style>", *drawing.parts, "</svg>"]) + "\n"


def _top(tree: FaultTree) -> str:
    """Return the label of the top event."""
    return tree.gates[tree.top].label or tree.top.replace("_", " ")
