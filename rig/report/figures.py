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

from rig.assess.patterns import SINGULAR
from rig.frame import FLIGHT_INDEX, INDEX, SIGNALS, SURFACES, Block, Pattern, State
from rig.report.moments import Limit, Moment
from rig.report.page import lay_out
from rig.units.angles import near, unwrapped
from rig.units.quantities import quantity
from rig.util.palette import (
    CHANNELS,
    DASHES,
    INK,
    MAGENTA,
    ORANGE,
    REFERENCE,
    SERIES,
    SOFT,
    TRUTH,
    VOTE,
    faint,
    series_colour,
)
from rig.util.runs import runs_where
from rig.view.series import Series, limits, series

Array = NDArray[np.float64]
Look = tuple[str, float, str]  # colour, width, dash
MOST_POINTS: Final = 2000  # of one line; of more, the smallest and largest of each stretch are drawn
_BAND, ACTING = faint(INK, 0.1), faint(ORANGE, 0.16)
_VOTE, _TRUTH, _REFERENCE = (VOTE, 3.0, "solid"), (TRUTH, 1.8, "solid"), (REFERENCE, 1.2, "solid")
DOTTED: Final = {"color": SOFT, "width": 1, "dash": "dot"}
_LEAST_SPANS: Final = {"throttle": 0.1}  # of an axis: smaller motion is not blown up
_LEAST_DEG: Final = 2.0
_MOST_THRESHOLDS: Final = 20.0  # drawn of a vote's error
_COUNTS: Final = 0.24  # of the height of a decision


def of_moment(
    rows: Block, rate_hz: float, moment: Moment, limit: Limit, acts: NDArray[np.bool_], waits: Mapping[str, int]
) -> go.Figure:
    """Draw a signal while it was decided: the band about the vote, the reference; below, the counts of frames.

    rows : (n,) of the flight; acts : (n,) whether a fault on the signal acts; waits : persistences, frames, by name
    """
    cut = slice(moment.begin, moment.end)
    shown, figure = series(rows[cut], rate_hz, moment.signal), go.Figure()
    low, high = limits(shown, limit.value)
    _band(figure, shown, limit)
    values = reference(rows[cut], moment.signal) * shown.scale
    if np.isfinite(values).any():
        name = f"reference{_off_scale(values, low, high, shown.unit)}"
        draw_line(figure, shown.time_s, values, name, _REFERENCE)
    _signal(figure, shown, (low, high), f"{moment.signal}, the decision", 480)
    _counts(figure, rows[cut], shown.time_s, INDEX[moment.signal], waits)
    _shade(figure, shown.time_s, acts[cut])
    _mark(figure, moment.first / rate_hz, "first", "left")
    if moment.isolated is not None:
        _mark(figure, moment.isolated / rate_hz, "failed", "right")
    return figure


def of_flight(rows: Block, rate_hz: float, name: str, threshold: float, acts: NDArray[np.bool_]) -> go.Figure:
    """Draw a signal over the whole flight; threshold : SI; other arguments as of ``of_moment``."""
    shown, figure = series(rows, rate_hz, name), go.Figure()
    _signal(figure, shown, limits(shown, threshold), f"{name}, the whole flight", 340)
    _shade(figure, shown.time_s, acts)
    return figure


def reference(rows: Block, name: str) -> Array:
    """Return the reference (n,) of a signal, SI, angles near the truth without its jumps; NaN where there is none."""
    s = INDEX[name]
    values = rows["reference"][:, s]
    return near(values, unwrapped(rows["truth"][:, s])) if SIGNALS[s].wraps else values


def _band(figure: go.Figure, shown: Series, limit: Limit) -> None:
    off = limit.value * shown.scale
    hidden: dict[str, Any] = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
    figure.add_scatter(**_points(shown.time_s, shown.voted - off), **hidden, showlegend=False)
    filled = {"fill": "tonexty", "fillcolor": _BAND, "name": f"vote ± {limit.text}"}
    figure.add_scatter(**_points(shown.time_s, shown.voted + off), **hidden, **filled)


def _signal(figure: go.Figure, shown: Series, ends: tuple[float, float], title: str, height: int) -> None:
    draw_line(figure, shown.time_s, shown.voted, "vote", _VOTE)
    draw_line(figure, shown.time_s, shown.truth, "truth", _TRUTH)
    for c, values in enumerate(shown.channels.T):
        if np.isfinite(values).any():
            name = f"channel {c + 1}{_off_scale(values, *ends, shown.unit)}"
            draw_line(figure, shown.time_s, values, name, (CHANNELS[c], 1.5, DASHES[c]))
    lay_out(figure, title, height)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title=f"{shown.name}, {shown.unit}".rstrip(", "), range=list(ends))


