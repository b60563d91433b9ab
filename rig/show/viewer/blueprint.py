"""The layout of the viewer, made from the tables of rig/core/frame/: one for the live stream, a saved .rrd and a
log."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, Final

import rerun.blueprint as rrb

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, DISCRETES, INDEX, SIGNALS, Discrete, Signal
from rig.core.units.quantities import unit_shown
from rig.flight.failures import decisive_s
from rig.show.viewer import charts, derived
from rig.show.viewer import rerun_columns as columns
from rig.show.viewer import state_strips as strips
from rig.show.viewer.beside_tabs import computers_tab, servo_tab
from rig.show.viewer.facts import Layout, Shown, Span, drawn_range
from rig.show.viewer.plots import (
    Axes,
    Line,
    about,
    attitude,
    chart,
    events,
    histogram,
    legend,
    list_series,
    map_view,
    margin,
    numbers,
    over_time,
    path,
    plot,
    status_now,
    status_view,
    strips_view,
    track,
)
from rig.show.viewer.scene import TIMELINE
from rig.show.viewer.style import CHANNEL_COLORS, FAULT, PALETTE, REFERENCE, THRESHOLD, TRUTH, VOTED, plain

OVERVIEW: Final = "overview"  # the first tab
MAIN: Final = "pitch_rate"  # its signal for a flight without faults
GROUPS: Final = tuple(dict.fromkeys(signal.group for signal in SIGNALS))
SERVOS: Final = "actuators"  # only of flights with servos
COMPUTERS: Final = "computers"  # only of flights with several
UNIT: Final = "unit"  # the last tab, only of flights with a unit under test
TABS: Final = (OVERVIEW, *GROUPS, "discretes", "surfaces", SERVOS, COMPUTERS, "control", "flight", UNIT)
LAYOUT: Final = Layout()
_MARGIN: Final = 0.033  # of a column, left of its strips


def blueprint(layout: Layout = LAYOUT) -> rrb.Blueprint:
    """Build the layout for the flights ``layout.shown``, open at ``layout.tab``; BadInput: no such tab.

    The overview has the first signal with a fault, or pitch rate.  With ``map_tiles`` a map stands beside the track;
    the viewer fetches its tiles from the internet.
    """
    shown, tab, map_tiles = layout
    require_tab(tab)
    tested = [flight for flight in shown if flight.facts.unit]
    moved = [flight for flight in shown if flight.facts.servos]
    several = [flight for flight in shown if flight.facts.computers > 1]
    if tab == UNIT and not tested:
        raise BadInput(f"no tab {tab!r}: no flight had a unit under test")
    if tab == SERVOS and not moved:
        raise BadInput(f'no tab {tab!r}: no flight had [actuators] model = "servo"')
    if tab == COMPUTERS and not several:
        raise BadInput(f"no tab {tab!r}: no flight had [computers] count of 2 or more")
    tabs = {
        OVERVIEW: _overview(main_signal(shown), shown),
        **{group: _group_tab(group, [s for s in SIGNALS if s.group == group], shown) for group in GROUPS},
        "discretes": _discretes_tab(shown),
        "surfaces": rrb.Grid(*(chart(content, shown) for content in charts.SURFACE), grid_columns=2, name="surfaces"),
        **({SERVOS: servo_tab(SERVOS, moved)} if moved else {}),
        **({COMPUTERS: computers_tab(COMPUTERS, several)} if several else {}),
        "control": _control_tab(shown),
        "flight": _flight_tab(shown, map_tiles),
        **({UNIT: _unit_tab(tested)} if tested else {}),
    }
    return rrb.Blueprint(
        rrb.Tabs(*tabs.values(), active_tab=list(tabs).index(tab)),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
        auto_layout=False,
    )


def require_tab(tab: str) -> None:
    """Raise BadInput if there is no such tab."""
    if tab not in TABS:
        raise BadInput(f"no tab {tab!r}; there are: {', '.join(TABS)}")


def main_signal(shown: Sequence[Shown]) -> Signal:
    """Return the signal of the overview: that of the decisive fault, or of the first one; the flight on top first."""
    seen = [flight.facts.seen.main for flight in reversed(shown) if flight.facts.seen is not None]
    faulted = [flight.facts.first_faulted for flight in reversed(shown)]
    return SIGNALS[INDEX[next(filter(None, (*seen, *faulted)), MAIN)]]


def _overview(signal: Signal, shown: Sequence[Shown]) -> rrb.Container:
    """Build the overview: the whole flight, its decisive seconds, and the state at the cursor on the right."""
    top, span = shown[-1], decisive_span(shown)
    whole = rrb.Vertical(
        _difference_plot(signal, shown),
        *([] if span is not None else [_signal_plot(signal, shown)]),
        rrb.Horizontal(margin(), status_view(status_shown(shown), shown), column_shares=[_MARGIN, 1.0 - _MARGIN]),
        row_shares=[2, 8] if span is not None else [2, 2, 5],
    )
    parts: list[rrb.Container] = [whole]
    shares = [9]
    if span is not None:
        parts.append(_decisive(signal, shown, span))
        shares.append(9)
    else:
        parts.append(rrb.Vertical(*(chart(content, shown) for content in charts.SURFACE)))
        shares.append(6)
    now = rrb.Vertical(status_now(top), numbers(top), events(shown), row_shares=[10, 3, 4])
    below = rrb.Horizontal(*parts, now, column_shares=[*shares, 6])
    return rrb.Vertical(about(shown), below, row_shares=[1.35 + 0.9 * (len(shown) - 1), 10], name=OVERVIEW)


def _decisive(signal: Signal, shown: Sequence[Shown], span: tuple[float, float]) -> rrb.Container:
    top = shown[-1:]
    name = f"zoom {span[0]:.1f} to {span[1]:.1f} s: {strips.title(signal)}"
    states = strips_view(name, strips.of_signal(signal), top, faults=signal.name, span_s=span)
    return rrb.Vertical(
        _difference_plot(signal, shown, span),
        _signal_plot(signal, shown, span),
        rrb.Horizontal(margin(), states, column_shares=[_MARGIN, 1.0 - _MARGIN]),
        row_shares=[2, 2, 3],
    )


def decisive_span(shown: Sequence[Shown]) -> Span:
    """Return the decisive seconds of the topmost flight with any; in flight, those after its first fault begins."""
    for flight in reversed(shown):
        if flight.facts.seen is not None:
            if flight.facts.seen.zoom_s is not None:
                return flight.facts.seen.zoom_s
        elif (start := flight.facts.first_start_s) is not None:
            return decisive_s(start, None, inf)
    return None


def status_shown(shown: Sequence[Shown]) -> list[strips.Strip]:
    """Return the strips of the overview: all signals; with several flights, signals with a channel that was not ok."""
    noted = {name for flight in shown if flight.facts.seen is not None for name in flight.facts.seen.noted}
    some = [strip for strip in strips.STATUS if strip.path[1:] in noted][: len(SIGNALS) // len(shown)]
    return list(strips.STATUS) if len(shown) == 1 or not some else some


def _group_tab(group: str, signals: Sequence[Signal], shown: Sequence[Shown]) -> rrb.Container:
    rows = [
        rrb.Horizontal(
            _signal_plot(s, shown),
            _deviation_plot(s, shown),
            strips_view(strips.title(s), strips.of_signal(s), shown, faults=s.name),
            column_shares=[3, 3, 2] if len(shown) == 1 else [3, 2, 3],
        )
        for s in signals
    ]
    return rrb.Vertical(legend(), *rows, row_shares=[0.15, *[1.0] * len(rows)], name=group)


def _signal_plot(signal: Signal, shown: Sequence[Shown], span: Span = None) -> Any:
    """Draw the signal in display units; its decisive seconds have a separate scale."""
    lines = _lines(signal, "", ("low", "high", "voted", *_CHANNELS, "reference", "truth"))
    values = drawn_range(shown, signal.name if span is None else "zoom")
    name = ", ".join(filter(None, (plain(signal.name), unit_shown(signal.unit))))
    return over_time(_zoomed(name, span), list_series(derived.NAMES, lines, shown), shown, Axes(span, values))


def _difference_plot(signal: Signal, shown: Sequence[Shown], span: Span = None) -> Any:
    """Draw channels and truth minus the vote, in thresholds; without a threshold, minus the truth."""
    if not any(signal.name in flight.facts.thresholds for flight in shown):
        return _deviation_plot(signal, shown)
    lines = _lines(signal, "apart_", ("fault", "low", "high", "truth", *_CHANNELS))
    name = f"{plain(signal.name)} minus voted value, in thresholds (clipped at {derived.LIMIT:g})"
    axes = Axes(span, (-derived.LIMIT - 0.1, derived.LIMIT + 0.1))
    return over_time(_zoomed(name, span), list_series(derived.NAMES, lines, shown), shown, axes)


def _zoomed(name: str, span: Span) -> str:
    return name if span is None else f"zoom: {name}"


def _deviation_plot(signal: Signal, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    lines = _lines(signal, "off_", ("voted", *_CHANNELS))
    name = ", ".join(filter(None, (f"{plain(signal.name)} minus true value", unit_shown(signal.unit))))
    return over_time(f"{name}; channels in use", list_series(derived.NAMES, lines, shown), shown)


_CHANNELS: Final = tuple(f"ch_{c + 1}" for c in range(CHANNELS))
_LOOKS: Final = {  # of a line: colour, width, drawn for flights below another
    "fault": (FAULT, 16.0, True),
    "low": (THRESHOLD, 1.0, False),
    "high": (THRESHOLD, 1.0, False),
    "voted": (VOTED, 3.5, True),
    "reference": (REFERENCE, 1.0, False),
    "truth": (TRUTH, 1.0, True),
    **{name: (CHANNEL_COLORS[c], 1.5, False) for c, name in enumerate(_CHANNELS)},
}


def _lines(signal: Signal, prefix: str, names: Sequence[str]) -> list[Line]:
    """Return lines of the derived list of ``signal``, by their names without ``prefix``."""
    lines = []
    for name in names:
        color, width, below = _LOOKS[name]
        label = f"{plain(signal.name)}, channel {name[3:]}" if name in _CHANNELS else f"{plain(signal.name)}, {name}"
        on = signal.name if name == "fault" else ""
        lines.append(Line(signal.topic, derived.VALUES, prefix + name, label, color, width, below, on))
    return lines


def _discretes_tab(shown: Sequence[Shown]) -> rrb.Container:
    rows = []
    for discrete in DISCRETES:
        name = f"{discrete.name}: faults, channels"
        states = strips_view(name, strips.of_discrete(discrete), shown, faults=discrete.name)
        rows.append(rrb.Horizontal(_discrete_plot(discrete, shown), states, column_shares=[3, 2]))
    return rrb.Vertical(*rows, name="discretes")


def _discrete_plot(discrete: Discrete, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    channels = [
        Line(discrete.topic, "rig.Discrete", name, f"channel {name[3:]}", CHANNEL_COLORS[c], below=False)
        for c, name in enumerate(_CHANNELS[: discrete.channels])
    ]
    voted = Line(discrete.topic, "rig.Discrete", "voted", "voted", VOTED, 3.5)
    truth = Line(discrete.topic, "rig.Discrete", "truth", "truth", TRUTH)
    return plot(plain(discrete.name), [voted, *channels, truth], shown, Axes(values=(-0.1, 1.1)))


def _control_tab(shown: Sequence[Shown]) -> rrb.Container:
    states = strips_view("faults, control law", [strips.LAW], shown, faults="")
    return rrb.Grid(*(chart(content, shown) for content in charts.CONTROL), states, grid_columns=3, name="control")


def _flight_tab(shown: Sequence[Shown], map_tiles: bool) -> rrb.Container:
    figures = rrb.Vertical(attitude(shown), *map(numbers, shown), row_shares=[5, *[2] * len(shown)])
    above = rrb.Horizontal(path(shown), track(shown), *([map_view(shown)] if map_tiles else []), figures)
    below = rrb.Horizontal(*(chart(content, shown) for content in charts.FLOWN), events(shown))
    return rrb.Vertical(above, below, row_shares=[3, 2], name="flight")


def _unit_tab(shown: Sequence[Shown]) -> rrb.Container:
    """Draw the reply times of the unit and the age of the replies in use; histograms up to the cursor."""
    clock = Line(columns.CLOCK, columns.CLOCK_TYPE, "reply_us", "reply time", VOTED)
    age = Line("/control", "rig.Control", "unit_age", "age", PALETTE[0], 3.0)
    late = Line(columns.CLOCK, columns.CLOCK_TYPE, "late_us", "lateness", PALETTE[0])
    paced = [flight for flight in shown if flight.facts.paced]
    bars = [histogram(columns.REPLIES, shown), *([histogram(columns.LATENESS, paced)] if paced else [])]
    return rrb.Vertical(
        plot("reply time and lateness, µs" if paced else "reply time, µs", [clock, *([late] if paced else [])], shown),
        plot("age of the reply in use, frames", [age], shown),
        rrb.Horizontal(*bars),
        name=UNIT,
    )
