"""The layout of the viewer, made from the tables of rig/frame/: one for the live stream, a saved .rrd and a log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import rerun.blueprint as rrb

from rig.errors import BadInput
from rig.frame import COMMANDS, DEMANDS, DISCRETES, INDEX, SIGNALS, SURFACES, Discrete, Signal
from rig.view import derived, lanes, times
from rig.view.facts import Layout, Shown
from rig.view.plots import (
    Line,
    about,
    attitude,
    events,
    fields,
    histogram,
    map_view,
    path,
    plot,
    plot_list,
    state_lanes,
    track,
)
from rig.view.scene import TIMELINE
from rig.view.style import CHANNEL_COLORS, FAULT, PALETTE, REFERENCE, THRESHOLD, TRUTH, VOTED

OVERVIEW: Final = "overview"  # the first tab
MAIN: Final = "pitch_rate"  # what it shows of a flight without faults
GROUPS: Final = tuple(dict.fromkeys(signal.group for signal in SIGNALS))
UNIT: Final = "unit"  # the last tab, of flights with a unit under test alone
TABS: Final = (OVERVIEW, *GROUPS, "discretes", "surfaces", "control", "flight", UNIT)
LAYOUT: Final = Layout()


def blueprint(layout: Layout = LAYOUT) -> rrb.Blueprint:
    """The layout for the flights ``layout.shown``, open at ``layout.tab``; BadInput: no such tab.

    The overview has the first signal that a fault sits on, else pitch rate.  With ``map_tiles`` there is a map
    beside the track, for which the viewer fetches tiles from the internet.
    """
    shown, tab, map_tiles = layout
    require_tab(tab)
    tested = [one for one in shown if one.facts.unit]
    if tab == UNIT and not tested:
        raise BadInput(f"no tab {tab!r}: no unit under test was flown")
    tabs = {
        OVERVIEW: _overview(_main(shown), shown),
        **{group: _group_tab(group, [s for s in SIGNALS if s.group == group], shown) for group in GROUPS},
        "discretes": _discretes_tab(shown),
        "surfaces": rrb.Grid(*(_surface_plot(name, shown) for name in SURFACES), grid_columns=2, name="surfaces"),
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
    """BadInput when there is no such tab."""
    if tab not in TABS:
        raise BadInput(f"no tab {tab!r}; there are: {', '.join(TABS)}")


def _main(shown: Sequence[Shown]) -> Signal:
    """The signal of the overview."""
    faulted = [one.facts.first_faulted for one in reversed(shown)]
    return SIGNALS[INDEX[next(filter(None, faulted), MAIN)]]


def _overview(signal: Signal, shown: Sequence[Shown]) -> rrb.Container:
    left = rrb.Vertical(
        _signal_plot(signal, shown),
        _deviation_plot(signal, shown),
        _signal_lanes(signal, shown, faults=""),
        row_shares=[4, 3, 5] if len(shown) == 1 else [5, 3, 5],
    )
    right = rrb.Vertical(
        about(shown), _surface_plot(SURFACES[0], shown), events(shown), attitude(shown), row_shares=[1, 2, 2, 3]
    )
    return rrb.Horizontal(left, right, column_shares=[5, 3], name=OVERVIEW)


def _group_tab(group: str, signals: Sequence[Signal], shown: Sequence[Shown]) -> rrb.Container:
    rows = [
        rrb.Horizontal(
            _signal_plot(s, shown),
            _deviation_plot(s, shown),
            _signal_lanes(s, shown, faults=s.name),
            column_shares=[3, 3, 2] if len(shown) == 1 else [3, 2, 3],
        )
        for s in signals
    ]
    return rrb.Vertical(*rows, name=group)


def _signal_plot(signal: Signal, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    band = signal.topic
    lines = [
        Line(band, derived.BAND, "fault", "fault acts", FAULT, 16.0, fault_on=signal.name),
        Line(band, derived.BAND, "low", "vote ± threshold", THRESHOLD, below=False),
        Line(band, derived.BAND, "high", "vote ± threshold", THRESHOLD, below=False),
        *_redundant(signal.topic, "rig.Signal", signal.channels),
        Line(signal.topic, "rig.Signal", "reference", "reference", REFERENCE, below=False),
        Line(signal.topic, "rig.Signal", "truth", "truth", TRUTH),
    ]
    return plot(f"{signal.name}, {signal.unit}", lines, shown)


def _deviation_plot(signal: Signal, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    lines = _redundant(signal.topic, derived.DEVIATION, signal.channels)
    name = f"{signal.name} less truth, {signal.unit}; trusted channels"
    return plot_list(name, signal.topic, derived.DEVIATION, lines, shown)  # the legend is beside it


def _redundant(path: str, archetype: str, channels: int) -> list[Line]:
    """The vote, thick and below the others, and its channels."""
    numbered = [
        Line(path, archetype, f"ch_{i + 1}", f"ch {i + 1}", CHANNEL_COLORS[i], below=False) for i in range(channels)
    ]
    return [Line(path, archetype, "voted", "voted", VOTED, 3.5), *numbered]


def _signal_lanes(signal: Signal, shown: Sequence[Shown], faults: str) -> Any:
    name = f"{signal.name}: faults, channels, pattern, resolver, source"
    return state_lanes(name, lanes.of_signal(signal), shown, faults)


def _discretes_tab(shown: Sequence[Shown]) -> rrb.Container:
    rows = []
    for discrete in DISCRETES:
        name = f"{discrete.name}: faults, channels"
        states = state_lanes(name, lanes.of_discrete(discrete), shown, faults=discrete.name)
        rows.append(rrb.Horizontal(_discrete_plot(discrete, shown), states, column_shares=[3, 2]))
    return rrb.Vertical(*rows, name="discretes")


def _discrete_plot(discrete: Discrete, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    lines = [
        *_redundant(discrete.topic, "rig.Discrete", discrete.channels),
        Line(discrete.topic, "rig.Discrete", "truth", "truth", TRUTH),
    ]
    return plot(discrete.name, lines, shown)


def _surface_plot(name: str, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    """What control asks, what reaches the actuator (another only while a fault is between), where it truly is."""
    lines = [
        Line("/control", "rig.Control", f"surface_{name}", "asked", VOTED, 3.5),
        Line("/control", "rig.Control", f"actuator_{name}", "to the actuator", PALETTE[0], 1.5),
        Line("/flight", "rig.Flight", name, "true position", TRUTH),
    ]
    plain, _, unit = name.rpartition("_")
    return plot(f"{plain}, {unit}" if plain else f"{name}, 1", lines, shown)


def _control_tab(shown: Sequence[Shown]) -> rrb.Container:
    def commands(name: str, *units: str) -> rrb.TimeSeriesView:
        names = [f"command_{field}" for field in COMMANDS if field.endswith(units)]
        return fields(name, "/control", "rig.Control", names, shown, "command_")

    def demands(name: str, *units: str) -> rrb.TimeSeriesView:
        names = [field for field in DEMANDS if field.endswith(units)]
        return fields(name, "/demand", "rig.Demand", names, shown)

    return rrb.Vertical(
        rrb.Horizontal(commands("commands, rad and rad/s", "_rad", "_rad_s"), demands("demands, rad", "_rad")),
        rrb.Horizontal(commands("commands, m and m/s", "_m", "_m_s"), demands("demands, m and m/s", "_m", "_m_s")),
        state_lanes("faults, control law", [lanes.LAW], shown, faults=""),
        row_shares=[3, 3, 1 + len(shown)],
        name="control",
    )


def _flight_tab(shown: Sequence[Shown], map_tiles: bool) -> rrb.Container:
    def flight(name: str, *names: str) -> rrb.TimeSeriesView:
        return fields(name, "/flight", "rig.Flight", names, shown)

    above = rrb.Horizontal(path(shown), track(shown), *([map_view(shown)] if map_tiles else []), attitude(shown))
    below = rrb.Horizontal(
        flight("height, m", "altitude_m", "height_m"),
        flight("speed and wind, m/s", "true_airspeed_m_s", "wind_north_m_s", "wind_east_m_s", "wind_down_m_s"),
        events(shown),
    )
    return rrb.Vertical(above, below, row_shares=[3, 2], name="flight")


def _unit_tab(shown: Sequence[Shown]) -> rrb.Container:
    """How long the unit took, how old the answers are that were flown; histograms up to the cursor."""
    clock = Line(times.PATH, times.ARCHETYPE, "reply_us", "reply time", VOTED)
    late = Line(times.PATH, times.ARCHETYPE, "late_us", "lateness", PALETTE[0])
    paced = [one for one in shown if one.facts.paced]
    bars = [histogram(times.REPLIES, shown), *([histogram(times.LATENESS, paced)] if paced else [])]
    return rrb.Vertical(
        plot("reply time and lateness, µs" if paced else "reply time, µs", [clock, *([late] if paced else [])], shown),
        fields("age of the answer that was flown, frames", "/control", "rig.Control", ["unit_age"], shown),
        rrb.Horizontal(*bars),
        name=UNIT,
    )
