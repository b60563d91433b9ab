"""The report of a design of thresholds: one HTML file that opens without a network, two pictures a signal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from rig.core.palette import series_colour
from rig.show.pages.page import lay_out, write_page


def write(path: Path, summary: dict[str, Any]) -> None:
    """Write threshold, smallest offset and share isolated over the persistence; ``summary`` of design_report.py."""
    title = f"{summary['budget_per_h']:g} false isolations an hour and signal, {summary['hours']:.3g} h of data"
    figures = dict(_pictures(summary["signals"]))
    facts = {"title": title, "rule": summary["rule"], "notes": summary["notes"], "pictures": list(figures)}
    write_page(path, "thresholds.html", figures, {}, **facts)


def _pictures(signals: dict[str, Any]) -> Iterator[tuple[str, go.Figure]]:
    """Yield two pictures a signal, a line a filter: threshold and smallest offset, and the share of faults isolated.

    Designs with one persistence are bars, one of each filter: a line of one point would be none.
    """
    for name, signal in signals.items():
        kinds = dict.fromkeys(map(_kind, signal["designs"]))
        of_kind = {kind: [design for design in signal["designs"] if _kind(design) == kind] for kind in kinds}
        draw = _lines if len({design["persistence"] for design in signal["designs"]}) > 1 else _bars
        sizes, shares = draw(of_kind)
        unit = signal["unit"]
        axes = {
            "threshold, smallest offset": f"size, {unit}" if unit else "size",
            "faults isolated as they should be": "%",
        }
        for figure, (what, axis) in zip((sizes, shares), axes.items(), strict=True):
            if figure.to_dict()["data"]:
                lay_out(figure, f"{name}: {what}", 340)
                if draw is _lines:
                    figure.update_xaxes(title="persistence, frames", tickformat="d")
                else:
                    frames = signal["designs"][0]["persistence"]
                    figure.update_xaxes(title=f"filter; persistence {frames} frames", type="category", tickangle=0)
                figure.update_yaxes(title=axis, range=[0, 102] if axis == "%" else None, rangemode="tozero")
                yield f"{name}: {what}", figure


def _lines(of_kind: dict[str, list[dict[str, Any]]]) -> tuple[go.Figure, go.Figure]:
    """Draw sizes and shares over the persistence."""
    sizes, shares = go.Figure(), go.Figure()
    for i, (kind, designs) in enumerate(of_kind.items()):
        frames = [each["persistence"] for each in designs]
        line = {"mode": "lines+markers", "line_color": series_colour(i)}
        sizes.add_scatter(x=frames, y=_values(designs, _upper), name=f"threshold, {kind}", **line)
        offsets = _values(designs, _offset)
        sizes.add_scatter(x=frames, y=offsets, name=f"smallest offset, {kind}", line_dash="dash", **line)
        shares.add_scatter(x=frames, y=_values(designs, _share), name=kind, **line)
    return sizes, shares


def _bars(of_kind: dict[str, list[dict[str, Any]]]) -> tuple[go.Figure, go.Figure]:
    """Draw sizes and shares of designs with one persistence."""
    sizes, shares = go.Figure(), go.Figure()
    kinds = [kind.replace(", ", ",<br>") for kind in of_kind]
    designs = [each[0] for each in of_kind.values()]
    for i, (what, value) in enumerate((("threshold", _upper), ("smallest offset", _offset))):
        sizes.add_bar(x=kinds, y=_values(designs, value), name=what, marker_color=series_colour(i))
    shares.add_bar(x=kinds, y=_values(designs, _share), name="isolated", marker_color=series_colour(0))
    return sizes, shares


def _values(designs: list[dict[str, Any]], value: Callable[[dict[str, Any]], float | None]) -> list[float | None]:
    return [value(each) for each in designs]


def _upper(design: dict[str, Any]) -> float:
    return next(iter((design["outlier_levels"] or design["levels"]).values()))["upper"]


def _offset(design: dict[str, Any]) -> float | None:
    return (design["tradeoff"] or {}).get("smallest_offset")


def _share(design: dict[str, Any]) -> float | None:
    share = (design["tradeoff"] or {}).get("found_rightly")
    return None if share is None else 100.0 * share


def _kind(design: dict[str, Any]) -> str:
    """Return what a line is of: filter, channel equalisation, sums."""
    words = [f"filter {design['filter_s']:g} s"]
    words += ["channel equalisation"] if design["equalise_bound"] else []
    words += [f"sums to {design['slow_limit']:.3g}"] if design["slow_limit"] else []
    return ", ".join(words)
