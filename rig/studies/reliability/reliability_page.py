"""The page of a probability per flight hour: one HTML file, with the assumptions at its top."""

from __future__ import annotations

from collections.abc import Sequence
from math import log10
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from rig.core.palette import DASHES, SERIES, SOFT, series_colour
from rig.show.pages.page import lay_out, write_page
from rig.studies.reliability.per_hour import (
    DECIDED,
    TARGETS,
    TARGETS_EXPLAINED,
    TITLES,
    WHAT,
    Result,
    numbers,
    target_text,
)


def write_report(results: Sequence[Result], assumptions: Sequence[str], path: Path) -> None:
    """Write the page of ``results``, one at least.  BadInput or RigError: the file cannot be written."""
    pictures = _pictures(results)
    write_page(
        path,
        "reliability.html",
        pictures,
        {},
        signal=results[0].signal,
        results=results,
        alone=[each for each in results if each.case.flights_between_checks == 1],
        columns={"numbers": numbers(results), "decided": DECIDED},
        explained=TARGETS_EXPLAINED,
        assumptions=assumptions,
        pictures=list(pictures),
    )


def _pictures(results: Sequence[Result]) -> dict[str, go.Figure]:
    """Draw every picture: an outcome at one rate and share of common mode."""
    sweep = dict.fromkeys((each.case.per_hour, each.case.beta) for each in results)
    shown = [what for what in WHAT if any(what in each.estimates for each in results)]
    figures = (_picture(results, what, *pair) for pair in sweep for what in shown)
    return {f"picture-{i}": figure for i, figure in enumerate(figures)}


def _picture(results: Sequence[Result], what: str, per_hour: float, beta: float) -> go.Figure:
    """Draw the probability over the channels: a line a manager, perfect isolation dashed, the requirements across."""
    chosen = [each for each in results if (each.case.per_hour, each.case.beta) == (per_hour, beta)]
    chosen = [each for each in chosen if each.case.flights_between_checks == 1 and what in each.estimates]
    figure = go.Figure()
    for i, manager in enumerate(dict.fromkeys(each.manager for each in chosen)):
        line = {"color": series_colour(i), "dash": DASHES[i % len(DASHES)]}
        _line(figure, [each for each in chosen if each.manager == manager], what, manager, line)
    ideal = {each.case.channels: each.perfect for each in chosen}
    line = {"dash": "longdash", "color": SERIES[-1]}
    figure.add_scatter(x=list(ideal), y=list(ideal.values()), name="perfect isolation", mode="lines", line=line)
    for name, target in TARGETS.items():
        figure.add_hline(y=target, line={"dash": "dot", "color": SOFT})
        place: dict[str, Any] = {"x": 1.01, "xref": "paper", "xanchor": "left", "y": log10(target)}
        figure.add_annotation(
            text=f"{name}, {target_text(target)}", **place, showarrow=False
        )  # of a log axis: its exponent
    case = f"one channel fails {per_hour:g} times an hour, common mode {100 * beta:g} %"
    title = f'{TITLES[what]}<br><span style="font-size: 12px">{case}</span>'
    lay_out(figure, title, 450, margin={"l": 10, "r": 120, "t": 60, "b": 10})
    figure.update_xaxes(title="channels", dtick=1)
    figure.update_yaxes(title="probability per flight hour", type="log", exponentformat="e")
    return figure


def _line(figure: go.Figure, points: Sequence[Result], what: str, name: str, line: dict[str, str]) -> None:
    """Draw a manager's medians with their intervals; where there is no lower end, the upper one as a triangle."""
    points = sorted(points, key=lambda each: each.case.channels)
    values = [each.estimates[what] for each in points]
    shown = [value.high if value.low is None else value.median for value in values]
    below = [0.0 if value.low is None else value.median - value.low for value in values]
    figure.add_scatter(
        x=[each.case.channels for each in points],
        y=shown,
        error_y={"array": [value.high - y for value, y in zip(values, shown, strict=True)], "arrayminus": below},
        marker={"symbol": ["circle" if value.low is not None else "triangle-down" for value in values], "size": 10},
        line=line,
        name=name,
    )
