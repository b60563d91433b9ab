"""The panels of a Foxglove layout and their arrangement; lines and rows of states by the paths of the log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from rig.core.units.quantities import scale_shown
from rig.log.schema import EVENTS, MESSAGES, TOPICS_OF_ROWS
from rig.show.viewer import state_strips as strips
from rig.show.viewer.facts import Facts
from rig.show.viewer.style import FAULT_STRIP, PALETTE, QUIET, VOTED, Color

Node = str | dict[str, Any]  # a panel's id, or two nodes beside or over each other
Span = tuple[float, float] | None

# The path of each number of FRAME, by its field and its place in it.
PATHS: Final = {
    (field.source, topic.at(field)): f"{topic.name}.{field.name}"
    for topic in TOPICS_OF_ROWS
    for field in MESSAGES[topic.message]
}
_ON_WHITE: Final = {VOTED: PALETTE[6]}  # the user chooses a dark or a white ground in Foxglove
DRAWN: Final = {"enabled": True, "timestampMethod": "receiveTime"}


class Panels:
    """The panels of a layout so far: their configurations by their ids."""

    def __init__(self) -> None:
        self.configs: dict[str, dict[str, Any]] = {}

    def add(self, kind: str, title: str, **config: Any) -> str:
        """Add a panel of Foxglove's ``kind``, and return its id; a setting of None is omitted."""
        name = f"{kind}!{len(self.configs) + 1}"
        titled = {"foxglovePanelTitle": title or None, **config}
        self.configs[name] = {key: value for key, value in titled.items() if value is not None}
        return name

    def plot(self, title: str, unit: str, paths: list[dict[str, Any]], values: Span = None, span: Span = None) -> str:
        """Add a plot, ``values`` in ``unit``; a plot with ``span`` keeps these seconds, all others move together."""
        axes: dict[str, Any] = {"yAxisLabel": unit or None, "isSynced": span is None}
        if values is not None:
            axes |= {"minYValue": values[0], "maxYValue": values[1]}
        if span is not None:
            axes |= {"timeWindowMode": "fixed", "minXValue": span[0], "maxXValue": span[1]}
        return self.add("Plot", title, paths=paths, xAxisVal="timestamp", showLegend=True, legendDisplay="top", **axes)

    def states(self, title: str, paths: list[dict[str, Any]], span: Span = None) -> str:
        """Add state transitions; ``span`` as of ``plot``."""
        axes: dict[str, Any] = {"isSynced": span is None}
        if span is not None:
            axes |= {"timeWindowMode": "fixed", "xAxisMinValue": span[0], "xAxisMaxValue": span[1]}
        return self.add("StateTransitions", title, paths=paths, **axes)

    def events(self) -> str:
        """Add the log of events."""
        return self.add("RosOut", "events", topicToRender=EVENTS.name, minLogLevel=1, searchTerms=[])


def split(direction: str, nodes: Sequence[tuple[Node, float]]) -> Node:
    """Arrange nodes in a ``row`` or a ``column``, with their shares of it."""
    (first, share), *rest = nodes
    if not rest:
        return first
    percent = 100.0 * share / sum(each for _, each in nodes)
    return {"direction": direction, "first": first, "second": split(direction, rest), "splitPercentage": percent}


def grid(nodes: Sequence[Node], columns: int) -> Node:
    """Arrange nodes in rows of ``columns``."""
    rows = [nodes[i : i + columns] for i in range(0, len(nodes), columns)]
    return split("column", [(split("row", [(node, 1) for node in row]), 1) for row in rows])


def line(path: str, unit: str, label: str, color: Color, width: float = 1.5) -> dict[str, Any]:
    """Return a line of a plot of the SI number at ``path``, in display units."""
    turned = path if scale_shown(unit) == 1.0 else f"{path}.@rad2deg"
    return {"value": turned, "label": label, "color": hex_of(color), "lineSize": width, "showLine": True, **DRAWN}


def state(strip: strips.Strip, label: str) -> dict[str, Any]:
    """Return a row of state transitions: with the labels and colours of Rerun."""
    looks = {code: strip.looks[name] for code, name in strip.states.items() if name in strip.looks}
    return states_at(PATHS[strip.field, strip.at], label, looks)


def states_at(path: str, label: str, looks: dict[int, tuple[str, Color]]) -> dict[str, Any]:
    """Return a row of state transitions of the enum at ``path``; looks : label and colour of its numbers."""
    return {"value": path, "label": label, "customStates": custom(looks), **DRAWN}


def custom(looks: dict[int, tuple[str, Color]], other: tuple[str, Color] = ("", QUIET)) -> dict[str, Any]:
    """Return labels and colours of the values of an enum, which is a number in the message."""
    states = [
        {"value": code, "operator": "=", "label": label, "color": hex_of(color)}
        for code, (label, color) in looks.items()
    ]
    return {"type": "range", "states": states, "otherwise": {"label": other[0], "color": hex_of(other[1])}}


def acting(facts: Facts) -> list[dict[str, Any]]:
    """Return a row for each eight faults (a byte of the log, a bit per fault), with a label while one alone acts."""
    rows = []
    for byte in range((len(facts.faults) + 7) // 8):
        eight = facts.faults[8 * byte : 8 * byte + 8]
        looks = {0: ("none", QUIET)} | {1 << bit: (fault.label, FAULT_STRIP) for bit, fault in enumerate(eight)}
        named = {"label": "faults" if byte == 0 else f"faults {8 * byte + 1} on"}
        states = custom(looks, ("several", FAULT_STRIP))
        rows.append({"value": PATHS["acting", (byte,)], **named, "customStates": states, **DRAWN})
    return rows


def hex_of(color: Color) -> str:
    """Return a colour in the notation of Foxglove."""
    return "#{:02x}{:02x}{:02x}".format(*_ON_WHITE.get(color, color))
