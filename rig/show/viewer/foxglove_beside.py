"""The tabs of a Foxglove layout for servo actuators and several computers, with the colours of the viewer."""

from __future__ import annotations

from typing import Final

from rig.core.frame import CHANNELS, COMPUTERS, LINKS, MOVED, SURFACES, ActuatorMonitor, Health, LaneTest
from rig.core.units.quantities import unit_of_name, unit_shown
from rig.flight.lane_events import test_name
from rig.show.viewer import foxglove_panels as panel
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.facts import Facts
from rig.show.viewer.style import CHANNEL_COLORS, FAILED, QUIET, REFERENCE, VOTED, plain

_TESTS: Final = {
    int(test): ("", QUIET) if test == LaneTest.NONE else ("by command", QUIET)
    if test == LaneTest.COMMANDED else (test_name(test), FAILED)
    for test in LaneTest
}  # fmt: skip


def beside_tabs(panels: panel.Panels, facts: Facts) -> dict[str, panel.Node]:
    """Return the tabs of servos and of several computers, by their names in the viewer."""
    tabs: dict[str, panel.Node] = {}
    if facts.servos:
        tabs["actuators"] = panel.split("column", [(_actuator(panels, surface), 1) for surface in MOVED])
    if facts.computers > 1:
        tabs["computers"] = _computers(panels, facts)
    return tabs


def _actuator(panels: panel.Panels, surface: str) -> panel.Node:
    """Arrange positions, currents, and the monitors that shut off channels."""
    topic = servos.topic(surface)
    channels = [(f"_{c + 1}", CHANNEL_COLORS[c]) for c in range(CHANNELS)]
    positions = [panel.line(f"{topic}.lvdt{end}", "rad", f"LVDT{plain(end)}", color) for end, color in channels]
    positions.append(panel.line(f"{topic}.asked_1", "rad", "command 1", REFERENCE))
    positions.append(panel.line(f"{topic}.ram", "rad", "ram", VOTED, 3.0))
    currents = [panel.line(f"{topic}.current{end}", "", f"current{plain(end)}", color) for end, color in channels]
    strip = servos.of_surface(surface)[0]
    looks = {int(monitor): strip.looks[monitor.name] for monitor in ActuatorMonitor}
    rows = [panel.states_at(f"{topic}.failed_by{end}", f"channel{plain(end)}", looks) for end, _ in channels]
    plots = [
        (panels.plot(f"{surface} position", unit_shown("rad"), positions), 3.0),
        (panels.plot(f"{surface} current", "", currents, (-1.1, 1.1)), 2.0),
    ]
    return panel.split("row", [*plots, (panels.states(f"{surface}: channels", rows), 2.0)])


def _computers(panels: panel.Panels, facts: Facts) -> panel.Node:
    """Arrange faults, health of the lanes with reasons, links, commands, clocks and events."""
    rows = panel.acting(facts)
    for i, name in enumerate(COMPUTERS[: facts.computers]):
        seen = computers.HEALTH[i].looks
        looks = {int(health): seen.get(health.name, ("failed", FAILED)) for health in Health}
        rows.append(panel.states_at(f"{computers.topic(i)}.health", f"lane {name}", looks))
        rows.append(panel.states_at(f"{computers.topic(i)}.failed_for", f"lane {name}, reason", _TESTS))
    links = [
        panel.states_at(f"/ccdl.state_{COMPUTERS[a]}_{COMPUTERS[b]}", f"{COMPUTERS[a]} to {COMPUTERS[b]}", looks)
        for (a, b), strip in zip(LINKS, computers.OF_LINKS, strict=True)
        if max(a, b) < facts.computers
        for looks in ({code: strip.looks[state] for code, state in strip.states.items() if state != "OUTVOTED"},)
    ]
    above = [(panels.states("faults, lanes", rows), 3.0), (panels.states("links", links), 2.0)]
    plots = [(_of_lanes(panels, facts, f"surface_{name}", plain(name.removesuffix("_rad"))), 1.0) for name in SURFACES]
    clocks = _of_lanes(panels, facts, computers.CLOCK, "clock lead, frames")
    below = panel.split("row", [*plots, (clocks, 1.0), (panels.events(), 1.0)])
    return panel.split("column", [(panel.split("row", above), 2.0), (below, 1.0)])


def _of_lanes(panels: panel.Panels, facts: Facts, field: str, title: str) -> str:
    """Draw a number of the message of all lanes."""
    unit = unit_of_name(field)
    lines = [
        panel.line(f"{computers.topic(i)}.{field}", unit, f"lane {name}", CHANNEL_COLORS[i])
        for i, name in enumerate(COMPUTERS[: facts.computers])
    ]
    return panels.plot(title, unit_shown(unit), lines)
