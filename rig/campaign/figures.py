"""The report's pictures: plotly figures as plain data."""

from __future__ import annotations

from typing import Any, Final

import plotly.graph_objects as go
import polars as pl

MOST_MAPS: Final = 12  # heat maps of one report
_SCALE: Final = [[0.0, "#b2182b"], [0.5, "#fddbc7"], [0.75, "#d1e5f0"], [1.0, "#2166ac"]]  # ends apart for any eye
_COLOURS: Final = ("#2166ac", "#b2182b", "#4d9221", "#8073ac", "#e08214", "#35978f", "#c51b7d", "#666666")
_LAYOUT: Final[dict[str, Any]] = {
    "template": "plotly_white",
    "font": {"family": "system-ui, sans-serif", "size": 13},
    "title": {"font": {"size": 15}},
    "margin": {"l": 10, "r": 10, "t": 40, "b": 10},
    "xaxis": {"automargin": True},
    "yaxis": {"automargin": True},
}
_AXES: Final = {
    "drift": "unit of the signal per second",
    "scale": "what is lost or gained, relative",
    "intermittent": "gap, s",
    "delay": "s",
    "frame_skew": "s",
    "cross_talk": "gain",
}


def heat_maps(rows: list[dict[str, Any]]) -> list[go.Figure]:
    """Detection over magnitude and flight point, a map a signal and kind; ``rows`` as summary's ``by_place``."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["signal"], row["kind"]), []).append(row)
    return [_heat_map(*key, part) for key, part in list(groups.items())[:MOST_MAPS]]


def _heat_map(signal: str, kind: str, rows: list[dict[str, Any]]) -> go.Figure:
    sizes = sorted({row["size"] for row in rows})
    places = sorted({row["place"] or "" for row in rows}, reverse=True)
    cells = {(row["place"] or "", row["size"]): row["detection_of_all"] for row in rows}
    at = [[cells.get((place, size)) for size in sizes] for place in places]
    figure = go.Figure(
        go.Heatmap(
            x=[f"{size:.4g}" for size in sizes],
            y=places,
            z=[[None if cell is None else cell["value"] for cell in line] for line in at],
            text=[["" if cell is None else f"{cell['count']}/{cell['of']:.0f}" for cell in line] for line in at],
            customdata=[[[0, 0] if c is None else [c["low"], c["high"]] for c in line] for line in at],
            texttemplate="%{text}",
            hovertemplate="%{y}<br>magnitude %{x}<br>detected %{text}, 95 % %{customdata[0]:.3f} to "
            "%{customdata[1]:.3f}<extra></extra>",
            colorscale=_SCALE,
            zmin=0.0,
            zmax=1.0,
            xgap=2,
            ygap=2,
            colorbar={"title": "detected", "thickness": 12},
        )
    )
    figure.update_layout(**_LAYOUT, title_text=f"{kind} of {signal}", height=150 + 34 * len(places))
    figure.update_xaxes(title=f"magnitude, {_AXES.get(kind, 'unit of the signal')}", type="category")
    figure.update_yaxes(type="category")
    return figure


def delay_curves(faults: pl.DataFrame) -> list[go.Figure]:
    """The share of detections that took no longer, by signal and kind, from either beginning."""
    detected = faults.filter(pl.col("outcome") == "detected")
    columns = {
        "delay_from_exceeded_s": "from leaving the threshold",
        "delay_from_onset_s": "from the onset",
    }
    return [_curves(detected, column, title) for column, title in columns.items() if len(detected)]


def _curves(detected: pl.DataFrame, column: str, title: str) -> go.Figure:
    figure = go.Figure()
    groups = detected.sort("signal", "kind").group_by(["signal", "kind"], maintain_order=True)
    for i, ((signal, kind), part) in enumerate(groups):
        counts = part[column].drop_nulls().value_counts().sort(column)
        if counts.is_empty():
            continue
        share = (counts["count"].cum_sum() / counts["count"].sum()).to_list()
        delays = counts[column].to_list()
        figure.add_scatter(
            x=[delays[0], *delays],
            y=[0.0, *share],
            mode="lines",
            line={"shape": "hv", "color": _COLOURS[i % len(_COLOURS)], "width": 2},
            name=f"{kind} of {signal} ({len(part)})",
            hovertemplate="%{x:.2f} s: %{y:.3f}<extra>%{fullData.name}</extra>",
        )
    legend = {"orientation": "h", "yanchor": "top", "y": -0.25}
    figure.update_layout(**_LAYOUT, title_text=f"Delay {title}", height=340, showlegend=True, legend=legend)
    figure.update_xaxes(title="delay, s", rangemode="tozero")
    figure.update_yaxes(title="share of detections", range=[0, 1.02])
    return figure


def reply_times(found: dict[str, Any]) -> go.Figure:
    """How many frames a unit under test answered in which time; ``found`` as summary's ``replies``."""
    share = [100.0 * count / max(found["frames"], 1) for count in found["counts"]]
    figure = go.Figure(
        go.Bar(
            x=found["bins_us"],
            y=share,
            customdata=found["counts"],
            marker={"color": _COLOURS[0]},
            hovertemplate="%{x} µs: %{customdata} frames, %{y:.3g} %<extra></extra>",
        )
    )
    figure.update_layout(**_LAYOUT, title_text="Reply time", height=340)
    figure.update_xaxes(title="reply time, µs", type="category")
    figure.update_yaxes(title="% of frames, logarithmic", type="log")
    return figure
