"""The tab of the servo actuators: of each surface, positions, currents, spool, and a lane for each channel."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from rig.core.frame import MOVED
from rig.core.frame.fields import elements
from rig.show.viewer import servo_series as servos
from rig.show.viewer.facts import Shown
from rig.show.viewer.plots import Axes, Line, events, legend, list_series, over_time, state_lanes

_Span = tuple[float, float] | None


def tab(name: str, shown: Sequence[Shown]) -> rrb.Container:
    """Build the tab of the flights with servos; where a channel was shut off, the seconds about it."""
    spans = [seen.coils_s for flight in reversed(shown) if (seen := flight.facts.seen) is not None]
    span = next(filter(None, spans), None)
    rows = [_row(surface, shown, span) for surface in MOVED]
    below = rrb.Horizontal(
        _plot(servos.PRESSURE, MOVED[0], shown, None),
        state_lanes("faults", [], shown, faults=""),
        events(shown),
        column_shares=[3, 3, 4],
    )
    return rrb.Vertical(legend(servos.LEGEND), *rows, below, row_shares=[0.15, *[1.0] * len(rows), 0.6], name=name)


def _row(surface: str, shown: Sequence[Shown], span: _Span) -> rrb.Container:
    position, *others = servos.PLOTS
    return rrb.Horizontal(
        _plot(position, surface, shown, span),
        *(_plot(each, surface, shown, span) for each in others),
        state_lanes(f"{surface}: channels, how many move it", servos.of_surface(surface), shown),
        column_shares=[3, 2, 2, 3],
    )


def _plot(drawn: servos.Plot, surface: str, shown: Sequence[Shown], span: _Span) -> rrb.TimeSeriesView:
    """Draw some numbers of a surface; ``span``: the seconds shown, None for all."""
    lines = [
        Line(servos.topic(surface), servos.VALUES, name, name.replace("_", " "), *servos.look(field, number))
        for field in drawn.fields
        for number, (name, _) in enumerate(elements(servos.FIELD[field]))
    ]
    title = f"{'hydraulic' if drawn is servos.PRESSURE else surface} {drawn.name}"
    zoom = "" if span is None else f": zoom {span[0]:.1f} to {span[1]:.1f} s"
    values = drawn.values or _position(servos.topic(surface), shown)
    return over_time(title + zoom, list_series(servos.NAMES, lines, shown), shown, Axes(span, values))


def _position(topic: str, shown: Sequence[Shown]) -> tuple[float, float] | None:
    """Return the axis that holds the positions of all flights that are over; None: there is none."""
    ranges = [seen.ranges[topic] for flight in shown if (seen := flight.facts.seen) is not None]
    return (min(low for low, _ in ranges), max(high for _, high in ranges)) if ranges else None