def _counts(figure: go.Figure, rows: Block, time_s: Array, s: int, waits: Mapping[str, int]) -> None:
    """Draw, below, for how many frames in a row a pattern without a majority or a suspect channel has lasted."""
    singular = np.isin(rows["pattern"][:, s], SINGULAR)
    patterns = np.where(singular, rows["pattern"][:, s], Pattern.NORMAL)
    found = {Pattern(int(p)).label: (patterns == p, (INK, 1.8, "solid")) for p in np.unique(patterns[singular])}
    for c, states in enumerate(rows["state"][:, s, : SIGNALS[s].channels].T):
        failed = states == State.FAILED
        suspect = ((states == State.SUSPECT) | (failed & ~np.roll(failed, 1))) & ~singular
        if suspect.any():
            found[f"channel {c + 1} suspect"] = suspect, (CHANNELS[c], 1.8, DASHES[c])
    most = 1.0
    for name, (mask, look) in found.items():
        lasted = in_a_row(mask)
        most = max(most, float(lasted.max()))
        draw_line(figure, time_s, lasted, f"frames, {name}", look, yaxis="y2", line_shape="hv")
    for side, (name, frames) in zip(("left", "right"), waits.items(), strict=False):
        anchor = "top" if frames < max(waits.values()) else "bottom"  # away from the other line
        figure.add_shape(type="line", xref="paper", x0=0, x1=1, yref="y2", y0=frames, y1=frames, line=DOTTED)
        place: dict[str, Any] = {"xref": "paper", "xanchor": side, "x": float(side == "right"), "yref": "y2"}
        figure.add_annotation(text=f"{name} {frames}", **place, y=frames, yanchor=anchor, showarrow=False)
    end = 1.45 * max(most if most < 100.0 else 0.0, *waits.values(), 2)
    below = {
        "domain": [0.0, _COUNTS - 0.05],
        "anchor": "x",
        "title": "frames",
        "range": [0.0, end],
        "automargin": True,
        "nticks": 4,
    }
    figure.update_layout(yaxis={"domain": [_COUNTS, 1.0]}, yaxis2=below, xaxis={"anchor": "y2"})


def in_a_row(mask: NDArray[np.bool_]) -> Array:
    """Return (n,) for how many rows ``mask`` (n,) has held up to each, that one included; 0 where it does not."""
    rows = np.arange(len(mask))
    return (rows - np.maximum.accumulate(np.where(mask, -1, rows))).astype(float)


def _off_scale(values: Array, low: float, high: float, unit: str) -> str:
    """Return the remark of a legend on a line that leaves the picture."""
    finite = values[np.isfinite(values)]
    beyond = finite[np.argmax(np.maximum(finite - high, low - finite))]
    return f" (to {beyond:+.3g} {unit})".replace(" )", ")") if not low <= beyond <= high else ""


def draw_line(figure: go.Figure, time_s: Array, values: Array, name: str, look: Look, **panel: Any) -> None:
    """Draw ``values`` (n,) over ``time_s`` (n,) as one line, thinned; ``panel``: of the figure."""
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
    shape = {"type": "rect", "yref": "y domain", "y0": 0, "y1": 1, "fillcolor": ACTING, "line_width": 0}
    for a, b in runs_where(acts)[:most]:
        figure.add_shape(**shape, layer="below", x0=float(time_s[a]), x1=float(time_s[b - 1]))


def _mark(figure: go.Figure, at_s: float, text: str, side: str) -> None:
    figure.add_vline(x=at_s, line=DOTTED, annotation_text=f"{text} {at_s:.2f} s", annotation_position=f"top {side}")


def vote_errors(rows: Block, rate_hz: float, thresholds: Mapping[str, float]) -> go.Figure:
    """Draw how far the votes are from the truth, in thresholds; ``thresholds`` SI, by signal."""
    figure, time_s, peak = go.Figure(), rows["frame"] / rate_hz, 1.0
    for i, (name, threshold) in enumerate(thresholds.items()):
        error = errors(rows, name) / threshold
        peak = max(peak, float(np.nanmax(np.abs(error), initial=0.0)))
        label = f"{name}, threshold {quantity(threshold, SIGNALS[INDEX[name]].unit)}"
        draw_line(figure, time_s, error, label, (series_colour(i), 1.2, "solid"))
    for level in (-1.0, 1.0):
        figure.add_hline(y=level, line=DOTTED)
    end = 1.15 * min(peak, _MOST_THRESHOLDS)
    lay_out(figure, "vote less truth", 300)
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
        lines = [("command", command, SERIES[0], "solid"), ("position", position, INK, "dash")]
        if not np.array_equal(command, actuated, equal_nan=True):  # a fault changed it
            lines.insert(1, ("at the actuator", actuated, MAGENTA, "dot"))
        drawn = [values * (degrees(1.0) if unit else 1.0) for _, values, _, _ in lines]
        for values, (what, _, colour, dash) in zip(drawn, lines, strict=True):
            draw_line(figure, time_s, values, what, (colour, 1.2, dash), row=i + 1, col=1)
        title = f"{name}, {unit}".rstrip(", ")
        figure.update_yaxes(title=title, range=spanned(drawn, _LEAST_SPANS.get(name, _LEAST_DEG)), row=i + 1, col=1)
    lay_out(figure, "surfaces and throttle", 600)
    figure.update_xaxes(title="time, s", row=len(SURFACES), col=1)
    return figure


def spanned(lines: Sequence[Array], least: float) -> list[float]:
    """Return the ends of an axis for lines (n,): their extremes with room, ``least`` apart at least."""
    values = np.concatenate(lines)
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    middle, half = (low + high) / 2.0, max((high - low) * 0.55, least / 2.0)
    return [middle - half, middle + half]
