"""A fault tree as an SVG picture: gates as boxes with their kind, events as circles with their probability.

The top event stands at the top left, what it takes is to the right of each gate: a tree is as wide as it is deep.
Of inputs that differ in the numbers of their channels alone the first is drawn; what was drawn before is named.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final

from rig.core.palette import INK, SERIES, SOFT, WHITE
from rig.studies.safety.fault_tree import FaultTree

WIDTH, HEIGHT, COLUMN, ROW, GAP = 150, 46, 186, 58, 14  # of a box; from one to the next
_NUMBER: Final = re.compile(r"(channel|channels|and) \d")
CHARACTERS: Final = 24  # of a line in a box


@dataclass
class _Drawing:
    tree: FaultTree
    hours: float
    parts: list[str] = field(default_factory=list)
    drawn: set[str] = field(default_factory=set)
    rows: int = 0
    deepest: int = 0

    def draw(self, name: str, depth: int) -> float:
        """Draw ``name`` and all that it takes; return the middle of its box, px from the top."""
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
                    below.append(self._box([f"and {len(alike) - 1} more like it"], depth + 1, SOFT))
        return self._box(self._lines(name, again), depth, SERIES[0] if gate else SERIES[1], below)

    def _kind(self, name: str) -> object:
        """Return what inputs that are drawn once have in common: no label, a label but for its numbers, or a rate."""
        if name in self.tree.gates:
            return _NUMBER.sub("", self.tree.gates[name].label)
        event = self.tree.events[name]
        return name if event.per_hour is None else (_NUMBER.sub("", event.label), event.per_hour)

    def _lines(self, name: str, again: bool) -> list[str]:
        if name in self.tree.events:
            event = self.tree.events[name]
            return [*_wrapped(event.label), f"{event.probability(self.hours):.3g}"]
        gate = self.tree.gates[name]
        kind = f"{gate.least} of {len(gate.inputs)}" if gate.kind == "atleast" else gate.kind.upper()
        return [*_wrapped(gate.label or name.replace("_", " ")), "drawn above" if again else kind]

    def _box(self, lines: list[str], depth: int, colour: str, inputs: Sequence[float] = ()) -> float:
        """Draw a box beside the first of its inputs, or in a row of its own."""
        if not inputs:
            self.rows += 1
        middle = inputs[0] if inputs else GAP + (self.rows - 1) * ROW + HEIGHT / 2
        left = GAP + depth * COLUMN
        bend = left + (WIDTH + COLUMN) / 2
        self.parts += [
            f'<path d="M{left + WIDTH} {middle:g} H{bend:g} V{each:g} H{left + COLUMN}" fill="none" stroke="{SOFT}"/>'
            for each in inputs
        ]
        self.parts.append(
            f'<rect x="{left}" y="{middle - HEIGHT / 2:g}" width="{WIDTH}" height="{HEIGHT}" rx="4" fill="{WHITE}" '
            f'stroke="{colour}" stroke-width="1.5"/>'
        )
        self.parts += [
            f'<text x="{left + WIDTH / 2:g}" y="{middle - HEIGHT / 2 + 13 + 14 * i:g}" text-anchor="middle">'
            f"{escape(text)}</text>"
            for i, text in enumerate(lines)
        ]
        return middle


def _wrapped(label: str) -> list[str]:
    """Return a label in two lines at most."""
    lines = [""]
    for word in label.split():
        if lines[-1] and len(lines[-1]) + len(word) >= CHARACTERS:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines if len(lines) <= 2 else [lines[0], lines[1][: CHARACTERS - 2] + " …"]


def picture(tree: FaultTree, hours: float) -> str:
    """Return the SVG of a tree, its events with their probabilities after ``hours``."""
    drawing = _Drawing(tree, hours)
    drawing.draw(tree.top, 0)
    width, height = 2 * GAP + drawing.deepest * COLUMN + WIDTH, 2 * GAP + (drawing.rows - 1) * ROW + HEIGHT
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" font-family="system-ui, sans-serif" font-size="11" fill="{INK}">'
    )
    return "\n".join([head, f"<title>{escape(tree.name)}, {hours:g} h</title>", *drawing.parts, "</svg>"]) + "\n"
