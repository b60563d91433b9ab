"""``rig.vote(...).plot()``: channels, vote and differences in thresholds, by matplotlib, imported at first use.

A long recording is drawn by the smallest and largest value of each part.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from rig.core.palette import CHANNELS, DASHES, LINE, RED, VOTE
from rig.show.notebook.log_shown import STYLES
from rig.show.pages.lines import Array, deviation_axis, line, thinned
from rig.show.votes.shown_signal import SINCE, ShownSignal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH: Final = 11.0  # inches
_ALONE, _AMONG = 5.2, 2.5  # height of one signal, and of each of several
_MARK: Final[dict[str, Any]] = {"color": RED, "linewidth": 1.2, "linestyle": (0, (4, 3))}


def figure_of(shown: Sequence[ShownSignal]) -> Figure:
    """Return a figure of signals: channels and vote, beside or below it each channel minus the vote.

    One signal has both panels below each other, several have a row each.  A dashed red line marks an isolation.
    """
    import matplotlib.pyplot as plt  # noqa: F401 # makes notebooks draw figures
    from matplotlib.figure import Figure

    one = len(shown) == 1
    figure = Figure(figsize=(_WIDTH, _ALONE if one else _AMONG * len(shown)), layout="constrained")
    grid = figure.subplots(*((2, 1) if one else (len(shown), 2)), sharex=True, squeeze=False)
    for signal, (values, differences) in zip(shown, grid.reshape(-1, 2), strict=True):
        _values(values, signal)
        _differences(differences, signal)
        for mark in signal.isolations:
            values.axvline(mark.time_s, **_MARK)
            differences.axvline(mark.time_s, **_MARK)
            _named(values, f" channel {mark.channel} isolated at {mark.time_s:.2f} s", mark.time_s)
    for axes in grid[-1]:
        axes.set_xlabel(SINCE)
    grid[0, -1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def _named(axes: Axes, text: str, at_s: float) -> None:
    place: dict[str, Any] = {"va": "bottom", "ha": "left", "fontsize": 8}
    axes.text(at_s, 1.0, text, **place, transform=axes.get_xaxis_transform())


def _values(axes: Axes, shown: ShownSignal) -> None:
    """Draw the vote with its threshold, and the channels."""
    if shown.threshold is not None:
        at = thinned(shown.voted)
        half = (shown.threshold * shown.bound)[at]
        axes.fill_between(shown.time_s[at], shown.voted[at] - half, shown.voted[at] + half, color=LINE)
    _line(axes, shown.time_s, shown.voted, color=VOTE, linewidth=2.2, label="vote")
    for c, channel in enumerate(shown.channels):
        _line(axes, shown.time_s, channel, **_look(c))
    axes.set(ylabel=shown.label, ylim=shown.ends())
    axes.margins(x=0.0)


def _differences(axes: Axes, shown: ShownSignal) -> None:
    """Draw each channel minus the vote, linear up to one threshold, logarithmic beyond."""
    axes.set_ylabel(f"minus the vote, {shown.measure}")
    axes.margins(x=0.0)
    axes.axhline(0.0, color=VOTE, linewidth=1.0)
    if not shown.channels:
        axes.text(0.5, 0.5, "the file has no channels", transform=axes.transAxes, ha="center", va="center")
        return
    largest = 1.0
    for c in range(len(shown.channels)):
        apart = shown.apart(c)
        largest = max(largest, float(np.abs(apart[np.isfinite(apart)]).max(initial=0.0)))
        _line(axes, shown.time_s, apart, **_look(c))
    if shown.threshold is not None:
        at = thinned(shown.bound)
        axes.fill_between(shown.time_s[at], -shown.bound[at], shown.bound[at], color=LINE, step="post", zorder=0)
        if largest > 2.0:
            ticks = deviation_axis(largest)["ticktext"]
            axes.set_yscale("symlog", linthresh=1.0)
            axes.set_yticks([float(tick) for tick in ticks], ticks)
            axes.minorticks_off()
        axes.set_ylim(-1.3 * largest, 1.3 * largest)


def _look(c: int) -> dict[str, Any]:
    return {"color": CHANNELS[c], "linewidth": 1.1, "linestyle": STYLES[DASHES[c]], "label": f"channel {c + 1}"}


def _line(axes: Axes, time_s: Array, values: Array, **look: Any) -> None:
    drawn = line(time_s, values)
    axes.plot(drawn.time_s, drawn.values, **look)
