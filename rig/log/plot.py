"""A signal of a log as a figure of matplotlib, which is imported when the first one is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rig.log.series import Series, limits, series, threshold
from rig.log.shown import resolved
from rig.util import fault_names
from rig.util.palette import CHANNELS, LINE, PALE_RED, VOTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rig.log.reader import Log

TRUTH, FAULT, BAND = "#000000", PALE_RED, LINE


def plot(log: Log, name: str) -> Figure:
    """Return a figure of channels, vote with its threshold, and truth of a signal; shaded while a fault on it acts.

    The axis follows vote and truth: a channel that is further off leaves the picture.  KeyError: no such signal.
    """
    import matplotlib.pyplot as plt  # noqa: F401 # makes notebooks draw figures
    from matplotlib.figure import Figure

    shown, allowed = series(log.rows, log.rate_hz, name), _threshold(log, name)
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.add_subplot(xlabel="time, s", ylabel=f"{name}, {shown.unit}" if shown.unit else name)
    axes.fill_between(shown.time_s, 0, 1, where=_acting(log, name), color=FAULT, transform=axes.get_xaxis_transform())
    _lines(axes, shown, allowed)
    low, high = limits(shown, allowed)
    if low < high:
        axes.set_ylim(low, high)
    axes.margins(x=0.0)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def _lines(axes: Axes, shown: Series, allowed: float) -> None:
    if allowed > 0.0:
        off = allowed * shown.scale
        axes.fill_between(shown.time_s, shown.voted - off, shown.voted + off, color=BAND, label="threshold")
    for c in range(shown.channels.shape[1]):
        axes.plot(shown.time_s, shown.channels[:, c], color=CHANNELS[c], linewidth=0.8, label=f"channel {c + 1}")
    axes.plot(shown.time_s, shown.voted, color=VOTE, linewidth=1.4, label="vote")
    axes.plot(shown.time_s, shown.truth, color=TRUTH, linewidth=1.0, linestyle="--", label="truth")


def _threshold(log: Log, name: str) -> float:
    """What the monitor of a signal allows, SI; 0 where the log does not say."""
    try:
        return threshold(resolved(log), name)
    except (KeyError, TypeError):
        return 0.0


def _acting(log: Log, name: str) -> NDArray[np.bool_]:
    """(n,) whether a fault that sits on the signal acts."""
    faults = resolved(log).get("faults", [])
    on = [i for i, fault in enumerate(faults) if name in fault_names.place(fault).split("+")]
    return np.asarray(np.unpackbits(log.rows["acting"], axis=1, bitorder="little")[:, on].any(axis=1))
