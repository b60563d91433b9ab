"""A layout for Foxglove, with which a log opens as it does in Rerun: the same tabs, main signal, decisive seconds.

Written in the form in which the application exports and imports layouts: panels by their ids, and a binary tree of
ids as their arrangement.  Plots are drawn from the log's own fields, found through rig.log.schema, in the unit that
people read.  A message path can turn rad into deg but cannot subtract: what derived.py makes (differences from vote and
truth, the band of the threshold, angles without jumps) is Rerun's alone.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from rig.frame import CHANNELS, DISCRETES, SIGNALS, Discrete, Signal
from rig.log.columns import unit_of
from rig.log.records import AIRCRAFT, WORLD
from rig.log.schema import EVENTS, MESSAGES, POSE_TOPICS, TOPICS_OF_ROWS
from rig.units.quantities import scale_shown, unit_shown
from rig.util.files import write_text
from rig.view import charts, lanes
from rig.view.blueprint import GROUPS, decisive_span, main_signal, status_shown
from rig.view.facts import Facts, Shown
from rig.view.opened import Opened
from rig.view.style import CHANNEL_COLORS, FAULT_LANE, PALETTE, QUIET, REFERENCE, TRUTH, VOTED, Color, plain

ENDING: Final = ".foxglove.json"
Node = str | dict[str, Any]  # a panel's id, or two nodes beside or over each other
# The path of each number of FRAME, by its field and its place in it.
_PATHS: Final = {
    (field.source, field.index if topic.item is None else (topic.item, *field.index)): f"{topic.name}.{field.name}"
    for topic in TOPICS_OF_ROWS
    for field in MESSAGES[topic.message].fields
}
_CHANNEL_FIELDS: Final = tuple(f"ch_{c + 1}" for c in range(CHANNELS))
_LINES: Final = (  # of a signal: field, colour, width
    ("truth", TRUTH, 1.0),
    ("reference", REFERENCE, 1.0),
    *((name, CHANNEL_COLORS[c], 1.5) for c, name in enumerate(_CHANNEL_FIELDS)),
    ("voted", VOTED, 3.0),
)
_ON_WHITE: Final = {VOTED: PALETTE[6]}  # Foxglove's ground is dark or white, as its user likes
_DRAWN: Final = {"enabled": True, "timestampMethod": "receiveTime"}
Span = tuple[float, float] | None


class Written(NamedTuple):
    """What a layout shows first: its main signal, and the decisive seconds; None: no fault acted."""

    panels: int
    signal: str
    zoom_s: Span


def write(opened: Opened, out: Path) -> Written:
    """Write the layout for the topmost of the logs that have been read.

    BadInput: ``out`` cannot be written; RigError: the disk does not take it.
    """
    shown = opened.about.layout.shown[-1]
    made = layout(shown, opened.about.text)
    write_text(out, json.dumps(made, indent=1, allow_nan=False) + "\n")
    return Written(len(made["configById"]), main_signal([shown]).name, decisive_span([shown]))


def layout(shown: Shown, text: str) -> dict[str, Any]:
    """Return the layout for one flight, whose outcome ``text`` says in Markdown."""
    panels = _Panels()
    facts, signal, span = shown.facts, main_signal([shown]), decisive_span([shown])
    tabs = {
        "overview": _overview(panels, shown, signal, span, text),
        **{group: _group(panels, facts, [s for s in SIGNALS if s.group == group]) for group in GROUPS},
        "discretes": _split("column", [(_discrete(panels, each), 1) for each in DISCRETES]),
        "surfaces": _grid([_chart(panels, facts, each) for each in charts.SURFACE], 2),
        "control": _control(panels, facts),
        "flight": _flight(panels, facts),
        **({"unit": _unit(panels, facts)} if facts.unit else {}),
    }
    listed = [{"title": title, "layout": node} for title, node in tabs.items()]
    root = panels.add("Tab", "", activeTabIdx=0, tabs=listed)
    playing = {"playbackConfig": {"speed": 1}, "globalVariables": {}, "userNodes": {}}
    return {"configById": panels.configs, **playing, "layout": root}


class _Panels:
    """The panels of a layout so far: their configurations by their ids."""

    def __init__(self) -> None:
        self.configs: dict[str, dict[str, Any]] = {}

    def add(self, kind: str, title: str, **config: Any) -> str:
        """Add a panel of Foxglove's ``kind``, and return its id; what is None is left out."""
        name = f"{kind}!{len(self.configs) + 1}"
        titled = {"foxglovePanelTitle": title or None, **config}
        self.configs[name] = {key: value for key, value in titled.items() if value is not None}
        return name

    def plot(self, title: str, unit: str, paths: list[dict[str, Any]], values: Span = None, span: Span = None) -> str:
        """Add a plot, ``values`` in ``unit``; one of the seconds ``span`` keeps them, all others move together."""
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


