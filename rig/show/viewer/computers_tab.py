"""The tab of several computers: which lane failed, when and why; links, votes of commands, commands, clocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

from rig.core.frame import COMPUTERS, SURFACES
from rig.show.viewer import lanes_view as computers
from rig.show.viewer.derived import DEGREE_NAMES, DEGREES
from rig.show.viewer.facts import Shown
from rig.show.viewer.plots import Axes, Line, events, legend, line_series, list_series, over_time, state_lanes
from rig.show.viewer.state_strips import Lane
from rig.show.viewer.style import CHANNEL_COLORS, VOTED, plain

_Span = tuple[float, float] | None


def tab(name: str, shown: Sequence[Shown]) -> rrb.Container:
    """Build the tab of the flights with several computers; where a lane failed, the seconds about it beside all."""
    spans = [seen.lanes_s for flight in reversed(shown) if (seen := flight.facts.seen) is not None]
    span, count = next(filter(None, spans), None), max(flight.facts.computers for flight in shown)
    whole = [*computers.fitted(computers.HEALTH, count), computers.LEADING, *computers.VOTES]
    near = [*computers.fitted(computers.HEALTH, count), *computers.fitted(computers.ACCUSED, count)]
    above = [_states("faults, computers, who leads, votes of commands", whole, shown, None)]
    if span is not None:
        zoom = f"zoom {span[0]:.1f} to {span[1]:.1f} s: faults, computers, by whom accused"
        above.append(_states(zoom, near, shown, span))
    links = state_lanes("links", computers.fitted(computers.OF_LINKS, count), shown)
    plots = [_commands(surface, shown, span) for surface in SURFACES[:3]]
    return rrb.Vertical(
        legend(computers.LEGEND),
        rrb.Horizontal(*above, links, column_shares=[*(3 for _ in above), 2]),
        rrb.Horizontal(*plots, _plot(computers.CLOCK, "clocks: lead, frames", shown, None, []), events(shown)),
        row_shares=[0.27, 4, 2],
        name=name,
    )


def _states(name: str, lanes: Sequence[Lane], shown: Sequence[Shown], span: _Span) -> Any:
    return state_lanes(name, lanes, shown, "", span)


def _commands(surface: str, shown: Sequence[Shown], span: _Span) -> rrb.TimeSeriesView:
    """Draw what each lane commands, and what reaches the surface."""
    name = f"actuator_{surface}"
    given = [Line("/control", DEGREES, name, "to the surface", VOTED, 3.5)] if name in DEGREE_NAMES else []
    zoom = "" if span is None else "zoom: "
    title = f"{zoom}{plain(surface.removesuffix('_rad'))}, deg: commands of the lanes"
    return _plot(surface, title, shown, span, given)


def _plot(name: str, title: str, shown: Sequence[Shown], span: _Span, given: Sequence[Line]) -> rrb.TimeSeriesView:
    """Draw a number of computers.NAMES of all lanes over what is ``given``, of the seconds ``span``; None: all."""
    series = list_series(DEGREE_NAMES, given, shown) if given else line_series([], shown)
    for i, lane in enumerate(COMPUTERS):
        line = Line(computers.topic(i), computers.VALUES, name, f"lane {lane}", CHANNEL_COLORS[i], 1.5)
        series |= list_series(computers.NAMES, [line], shown)
    ranges = [seen.ranges[name] for flight in shown if (seen := flight.facts.seen) and name in seen.ranges]
    values = (min(low for low, _ in ranges), max(high for _, high in ranges)) if ranges else None
    return over_time(title, series, shown, Axes(span, values))
