"""The pictures of a report of one flight: signals, votes' errors, surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import degrees
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from rig.frame import FLIGHT_INDEX, INDEX, SIGNALS, SURFACES, Block
from rig.report.moments import Moment
from rig.report.page import lay_out
from rig.units.angles import near
from rig.util.palette import CHANNELS, ORANGE, SERIES, SOFT, TRUTH, VOTE, faint, series_colour
from rig.view.series import Series, limits, series

Array = NDArray[np.float64]
Look = tuple[str, float, str]  # colour, width, dash
MOST_POINTS: Final = 2000  # of one line; of more, the smallest and largest of each stretch are drawn
_BAND, _ACTING = faint(VOTE, 0.12), faint(ORANGE, 0.16)
_DOTTED: Final = {"color": SOFT, "width": 1, "dash": "dot"}
_LEAST_SPANS: Final = {"throttle": 0.1}  # of an axis: smaller motion is not blown up
_LEAST_DEG: Final = 2.0
_MOST_THRESHOLDS: Final = 20.0  # drawn of a vote's error
_LEGEND_Y: Final = -0.2


def of_moment(rows: Block, rate_hz: float, moment: Moment, threshold: float, acts: NDArray[np.bool_]) -> go.Figure:
    """Draw a signal while it was decided, with the band in which a channel may be about the vote.

    rows : (n,) of the flight; threshold : SI; acts : (n,) whether a fault on the signal acts
    """
    cut = slice(moment.begin, moment.end)
    shown = series(rows[cut], rate_hz, moment.signal)
    figure = _signal(shown, threshold, f"{moment.signal}, the decision", band=True)
    _shade(figure, shown.time_s, acts[cut])
    _mark(figure, moment.first / rate_hz, "first", "left")
    if moment.isolated is not None:
        _mark(figure, moment.isolated / rate_hz, "failed", "right")
    return figure


def of_flight(rows: Block, rate_hz: float, name: str, threshold: float, acts: NDArray[np.bool_]) -> go.Figure:
    """Draw a signal over the whole flight; arguments as of ``of_moment``."""
    shown = series(rows, rate_hz, name)
    figure = _signal(shown, threshold, f"{name}, the whole flight", band=False)
    _shade(figure, shown.time_s, acts)
    return figure


def _signal(shown: Series, threshold: float, title: str, *, band: bool) -> go.Figure:
    figure, (low, high) = go.Figure(), limits(shown, threshold)
    if band:
        off = threshold * shown.scale
        hidden: dict[str, Any] = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
        figure.add_scatter(**_points(shown.time_s, shown.voted - off), **hidden, showlegend=False)
        filled = {"fill": "tonexty", "fillcolor": _BAND, "name": "vote ± threshold"}
        figure.add_scatter(**_points(shown.time_s, shown.voted + off), **hidden, **filled)
    for c, values in enumerate(shown.channels.T):
        if np.isfinite(values).any():
            name = f"channel {c + 1}{_off_scale(values, low, high, shown.unit)}"
            _line(figure, shown.time_s, values, name, (CHANNELS[c], 1.2, "solid"))
    _line(figure, shown.time_s, shown.voted, "vote", (VOTE, 2.2, "solid"))
    _line(figure, shown.time_s, shown.truth, "truth", (TRUTH, 1.6, "dash"))
    lay_out(figure, title, 380, _LEGEND_Y)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title=f"{shown.name}, {shown.unit}".rstrip(", "), range=[low, high])
    return figure


def _off_scale(values: Array, low: float, high: float, unit: str) -> str:
    """Return the remark of a legend on a line that leaves the picture."""
    finite = values[np.isfinite(values)]
    beyond = finite[np.argmax(np.maximum(finite - high, low - finite))]
    return f" (to {beyond:+.3g} {unit})".replace(" )", ")") if not low <= beyond <= high else ""


def _line(figure: go.Figure, time_s: Array, values: Array, name: str, look: Look, **panel: Any) -> None:
    line = dict(zip(("color", "width", "dash"), look, strict=True))
    figure.add_scatter(**_points(time_s, values), mode="lines", name=name, line=line, **panel)


def _points(time_s: Array, values: Array) -> dict[str, Any]:
    chosen = thinned(values)
    with np.errstate(over="ignore"):  # a flight that ends not finite
        return {"x": np.round(time_s[chosen], 6), "y": values[chosen].astype(np.float32)}


def thinned(values: Array) -> NDArray[np.intp]:
    """Return which of ``values`` (n,) are drawn: all, or the extremes of each of MOST_POINTS / 2 stretches."""
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), MOST_POINTS // 2 + 1).astype(np.intp)
    low, high = np.nan_to_num(values, nan=np.inf), np.nan_to_num(values, nan=-np.inf)
    return np.unique([[a + low[a:b].argmin(), a + high[a:b].argmax()] for a, b in pairwise(edges)])


def _shade(figure: go.Figure, time_s: Array, acts: NDArray[np.bool_], most: int = 200) -> None:
    """Shade the first ``most`` stretches in which a fault acts."""
    begins = np.flatnonzero(acts & ~np.concatenate([[False], acts[:-1]]))
    ends = np.flatnonzero(acts & ~np.concatenate([acts[1:], [False]]))
    shape = {"type": "rect", "yref": "paper", "y0": 0, "y1": 1, "fillcolor": _ACTING, "layer": "below", "line_width": 0}
    pairs = list(zip(begins, ends, strict=True))[:most]
    figure.update_layout(shapes=[{**shape, "x0": float(time_s[a]), "x1": float(time_s[b])} for a, b in pairs])


def _mark(figure: go.Figure, at_s: float, text: str, side: str) -> None:
    figure.add_vline(x=at_s, line=_DOTTED, annotation_text=f"{text} {at_s:.2f} s", annotation_position=f"top {side}")


def vote_errors(rows: Block, rate_hz: float, thresholds: Mapping[str, float]) -> go.Figure:
    """Draw how far the votes are from the truth, in thresholds; ``thresholds`` SI, by signal."""
    figure, time_s, peak = go.Figure(), rows["frame"] / rate_hz, 1.0
    for i, (name, threshold) in enumerate(thresholds.items()):
        error = errors(rows, name) / threshold
        peak = max(peak, float(np.nanmax(np.abs(error), initial=0.0)))
        _line(figure, time_s, error, name, (series_colour(i), 1.2, "solid"))
    for level in (-1.0, 1.0):
        figure.add_hline(y=level, line=_DOTTED)
    end = 1.15 * min(peak, _MOST_THRESHOLDS)
    lay_out(figure, "vote less truth", 340, _LEGEND_Y)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title="thresholds", range=[-end, end])
    return figure


def errors(rows: Block, name: str) -> Array:
    """Return vote less truth (n,) of a signal, SI, angles the short way round; NaN where either is no number."""
    voted, truth = rows["voted"][:, INDEX[name]], rows["truth"][:, INDEX[name]]
    with np.errstate(invalid="ignore"):
        return (near(voted, truth) if SIGNALS[INDEX[name]].wraps else voted) - truth


def surfaces(rows: Block, rate_hz: float) -> go.Figure:
    """Draw commands and positions of the surfaces, degrees, and of the throttle; no axis blows up small motion."""
    figure = make_subplots(rows=len(SURFACES), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    time_s = rows["frame"] / rate_hz
    for i, field in enumerate(SURFACES):
        name, unit = field.removesuffix("_rad"), "deg" if field.endswith("_rad") else ""
        command, actuated = rows["surface"][:, i], rows["actuator"][:, i]
        position = rows["flight"][:, FLIGHT_INDEX[field]]
        lines = [("command", command, SERIES[0], "solid"), ("position", position, TRUTH, "dash")]
        if not np.array_equal(command, actuated, equal_nan=True):  # a fault changed it
            lines.insert(1, ("at the actuator", actuated, ORANGE, "dot"))
        drawn = [values * (degrees(1.0) if unit else 1.0) for _, values, _, _ in lines]
        for values, (what, _, colour, dash) in zip(drawn, lines, strict=True):
            _line(figure, time_s, values, what, (colour, 1.2, dash), row=i + 1, col=1)
        title = f"{name}, {unit}".rstrip(", ")
        figure.update_yaxes(title=title, range=spanned(drawn, _LEAST_SPANS.get(name, _LEAST_DEG)), row=i + 1, col=1)
    traces: list[Any] = list(figure.select_traces())
    first = {trace.name: trace.yaxis for trace in reversed(traces)}
    figure.for_each_trace(lambda trace: trace.update(showlegend=trace.yaxis == first[trace.name]))
    lay_out(figure, "surfaces and throttle", 640, legend_y=-0.08)
    figure.update_xaxes(title="time, s", row=len(SURFACES), col=1)
    return figure


def spanned(lines: Sequence[Array], least: float) -> list[float]:
    """Return the ends of an axis for lines (n,): their extremes with room, ``least`` apart at least."""
    values = np.concatenate(lines)
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    middle, half = (low + high) / 2.0, max((high - low) * 0.55, least / 2.0)
    return [middle - half, middle + half]
