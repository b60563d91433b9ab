"""The picture that answers how many channels a requirement needs: probability per flight hour over channels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import plotly.graph_objects as go

from rig.reliability.result import TARGETS, Result
from rig.reliability.words import TITLES

COLOURS: Final = ("#2166ac", "#b2182b", "#4d9221", "#8073ac", "#e08214", "#35978f", "#c51b7d", "#666666")


def picture(found: Sequence[Result], what: str, per_hour: float, beta: float) -> go.Figure:
    """Draw one figure: a line a manager at one rate, perfect isolation dashed, the requirements across."""
    chosen = [one for one in found if (one.case.per_hour, one.case.beta) == (per_hour, beta)]
    chosen = [one for one in chosen if one.case.flights_between_checks == 1 and what in one.estimates]
    figure = go.Figure()
    for colour, manager in zip(COLOURS, dict.fromkeys(one.manager for one in chosen), strict=False):
        _line(figure, [one for one in chosen if one.manager == manager], what, manager, colour)
    ideal = {one.case.channels: one.perfect for one in chosen}
    line = {"dash": "dash", "color": "#444444"}
    figure.add_scatter(x=list(ideal), y=list(ideal.values()), name="perfect isolation", mode="lines", line=line)
    for name, target in TARGETS.items():
        figure.add_hline(y=target, line={"dash": "dot", "color": "#999999"}, annotation_text=f"{name}, {target:g}")
    figure.update_layout(
        template="plotly_white",
        title=f"{TITLES[what]}: one channel fails {per_hour:g} times an hour, common mode {100 * beta:g} %",
        xaxis={"title": "channels", "dtick": 1},
        yaxis={"title": "probability per flight hour", "type": "log", "exponentformat": "power"},
    )
    return figure


def _line(figure: go.Figure, points: Sequence[Result], what: str, name: str, colour: str) -> None:
    """Return a manager's medians with their intervals; a point without a lower end is an open triangle."""
    points = sorted(points, key=lambda one: one.case.channels)
    values = [one.estimates[what] for one in points]
    below = [value.median - (value.low if value.low is not None else value.median * 1e-3) for value in values]
    figure.add_scatter(
        x=[one.case.channels for one in points],
        y=[value.median for value in values],
        error_y={"array": [value.high - value.median for value in values], "arrayminus": below},
        marker={"symbol": ["circle" if value.low is not None else "triangle-down-open" for value in values], "size": 9},
        line={"color": colour},
        name=name,
    )
