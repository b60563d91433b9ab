"""The report: one HTML file that opens without a network, the assumptions at its top.

Its pictures answer how many channels a requirement needs: probability per flight hour over channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import plotly.graph_objects as go

from rig.reliability.result import TARGETS, TITLES, WHAT, Result, decided_by, interval
from rig.report.page import COLOURS, render
from rig.util.files import write_text


def write_report(results: Sequence[Result], assumptions: Sequence[str], path: Path) -> None:
    """Write the page of ``results``, of which there is one at least.  BadInput or RigError: it cannot be written."""
    pictures = _pictures(results)
    text = render(
        "reliability/report.html",
        pictures,
        {"interval": interval, "decided_by": decided_by},
        signal=results[0].signal,
        found=results,
        titles={name: title for name, title in TITLES.items() if any(name in result.estimates for result in results)},
        targets=TARGETS,
        assumptions=assumptions,
        pictures=list(pictures),
    )
    write_text(path, text)


def _pictures(results: Sequence[Result]) -> dict[str, go.Figure]:
    """Draw every picture: an outcome at one rate and share of common mode."""
    sweep = dict.fromkeys((result.case.per_hour, result.case.beta) for result in results)
    shown = [what for what in WHAT if any(what in result.estimates for result in results)]
    figures = (picture(results, what, *pair) for pair in sweep for what in shown)
    return {f"picture-{i}": figure for i, figure in enumerate(figures)}


def picture(results: Sequence[Result], what: str, per_hour: float, beta: float) -> go.Figure:
    """Draw one figure: a line a manager at one rate, perfect isolation dashed, the requirements across."""
    chosen = [
        result
        for result in results
        if (result.case.per_hour, result.case.beta, result.case.flights_between_checks) == (per_hour, beta, 1)
        and what in result.estimates
    ]
    figure = go.Figure()
    for colour, manager in zip(COLOURS, dict.fromkeys(result.manager for result in chosen), strict=False):
        _line(figure, [result for result in chosen if result.manager == manager], what, manager, colour)
    ideal = {result.case.channels: result.perfect for result in chosen}
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
    """Draw a manager's medians with their intervals; a point without a lower end is an open triangle."""
    points = sorted(points, key=lambda result: result.case.channels)
    values = [result.estimates[what] for result in points]
    below = [value.median - (value.low if value.low is not None else value.median * 1e-3) for value in values]
    figure.add_scatter(
        x=[result.case.channels for result in points],
        y=[value.median for value in values],
        error_y={"array": [value.high - value.median for value in values], "arrayminus": below},
        marker={"symbol": ["circle" if value.low is not None else "triangle-down-open" for value in values], "size": 9},
        line={"color": colour},
        name=name,
    )
