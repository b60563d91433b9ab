"""The picture of robustness over the flights of a search, or over its simulations of a plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.core.palette import BLUE, INK, ORANGE, RED, SOFT, faint
from rig.show.pages.page import lay_out
from rig.verdict.requirements.robustness import robustness_text

MOST: Final = 30.0  # drawn of a robustness


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """The robustness that is drawn."""

    robustness: Sequence[float]  # of each draw
    names: Sequence[str]  # of its arm
    first: int  # draws that no method chose
    first_called: str
    one: str = "flight"  # what a draw is
    of_one_draw: int = 1
    difference: bool = False  # robustness is that of two settings


def robustness_figure(of: Drawn, worst: Sequence[int]) -> go.Figure:
    """Draw the robustness of each draw; ``worst``: the draw that stands for each cluster."""
    shown = np.clip(np.array(of.robustness, float), -MOST, MOST)
    numbers = (np.arange(len(shown)) + 1) * of.of_one_draw
    made = go.Figure()
    for label, part, colour, symbol in (
        (of.first_called, slice(0, of.first), SOFT, "circle"),
        ("chosen", slice(of.first, len(shown)), BLUE, "diamond"),
    ):
        hover = f"{of.one} %{{x}}: robustness %{{customdata}}<extra>{label}</extra>"
        marks: dict[str, Any] = {
            "mode": "markers",
            "marker": {"color": faint(colour, 0.8), "size": 6, "symbol": symbol},
        }
        texts = [
            f"{robustness_text(robustness) or 'none'}<br>{name}"
            for robustness, name in zip(of.robustness[part], of.names[part], strict=True)
        ]
        made.add_scatter(x=numbers[part], y=shown[part], name=label, customdata=texts, hovertemplate=hover, **marks)
    line: dict[str, Any] = {"mode": "lines", "line": {"color": INK, "width": 2, "shape": "hv"}}
    made.add_scatter(x=numbers, y=np.minimum.accumulate(shown), name="least so far", hoverinfo="skip", **line)
    for i, place in enumerate(worst, 1):
        at: dict[str, Any] = {"x": numbers[place], "y": shown[place]}
        made.add_annotation(**at, text=f"{i}", ax=14, ay=-24, xanchor="left", arrowhead=2, arrowcolor=INK)
    least = float(shown[: of.first].min())
    below = least < 0.0
    line = {"color": ORANGE, "width": 1.5, "dash": "dash"}
    _level(made, least, f"least of the {of.first_called} {of.one}s", line, above=not below)
    zero = "no difference" if of.difference else "violated below 0"
    _level(made, 0.0, zero, {"color": RED, "width": 1}, above=below)
    lay_out(made, f"Robustness of the {of.one}s of the search", 420)
    made.update_xaxes(title=of.one)
    made.update_yaxes(title="difference of robustness" if of.difference else "robustness")
    return made


def _level(figure: go.Figure, robustness: float, text: str, line: dict[str, Any], above: bool) -> None:
    """Draw a level with its text above or below its right end."""
    figure.add_hline(y=robustness, line=line)
    place: dict[str, Any] = {"x": 1.0, "xref": "paper", "xanchor": "right", "yanchor": "bottom" if above else "top"}
    figure.add_annotation(y=robustness, text=text, showarrow=False, **place)
