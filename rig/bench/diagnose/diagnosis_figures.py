"""Plots of a diagnosis: the channels with the vote, and the differences in thresholds; few points, whatever the log.

The points of a line are the smallest and the largest value of equal parts of time, so a page stays small.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from rig.bench.diagnose.findings import SignalDiagnosis
from rig.bench.diagnose.one_quantity import Shown
from rig.core.palette import CHANNELS, DASHES, ORANGE, RED, SOFT, VOTE, faint
from rig.log.recordings.stamps import Floats
from rig.show.pages.page import lay_out

_HEIGHT: Final = 260
_CHARACTERS: Final = 80_000  # of all points of a page; plotly's own library is nearly the rest of 5 MB
_OF_A_POINT: Final = 5.4  # a number of 4 bytes
_FEWEST, _MOST = 60, 1200


def points(lines: int) -> int:
    """Return the number of points of each line on a page with ``lines`` lines."""
    return int(np.clip(_CHARACTERS / (_OF_A_POINT * max(lines, 1)), _FEWEST, _MOST)) // 2 * 2


def extremes(time_s: Floats, values: Floats, count: int, ends: tuple[float, float]) -> NDArray[np.float32]:
    """Return (count,) the smallest and the largest value of each of count / 2 parts of the time; NaN of an empty one.

    ends : first and last time of the parts
    """
    parts = count // 2
    edges = np.searchsorted(time_s, np.linspace(*ends, parts + 1))
    edges[-1] = len(time_s)
    made = np.full(count, np.nan, np.float32)
    filled = np.flatnonzero(np.diff(edges) > 0)
    starts = edges[filled]
    if len(starts):
        low, high = (np.nan_to_num(values, nan=end) for end in (np.inf, -np.inf))
        made[2 * filled] = np.minimum.reduceat(low, starts)
        made[2 * filled + 1] = np.maximum.reduceat(high, starts)
    made[~np.isfinite(made)] = np.nan
    return made


def signal_figures(
    name: str, one: SignalDiagnosis, a: int, shown: Shown, labels: Sequence[str], count: int, zero_s: float
) -> Iterator[tuple[str, go.Figure]]:
    """Yield the two plots of signal ``name``, axis a of its quantity; ``count`` points a line.

    labels : of the channels
    """
    ends = float(shown.time_s[0]), float(shown.time_s[-1])
    unit = f", {one.unit}" if one.unit else ""
    figure = go.Figure()
    for c, column in enumerate(shown.x[a]):
        _line(figure, labels[c], extremes(shown.time_s, column / shown.scale, count, ends), ends, zero_s, c)
    if shown.voted is not None:
        voted = extremes(shown.time_s, shown.voted[a] / shown.scale, count, ends)
        _line(figure, "vote", voted, ends, zero_s, None)
    _marks(figure, one)
    lay_out(figure, f"{name}: channels and vote", _HEIGHT)
    figure.update_xaxes(title="s after the first row")
    figure.update_yaxes(title=f"{name}{unit}")
    yield f"{name}: channels", figure
    if shown.apart is None or shown.compared_s is None:
        return
    figure = go.Figure()
    for c, column in zip(shown.compared, shown.apart[a], strict=True):
        _line(figure, labels[c - 1], extremes(shown.compared_s, column, count, ends), ends, zero_s, c - 1)
    figure.add_hrect(-1, 1, fillcolor=faint(SOFT, 0.15), line_width=0, layer="below")
    _marks(figure, one)
    lay_out(figure, f"{name}: differences, in thresholds", _HEIGHT)
    figure.update_xaxes(title="s after the first row")
    figure.update_yaxes(title="thresholds")
    yield f"{name}: differences", figure


def _line(
    figure: go.Figure, name: str, values: NDArray[Any], ends: tuple[float, float], zero_s: float, c: int | None
) -> None:
    """Add a line; c : its channel, from 0; None: the vote."""
    step_s = (ends[1] - ends[0]) / len(values)
    style = {"color": VOTE, "width": 1} if c is None else {"color": CHANNELS[c], "width": 1.2, "dash": DASHES[c]}
    x = {"x0": round(ends[0] - zero_s, 6), "dx": step_s}
    figure.add_scatter(**x, y=values, mode="lines", name=name, line=style, connectgaps=False)


def _marks(figure: go.Figure, one: SignalDiagnosis) -> None:
    """Mark the beginning of the fault, and its isolation in flight."""
    if one.since_s is not None:
        figure.add_vline(one.since_s, line={"color": ORANGE, "width": 1.5, "dash": "dot"})
    if one.in_flight is not None and one.in_flight.at_s is not None:
        figure.add_vline(one.in_flight.at_s, line={"color": RED, "width": 1.5})
