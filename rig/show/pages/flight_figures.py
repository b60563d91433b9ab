"""The pictures of a report of one flight: signals, votes' errors, surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from rig.core.frame import INDEX, SIGNALS, SURFACES, Block, Pattern, State
from rig.core.palette import (
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
from rig.core.runs import runs_where
from rig.core.units.angles import near, unwrapped
from rig.core.units.quantities import quantity, unit_shown
from rig.show.pages.course import Limit, Moment
from rig.show.pages.lines import Array, Line, SignalLines, SurfaceLines, line, signal_lines
from rig.show.pages.page import lay_out
from rig.show.viewer.series import Series, limits, series
from rig.verdict.patterns import SPLITS

Look = tuple[str, float, str]  # colour, width, dash
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

    rows : (n,) of the moment; acts : (n,) whether a fault on the signal acts; waits : persistences, frames, by name
    """
    shown, figure = series(rows, rate_hz, moment.signal), go.Figure()
    low, high = limits(shown, limit.value)
    _band(figure, shown, limit)
    values = line(shown.time_s, reference(rows, moment.signal) * shown.scale)
    if values.drawn:
        _draw(figure, values, f"reference{_off_scale(values, low, high, shown.unit)}", _REFERENCE)
    _signal(figure, signal_lines(shown, (low, high)), moment.signal, f"{moment.signal}, the decision", 480)
    _counts(figure, rows, shown.time_s, INDEX[moment.signal], waits)
    _shade(figure, runs_where(acts) + moment.begin, rate_hz)
    _mark(figure, moment.first / rate_hz, "first", "left")
    if moment.isolated is not None:
        _mark(figure, moment.isolated / rate_hz, "failed", "right")
    return figure


def of_flight(shown: SignalLines, rate_hz: float, name: str, acts: NDArray[np.bool_]) -> go.Figure:
    """Draw a signal over the whole flight; acts : (n,) whether a fault on it acts."""
    figure = go.Figure()
    _signal(figure, shown, name, f"{name}, the whole flight", 340)
    _shade(figure, runs_where(acts), rate_hz)
    return figure


def reference(rows: Block, name: str) -> Array:
    """Return the reference (n,) of a signal, SI, angles near the truth without its jumps; NaN where there is none."""
    s = INDEX[name]
    values = rows["reference"][:, s]
    return near(values, unwrapped(rows["truth"][:, s])) if SIGNALS[s].wraps else values


def _band(figure: go.Figure, shown: Series, limit: Limit) -> None:
    off = limit.value * shown.scale
    hidden: dict[str, Any] = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
    figure.add_scatter(**_points(line(shown.time_s, shown.voted - off)), **hidden, showlegend=False)
    filled = {"fill": "tonexty", "fillcolor": _BAND, "name": f"vote ± {limit.text}"}
    figure.add_scatter(**_points(line(shown.time_s, shown.voted + off)), **hidden, **filled)


def _signal(figure: go.Figure, shown: SignalLines, name: str, title: str, height: int) -> None:
    _draw(figure, shown.voted, "vote", _VOTE)
    _draw(figure, shown.truth, "truth", _TRUTH)
    unit = unit_shown(SIGNALS[INDEX[name]].unit)
    for c, values in enumerate(shown.channels):
        if values.drawn:
            label = f"channel {c + 1}{_off_scale(values, *shown.ends, unit)}"
            _draw(figure, values, label, (CHANNELS[c], 1.5, DASHES[c]))
    lay_out(figure, title, height)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title=f"{name}, {unit}".rstrip(", "), range=list(shown.ends))


def _counts(figure: go.Figure, rows: Block, time_s: Array, s: int, waits: Mapping[str, int]) -> None:
    """Draw, below, for how many frames in a row a split or a suspect channel has lasted."""
    in_split = np.isin(rows["pattern"][:, s], SPLITS)
    patterns = np.where(in_split, rows["pattern"][:, s], Pattern.NORMAL)
    found = {Pattern(int(p)).label: (patterns == p, (INK, 1.8, "solid")) for p in np.unique(patterns[in_split])}
    for c, states in enumerate(rows["state"][:, s, : SIGNALS[s].channels].T):
        failed = states == State.FAILED
        suspect = ((states == State.SUSPECT) | (failed & ~np.roll(failed, 1))) & ~in_split
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


