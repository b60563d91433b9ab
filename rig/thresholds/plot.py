"""The trade-off as a picture: one HTML file that opens offline."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from rig.util.files import write_text

_COLOURS = ("#2166ac", "#b2182b", "#4d9221", "#8073ac")


def write(path: Path, found: dict[str, Any]) -> None:
    """Draw threshold, smallest offset and share found over the persistence, a row of panels a signal."""
    signals = {name: signal for name, signal in found["signals"].items() if signal["designs"]}
    titles = [f"{name}: {what}" for name in signals for what in ("threshold, smallest offset", "found rightly")]
    figure = make_subplots(rows=max(len(signals), 1), cols=2, subplot_titles=titles)
    for row, signal in enumerate(signals.values(), 1):
        filters = dict.fromkeys(one["filter_s"] for one in signal["designs"])
        for colour, filter_s in zip(_COLOURS * len(filters), filters, strict=False):
            _lines(figure, row, [one for one in signal["designs"] if one["filter_s"] == filter_s], colour)
    title = f"{found['budget_per_h']:g} false isolations an hour and signal, {found['hours']:.3g} h of data"
    figure.update_layout(template="plotly_white", title=title, height=320 * max(len(signals), 1) + 120)
    figure.update_xaxes(title_text="persistence, frames")
    write_text(path, figure.to_html(include_plotlyjs=True, full_html=True, div_id="thresholds"))


def _lines(figure: go.Figure, row: int, designs: list[dict[str, Any]], colour: str) -> None:
    frames = [one["persistence"] for one in designs]
    label = f"filter {designs[0]['filter_s']:g} s"
    found = [one["tradeoff"] or {} for one in designs]
    upper = [next(iter(one["levels"].values()))["upper"] for one in designs]
    offsets = [of.get("smallest_offset") for of in found]
    shares = [of.get("found_rightly") for of in found]
    drawn = (
        (1, upper, f"threshold, {label}", "solid"),
        (1, offsets, f"smallest offset, {label}", "dash"),
        (2, shares, f"share, {label}", "solid"),
    )
    for column, values, name, dash in drawn:
        line = go.Scatter(
            x=frames,
            y=values,
            name=name,
            mode="lines+markers",
            line={"color": colour, "dash": dash},
            showlegend=row == 1,
        )
        figure.add_trace(line, row=row, col=column)
