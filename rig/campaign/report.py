"""The report of a campaign: one HTML file with everything in it, for a browser without a network.

Magnitudes are shown in the unit of their signal, angles in degrees.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import plotly.graph_objects as go
import polars as pl

from rig.campaign.folder import Folder
from rig.campaign.rows import SIZES
from rig.campaign.summary import acted, summary
from rig.errors import BadInput
from rig.faults.fault import KINDS
from rig.frame import INDEX, SIGNALS
from rig.report.page import COLOURS, DASH, LAYOUT, render
from rig.units.quantities import number, unit_shown
from rig.util.files import write_text

MOST_MAPS: Final = 12  # heat maps of one report
_SCALE: Final = [[0.0, "#b2182b"], [0.5, "#fddbc7"], [0.75, "#d1e5f0"], [1.0, "#2166ac"]]  # ends apart for any eye
_NEUTRAL: Final = "#d8dde2"  # where no fault could be detected
_RATE: Final = "signal/s"  # units of settings, as the catalogue has them
_SIGNAL: Final = ("signal", _RATE)
Rows = list[dict[str, Any]]


def report(folder: Folder, out: Path) -> dict[str, Any]:
    """Write the report of a campaign to ``out``; return its figures as plain data. BadInput: nothing was flown yet."""
    if folder.tables["runs"].is_empty():
        raise BadInput(f"{folder.path}: no run is done yet, there is nothing to report")
    figures = summary(folder)
    maps = {f"map-{i}": figure for i, figure in enumerate(heat_maps(figures["by_place"]))}
    delays = {f"delay-{i}": figure for i, figure in enumerate(delay_curves(acted(folder.tables)))}
    replies = {} if figures["replies"] is None else {"replies-0": reply_times(figures["replies"])}
    filters = {"magnitude": lambda *of: magnitude_shown(*of) or DASH, "magnitude_unit": magnitude_unit}
    drawn = {**maps, **delays, **replies}
    write_text(out, render("campaign/report.html", drawn, filters, found=figures, maps=list(maps), delays=list(delays)))
    return figures


def heat_maps(rows: Rows) -> list[go.Figure]:
    """Draw detection over magnitude and flight point, a map a signal and kind; ``rows`` as summary's ``by_place``."""
    groups: dict[tuple[str, str], Rows] = {}
    for row in rows:
        groups.setdefault((row["signal"], row["kind"]), []).append(row)
    return [_heat_map(*key, part) for key, part in list(groups.items())[:MOST_MAPS]]


def _heat_map(signal: str, kind: str, rows: Rows) -> go.Figure:
    """Colour by the share of the detectable faults; grey where the error of none left the threshold."""
    places = sorted({row["place"] or "" for row in rows}, reverse=True)
    possible = [row for row in rows if row["detection"]["of"]]
    sizes = [magnitude_shown(size, signal, kind) for size in sorted({row["size"] for row in rows})]
    colorbar = {"title": "detected", "thickness": 12, "tickformat": ".0%"}
    bounds = {"zmin": 0.0, "zmax": 1.0, "xgap": 2, "ygap": 2, "texttemplate": "%{text}"}
    figure = go.Figure(go.Heatmap(**_cells(possible, signal, kind), **bounds, colorscale=_SCALE, colorbar=colorbar))
    if len(possible) < len(rows):
        never = _cells([row for row in rows if not row["detection"]["of"]], signal, kind)
        figure.add_heatmap(**never, **bounds, colorscale=[[0.0, _NEUTRAL], [1.0, _NEUTRAL]], showscale=False)
    figure.update_layout(**LAYOUT, title_text=f"{kind} of {signal}", height=150 + 34 * len(places))
    unit = magnitude_unit(signal, kind)
    order: dict[str, Any] = {"type": "category", "categoryorder": "array"}
    figure.update_xaxes(title=f"magnitude, {unit}" if unit else "magnitude", categoryarray=sizes, **order)
    figure.update_yaxes(categoryarray=places, **order)
    return figure


def _cells(rows: Rows, signal: str, kind: str) -> dict[str, Any]:
    """Return places, colours and texts of the cells of a map."""
    sizes, places = sorted({row["size"] for row in rows}), sorted({row["place"] or "" for row in rows}, reverse=True)
    cells = {(row["place"] or "", row["size"]): row for row in rows}
    grid = [[cells.get((place, size)) for size in sizes] for place in places]
    drawn = [[None if cell is None else cell["detection"]["value"] or 0.0 for cell in line] for line in grid]
    return {
        "x": [magnitude_shown(size, signal, kind) for size in sizes],
        "y": places,
        "z": drawn,
        "text": [["" if cell is None else _counted(cell) for cell in line] for line in grid],
        "customdata": [["" if cell is None else _hover_text(cell) for cell in line] for line in grid],
        "hovertemplate": f"%{{y}}<br>magnitude %{{x}} {magnitude_unit(signal, kind)}<br>%{{customdata}}<extra></extra>",
    }


