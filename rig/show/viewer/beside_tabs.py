"""The tabs of flights with servo actuators or several computers; blueprint.py has the tabs of all flights."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from rig.core.frame import COMPUTERS, MOVED, SURFACES
from rig.core.frame.fields import elements
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.derived import DEGREE_NAMES, DEGREES
from rig.show.viewer.facts import Shown, Span, drawn_range
from rig.show.viewer.plots import Axes, Line, events, legend, line_series, list_series, over_time, strips_view
from rig.show.viewer.style import CHANNEL_COLORS, VOTED, plain


def servo_tab(name: str, shown: Sequence[Shown]) -> rrb.Container:
    """Draw positions, currents, spool and the states of the channels of each surface.

    If a channel was shut off, the plots show the seconds around it.
    """
    spans = [seen.coils_s for flight in reversed(shown) if (seen := flight.facts.seen) is not None]
    span = next(filter(None, spans), None)
    rows = [
        rrb.Horizontal(
            *(_servo_plot(each, surface, shown, span) for each in servos.PLOTS),
            strips_view(f"{surface}: channels, number of channels that move it", servos.of_surface(surface), shown),
            column_shares=[3, 2, 2, 3],
        )
        for surface in MOVED
    ]
    below = rrb.Horizontal(
        _servo_plot(servos.PRESSURE, MOVED[0], shown, None),
        strips_view("faults", [], shown, faults=""),
        events(shown),
        column_shares=[3, 3, 4],
    )
    return rrb.Vertical(legend(servos.LEGEND), *rows, below, row_shares=[0.15, *[1.0] * len(rows), 0.6], name=name)


def _servo_plot(drawn: servos.Plot, surface: str, shown: Sequence[Shown], span: Span) -> rrb.TimeSeriesView:
    """Draw numbers of a surface; span : the seconds shown, None: all."""
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
    """Draw the health of each lane, links, votes of commands, commands and clocks.

    If a lane failed, the seconds around it stand beside the whole flight.
    """
    spans = [seen.lanes_s for flight in reversed(shown) if (seen := flight.facts.seen) is not None]
    span, count = next(filter(None, spans), None), max(flight.facts.computers for flight in shown)
    health = computers.fitted(computers.HEALTH, count)
    whole = [*health, computers.LEADING, *computers.VOTES]
    above = [strips_view("faults, lanes, leading lane, votes of commands", whole, shown, "")]
    if span is not None:
        near = [*health, *computers.fitted(computers.REPORTED, count)]
        zoom = f"zoom {span[0]:.1f} to {span[1]:.1f} s: faults, lanes, lanes that report them"
        above.append(strips_view(zoom, near, shown, "", span))
    links = strips_view("links", computers.fitted(computers.OF_LINKS, count), shown)
    plots = [_commands(surface, shown, span) for surface in SURFACES[:3]]
    clocks = _of_lanes(computers.CLOCK, "clock lead, frames", shown, None, [])
    return rrb.Vertical(
        legend(computers.LEGEND),
        rrb.Horizontal(*above, links, column_shares=[*(3 for _ in above), 2]),
        rrb.Horizontal(*plots, clocks, events(shown)),
        row_shares=[0.27, 4, 2],
        name=name,
    )


def _commands(surface: str, shown: Sequence[Shown], span: Span) -> rrb.TimeSeriesView:
    """Draw the command of each lane, and the command that reaches the surface."""
    name = f"surface_command_{surface}"
    given = [Line("/control", DEGREES, name, "output to the surface", VOTED, 3.5)] if name in DEGREE_NAMES else []
    zoom = "" if span is None else "zoom: "
    title = f"{zoom}{plain(surface.removesuffix('_rad'))}, deg: commands of the lanes"
    return _of_lanes(surface, title, shown, span, given)


def _of_lanes(name: str, title: str, shown: Sequence[Shown], span: Span, given: Sequence[Line]) -> rrb.TimeSeriesView:
    """Draw a number of computers.NAMES of all lanes over the ``given`` lines; span : the seconds shown, None: all."""
    series = list_series(DEGREE_NAMES, given, shown) if given else line_series([], shown)
    for i, lane in enumerate(COMPUTERS):
        line = Line(computers.topic(i), computers.VALUES, name, f"lane {lane}", CHANNEL_COLORS[i], 1.5)
        series |= list_series(computers.NAMES, [line], shown)
    return over_time(title, series, shown, Axes(span, drawn_range(shown, name)))
