"""A fault tree, its exact probability, and its XML for SCRAM and other tools.

The top gate becomes a binary decision diagram.  Its probability is a sum of products of positive terms, so a small one
keeps its digits.  Sources: Bryant (1986), section 4 (ite with a table of unique nodes); Rauzy (1993), section 4
(the probability of a diagram); Open-PSA model exchange format 2.0d for gates, events and the XML.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import combinations
from math import expm1
from typing import Final, Literal
from xml.etree import ElementTree as ET

from rig.core.errors import BadInput
from rig.core.text import quoted

FALSE, TRUE = 0, 1  # terminal nodes of a diagram
NAME: Final = re.compile(r"[A-Za-z_]\w*(-\w+)*", re.ASCII)  # an NCName without dots, as the schema's Identifier


@dataclass(frozen=True, slots=True)
class Event:
    """A basic event with a rate per hour, or with a probability that does not depend on time."""

    label: str
    per_hour: float | None = None
    chance: float = 0.0

    def probability(self, hours: float) -> float:
        """Return the probability that the event has happened after ``hours``."""
        return self.chance if self.per_hour is None else -expm1(-self.per_hour * hours)


@dataclass(frozen=True, slots=True)
class Gate:
    """A gate over inputs, the names of gates or events: ``least`` of them are needed; 1: OR, all: AND."""

    inputs: tuple[str, ...]
    least: int
    label: str = ""

    @property
    def kind(self) -> Literal["or", "and", "atleast"]:
        """Return the kind of the gate in Open-PSA."""
        return "or" if self.least == 1 else "and" if self.least == len(self.inputs) else "atleast"


@dataclass
class FaultTree:
    """A coherent tree: gates and events by name, no negation; ``top`` is a gate."""

    name: str
    top: str
    gates: dict[str, Gate] = field(default_factory=dict)
    events: dict[str, Event] = field(default_factory=dict)

    def any_of(self, name: str, inputs: Sequence[str], label: str = "") -> str:
        """Add an OR gate of ``inputs``, and return its name."""
        return self.at_least(name, 1, inputs, label)

    def all_of(self, name: str, inputs: Sequence[str], label: str = "") -> str:
        """Add an AND gate of ``inputs``, and return its name."""
        return self.at_least(name, len(inputs), inputs, label)

    def at_least(self, name: str, least: int, inputs: Sequence[str], label: str = "") -> str:
        """Add a gate that is true when ``least`` of ``inputs`` are, and return its name."""
        self.gates[name] = Gate(tuple(inputs), least, label)
        return name

    def event(self, name: str, label: str, per_hour: float | None = None, chance: float = 0.0) -> str:
        """Add a basic event, and return its name."""
        self.events[name] = Event(label, per_hour, chance)
        return name


class _Diagram:
    """The nodes (variable, if it happened, if not) by number, each once; variables in the order of their first use."""

    def __init__(self, tree: FaultTree) -> None:
        self.tree = tree
        self.nodes: list[tuple[int, int, int]] = [(-1, 0, 0), (-1, 1, 1)]
        self.events: list[str] = []
        self._unique: dict[tuple[int, int, int], int] = {}
        self._ite: dict[tuple[int, int, int], int] = {}
        self._of: dict[str, int] = {}
        self._place: dict[str, int] = {}

    def of(self, name: str) -> int:
        """Return the node of a gate or an event."""
        if name not in self._of:
            self._of[name] = self._gate(self.tree.gates[name]) if name in self.tree.gates else self._event(name)
        return self._of[name]

    def _event(self, name: str) -> int:
        self.events.append(name)
        return self._node(len(self.events) - 1, TRUE, FALSE)

    def _gate(self, gate: Gate) -> int:
        inputs = [self.of(name) for name in gate.inputs]
        counts = [TRUE] + [FALSE] * gate.least  # at least i of the inputs so far
        for node in inputs:
            counts = [TRUE, *(self.ite(node, counts[i - 1], counts[i]) for i in range(1, gate.least + 1))]
        return counts[gate.least]

    def ite(self, test: int, then: int, other: int) -> int:
        """Return the node of ``then`` if ``test`` is true, and of ``other`` if it is false."""
        if test in (FALSE, TRUE):
            return then if test == TRUE else other
        if then == other:
            return then
        key = test, then, other
        if key not in self._ite:
            first = min(self.nodes[node][0] for node in key if node > TRUE)
            high, low = ([self._half(node, first, side) for node in key] for side in (1, 2))
            self._ite[key] = self._node(first, self.ite(*high), self.ite(*low))
        return self._ite[key]

    def _half(self, node: int, variable: int, side: int) -> int:
        return self.nodes[node][side] if self.nodes[node][0] == variable else node

    def _node(self, variable: int, high: int, low: int) -> int:
        if high == low:
            return high
        key = variable, high, low
        if key not in self._unique:
            self.nodes.append(key)
            self._unique[key] = len(self.nodes) - 1
        return self._unique[key]


def probability(tree: FaultTree, hours: float) -> float:
    """Return the exact probability of the top gate after ``hours``."""
    diagram = _Diagram(tree)
    top = diagram.of(tree.top)
    chances = [tree.events[name].probability(hours) for name in diagram.events]

    @cache
    def of(node: int) -> float:
        if node in (FALSE, TRUE):
            return float(node)
        variable, high, low = diagram.nodes[node]
        return chances[variable] * of(high) + (1.0 - chances[variable]) * of(low)

    return of(top)


Sets = frozenset[frozenset[str]]
NEVER: Final[Sets] = frozenset()


def cut_sets(tree: FaultTree) -> Sets:
    """Return the minimal cut sets: sets of events that make the top gate true, none contained in another."""

    @cache
    def of(name: str) -> Sets:
        if name in tree.events:
            return frozenset([frozenset([name])])
        gate, found = tree.gates[name], NEVER
        for chosen in combinations(gate.inputs, gate.least):
            found |= _together([of(each) for each in chosen])
        return _minimal(found)

    return of(tree.top)


def _together(parts: Sequence[Sets]) -> Sets:
    """Return the minimal sets that contain one set of each part."""
    whole: Sets = frozenset([frozenset()])
    for part in parts:
        whole = _minimal(frozenset(one | other for one in whole for other in part))
    return whole


def _minimal(sets: Sets) -> Sets:
    kept: list[frozenset[str]] = []
    for each in sorted(sets, key=len):
        if not any(smaller <= each for smaller in kept):
            kept.append(each)
    return frozenset(kept)


def direct_sum(tree: FaultTree, sets: Sets, hours: float) -> float:
    """Return the sum of the probabilities of the cut sets, which counts joint events more than once."""
    chances: Mapping[str, float] = {name: event.probability(hours) for name, event in tree.events.items()}
    total = 0.0
    for each in sorted(sets, key=sorted):
        product = 1.0
        for name in sorted(each):
            product *= chances[name]
        total += product
    return total


def require_name(where: str, name: str) -> None:
    """Raise BadInput unless ``name`` can name a gate or event; ``where`` is the file and key."""
    if not NAME.fullmatch(name):
        raise BadInput(
            f"{where}: {quoted(name)} cannot be a name in the tree's XML; allowed: a letter, then letters, digits, _ "
            "and single hyphens"
        )


def open_psa(tree: FaultTree) -> str:
    """Return the XML of a tree, top gate first; the reading tool sets the mission time of the rates."""
    root = ET.Element("opsa-mef", name=tree.name)
    within = ET.SubElement(root, "define-fault-tree", name=tree.name)
    for name in sorted(tree.gates, key=lambda name: name != tree.top):
        _gate(within, name, tree.gates[name], tree)
    data = ET.SubElement(root, "model-data")
    for name, event in tree.events.items():
        _event(data, name, event)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=False) + "\n"


def _gate(within: ET.Element, name: str, gate: Gate, tree: FaultTree) -> None:
    element = _defined(within, "gate", name, gate.label)
    if len(gate.inputs) > 1:
        least = {"min": str(gate.least)} if gate.kind == "atleast" else {}
        element = ET.SubElement(element, gate.kind, least)
    for each in gate.inputs:  # a gate of one input passes it through
        ET.SubElement(element, "gate" if each in tree.gates else "basic-event", name=each)


def _event(data: ET.Element, name: str, event: Event) -> None:
    element = _defined(data, "basic-event", name, event.label)
    if event.per_hour is None:
        ET.SubElement(element, "float", value=repr(event.chance))
        return
    exponential = ET.SubElement(element, "exponential")
    ET.SubElement(exponential, "float", value=repr(event.per_hour))
    ET.SubElement(exponential, "system-mission-time")


def _defined(within: ET.Element, what: str, name: str, label: str) -> ET.Element:
    element = ET.SubElement(within, f"define-{what}", name=name)
    if label:
        ET.SubElement(element, "label").text = label
    return element