def _counted(cell: dict[str, Any]) -> str:
    detection = cell["detection"]
    return f"{detection['count']}/{detection['of']:.0f}" if detection["of"] else f"({cell['acted']})"


def _hover_text(cell: dict[str, Any]) -> str:
    """Return the text of a cell that is pointed at."""
    detection = cell["detection"]
    never = cell["acted"] - int(detection["of"])
    below = f"{never} undetectable: error below the threshold" if never else ""
    if not detection["of"]:
        return below
    text = f"detected {_counted(cell)}, 95 % {detection['low']:.3f} to {detection['high']:.3f}"
    return f"{text}<br>{below}" if below else text


def delay_curves(faults: pl.DataFrame) -> list[go.Figure]:
    """Draw the share of detections that took no longer, by signal and kind, from either beginning."""
    detected = faults.filter(pl.col("outcome") == "detected")
    columns = {
        "delay_from_exceeded_s": "from leaving the threshold",
        "delay_from_onset_s": "from the onset",
    }
    return [_curves(detected, column, title) for column, title in columns.items() if len(detected)]


def _curves(detected: pl.DataFrame, column: str, title: str) -> go.Figure:
    figure = go.Figure()
    delays = [0.0, *detected[column].drop_nulls().to_list()]
    begin, end = 1.1 * min(delays), 1.1 * max(delays)  # a channel can be failed before its error leaves the threshold
    groups = detected.sort("signal", "kind").group_by(["signal", "kind"], maintain_order=True)
    for i, ((signal, kind), part) in enumerate(groups):
        counts = part[column].drop_nulls().value_counts().sort(column)
        if counts.is_empty():
            continue
        share = (counts["count"].cum_sum() / counts["count"].sum()).to_list()
        figure.add_scatter(
            x=[begin, *counts[column].to_list(), end],
            y=[0.0, *share, share[-1]],
            mode="lines",
            line={"shape": "hv", "color": COLOURS[i % len(COLOURS)], "width": 2},
            name=f"{kind} of {signal} ({len(part)})",
            hovertemplate="%{x:.2f} s: %{y:.3f}<extra>%{fullData.name}</extra>",
        )
    legend = {"orientation": "h", "yanchor": "top", "y": -0.25}
    figure.update_layout(**LAYOUT, title_text=f"Delay {title}", height=340, showlegend=True, legend=legend)
    figure.update_xaxes(title="delay, s", range=[begin, end or 1.0])  # room behind the last step
    figure.update_yaxes(title="share of detections", range=[0, 1.02])
    return figure


def reply_times(replies: dict[str, Any]) -> go.Figure:
    """Draw how many frames a unit under test answered in which time; ``replies`` as of summary."""
    share = [100.0 * count / max(replies["frames"], 1) for count in replies["counts"]]
    figure = go.Figure(
        go.Bar(
            x=replies["bins_us"],
            y=share,
            customdata=replies["counts"],
            marker={"color": COLOURS[0]},
            hovertemplate="%{x} µs: %{customdata} frames, %{y:.3g} %<extra></extra>",
        )
    )
    figure.update_layout(**LAYOUT, title_text="Reply time", height=340)
    figure.update_xaxes(title="reply time, µs", type="category")
    figure.update_yaxes(title="% of frames, logarithmic", type="log")
    return figure


def magnitude_unit(signal: str, kind: str) -> str:
    """Return the unit that magnitudes of a kind on a signal are shown in: ``deg/s``; "" where they have none."""
    unit = _setting(kind)
    if unit not in _SIGNAL:
        return unit_shown(unit)
    shown = unit_shown(_of_signal(signal))
    return f"{shown or '1'}/s" if unit == _RATE else shown


def magnitude_shown(value: float | None, signal: str, kind: str) -> str:
    """Return a magnitude, SI, in ``magnitude_unit``; "" for None."""
    return number(value, _of_signal(signal) if _setting(kind) in _SIGNAL else "")


def _of_signal(signal: str) -> str:
    return SIGNALS[INDEX[signal]].unit if signal in INDEX else ""


def _setting(kind: str) -> str:
    """Return the unit of the setting that says how large a fault of the kind is."""
    models: dict[str, Any] = dict(KINDS)
    extra = models[kind].model_fields[SIZES[kind][0]].json_schema_extra if kind in SIZES else None
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""
