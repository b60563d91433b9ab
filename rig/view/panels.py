"""The views beside the plots: texts, figures, the matrix at the cursor, the scene, histograms."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from rig.view import matrix
from rig.view.facts import Shown
from rig.view.scene import ABOUT, HORIZON, MARGIN, NUMBERS, TIMELINE, WORLD
from rig.view.times import Bars


def histogram(bars: Bars, shown: Sequence[Shown]) -> rrb.BarChartView:
    """A histogram of every flight."""
    return rrb.BarChartView(name=bars.name, origin="/", contents=[one.root + bars.path for one in shown])


def about(shown: Sequence[Shown]) -> rrb.TextDocumentView:
    """Which flights these are, and how they went."""
    return rrb.TextDocumentView(
        name="flights" if len(shown) > 1 else "flight", origin=ABOUT, contents=[ABOUT], titlebar=False
    )


def margin() -> rrb.TextDocumentView:
    """Nothing, as wide as the axis of a plot: what stands right of it begins where plots do."""
    return rrb.TextDocumentView(name="margin", origin=MARGIN, contents=[MARGIN], titlebar=False)


def status_now(one: Shown) -> rrb.Spatial2DView:
    """The channels of all signals at the cursor, and the legend."""
    return rrb.Spatial2DView(
        name=f"{one.prefix}channels at the cursor",
        origin="/",
        contents=[one.root + matrix.PATH, one.root + matrix.NAMES],
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, matrix.WIDTH), y_range=(matrix.TOP, matrix.BOTTOM)),
    )


def legend() -> rrb.Spatial2DView:
    """What the colours of lines mean, in a strip."""
    return rrb.Spatial2DView(
        name="legend",
        origin="/",
        contents=[matrix.LEGEND],
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, matrix.STRIP), y_range=(-1.0, 1.0)),
        titlebar=False,
    )


def numbers(one: Shown) -> rrb.TextDocumentView:
    """The true flight condition at the cursor, in figures."""
    path = one.root + NUMBERS
    return rrb.TextDocumentView(name=f"{one.prefix}true flight condition at the cursor", origin=path, contents=[path])


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
