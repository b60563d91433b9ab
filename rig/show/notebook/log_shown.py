"""A log in a notebook: one line, a small table, and a figure of a signal by matplotlib, imported at first use."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rig.core import fault_names
from rig.core.ending import ending
from rig.core.errors import BadLog
from rig.core.palette import CHANNELS, DASHES, LINE, ORANGE, TRUTH, VOTE
from rig.flight.failures import failed_channels, failed_text
from rig.flight.suspects import count_suspects, new_counts, slow_faults_text, suspects
from rig.log import Log, scenario_of, unit_of
from rig.show.viewer.series import Series, limits, series, threshold
from rig.show.viewer.state_strips import acting
from rig.unit.unit_facts import voter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ACTING: Final[dict[str, Any]] = {"color": ORANGE, "alpha": 0.16, "linewidth": 0}
STYLES: Final = dict(zip(DASHES, ("-", "--", "-.", ":"), strict=True))  # plotly's names in matplotlib's


def line(log: Log) -> str:
    """Return a log in one line."""
    scenario = _scenario(log)
    title = scenario.get("title") or scenario.get("aircraft") or "recording"
    seed = f" seed {scenario['seed']}" if "seed" in scenario else ""
    return f"<Log {title}{seed}: {_verdict(log)}; isolated {_failed(log)}>"


def table(log: Log, conclusion: Sequence[str], overrides: Sequence[str] = (), path: Path | None = None) -> str:
    """Return an HTML table: scenario, verdict, failed channels, conclusion, digest."""
    scenario = _scenario(log)
    manager, unit = scenario.get("redundancy", {}).get("manager", ""), unit_of(log.metadata)
    voted = voter(manager, unit) if manager else ""
    flown = (f"seed {scenario.get('seed', '')}", voted, *overrides)
    cells = [
        ("scenario", f"{scenario.get('title') or scenario.get('aircraft', '')}, {', '.join(filter(None, flown))}"),
        ("verdict", _verdict(log)),
        ("failed channels", _failed(log)),
        *(("" if i else "conclusion", text) for i, text in enumerate(conclusion)),
        ("digest", (log.result or {}).get("digest", "none")),
        *([("log", str(path))] if path is not None else []),
    ]
    style = 'style="text-align:left;vertical-align:top"'
    rows = "".join(f"<tr><th {style}>{escape(head)}</th><td {style}>{escape(text)}</td></tr>" for head, text in cells)
    return f"<table>{rows}</table>"


def _scenario(log: Log) -> dict[str, Any]:
    """Return the scenario of a log; empty if it cannot be read."""
    try:
        return scenario_of(log.metadata, "log")
    except BadLog:
        return {}


def _verdict(log: Log) -> str:
    if log.result is None:
        return f"not finished, {len(log.rows) / log.rate_hz:g} s"
    return ending(log.result.get("survived") == "True", log.result.get("end_reason", ""), log.frames, log.rate_hz)


def _failed(log: Log) -> str:
    """Return the channels that are failed in the last frame, and those that were suspect in many frames."""
    counts = new_counts()
    count_suspects(log.rows, counts)
    failed = failed_text(failed_channels(log.rows[-1]) if len(log.rows) else {})
    return failed + slow_faults_text(suspects(counts, len(log.rows)))


def plot(log: Log, name: str) -> Figure:
    """Return a figure of channels, vote with its threshold, and truth of a signal; shaded while a fault is active.

    The axis follows vote and truth: a channel far from them leaves the picture.  BadInput: unknown signal.
    """
    import matplotlib.pyplot as plt  # noqa: F401 # makes notebooks draw figures
    from matplotlib.figure import Figure

    shown, scenario = series(log.rows, log.rate_hz, name), _scenario(log)
    try:
        allowed = threshold(scenario, name)
    except (KeyError, TypeError):  # the log has no threshold of this signal
        allowed = 0.0
    faults = scenario.get("faults", [])
    on = [i for i, fault in enumerate(faults) if name in fault_names.place(fault).split("+")]
    acts = acting(log.rows, len(faults))[:, on].any(axis=1)
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.add_subplot(xlabel="time, s", ylabel=f"{name}, {shown.unit}" if shown.unit else name)
    axes.fill_between(shown.time_s, 0, 1, where=acts, **ACTING, transform=axes.get_xaxis_transform())
    lines(axes, shown, allowed)
    low, high = limits(shown, allowed)
    if low < high:
        axes.set_ylim(low, high)
    axes.margins(x=0.0)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def lines(axes: Axes, shown: Series, allowed: float) -> None:
    """Draw the vote with the band ``allowed`` (SI) around it, truth and channels."""
    if allowed > 0.0:
        off = allowed * shown.scale
        axes.fill_between(shown.time_s, shown.voted - off, shown.voted + off, color=LINE, label="threshold")
    axes.plot(shown.time_s, shown.voted, color=VOTE, linewidth=2.2, label="vote")
    axes.plot(shown.time_s, shown.truth, color=TRUTH, linewidth=1.2, label="truth")
    for c in range(shown.channels.shape[1]):
        look: dict[str, Any] = {"color": CHANNELS[c], "linewidth": 1.1, "linestyle": STYLES[DASHES[c]]}
        axes.plot(shown.time_s, shown.channels[:, c], **look, label=f"channel {c + 1}")
