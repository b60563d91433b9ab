"""The page of the sensitivity of a result of a campaign: a bar an input, with its interval and the noise floor."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import plotly.graph_objects as go

from rig.core.palette import BLUE, INK, UNUSED
from rig.show.pages.page import lay_out, write_page
from rig.studies.campaign.drivers import COLUMNS

_BAR_PX: Final = 34


def write(out: Path, found: dict[str, Any]) -> None:
    """Write the page of a ``drivers.sensitivity`` to ``out``.  BadInput or RigError: it cannot be written."""
    write_page(out, "sensitivity.html", {"indices": bars(found)}, {}, found=found, columns=COLUMNS)


def bars(found: dict[str, Any]) -> go.Figure:
    """Draw the index of each input with its interval, the largest on top; grey: not above its noise floor."""
    rows = found["inputs"][::-1]
    index = [row["index"] for row in rows]
    figure = go.Figure()
    figure.add_bar(
        y=[row["name"] for row in rows],
        x=index,
        orientation="h",
        name="index with 95 % interval",
        marker={"color": [BLUE if row["verdict"] == "yes" else UNUSED for row in rows]},
        error_x={
            "array": [max(row["high"] - row["index"], 0.0) for row in rows],
            "arrayminus": [max(row["index"] - row["low"], 0.0) for row in rows],
            "color": INK,
            "thickness": 1.5,
        },
        customdata=[
            f"{row['low']:.3f} to {row['high']:.3f}; {row['groups']} groups, {row['rows']} rows" for row in rows
        ],
        hovertemplate="%{y}: %{x:.3f} (%{customdata})<extra></extra>",
    )
    figure.add_scatter(
        y=[row["name"] for row in rows],
        x=[row["floor"] for row in rows],
        name="noise floor",
        mode="markers",
        marker={"symbol": "line-ns", "size": 20, "line": {"color": INK, "width": 2.5}},
        hovertemplate="noise floor of %{y}: %{x:.3f}<extra></extra>",
    )
    lay_out(figure, f"Sensitivity of {found['of']}", 130 + _BAR_PX * len(rows))
    figure.update_xaxes(title="PAWN index", rangemode="tozero")
    figure.update_yaxes(type="category", automargin=True)
    return figure
