"""The tabs of flights with servo actuators or several computers, beside those that all flights have (blueprint.py)."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from rig.core.frame import COMPUTERS, MOVED, SURFACES
from rig.core.frame.fields import elements
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.derived import DEGREE_NAMES, DEGREES
from rig.show.viewer.facts import Shown, Span, drawn_range
from rig.show.viewer.plots import Axes, Line, events, legend, line_series, list_series, over_time, state_lanes
from rig.show.viewer.style import CHANNEL_COLORS, VOTED, plain


def servo_tab(name: str, shown: Sequence[Shown]) -> rrb.Container:
    """Draw of each surface positions, currents, spool, and a lane for each channel.

    Where a channel was shut off, the seconds about it.
    """
    spans = [seen.coils_s for flight in reversed(shown) if (seen := flight.facts.seen) is not None]
    span = next(filter(None, spans), None)
    rows = [
        rrb.Horizontal(
            *(_servo_plot(each, surface, shown, span) for each in servos.PLOTS),
            state_lanes(f"{surface}: channels, how many move it", servos.of_surface(surface), shown),
            column_shares=[3, 2, 2, 3],
        )
        for surface in MOVED
    ]
    below = rrb.Horizontal(
        _servo_plot(servos.PRESSURE, MOVED[0], shown, None),
        state_lanes("faults", [], shown, faults=""),
        events(shown),
        column_shares=[3, 3, 4],
    )
    return rrb.Vertical(legend(servos.LEGEND), *rows, below, row_shares=[0.15, *[1.0] * len(rows), 0.6], name=name)


def _servo_plot(drawn: servos.Plot, surface: str, shown: Sequence[Shown], span: Span) -> rrb.TimeSeriesView:
    """Draw some numbers of a surface; ``span``: the seconds shown, None for all."""
    topic = servos.topic(surface)
    lines = [
        Line(topic, servos.VALUES, name, plain(name), *servos.look(field, number))
        for field in drawn.fields
        for number, (name, _) in enumerate(elements(servos.FIELD[field]))
    ]
    title = f"{'hydraulic' if drawn is servos.PRESSURE else surface} {drawn.name}"
    zoom = "" if span is None else f": zoom {span[0]:.1f} to {span[1]:.1f} s"
    axes = Axes(span, drawn.values or drawn_range(shown, topic))
    return over_time(title + zoom, list_series(servos.NAMES, lines, shown), shown, axes)


def computers_tab(name: str, shown: Sequence[Shown]) -> rrb.Container:
    """Draw which lane failed, when and why; links, votes of commands, commands, clocks.

    Where a lane failed, the seconds about it beside all.
    """
    spans = [seen.lanes_s for flight in reversed(shown) if (seen := flight.facts.seen) is not None]
    span, count = next(filter(None, spans), None), max(flight.facts.computers for flight in shown)
    health = computers.fitted(computers.HEALTH, count)
    whole = [*health, computers.LEADING, *computers.VOTES]
    above = [state_lanes("faults, computers, who leads, votes of commands", whole, shown, "")]
    if span is not None:
        near = [*health, *computers.fitted(computers.ACCUSED, count)]
        zoom = f"zoom {span[0]:.1f} to {span[1]:.1f} s: faults, computers, by whom accused"
        above.append(state_lanes(zoom, near, shown, "", span))
    links = state_lanes("links", computers.fitted(computers.OF_LINKS, count), shown)
    plots = [_commands(surface, shown, span) for surface in SURFACES[:3]]
    clocks = _of_lanes(computers.CLOCK, "clocks: lead, frames", shown, None, [])
    return rrb.Vertical(
        legend(computers.LEGEND),
        rrb.Horizontal(*above, links, column_shares=[*(3 for _ in above), 2]),
        rrb.Horizontal(*plots, clocks, events(shown)),
        row_shares=[0.27, 4, 2],
        name=name,
    )


def _commands(surface: str, shown: Sequence[Shown], span: Span) -> rrb.TimeSeriesView:
    """Draw what each lane commands, and what reaches the surface."""
    name = f"surface_command_{surface}"
    given = [Line("/control", DEGREES, name, "to the surface", VOTED, 3.5)] if name in DEGREE_NAMES else []
    zoom = "" if span is None else "zoom: "
    title = f"{zoom}{plain(surface.removesuffix('_rad'))}, deg: commands of the lanes"
    return _of_lanes(surface, title, shown, span, given)


def _of_lanes(name: str, title: str, shown: Sequence[Shown], span: Span, given: Sequence[Line]) -> rrb.TimeSeriesView:
    """Draw a number of computers.NAMES of all lanes over what is ``given``, of the seconds ``span``; None: all."""
    series = list_series(DEGREE_NAMES, given, shown) if given else line_series([], shown)
    for i, lane in enumerate(COMPUTERS):
        line = Line(computers.topic(i), computers.VALUES, name, f"lane {lane}", CHANNEL_COLORS[i], 1.5)
        series |= list_series(computers.NAMES, [line], shown)
    return over_time(title, series, shown, Axes(span, drawn_range(shown, name)))
