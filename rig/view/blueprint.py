"""The layout of the viewer, made from the tables of rig/frame.py.

One blueprint serves the live stream, a saved .rrd and our log: all three hold one struct a frame and entity,
and a component mapping picks the fields.  Mappings are not a stable API of Rerun: they are used here alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import Any, Final

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from rig.errors import BadInput
from rig.frame import COMMANDS, DEMANDS, DISCRETES, SIGNALS, SURFACES, Discrete, Law, Pattern, Resolver, Signal
from rig.view import deviation
from rig.view.columns import TIMELINE, WORLD

Color = tuple[int, int, int]
Looks = dict[str, tuple[str, Color]]  # member of an enum: label, colour
Line = tuple[str, str, Color, float]  # field of the struct, name in the legend, colour, width in points

# Okabe and Ito's palette, which people with any colour vision can tell apart, on the viewer's dark ground.
CHANNEL_COLORS: Final[tuple[Color, ...]] = ((86, 180, 233), (230, 159, 0), (0, 158, 115), (204, 121, 167))
VOTED: Final[Color] = (240, 228, 66)
TRUTH: Final[Color] = (255, 255, 255)
REFERENCE: Final[Color] = (213, 94, 0)
PALETTE: Final[tuple[Color, ...]] = (*CHANNEL_COLORS, VOTED, REFERENCE, (0, 114, 178), (170, 170, 170))
QUIET: Final[Color] = (70, 76, 82)  # a state that needs no attention
STATE_LOOKS: Final[Looks] = {
    "OK": ("ok", (0, 114, 178)),
    "SUSPECT": ("suspect", VOTED),
    "FAILED": ("failed", REFERENCE),
}
OVERVIEW: Final = "overview"  # the first tab
MAIN: Final = "pitch_rate"  # what it shows


def blueprint(signals: Sequence[str] | None = None, tab: str = OVERVIEW) -> rrb.Blueprint:
    """The layout for ``signals``, by name, None for all; it opens at ``tab``.

    The overview shows pitch rate, or else the first of the signals.  BadInput: no such signal or tab.
    """
    shown = [signal for signal in SIGNALS if signals is None or signal.name in signals]
    if not shown:
        raise BadInput(f"no signal {', '.join(signals or ())}; there are: {', '.join(s.name for s in SIGNALS)}")
    groups = dict.fromkeys(signal.group for signal in shown)
    main = next((signal for signal in shown if signal.name == MAIN), shown[0])
    tabs = {
        OVERVIEW: _overview(main),
        **{group: _group_tab(group, [s for s in shown if s.group == group]) for group in groups},
        "discretes": _discretes_tab(),
        "control": _control_tab(),
        "flight": _flight_tab(),
    }
    if tab not in tabs:
        raise BadInput(f"no tab {tab!r}; there are: {', '.join(tabs)}")
    return rrb.Blueprint(
        rrb.Tabs(*tabs.values(), active_tab=list(tabs).index(tab)),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
        auto_layout=False,
    )


def _overview(signal: Signal) -> rrb.Container:
    left = rrb.Vertical(_signal_plot(signal), _deviation_plot(signal), _signal_lanes(signal), row_shares=[5, 4, 4])
    right = rrb.Vertical(_surfaces(), _events(), _attitude(), row_shares=[2, 2, 2])
    return rrb.Horizontal(left, right, column_shares=[5, 3], name=OVERVIEW)


def _group_tab(group: str, signals: Sequence[Signal]) -> rrb.Container:
    rows = [
        rrb.Horizontal(_signal_plot(s), _deviation_plot(s), _signal_lanes(s), column_shares=[3, 3, 2]) for s in signals
    ]
    return rrb.Vertical(*rows, name=group)


def _signal_plot(signal: Signal) -> rrb.TimeSeriesView:
    lines = [
        *_redundant(signal.channels),
        ("reference", "reference", REFERENCE, 1.0),
        ("truth", "truth", TRUTH, 1.0),
    ]
    return _plot(f"{signal.name}, {signal.unit}", signal.topic, "rig.Signal", lines)


def _deviation_plot(signal: Signal) -> rrb.TimeSeriesView:
    lines = _redundant(signal.channels)
    name = f"{signal.name} less truth, {signal.unit}; trusted channels"
    return _plot(name, deviation.path(signal), deviation.ARCHETYPE, lines, legend=False)  # as beside it


def _redundant(channels: int) -> list[Line]:
    """The vote, thick and below the others, and its channels."""
    lines = [(f"ch_{i + 1}", f"ch {i + 1}", CHANNEL_COLORS[i], 1.0) for i in range(channels)]
    return [("voted", "voted", VOTED, 3.5), *lines]


def _plot(name: str, path: str, archetype: str, lines: Iterable[Line], legend: bool = True) -> rrb.TimeSeriesView:
    """Fields of one struct against time, the first below the others."""
    series = [
        rr.SeriesLines(names=label, colors=[color], widths=[width]).visualizer(
            mappings=[_pick("Scalars:scalars", archetype, field)]
        )
        for field, label, color, width in lines
    ]
    return rrb.TimeSeriesView(
        name=name,
        origin=path,
        contents=path,
        overrides={path: series},
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=legend),
    )


def _pick(slot: str, archetype: str, field: str) -> Any:
    return VisualizerComponentMapping(
        slot, ComponentSourceKind.SourceComponent, source_component=f"{archetype}:message", selector=f".{field}"
    )


def _signal_lanes(signal: Signal) -> rrb.StateTimelineView:
    lanes = [
        *_channel_lanes("rig.Signal", signal.channels),
        _lane("rig.Signal", "pattern", "pattern", _attention(Pattern, Pattern.NORMAL)),
        _lane("rig.Signal", "resolver", "resolver", _attention(Resolver, Resolver.NONE)),
    ]
    return _lanes(f"{signal.name}: channels, pattern, resolver", signal.topic, lanes)


def _lanes(name: str, path: str, lanes: Sequence[Any]) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(name=name, origin=path, contents=path, overrides={path: lanes})


def _channel_lanes(archetype: str, channels: int) -> list[Any]:
    return [_lane(archetype, f"st_{i + 1}", f"ch {i + 1}", STATE_LOOKS) for i in range(channels)]


def _lane(archetype: str, field: str, subject: str, looks: Looks) -> Any:
    """An enum of the struct as a lane.  The viewer cannot name a lane, so each state says whose it is."""
    look = rr.StateConfiguration(
        values=list(looks),
        labels=[f"{subject}: {label}" for label, _ in looks.values()],
        colors=[color for _, color in looks.values()],
    )
    return look.visualizer(mappings=[_pick("StateChange:state", archetype, f"{field}.name")])


def _attention(enum: type[IntEnum], quiet: IntEnum) -> Looks:
    """A look for each member; the one that needs no attention stays in the background."""
    return {
        member.name: (
            getattr(member, "label", member.name.lower()),
            QUIET if member == quiet else PALETTE[member.value % len(PALETTE)],
        )
        for member in enum
    }


def _discretes_tab() -> rrb.Container:
    rows = []
    for discrete in DISCRETES:
        lanes = _lanes(f"{discrete.name}: channels", discrete.topic, _channel_lanes("rig.Discrete", discrete.channels))
        rows.append(rrb.Horizontal(_discrete_plot(discrete), lanes, column_shares=[3, 2]))
    return rrb.Vertical(*rows, name="discretes")


def _discrete_plot(discrete: Discrete) -> rrb.TimeSeriesView:
    lines = [*_redundant(discrete.channels), ("truth", "truth", TRUTH, 1.0)]
    return _plot(discrete.name, discrete.topic, "rig.Discrete", lines)


def _control_tab() -> rrb.Container:
    def commands(*units: str) -> list[str]:
        return [f"command_{name}" for name in COMMANDS if name.endswith(units)]

    law = _lane("rig.Control", "law", "law", _attention(Law, Law.AUTOPILOT))
    return rrb.Grid(
        _surfaces(),
        _fields("commands, rad and rad/s", "/control", "rig.Control", commands("_rad", "_rad_s")),
        _fields("commands, m and m/s", "/control", "rig.Control", commands("_m", "_m_s")),
        _fields("demands, rad", "/demand", "rig.Demand", [name for name in DEMANDS if name.endswith("_rad")]),
        _fields("demands, m and m/s", "/demand", "rig.Demand", [n for n in DEMANDS if not n.endswith("_rad")]),
        _lanes("control law", "/control", [law]),
        grid_columns=2,
        name="control",
    )


def _flight_tab() -> rrb.Container:
    def flight(name: str, *fields: str) -> rrb.TimeSeriesView:
        return _fields(name, "/flight", "rig.Flight", fields)

    return rrb.Grid(
        _attitude(),
        flight("height, m", "altitude_m", "height_m"),
        flight("speed and wind, m/s", "true_airspeed_m_s", "wind_north_m_s", "wind_east_m_s", "wind_down_m_s"),
        flight("track, m", "north_m", "east_m"),
        flight("actuators, rad; throttle, 1", "elevator_rad", "aileron_rad", "rudder_rad", "throttle"),
        _events(),
        grid_columns=2,
        name="flight",
    )


def _events() -> rrb.TextLogView:
    shown = rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"], timeline_columns=[TIMELINE])
    return rrb.TextLogView(name="events", origin="/events", contents="/events", columns=shown)


def _surfaces() -> rrb.TimeSeriesView:
    names = [f"surface_{name}" for name in SURFACES]
    return _fields("surface commands, rad; throttle, 1", "/control", "rig.Control", names)


def _fields(name: str, path: str, archetype: str, fields: Sequence[str]) -> rrb.TimeSeriesView:
    """Fields of one struct, each in the next colour of the palette."""
    lines = [
        (field, field.removeprefix("surface_").removeprefix("command_"), PALETTE[i % len(PALETTE)], 1.5)
        for i, field in enumerate(fields)
    ]
    return _plot(name, path, archetype, lines)


def _attitude() -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        name="attitude",
        origin="/",
        contents=["/pose", "/aircraft"],
        spatial_information=rrb.SpatialInformation(target_frame=WORLD),
        eye_controls=rrb.EyeControls3D(tracking_entity="/aircraft"),
    )
