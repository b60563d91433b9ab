"""The report of a benchmark: one HTML file with the verdict, the shares isolated over the size, and the delays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log10
from pathlib import Path
from typing import Any, Final

import plotly.graph_objects as go

from rig.core.palette import DASHES, series_colour
from rig.show.pages.page import lay_out, write_page
from rig.studies.campaign.statistics import proportion

_HEIGHT: Final = 340
_APART: Final = 0.011  # of the x axis, from one manager to the next
_MARKS: Final = ("circle", "square", "diamond", "triangle-up", "triangle-down", "x", "cross")
_AT_ONCE: Final = 16  # sentences of a list; the others fold away
Row = dict[str, Any]


def write(path: Path, result: dict[str, Any]) -> None:
    """Write the page of ``result``, as of run_benchmark.py: verdict, and pictures with the reference as flown."""
    budget = result["budget_per_h"]
    events = f"{budget:g} false isolation{'' if budget == 1.0 else 's'}"
    title = f"Calibrated to {events} an hour and signal on {result['hours']:.3g} h"
    entrants = list(dict.fromkeys(row["manager"] for row in result["levels"]))
    figures = dict([*_shares(result["by_size"], entrants), *_delays(result["curve"], entrants)])
    lost, others = result["losses"], result["verdict"][len(result["losses"]) :]
    about = {"title": title, "losses": lost, "verdict": others, "most": _AT_ONCE, "pictures": list(figures)}
    write_page(path, "benchmark.html", figures, {}, **about)


def _shares(rows: Sequence[Row], entrants: Sequence[str]) -> Iterator[tuple[str, go.Figure]]:
    """Yield a picture a signal, place and kind: the share isolated over the size, a line a manager."""
    for key in dict.fromkeys(map(_key, rows)):
        figure, sizes = go.Figure(), [row["size"] for row in rows if _key(row) == key]
        for name in entrants:
            mine = [row for row in rows if _key(row) == key and row["manager"] == name]
            figure.add_scatter(
                x=_apart(mine, sizes, "size", name, entrants), **_isolated(mine), **_line(name, entrants)
            )
        title = f"{', '.join(key)}: share isolated"
        lay_out(figure, title, _HEIGHT)
        _log_axis(figure, "size of the fault, thresholds", sizes)
        _share_axis(figure)
        yield title, figure


def _delays(rows: Sequence[Row], entrants: Sequence[str]) -> Iterator[tuple[str, go.Figure]]:
    """Yield two pictures a signal and place: median delay, and share isolated, over the rate."""
    budgets = [row["budget_per_h"] for row in rows]
    for key in dict.fromkeys((row["signal"], row["place"]) for row in rows):
        of = ", ".join(key)
        for what in ("median delay, s", "share isolated"):
            figure = go.Figure()
            for name in entrants:
                mine = [row for row in rows if (row["signal"], row["place"]) == key and row["manager"] == name]
                if len(mine) > 1:
                    share = what.startswith("share")
                    values = _isolated(mine) if share else {"y": [row["delay_median_s"] for row in mine]}
                    places = _apart(mine, budgets, "budget_per_h", name, entrants)
                    figure.add_scatter(x=places, **values, **_line(name, entrants))
            lay_out(figure, f"{of}: {what}", _HEIGHT)
            _log_axis(figure, "false isolations an hour", budgets)
            if what.startswith("share"):
                _share_axis(figure)
            else:
                figure.update_yaxes(title=what, rangemode="tozero")
            yield f"{of}: {what}", figure


def _isolated(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the shares isolated, in %, with their exact 95 % intervals."""
    rates = [proportion(row["isolated"], row["trials"]) for row in rows]
    low, values, high = (
        [100.0 * (share or 0.0) for share in of] for of in zip(*((r.low, r.value, r.high) for r in rates), strict=True)
    )
    above, below = ([abs(end - value) for end, value in zip(ends, values, strict=True)] for ends in (high, low))
    bars = {"type": "data", "array": above, "arrayminus": below, "thickness": 1, "width": 3}
    counts = [f"{row['isolated']} of {row['trials']}" for row in rows]
    return {"y": values, "error_y": bars, "customdata": counts, "hovertemplate": "%{customdata}"}


def _share_axis(figure: go.Figure) -> None:
    figure.update_yaxes(title="isolated, % (95 % interval)", range=[-4, 104])


def _key(row: Row) -> tuple[Any, ...]:
    return row["signal"], row["place"], row["kind"]


def _apart(rows: Sequence[Row], drawn: Sequence[float], axis: str, name: str, entrants: Sequence[str]) -> list[float]:
    """Return the places on a logarithmic axis, moved a little by manager, so that no interval hides another.

    drawn : all places on the axis
    """
    step = (max(drawn) / min(drawn)) ** _APART
    moved = step ** (list(entrants).index(name) - (len(entrants) - 1) / 2)
    return [row[axis] * moved for row in rows]


def _log_axis(figure: go.Figure, title: str, drawn: Sequence[float]) -> None:
    """Give the x axis a tick at each place that is drawn, none closer to another than a tenth of the axis."""
    places = sorted({float(x) for x in drawn})
    shown: list[float] = []
    for place in places:
        if not shown or log10(place / shown[-1]) > 0.1 * log10(places[-1] / places[0]):
            shown.append(place)
    ticks: dict[str, Any] = {
        "tickvals": shown,
        "ticktext": [f"{x:.2g}" if x < 100.0 else f"{x:.0f}" for x in shown],
        "tickangle": 0,
    }
    figure.update_xaxes(title=title, type="log", **ticks)


def _line(name: str, entrants: Sequence[str]) -> dict[str, Any]:
    """Return the look of a manager's line: no two have the same colour, dash and mark."""
    place = list(entrants).index(name)
    marker = {"symbol": _MARKS[(place + place // len(_MARKS)) % len(_MARKS)], "size": 7, "color": series_colour(place)}
    line = {"color": series_colour(place), "dash": DASHES[place % len(DASHES)]}
    return {"name": name, "mode": "lines+markers", "line": line, "marker": marker}