def _split(direction: str, nodes: Sequence[tuple[Node, float]]) -> Node:
    """Arrange nodes in a ``row`` or a ``column``, with their shares of it."""
    (first, share), *rest = nodes
    if not rest:
        return first
    percent = 100.0 * share / sum(each for _, each in nodes)
    return {"direction": direction, "first": first, "second": _split(direction, rest), "splitPercentage": percent}


def _grid(nodes: Sequence[Node], columns: int) -> Node:
    rows = [nodes[i : i + columns] for i in range(0, len(nodes), columns)]
    return _split("column", [(_split("row", [(node, 1) for node in row]), 1) for row in rows])


def _overview(panels: _Panels, shown: Shown, signal: Signal, span: Span, text: str) -> Node:
    """Arrange the headline over the whole flight, its decisive seconds and what is at the cursor."""
    facts = shown.facts
    signals = [SIGNALS[lane.at[0]] for lane in status_shown([shown])]
    patterns = [_state(lane, plain(s.name)) for s in signals for lane in lanes.of_signal(s) if lane.field == "pattern"]
    whole = [(_signal_plot(panels, facts, signal), 2), (panels.states("patterns", patterns), 3)]
    surfaces = [(_chart(panels, facts, each), 1) for each in charts.SURFACE] if span is None else []
    title = "" if span is None else f"zoom {span[0]:.1f} to {span[1]:.1f} s: "
    zoom = [
        (_signal_plot(panels, facts, signal, span, title), 2),
        (_signal_states(panels, facts, signal, span, title), 3),
    ]
    bulbs = [(_bulb(panels, signal, channel), 1.0) for channel in range(signal.channels)]
    raw = panels.add("RawMessages", f"{plain(signal.name)} at the cursor", topicPath=signal.topic)
    now = [(_split("row", bulbs), 1), (raw, 4), (panels.events(), 3)]
    columns = [
        (_split("column", nodes), share) for nodes, share in ((whole, 9), (zoom, 9), (surfaces, 6), (now, 6)) if nodes
    ]
    return _split("column", [(panels.add("Markdown", "", markdown=text), 1.35), (_split("row", columns), 10)])


def _group(panels: _Panels, facts: Facts, signals: Sequence[Signal]) -> Node:
    pairs = [[(_signal_plot(panels, facts, s), 3), (_signal_states(panels, facts, s), 2)] for s in signals]
    return _split("column", [(_split("row", pair), 1) for pair in pairs])


def _signal_plot(panels: _Panels, facts: Facts, signal: Signal, span: Span = None, title: str = "") -> str:
    """Draw truth, reference, channels and vote of a signal, on the scale that Rerun has."""
    fields = [line for line in _LINES if line[0] not in _CHANNEL_FIELDS[signal.channels :]]
    paths = [_line(f"{signal.topic}.{name}", signal.unit, plain(name), color, width) for name, color, width in fields]
    key = signal.name if span is None else "zoom"
    values = None if signal.wraps else _range(facts, key)
    return panels.plot(f"{title}{plain(signal.name)}", unit_shown(signal.unit), paths, values, span)


def _range(facts: Facts, name: str) -> Span:
    """Return the scale that Rerun has; not for an angle on the circle, whose jumps the log has and Rerun has not."""
    return None if facts.seen is None else facts.seen.ranges.get(name)


def _signal_states(panels: _Panels, facts: Facts, signal: Signal, span: Span = None, title: str = "") -> str:
    """Draw when faults act, and the states of a signal: its channels, level, pattern, resolver, source."""
    rows = [_state(lane, plain(lane.path.rsplit("/", 1)[1])) for lane in lanes.of_signal(signal)]
    level = {"value": f"{signal.topic}.level", "label": "level", **_DRAWN}
    return panels.states(f"{title}{lanes.title(signal)}", [*_acting(facts), *rows, level], span)


def _line(path: str, unit: str, label: str, color: Color, width: float = 1.5) -> dict[str, Any]:
    """Return a line of a plot of the SI number at ``path``, in the unit that people read."""
    turned = path if scale_shown(unit) == 1.0 else f"{path}.@rad2deg"
    return {"value": turned, "label": label, "color": _hex(color), "lineSize": width, "showLine": True, **_DRAWN}


def _state(lane: lanes.Lane, label: str) -> dict[str, Any]:
    """Return a row of state transitions: its states as Rerun calls and paints them."""
    looks = {code: lane.looks[name] for code, name in lane.states.items() if name in lane.looks}
    return {"value": _PATHS[lane.field, lane.at], "label": label, "customStates": _custom(looks), **_DRAWN}


def _custom(looks: dict[int, tuple[str, Color]], other: tuple[str, Color] = ("", QUIET)) -> dict[str, Any]:
    """Return labels and colours of the values of an enum, which is a number in the message."""
    states = [
        {"value": code, "operator": "=", "label": label, "color": _hex(color)} for code, (label, color) in looks.items()
    ]
    return {"type": "range", "states": states, "otherwise": {"label": other[0], "color": _hex(other[1])}}


