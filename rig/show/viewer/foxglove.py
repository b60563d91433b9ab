"""A layout for Foxglove with the tabs, main signal and decisive seconds that a log has in Rerun.

The file has the form in which the application exports and imports layouts: panels by their ids, and a binary tree of
ids as their arrangement.  Plots use the fields of the log, found through rig.log.schema, in display units.  A message
path can convert rad to deg but cannot subtract, so the quantities of derived.py (differences from vote and truth, the
band of the threshold, unwrapped angles) exist in Rerun only.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final, NamedTuple

from rig.core.files import write_text
from rig.core.frame import CHANNELS, DISCRETES, SIGNALS, Discrete, Signal
from rig.core.units.quantities import unit_shown
from rig.log.columns import unit_of
from rig.log.records import AIRCRAFT, WORLD
from rig.log.schema import POSE_TOPICS
from rig.show.viewer import charts
from rig.show.viewer import foxglove_panels as panel
from rig.show.viewer import state_strips as strips
from rig.show.viewer.blueprint import GROUPS, decisive_span, main_signal, status_shown
from rig.show.viewer.facts import Facts, Shown
from rig.show.viewer.foxglove_beside import beside_tabs
from rig.show.viewer.opened import Opened
from rig.show.viewer.style import CHANNEL_COLORS, PALETTE, QUIET, REFERENCE, TRUTH, VOTED, plain

ENDING: Final = ".foxglove.json"
_CHANNEL_FIELDS: Final = tuple(f"ch_{c + 1}" for c in range(CHANNELS))
_LINES: Final = (  # of a signal: field, colour, width
    ("truth", TRUTH, 1.0),
    ("reference", REFERENCE, 1.0),
    *((name, CHANNEL_COLORS[c], 1.5) for c, name in enumerate(_CHANNEL_FIELDS)),
    ("voted", VOTED, 3.0),
)


class Written(NamedTuple):
    """Summary of a written layout: panels, main signal, and decisive seconds; None: no active fault."""

    panels: int
    signal: str
    zoom_s: panel.Span


def write(opened: Opened, out: Path) -> Written:
    """Write the layout for the topmost of the logs.

    BadInput: ``out`` cannot be written; RigError: the disk reports an error.
    """
    shown = opened.about.layout.shown[-1]
    made = layout(shown, opened.about.text)
    write_text(out, json.dumps(made, indent=1, allow_nan=False) + "\n")
    return Written(len(made["configById"]), main_signal([shown]).name, decisive_span([shown]))


def layout(shown: Shown, text: str) -> dict[str, Any]:
    """Return the layout for one flight; text : its outcome, Markdown."""
    panels = panel.Panels()
    facts, signal, span = shown.facts, main_signal([shown]), decisive_span([shown])
    tabs = {
        "overview": _overview(panels, shown, signal, span, text),
        **{group: _group(panels, facts, group) for group in GROUPS},
        "discretes": panel.split("column", [(_discrete(panels, each), 1) for each in DISCRETES]),
        "surfaces": panel.grid([_chart(panels, facts, each) for each in charts.SURFACE], 2),
        **beside_tabs(panels, facts),
        "control": _control(panels, facts),
        "flight": _flight(panels, facts),
        **({"unit": _unit(panels, facts)} if facts.unit else {}),
    }
    listed = [{"title": title, "layout": node} for title, node in tabs.items()]
    root = panels.add("Tab", "", activeTabIdx=0, tabs=listed)
    playing = {"playbackConfig": {"speed": 1}, "globalVariables": {}, "userNodes": {}}
    return {"configById": panels.configs, **playing, "layout": root}


def _overview(panels: panel.Panels, shown: Shown, signal: Signal, span: panel.Span, text: str) -> panel.Node:
    """Arrange the headline over the whole flight, its decisive seconds and the state at the cursor."""
    facts = shown.facts
    signals = [SIGNALS[strip.at[0]] for strip in status_shown([shown])]
    patterns = [
        panel.state(strip, plain(s.name)) for s in signals for strip in strips.of_signal(s) if strip.field == "pattern"
    ]
    whole = [(_signal_plot(panels, facts, signal), 2), (panels.states("patterns", patterns), 3)]
    surfaces = [(_chart(panels, facts, each), 1) for each in charts.SURFACE] if span is None else []
    title = "" if span is None else f"zoom {span[0]:.1f} to {span[1]:.1f} s: "
    zoom = [
        (_signal_plot(panels, facts, signal, span, title), 2),
        (_signal_states(panels, facts, signal, span, title), 3),
    ]
    bulbs = [(_bulb(panels, signal, channel), 1.0) for channel in range(signal.channels)]
    raw = panels.add("RawMessages", f"{plain(signal.name)} at the cursor", topicPath=signal.topic)
    now = [(panel.split("row", bulbs), 1), (raw, 4), (panels.events(), 3)]
    columns = [
        (panel.split("column", nodes), share)
        for nodes, share in ((whole, 9), (zoom, 9), (surfaces, 6), (now, 6))
        if nodes
    ]
    return panel.split("column", [(panels.add("Markdown", "", markdown=text), 1.35), (panel.split("row", columns), 10)])


def _group(panels: panel.Panels, facts: Facts, group: str) -> panel.Node:
    signals = [signal for signal in SIGNALS if signal.group == group]
    pairs = [[(_signal_plot(panels, facts, s), 3), (_signal_states(panels, facts, s), 2)] for s in signals]
    return panel.split("column", [(panel.split("row", pair), 1) for pair in pairs])


def _signal_plot(panels: panel.Panels, facts: Facts, signal: Signal, span: panel.Span = None, title: str = "") -> str:
    """Draw truth, reference, channels and vote of a signal, on the scale of Rerun."""
    fields = [line for line in _LINES if line[0] not in _CHANNEL_FIELDS[signal.channels :]]
    paths = [
        panel.line(f"{signal.topic}.{name}", signal.unit, plain(name), color, width) for name, color, width in fields
    ]
    key = signal.name if span is None else "zoom"
    values = None if signal.wraps else _range(facts, key)
    return panels.plot(f"{title}{plain(signal.name)}", unit_shown(signal.unit), paths, values, span)


def _range(facts: Facts, name: str) -> panel.Span:
    """Return the scale of Rerun; not for angles, which wrap in the log and are unwrapped in Rerun."""
    return None if facts.seen is None else facts.seen.ranges.get(name)


def _signal_states(panels: panel.Panels, facts: Facts, signal: Signal, span: panel.Span = None, title: str = "") -> str:
    """Draw active faults and the states of a signal: its channels, level, pattern, decided_by, source."""
    rows = [panel.state(strip, plain(strip.path.rsplit("/", 1)[1])) for strip in strips.of_signal(signal)]
    level = {"value": f"{signal.topic}.level", "label": "level", **panel.DRAWN}
    return panels.states(f"{title}{strips.title(signal)}", [*panel.acting(facts), *rows, level], span)


def _bulb(panels: panel.Panels, signal: Signal, channel: int) -> str:
    """Show the state of one channel at the cursor."""
    strip = strips.of_signal(signal)[channel]
    rules = [
        {"operator": "=", "rawValue": str(code), "label": name.lower(), "color": panel.hex_of(strip.looks[name][1])}
        for code, name in strip.states.items()
        if name in strip.looks
    ]
    other = {"fallbackLabel": "not fitted", "fallbackColor": panel.hex_of(QUIET)}
    path = panel.PATHS[strip.field, strip.at]
    return panels.add("Indicator", f"channel {channel + 1}", path=path, style="bulb", rules=rules, **other)


def _discrete(panels: panel.Panels, discrete: Discrete) -> panel.Node:
    fields = [line for line in _LINES if line[0] not in ("reference", *_CHANNEL_FIELDS[discrete.channels :])]
    paths = [panel.line(f"{discrete.topic}.{name}", "", plain(name), color, width) for name, color, width in fields]
    states = [panel.state(strip, plain(strip.path.rsplit("/", 1)[1])) for strip in strips.of_discrete(discrete)]
    drawn = panels.plot(plain(discrete.name), "", paths, (-0.1, 1.1))
    return panel.split("row", [(drawn, 3), (panels.states(f"{plain(discrete.name)}: channels", states), 2)])


def _chart(panels: panel.Panels, facts: Facts, chart: charts.Chart) -> str:
    lines = []
    for i, name in enumerate(chart.names):
        path = ".".join(charts.place(name))
        unit = unit_of(path.removeprefix("/"))
        lines.append(panel.line(path, unit, charts.label(name, chart), PALETTE[i % len(PALETTE)], 1.5 if i else 3.0))
    values = None if "command_heading_rad" in chart.names else _range(facts, chart.name)
    return panels.plot(chart.name, unit_shown(chart.unit), lines, values)


def _control(panels: panel.Panels, facts: Facts) -> panel.Node:
    law = panels.states("faults, control law", [*panel.acting(facts), panel.state(strips.LAW, "control law")])
    return panel.grid([*(_chart(panels, facts, each) for each in charts.CONTROL), law], 3)


def _flight(panels: panel.Panels, facts: Facts) -> panel.Node:
    """Arrange the aircraft in space and on a map over height, speed and events."""
    pose, position = (topic.name for topic in POSE_TOPICS)
    of = {"layerId": "foxglove.Grid", "instanceId": "sea", "frameId": WORLD}
    sea = {**of, "visible": True, "size": 1e5, "divisions": 100}
    camera = {"distance": 30.0, "perspective": True, "phi": 70.0, "thetaOffset": 60.0, "fovy": 45.0, "far": 1e5}
    scene = {"transforms": {"axisSize": 5.0, "showLabel": True, "enablePreloading": True}}
    follow = {"fixedFrame": WORLD, "followTf": AIRCRAFT, "followMode": "follow-position"}
    drawn = {"layers": {"sea": sea}, "topics": {pose: {"visible": True}}}
    space = panels.add("3D", "attitude over a sea of 1 km squares", cameraState=camera, scene=scene, **follow, **drawn)
    ground = panels.add("map", "track", layer="map", followTopic=position, zoomLevel=12)
    below = [(_chart(panels, facts, each), 1.0) for each in charts.FLOWN]
    above = panel.split("row", [(space, 1), (ground, 1)])
    return panel.split("column", [(above, 3), (panel.split("row", [*below, (panels.events(), 1)]), 2)])


def _unit(panels: panel.Panels, facts: Facts) -> panel.Node:
    """Arrange the reply times of the unit over the age of the replies in use."""
    times = [("reply_us", "reply time"), *([("late_us", "lateness")] if facts.paced else [])]
    drawn = [
        panel.line(f"/timing.{name}", "", label, PALETTE[i + 6 * (i == 0)]) for i, (name, label) in enumerate(times)
    ]
    age = panel.line(panel.PATHS["unit_age", ()], "", "age", PALETTE[0], 3.0)
    plots = [panels.plot(" and ".join(label for _, label in times), "µs", drawn)]
    plots.append(panels.plot("age of the reply in use", "frames", [age]))
    return panel.split("column", [(each, 1) for each in plots])
