"""The views of the layout: lines and strips of states against time, texts, figures, matrix, scene, histograms.

A log, a stream and a saved .rrd hold one struct per frame and entity; a component mapping selects the fields.
Mappings are not a stable API of Rerun, so this module alone uses them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import LinkAxis
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from rig.show.viewer import matrix
from rig.show.viewer.charts import Chart, label, place
from rig.show.viewer.derived import DEGREE_NAMES, DEGREES
from rig.show.viewer.facts import Shown, Span, drawn_range
from rig.show.viewer.rerun_columns import Bars
from rig.show.viewer.scene import ABOUT, HORIZON, MARGIN, NUMBERS, TIMELINE, WORLD
from rig.show.viewer.state_strips import ENDS, Strip, fault_path
from rig.show.viewer.style import ACTING, COLOR_NAMES, FAULT_STRIP, PALETTE, QUIET, Color, Looks, shade


class Line(NamedTuple):
    """A field of the struct of an entity as a line; width in points.

    below : flights below another show it too
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


class Axes(NamedTuple):
    """The axes of a plot: seconds, None: the whole flight; lowest and highest value, None: fitted."""

    time_s: Span = None
    values: Span = None


FITTED: Final = Axes()
_Series = dict[Any, list[Any]]


def plot(name: str, lines: Iterable[Line], shown: Sequence[Shown], axes: Axes = FITTED) -> rrb.TimeSeriesView:
    """Draw fields of structs against time, of every flight; the first of one entity below its others."""
    return over_time(name, line_series(lines, shown), shown, axes)


def line_series(lines: Iterable[Line], shown: Sequence[Shown]) -> _Series:
    """Return lines that are fields of structs, by their entities."""
    series: _Series = {}
    lines = list(lines)
    for flight in shown:
        for line in lines:
            if not _has(flight, line):
                continue
            look = rr.SeriesLines(
                names=flight.prefix + line.label, colors=[shade(line.color, flight.below)], widths=[line.width]
            )
            component, source = f"{line.archetype}:message", ComponentSourceKind.SourceComponent
            picked = VisualizerComponentMapping(
                "Scalars:scalars", source, source_component=component, selector=f".{line.field}"
            )
            series.setdefault(flight.root + line.path, []).append(look.visualizer(mappings=[picked]))
    return series


def list_series(names: Sequence[str], lines: Sequence[Line], shown: Sequence[Shown]) -> _Series:
    """Return lines that are numbers of one list a frame, by their entity; ``names``: of all numbers of the list.

    All lines of a flight are one part of the layout, not one part per line: the viewer opens it faster.
    """
    by_name, series = {line.field: line for line in lines}, {}
    for flight in shown:
        drawn = [by_name.get(name) for name in names]
        look = rr.SeriesLines(
            names=[flight.prefix + (line.label if line else name) for line, name in zip(drawn, names, strict=True)],
            colors=[shade(line.color if line else QUIET, flight.below) for line in drawn],
            widths=[line.width if line else 1.0 for line in drawn],
            visible_series=[line is not None and _has(flight, line) for line in drawn],
        )
        component = f"{lines[0].archetype}:values"
        values = VisualizerComponentMapping(
            "Scalars:scalars", ComponentSourceKind.SourceComponent, source_component=component
        )
        series[flight.root + lines[0].path] = [look.visualizer(mappings=[values])]
    return series


def _has(flight: Shown, line: Line) -> bool:
    return (line.below or not flight.below) and not (line.fault_on and not flight.facts.faults_on(line.fault_on))


def over_time(name: str, series: _Series, shown: Sequence[Shown], axes: Axes = FITTED) -> rrb.TimeSeriesView:
    """Build a plot without a legend, which would cover the lines: title or legend panel name the colours."""
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=list(series),
        overrides=series,
        axis_x=time_axis(shown, axes.time_s),
        axis_y=None if axes.values is None else rrb.ScalarAxis(range=axes.values),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def time_axis(shown: Sequence[Shown], span_s: Span = None) -> rrb.TimeAxis:
    """Return the axis of the part ``span_s``; None: the longest flight, or the latest seconds.

    The default axis of Rerun would show one minute around the cursor.
    """
    seen = [flight.facts.seen for flight in shown]
    if span_s is None and None in seen:
        return rrb.TimeAxis(link=LinkAxis.LinkToGlobal)
    whole = 0.0, max((each.end_s for each in seen if each is not None), default=0.0)
    first, last = (rr.TimeRangeBoundary.absolute(seconds=s) for s in span_s or whole)
    return rrb.TimeAxis(link=LinkAxis.Independent, view_range=rr.TimeRange(first, last))


def chart(content: Chart, shown: Sequence[Shown]) -> rrb.TimeSeriesView:
    """Draw numbers of one unit; the colours are named in the title."""
    lines = [
        Line(*_drawn(name), label(name, content), PALETTE[i % len(PALETTE)], 1.5 if i else 3.0)
        for i, name in enumerate(content.names)
    ]
    listed = [line for line in lines if line.archetype == DEGREES]
    series = list_series(DEGREE_NAMES, listed, shown) if listed else {}
    for path, drawn in line_series([line for line in lines if line.archetype != DEGREES], shown).items():
        series[path] = [*series.get(path, []), *drawn]
    colours = ", ".join(f"{line.label} {COLOR_NAMES[i % len(PALETTE)]}" for i, line in enumerate(lines))
    return over_time(f"{content.title}: {colours}", series, shown, Axes(values=drawn_range(shown, content.name)))


