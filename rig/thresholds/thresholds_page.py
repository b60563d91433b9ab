"""The report of a design of thresholds: one HTML file that opens without a network, a row of panels a signal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from rig.report.page import lay_out, write_page
from rig.util.palette import series_colour


def write(path: Path, summary: dict[str, Any]) -> None:
    """Write threshold, smallest offset and share isolated over the persistence; ``summary`` as of report.summary."""
    title = f"{summary['budget_per_h']:g} false isolations an hour and signal, {summary['hours']:.3g} h of data"
    about = {"title": title, "rule": summary["rule"], "notes": summary["notes"]}
    write_page(path, "thresholds.html", {"thresholds": _picture(summary)}, {}, **about)


def _picture(summary: dict[str, Any]) -> go.Figure:
    """Draw two panels a signal: threshold and smallest offset, and the share of faults isolated."""
    signals = {name: signal for name, signal in summary["signals"].items() if signal["designs"]}
    titles = [f"{name}: {what}" for name in signals for what in ("threshold, smallest offset", "found rightly")]
    figure = make_subplots(rows=max(len(signals), 1), cols=2, subplot_titles=titles)
    for row, signal in enumerate(signals.values(), 1):
        for i, filter_s in enumerate(dict.fromkeys(design["filter_s"] for design in signal["designs"])):
            designs = [design for design in signal["designs"] if design["filter_s"] == filter_s]
            _lines(figure, row, designs, series_colour(i))
    lay_out(figure, "", 320 * max(len(signals), 1) + 120)
    figure.update_xaxes(title_text="persistence, frames")
    return figure


def _lines(figure: go.Figure, row: int, designs: list[dict[str, Any]], colour: str) -> None:
    label, tradeoffs = f"filter {designs[0]['filter_s']:g} s", [design["tradeoff"] or {} for design in designs]
    upper = [next(iter(design["levels"].values()))["upper"] for design in designs]
    lines = (
        (1, upper, f"threshold, {label}", "solid"),
        (1, [tradeoff.get("smallest_offset") for tradeoff in tradeoffs], f"smallest offset, {label}", "dash"),
        (2, [tradeoff.get("found_rightly") for tradeoff in tradeoffs], f"share, {label}", "solid"),
    )
    for column, values, name, dash in lines:
        line = {"color": colour, "dash": dash}
        frames = [design["persistence"] for design in designs]
        shared = {"mode": "lines+markers", "showlegend": row == 1, "row": row, "col": column}
        figure.add_scatter(x=frames, y=values, name=name, line=line, **shared)
