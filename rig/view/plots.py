"""The kinds of views that the layout is made of: lines against time, lanes of states, the scene.

A log, a stream and a saved .rrd hold one struct a frame and entity; a component mapping picks the fields.
Mappings are not a stable API of Rerun: they are used here alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from rig.view.facts import UNKNOWN, Shown
from rig.view.lanes import Lane, fault_path
from rig.view.scene import ABOUT, HORIZON, TIMELINE, WORLD
from rig.view.style import ACTING, FAULT_LANE, PALETTE, Color, Looks, shade
from rig.view.times import Bars


class Line(NamedTuple):
    """A field of the struct of an entity as a line; width in points.

    below : whether flights that lie below another show it too
    fault_on : a signal; flights without a fault on it do not show the line
    """

    path: str
    archetype: str
    field: str
    label: str
    color: Color
    width: float = 1.0
    below: bool = True
    fault_on: str = ""


def plot(name: str, lines: Iterable[Line], shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    """Lines against time, of every flight; the first of one entity below its others."""
    series: dict[Any, list[Any]] = {}
    lines = list(lines)
    for one in shown:
        for line in lines:
            if (one.below and not line.below) or (line.fault_on and not one.facts.faults_on(line.fault_on)):
                continue
            look = rr.SeriesLines(
                names=one.prefix + line.label, colors=[shade(line.color, one.below)], widths=[line.width]
            )
            component, source = f"{line.archetype}:message", ComponentSourceKind.SourceComponent
            picked = VisualizerComponentMapping(
                "Scalars:scalars", source, source_component=component, selector=f".{line.field}"
            )
            drawn = look.visualizer(mappings=[picked])
            series.setdefault(one.root + line.path, []).append(drawn)
    return _over_time(name, series, rrb.PlotLegend(corner=rrb.Corner2D.LeftTop))


def plot_list(
    name: str, path: str, archetype: str, lines: Sequence[Line], shown: Sequence[Shown]
) -> rrb.TimeSeriesView:
    """Lines against time without a legend, of the numbers of one list a frame, in its order.

    All lines of a flight are one part of the layout, where ``plot`` has one a line: the viewer opens it sooner.
    """
    series = {}
    for one in shown:
        look = rr.SeriesLines(
            names=[one.prefix + line.label for line in lines],
            colors=[shade(line.color, one.below) for line in lines],
            widths=[line.width for line in lines],
            visible_series=[line.below or not one.below for line in lines],
        )
        values = VisualizerComponentMapping(
            "Scalars:scalars", ComponentSourceKind.SourceComponent, source_component=f"{archetype}:values"
        )
        series[one.root + path] = [look.visualizer(mappings=[values])]
    return _over_time(name, series, rrb.PlotLegend(visible=False))


def _over_time(name: str, series: dict[Any, Any], legend: rrb.PlotLegend) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(name=name, origin="/", contents=list(series), overrides=series, plot_legend=legend)


def fields(
    name: str, path: str, archetype: str, names: Sequence[str], shown: Sequence[Shown], prefix: str = ""
) -> rrb.TimeSeriesView:
    """Fields of one struct, each in the next colour of the palette, without their ``prefix``; the first is thick."""
    lines = [
        Line(path, archetype, field, field.removeprefix(prefix), PALETTE[i % len(PALETTE)], 1.5 if i else 3.0)
        for i, field in enumerate(names)
    ]
    return plot(name, lines, shown)


def state_lanes(name: str, lanes: Sequence[Lane], shown: Sequence[Shown], faults: str | None = None) -> Any:
    """Lanes of states, a view for each flight, side by side.

    faults : those on this signal have lanes above the others; "" for all faults, None for none
    """
    views = []
    for one in shown:
        own: dict[Any, Any] = {
            one.root + fault_path(i): _configuration({ACTING: (fault.label, FAULT_LANE)})
            for i, fault in enumerate(one.facts.faults)
            if faults is not None and one.facts is not UNKNOWN and faults in ("", fault.place)
        }
        common, contents = dict[str, Any](), list(own)
        for lane in lanes:
            contents.append(one.root + lane.path)
            if any(common.setdefault(state, look) != look for state, look in lane.looks.items()):
                own[one.root + lane.path] = _configuration(lane.looks)
        views.append(
            rrb.StateTimelineView(
                name=one.prefix + name,
                origin="/",
                contents=contents,
                overrides=own,
                defaults=[_configuration(common)],
            )
        )
    return views[0] if len(views) == 1 else rrb.Horizontal(*views)


def _configuration(looks: Looks) -> rr.StateConfiguration:
    return rr.StateConfiguration(
        values=list(looks),
        labels=[label for label, _ in looks.values()],
        colors=[color for _, color in looks.values()],
    )


def histogram(bars: Bars, shown: Sequence[Shown]) -> rrb.BarChartView:
    """A histogram of every flight."""
    return rrb.BarChartView(name=bars.name, origin="/", contents=[one.root + bars.path for one in shown])


def about(shown: Sequence[Shown]) -> rrb.TextDocumentView:
    """Which flights these are."""
    return rrb.TextDocumentView(name="flights" if len(shown) > 1 else "flight", origin=ABOUT, contents=[ABOUT])


def events(shown: Sequence[Shown]) -> rrb.TextLogView:
    """What happened, in words."""
    return rrb.TextLogView(
        name="events",
        origin="/",
        contents=[f"{one.root}/events" for one in shown],
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"], timeline_columns=[TIMELINE]),
    )


def attitude(shown: Sequence[Shown]) -> rrb.Spatial3DView:
    """The figures of all flights over one compass, seen from behind, above and the left of one that flies north."""
    eye = rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=(-9.0, -22.0, 11.0), look_target=(0.0, 0.0, 0.0))
    contents = [one.root + part for one in shown for part in ("/attitude", "/aircraft", "/horizon")]
    return _space("attitude", HORIZON, contents, eye, 10.0)


def path(shown: Sequence[Shown]) -> rrb.Spatial3DView:
    """The whole way flown, from afar."""
    contents = [one.root + part for one in shown for part in ("/pose", "/here", "/path")]
    return _space("path; the grid is 1 km wide", WORLD, contents, grid_m=1000.0)


def _space(
    name: str, frame: str, contents: list[str], eye: rrb.EyeControls3D | None = None, grid_m: float = 1.0
) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        name=name,
        origin="/",
        contents=contents,
        spatial_information=rrb.SpatialInformation(target_frame=frame),
        eye_controls=eye,
        line_grid=rrb.LineGrid3D(spacing=grid_m),
    )


def track(shown: Sequence[Shown]) -> rrb.Spatial2DView:
    """The way flown from above, north up, with the position in words: a map that needs no internet."""
    return rrb.Spatial2DView(
        name="track from above, north up, in m",
        origin="/",
        contents=[one.root + part for one in shown for part in ("/track", "/track/here")],
    )


def map_view(shown: Sequence[Shown]) -> rrb.MapView:
    """The way flown on a map, whose tiles the viewer fetches from OpenStreetMap."""
    contents = [one.root + part for one in shown for part in ("/position", "/map")]
    return rrb.MapView(name="map (tiles from OpenStreetMap)", origin="/", contents=contents)