def _drawn(name: str) -> tuple[str, str, str]:
    """Return entity, archetype and field of a name of a chart."""
    if name in DEGREE_NAMES:
        return "/control", DEGREES, name
    topic, field = place(name)
    return topic, f"rig.{topic[1:].title().replace('_', '')}", field


def status_view(strips: Sequence[Strip], shown: Sequence[Shown]) -> rrb.StateTimelineView:
    """Build a strip for each signal with all its channels; with several flights, those of a signal together."""
    looks = {**ENDS, **strips[0].looks}
    return rrb.StateTimelineView(
        name="channels of each signal: blue ok, yellow suspect, red failed, dark red all",
        origin="/",
        contents=[flight.root + strip.path for strip in strips for flight in shown],
        defaults=[_configuration(looks)],
        time_view=time_axis(shown),
    )


def strips_view(
    name: str,
    strips: Sequence[Strip],
    shown: Sequence[Shown],
    faults: str | None = None,
    span_s: Span = None,
) -> Any:
    """Build strips of states, a view for each flight, side by side.

    faults : signal whose faults have strips above the others; "" for all faults, None for none
    span_s : the part of the flight that is shown, see time_axis
    """
    views = []
    for flight in shown:
        own: dict[Any, Any] = {
            flight.root + fault_path(i): _configuration({ACTING: (fault.label, FAULT_STRIP)})
            for i, fault in enumerate(flight.facts.faults)
            if faults is not None and flight.facts.thresholds and (not faults or faults in fault.places)
        }
        common, contents = dict[str, Any](ENDS), list(own)
        for strip in strips:
            contents.append(flight.root + strip.path)
            if any(common.setdefault(state, look) != look for state, look in strip.looks.items()):
                own[flight.root + strip.path] = _configuration(strip.looks)
        views.append(
            rrb.StateTimelineView(
                name=flight.prefix + name,
                origin="/",
                contents=contents,
                overrides=own,
                defaults=[_configuration(common)],
                time_view=time_axis(shown, span_s),
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
    """Build a histogram of every flight."""
    return rrb.BarChartView(name=bars.name, origin="/", contents=[flight.root + bars.path for flight in shown])


def about(shown: Sequence[Shown]) -> rrb.TextDocumentView:
    """Build the text with the flights and their outcomes."""
    return _text("flights" if len(shown) > 1 else "flight", ABOUT, titlebar=False)


def margin() -> rrb.TextDocumentView:
    """Build an empty text as wide as the axis of a plot, so that strips begin where plots begin."""
    return _text("margin", MARGIN, titlebar=False)


def numbers(flight: Shown) -> rrb.TextDocumentView:
    """Build the text of the true flight condition at the cursor."""
    return _text(f"{flight.prefix}true flight condition at the cursor", flight.root + NUMBERS)


def _text(name: str, path: str, *, titlebar: bool = True) -> rrb.TextDocumentView:
    return rrb.TextDocumentView(name=name, origin=path, contents=[path], titlebar=None if titlebar else False)


def status_now(flight: Shown) -> rrb.Spatial2DView:
    """Build the matrix of all channels at the cursor, and its legend."""
    return rrb.Spatial2DView(
        name=f"{flight.prefix}channels at the cursor",
        origin="/",
        contents=[flight.root + matrix.PATH, flight.root + matrix.NAMES],
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, matrix.WIDTH), y_range=(matrix.TOP, matrix.BOTTOM)),
    )


def legend(path: str = matrix.LEGEND) -> rrb.Spatial2DView:
    """Build the legend of the colours of lines, in a strip; ``path``: of its labels."""
    return rrb.Spatial2DView(
        name="legend",
        origin="/",
        contents=[path],
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, matrix.STRIP), y_range=(-1.0, 1.0)),
        titlebar=False,
    )


def events(shown: Sequence[Shown]) -> rrb.TextLogView:
    """Build the list of events."""
    return rrb.TextLogView(
        name="events",
        origin="/",
        contents=[f"{flight.root}/events" for flight in shown],
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"], timeline_columns=[TIMELINE]),
    )


def attitude(shown: Sequence[Shown]) -> rrb.Spatial3DView:
    """Build the figures of all flights over one compass, seen from behind, above and left of one that flies north."""
    eye = rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=(-9.0, -22.0, 11.0), look_target=(0.0, 0.0, 0.0))
    contents = [flight.root + part for flight in shown for part in ("/attitude", "/aircraft", "/horizon")]
    return _space("attitude", HORIZON, contents, eye, 10.0)


def path(shown: Sequence[Shown]) -> rrb.Spatial3DView:
    """Build the whole path in three dimensions."""
    contents = [flight.root + part for flight in shown for part in ("/pose", "/here", "/path")]
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
    """Build the path from above, north up, with the position in words: a map that needs no internet."""
    return rrb.Spatial2DView(
        name="track from above, north up, in m",
        origin="/",
        contents=[flight.root + part for flight in shown for part in ("/track", "/track/here")],
    )


def map_view(shown: Sequence[Shown]) -> rrb.MapView:
    """Build the path on a map, whose tiles the viewer fetches from OpenStreetMap."""
    contents = [flight.root + part for flight in shown for part in ("/position", "/map")]
    return rrb.MapView(name="map (tiles from OpenStreetMap)", origin="/", contents=contents)