def _acting(facts: Facts) -> list[dict[str, Any]]:
    """Return a row for each eight faults: a byte of the log, a bit a fault, named while one of them acts alone."""
    rows = []
    for byte in range((len(facts.faults) + 7) // 8):
        eight = facts.faults[8 * byte : 8 * byte + 8]
        looks = {0: ("none", QUIET)} | {1 << bit: (fault.label, FAULT_LANE) for bit, fault in enumerate(eight)}
        named = {"label": "faults" if byte == 0 else f"faults {8 * byte + 1} on"}
        custom = _custom(looks, ("several", FAULT_LANE))
        rows.append({"value": _PATHS["acting", (byte,)], **named, "customStates": custom, **_DRAWN})
    return rows


def _hex(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*_ON_WHITE.get(color, color))


def _bulb(panels: _Panels, signal: Signal, channel: int) -> str:
    """Show the state of one channel at the cursor."""
    lane = lanes.of_signal(signal)[channel]
    rules = [
        {"operator": "=", "rawValue": str(code), "label": name.lower(), "color": _hex(lane.looks[name][1])}
        for code, name in lane.states.items()
        if name in lane.looks
    ]
    other = {"fallbackLabel": "not fitted", "fallbackColor": _hex(QUIET)}
    path = _PATHS[lane.field, lane.at]
    return panels.add("Indicator", f"channel {channel + 1}", path=path, style="bulb", rules=rules, **other)


def _discrete(panels: _Panels, discrete: Discrete) -> Node:
    fields = [line for line in _LINES if line[0] not in ("reference", *_CHANNEL_FIELDS[discrete.channels :])]
    paths = [_line(f"{discrete.topic}.{name}", "", plain(name), color, width) for name, color, width in fields]
    states = [_state(lane, plain(lane.path.rsplit("/", 1)[1])) for lane in lanes.of_discrete(discrete)]
    drawn = panels.plot(plain(discrete.name), "", paths, (-0.1, 1.1))
    return _split("row", [(drawn, 3), (panels.states(f"{plain(discrete.name)}: channels", states), 2)])


def _chart(panels: _Panels, facts: Facts, chart: charts.Chart) -> str:
    """Draw numbers of one unit."""
    lines = []
    for i, name in enumerate(chart.names):
        path = _chart_path(name)
        unit = unit_of(path.removeprefix("/"))
        lines.append(_line(path, unit, charts.label(name, chart), PALETTE[i % len(PALETTE)], 1.5 if i else 3.0))
    values = None if "command_heading_rad" in chart.names else _range(facts, chart.name)
    return panels.plot(chart.name, unit_shown(chart.unit), lines, values)


def _chart_path(name: str) -> str:
    """Return the path of a name of a chart."""
    where, _, field = name.partition("_")
    topics = {"flight": "/flight", "position": "/flight", "demand": "/demand"}
    return f"{topics[where]}.{field}" if where in topics else f"/control.{name}"


def _control(panels: _Panels, facts: Facts) -> Node:
    law = panels.states("faults, control law", [*_acting(facts), _state(lanes.LAW, "control law")])
    return _grid([*(_chart(panels, facts, each) for each in charts.CONTROL), law], 3)


def _flight(panels: _Panels, facts: Facts) -> Node:
    """Arrange the aircraft in space and on a map over height, speed and events."""
    pose, position = (topic.name for topic in POSE_TOPICS)
    sea = {
        "layerId": "foxglove.Grid",
        "instanceId": "sea",
        "frameId": WORLD,
        "visible": True,
        "size": 1e5,
        "divisions": 100,
    }
    camera = {"distance": 30.0, "perspective": True, "phi": 70.0, "thetaOffset": 60.0, "fovy": 45.0, "far": 1e5}
    scene = {"transforms": {"axisSize": 5.0, "showLabel": True, "enablePreloading": True}}
    follow = {"fixedFrame": WORLD, "followTf": AIRCRAFT, "followMode": "follow-position"}
    drawn = {"layers": {"sea": sea}, "topics": {pose: {"visible": True}}}
    space = panels.add("3D", "attitude over a sea of 1 km squares", cameraState=camera, scene=scene, **follow, **drawn)
    ground = panels.add("map", "track", layer="map", followTopic=position, zoomLevel=12)
    below = [(_chart(panels, facts, each), 1.0) for each in charts.FLOWN]
    above = _split("row", [(space, 1), (ground, 1)])
    return _split("column", [(above, 3), (_split("row", [*below, (panels.events(), 1)]), 2)])


def _unit(panels: _Panels, facts: Facts) -> Node:
    """Arrange the unit's reply times over the age of the answers that were flown."""
    times = [("reply_us", "reply time"), *([("late_us", "lateness")] if facts.paced else [])]
    drawn = [_line(f"/timing.{name}", "", label, PALETTE[i + 6 * (i == 0)]) for i, (name, label) in enumerate(times)]
    age = _line(_PATHS["unit_age", ()], "", "age", PALETTE[0], 3.0)
    plots = [panels.plot(" and ".join(label for _, label in times), "µs", drawn)]
    plots.append(panels.plot("age of the answer that was flown", "frames", [age]))
    return _split("column", [(each, 1) for each in plots])
