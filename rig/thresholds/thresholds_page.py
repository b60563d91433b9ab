"""The report of a design of thresholds: one HTML file that opens without a network, two pictures a signal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from rig.report.page import lay_out, write_page
from rig.util.palette import series_colour


def write(path: Path, summary: dict[str, Any]) -> None:
    """Write threshold, smallest offset and share isolated over the persistence; ``summary`` as of report.summary."""
    title = f"{summary['budget_per_h']:g} false isolations an hour and signal, {summary['hours']:.3g} h of data"
    figures = dict(_pictures(summary["signals"]))
    facts = {"title": title, "rule": summary["rule"], "notes": summary["notes"], "pictures": list(figures)}
    write_page(path, "thresholds.html", figures, {}, **facts)


def _pictures(signals: dict[str, Any]) -> Iterator[tuple[str, go.Figure]]:
    """Yield two pictures a signal, a line a filter: threshold and smallest offset, and the share of faults isolated."""
    for name, signal in signals.items():
        sizes, shares = go.Figure(), go.Figure()
        for i, kind in enumerate(dict.fromkeys(map(_kind, signal["designs"]))):
            designs = [design for design in signal["designs"] if _kind(design) == kind]
            frames, tradeoffs = [each["persistence"] for each in designs], [each["tradeoff"] or {} for each in designs]
            upper = [next(iter((each["outlier_levels"] or each["levels"]).values()))["upper"] for each in designs]
            line, label = {"mode": "lines+markers", "line_color": series_colour(i)}, kind
            sizes.add_scatter(x=frames, y=upper, name=f"threshold, {label}", **line)
            offsets = [each.get("smallest_offset") for each in tradeoffs]
            sizes.add_scatter(x=frames, y=offsets, name=f"smallest offset, {label}", line_dash="dash", **line)
            shares.add_scatter(x=frames, y=[each.get("found_rightly") for each in tradeoffs], name=label, **line)
        for figure, what in ((sizes, "threshold, smallest offset"), (shares, "share found rightly")):
            if figure.to_dict()["data"]:
                lay_out(figure, f"{name}: {what}", 340)
                figure.update_xaxes(title="persistence, frames")
                yield f"{name}: {what}", figure


def _kind(design: dict[str, Any]) -> str:
    """Return what a line is of: filter, learned bias, sums."""
    words = [f"filter {design['filter_s']:g} s"]
    words += ["learned bias"] if design["bias_bound"] else []
    words += [f"sums to {design['slow_limit']:.3g}"] if design["slow_limit"] else []
    return ", ".join(words)
