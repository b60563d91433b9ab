"""The pictures of a report of one flight: signals, errors of the voted values, surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from rig.core.frame import INDEX, SIGNALS, SURFACES, Block
from rig.core.palette import (
    CHANNELS,
    DASHES,
    INK,
    MAGENTA,
    ORANGE,
    SERIES,
    SOFT,
    TRUTH,
    VOTE,
    faint,
    series_colour,
)
from rig.core.runs import runs_where
from rig.core.units.angles import near, unwrapped
from rig.core.units.quantities import quantity, unit_shown
from rig.show.pages.lines import Array, Line, SignalLines, SurfaceLines, line
from rig.show.pages.page import lay_out

Look = tuple[str, float, str]  # colour, width, dash
ACTING: Final = faint(ORANGE, 0.16)
_VOTE, _TRUTH = (VOTE, 3.0, "solid"), (TRUTH, 1.8, "solid")
DOTTED: Final = {"color": SOFT, "width": 1, "dash": "dot"}
_LEAST_SPANS: Final = {"throttle": 0.1}  # of an axis: smaller motion is not blown up
_LEAST_DEG: Final = 2.0
_MOST_THRESHOLDS: Final = 20.0  # of the axis of the errors of voted values


def of_flight(shown: SignalLines, rate_hz: float, name: str, acts: NDArray[np.bool_]) -> go.Figure:
    """Draw a signal over the whole flight; acts : (n,) a fault on it acts."""
    figure = go.Figure()
    _signal(figure, shown, name, f"{name}, the whole flight", 340)
    shade(figure, runs_where(acts), rate_hz)
    return figure


def reference(rows: Block, name: str) -> Array:
    """Return the reference (n,) of a signal, SI, angles unwrapped near the true value; NaN: no reference."""
    s = INDEX[name]
    values = rows["reference"][:, s]
    return near(values, unwrapped(rows["truth"][:, s])) if SIGNALS[s].wraps else values


def _signal(figure: go.Figure, shown: SignalLines, name: str, title: str, height: int) -> None:
    draw(figure, shown.voted, "voted value", _VOTE)
    draw(figure, shown.truth, "true value", _TRUTH)
    unit = unit_shown(SIGNALS[INDEX[name]].unit)
    for c, values in enumerate(shown.channels):
        if values.drawn:
            label = f"channel {c + 1}{_off_scale(values, *shown.ends, unit)}"
            draw(figure, values, label, (CHANNELS[c], 1.5, DASHES[c]))
    lay_out(figure, title, height)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title=f"{name}, {unit}".rstrip(", "), range=list(shown.ends))


def _off_scale(values: Line, low: float, high: float, unit: str) -> str:
    """Return the peak of a line that leaves the picture, for the legend."""
    beyond = values.most if values.most - high >= low - values.least else values.least
    return f" (to {beyond:+.3g} {unit})".replace(" )", ")") if not low <= beyond <= high else ""


def draw_line(figure: go.Figure, time_s: Array, values: Array, name: str, look: Look, **panel: Any) -> None:
    """Draw ``values`` (n,) over ``time_s`` (n,) as one line, thinned; ``panel``: of the figure."""
    draw(figure, line(time_s, values), name, look, **panel)


def draw(figure: go.Figure, drawn: Line, name: str, look: Look, **panel: Any) -> None:
    """Draw a line that is thinned already."""
    style = dict(zip(("color", "width", "dash"), look, strict=True))
    figure.add_scatter(**_points(drawn), mode="lines", name=name, line=style, **panel)


def _points(drawn: Line) -> dict[str, Any]:
    with np.errstate(over="ignore"):  # a flight that ends not finite
        return {"x": np.round(drawn.time_s, 6), "y": drawn.values.astype(np.float32)}


def shade(figure: go.Figure, stretches: NDArray[np.intp], rate_hz: float, most: int = 200) -> None:
    """Shade the first ``most`` stretches (n, 2) of frames in which a fault acts."""
    shape = {"type": "rect", "yref": "y domain", "y0": 0, "y1": 1, "fillcolor": ACTING, "line_width": 0}
    for a, b in stretches[:most].tolist():
        figure.add_shape(**shape, layer="below", x0=a / rate_hz, x1=(b - 1) / rate_hz)


def mark_panels(figure: go.Figure, time_s: Array, acts: NDArray[np.bool_], failed_s: Iterable[float]) -> None:
    """Shade, in all panels, the time in which a fault acts (n,), and mark each failure."""
    every: dict[str, Any] = {"row": "all", "col": 1}
    for a, b in runs_where(acts):
        figure.add_vrect(float(time_s[a]), float(time_s[b - 1]), fillcolor=ACTING, line_width=0, layer="below", **every)
    for at_s in failed_s:
        figure.add_vline(x=at_s, line=DOTTED, **every)


def vote_errors(found: Mapping[str, Line], thresholds: Mapping[str, float]) -> go.Figure:
    """Draw voted minus true values, in error limits; ``thresholds`` SI, by signal."""
    figure, peak = go.Figure(), 1.0
    for i, (name, error) in enumerate(found.items()):
        peak = max(peak, float(np.nanmax(np.abs(error.values), initial=0.0)))
        label = f"{name}, error limit {quantity(thresholds[name], SIGNALS[INDEX[name]].unit)}"
        draw(figure, error, label, (series_colour(i), 1.2, "solid"))
    for level in (-1.0, 1.0):
        figure.add_hline(y=level, line=DOTTED)
    end = 1.15 * min(peak, _MOST_THRESHOLDS)
    lay_out(figure, "voted minus true value", 300)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title="error limits", range=[-end, end])
    return figure


def surfaces(found: Sequence[SurfaceLines]) -> go.Figure:
    """Draw commands and positions of the surfaces, degrees, and of the throttle; axes have a least span."""
    figure = make_subplots(rows=len(SURFACES), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for i, (field, surface) in enumerate(zip(SURFACES, found, strict=True)):
        name, unit = field.removesuffix("_rad"), "deg" if field.endswith("_rad") else ""
        lines = [("command", surface.command, SERIES[0], "solid"), ("position", surface.position, INK, "dash")]
        if surface.changed:
            lines.insert(1, ("command at the actuator", surface.actuated, MAGENTA, "dot"))
        for what, drawn, colour, dash in lines:
            draw(figure, drawn, what, (colour, 1.2, dash), row=i + 1, col=1)
        ends = spanned([drawn for _, drawn, _, _ in lines], _LEAST_SPANS.get(name, _LEAST_DEG))
        figure.update_yaxes(title=f"{name}, {unit}".rstrip(", "), range=ends, row=i + 1, col=1)
    lay_out(figure, "surfaces and throttle", 600)
    figure.update_xaxes(title="time, s", row=len(SURFACES), col=1)
    return figure


def spanned(lines: Sequence[Line], least: float) -> list[float]:
    """Return the ends of an axis for lines: their extremes with room, ``least`` apart at least."""
    low, high = min(drawn.least for drawn in lines), max(drawn.most for drawn in lines)
    low, high = (low, high) if low <= high else (0.0, 0.0)
    middle, half = (low + high) / 2.0, max((high - low) * 0.55, least / 2.0)
    return [middle - half, middle + half]