def _off_scale(values: Line, low: float, high: float, unit: str) -> str:
    """Return the remark of a legend on a line that leaves the picture."""
    beyond = values.most if values.most - high >= low - values.least else values.least
    return f" (to {beyond:+.3g} {unit})".replace(" )", ")") if not low <= beyond <= high else ""


def draw_line(figure: go.Figure, time_s: Array, values: Array, name: str, look: Look, **panel: Any) -> None:
    """Draw ``values`` (n,) over ``time_s`` (n,) as one line, thinned; ``panel``: of the figure."""
    _draw(figure, line(time_s, values), name, look, **panel)


def _draw(figure: go.Figure, drawn: Line, name: str, look: Look, **panel: Any) -> None:
    style = dict(zip(("color", "width", "dash"), look, strict=True))
    figure.add_scatter(**_points(drawn), mode="lines", name=name, line=style, **panel)


def _points(drawn: Line) -> dict[str, Any]:
    with np.errstate(over="ignore"):  # a flight that ends not finite
        return {"x": np.round(drawn.time_s, 6), "y": drawn.values.astype(np.float32)}


def _shade(figure: go.Figure, stretches: NDArray[np.intp], rate_hz: float, most: int = 200) -> None:
    """Shade the first ``most`` stretches (n, 2) of frames in which a fault acts."""
    shape = {"type": "rect", "yref": "y domain", "y0": 0, "y1": 1, "fillcolor": ACTING, "line_width": 0}
    for a, b in stretches[:most].tolist():
        figure.add_shape(**shape, layer="below", x0=a / rate_hz, x1=(b - 1) / rate_hz)


def _mark(figure: go.Figure, at_s: float, text: str, side: str) -> None:
    figure.add_vline(x=at_s, line=DOTTED, annotation_text=f"{text} {at_s:.2f} s", annotation_position=f"top {side}")


def mark_panels(figure: go.Figure, time_s: Array, acts: NDArray[np.bool_], failed_s: Iterable[float]) -> None:
    """Shade, in all panels, the time in which a fault acts (n,), and mark each failure."""
    every: dict[str, Any] = {"row": "all", "col": 1}
    for a, b in runs_where(acts):
        figure.add_vrect(float(time_s[a]), float(time_s[b - 1]), fillcolor=ACTING, line_width=0, layer="below", **every)
    for at_s in failed_s:
        figure.add_vline(x=at_s, line=DOTTED, **every)


def vote_errors(found: Mapping[str, Line], thresholds: Mapping[str, float]) -> go.Figure:
    """Draw how far the votes are from the truth, in thresholds; ``thresholds`` SI, by signal."""
    figure, peak = go.Figure(), 1.0
    for i, (name, error) in enumerate(found.items()):
        peak = max(peak, float(np.nanmax(np.abs(error.values), initial=0.0)))
        label = f"{name}, threshold {quantity(thresholds[name], SIGNALS[INDEX[name]].unit)}"
        _draw(figure, error, label, (series_colour(i), 1.2, "solid"))
    for level in (-1.0, 1.0):
        figure.add_hline(y=level, line=DOTTED)
    end = 1.15 * min(peak, _MOST_THRESHOLDS)
    lay_out(figure, "vote less truth", 300)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(title="thresholds", range=[-end, end])
    return figure


def surfaces(found: Sequence[SurfaceLines]) -> go.Figure:
    """Draw commands and positions of the surfaces, degrees, and of the throttle; no axis blows up small motion."""
    figure = make_subplots(rows=len(SURFACES), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for i, (field, surface) in enumerate(zip(SURFACES, found, strict=True)):
        name, unit = field.removesuffix("_rad"), "deg" if field.endswith("_rad") else ""
        lines = [("command", surface.command, SERIES[0], "solid"), ("position", surface.position, INK, "dash")]
        if surface.changed:
            lines.insert(1, ("at the actuator", surface.actuated, MAGENTA, "dot"))
        for what, drawn, colour, dash in lines:
            _draw(figure, drawn, what, (colour, 1.2, dash), row=i + 1, col=1)
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
