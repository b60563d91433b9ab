"""The report of a design of thresholds: one HTML file with the data, the tail fit and the trade-off of each signal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.core.palette import BLUE, GREEN, INK, ORANGE, SOFT, series_colour
from rig.show.pages.page import lay_out, write_page
from rig.studies.thresholds.design import Threshold
from rig.studies.thresholds.slow_test_delays import DRIFT, OFFSETS

_HEIGHT: Final = 340
_WIDE: Final = 30.0  # largest over smallest size from which the axis is logarithmic
_MARKS: Final = ("circle", "square", "diamond", "triangle-up", "triangle-down", "x", "cross")
Design = dict[str, Any]


def write(path: Path, summary: dict[str, Any], chosen: Mapping[str, Threshold]) -> None:
    """Write the page of a design; ``summary`` of design_report.py.

    chosen : of each signal, the threshold that isolates one of all channels, in the unit of the signal
    """
    budget = summary["budget_per_h"]
    title = f"{budget:g} false isolations an hour and signal, {summary['hours']:.3g} h of data"
    figures: dict[str, dict[str, go.Figure]] = {}
    for name, signal in summary["signals"].items():
        pictures = dict(_tail(signal, chosen[name], budget)) if name in chosen else {}
        figures[name] = {f"{name}: {what}": figure for what, figure in [*pictures.items(), *_tradeoff(signal)]}
    tests = {name: of["slow_tests"] for name, of in summary["signals"].items() if of["slow_tests"] is not None}
    told = {"tests": [_tests_row(name, of, summary["signals"][name]["unit"]) for name, of in tests.items()]}
    told |= {"sizes": [f"{size:g}" for size in OFFSETS], "drift": f"{DRIFT:g}"}
    facts = {**told, "title": title, "rule": summary["rule"], "notes": summary["notes"]}
    rows = [_row(name, signal) for name, signal in summary["signals"].items() if signal["chosen"] is not None]
    drawn = {key: figure for of in figures.values() for key, figure in of.items()}
    write_page(
        path, "thresholds.html", drawn, {}, rows=rows, signals={n: list(of) for n, of in figures.items()}, **facts
    )


def _row(name: str, signal: dict[str, Any]) -> Design:
    """Return the chosen design of a signal, as the page tells it."""
    design = _chosen(signal)
    return {
        "signal": name,
        "threshold": _upper(design),
        "unit": signal["unit"],
        "kind": _kind(design),
        "persistence": design["persistence"],
        "offset": _offset(design),
        "share": _share(design),
        "events": next(iter(design["levels"].values()))["clusters"],
    }


def _tests_row(name: str, tests: dict[str, Any], unit: str | None) -> dict[str, Any]:
    """Return the design of a signal's slow-fault tests, as the page tells it."""
    keys, beyond = tests["keys"], tests["held_out_beyond"]
    reserves = {key: "" if reserve is None else f" x {reserve:.2f}" for key, reserve in tests["reserve"].items()}
    error = keys.get("reference_error")
    return {
        "signal": name,
        "factors": [f"{keys[key]:.3g} ({tests['largest'][key]:.2f}{by})" for key, by in reserves.items()],
        "reference": "-" if error is None else f"{error:.3g} {unit or ''} + {keys['reference_frames']:.3g} frames",
        "beyond": "-" if beyond is None else f"{beyond} of {tests['flights']}",
        "delays": _delays(tests),
        "in_motion": _delays(tests["in_motion"]) if tests["allowance"] > 0.0 else [],
    }


def _delays(tests: dict[str, Any]) -> list[str]:
    """Return the smallest isolated offset, and the delays of all sizes and of the drift."""
    smallest, delay_s = tests["smallest_offset"], tests["delay_s"]
    delays = [*delay_s["offset"].values(), delay_s["drift"]]
    return [
        "none" if smallest is None else f"{smallest:.3f}",
        *("none" if delay is None else f"{delay:.2f} s" for delay in delays),
    ]


def _chosen(signal: dict[str, Any]) -> Design:
    """Return the chosen design of a signal, which has one."""
    keys = signal["chosen"]
    return next(each for each in signal["designs"] if _is_of(each, keys))


def _is_of(design: Design, keys: dict[str, Any]) -> bool:
    """Return True if a design has the ``keys`` that were written."""
    same = ("slow_limit",) if design["kept"] else ("filter_s", "persistence", "slow_limit")
    return all((design[name] or 0) == (keys.get(name) or 0) for name in same)


def _tail(signal: dict[str, Any], threshold: Threshold, budget_per_h: float) -> Iterator[tuple[str, go.Figure]]:
    """Yield the picture of the events in the data, the fitted tail, and the threshold at the allowed rate."""
    tail = threshold.tail
    if tail is None or not tail.peaks:
        return
    count = len(tail.peaks)
    measured = np.arange(count, 0, -1) / tail.hours
    rates = np.geomspace(max(measured[0], budget_per_h), min(measured[-1], budget_per_h) / 3.0, 60)
    made = go.Figure()
    mark = {"mode": "markers", "marker": {"color": SOFT, "size": 6}}
    made.add_scatter(x=measured, y=tail.peaks, name=f"events in the data ({count})", **mark)
    line = {"mode": "lines", "line": {"color": BLUE, "width": 2}}
    made.add_scatter(x=rates, y=[tail.level(float(rate)) for rate in rates], name="fitted tail", **line)
    ends = {"x": [float(rates.min()), float(rates.max())], "mode": "lines"}
    made.add_scatter(
        y=[threshold.upper] * 2, name="threshold", line={"color": ORANGE, "width": 2, "dash": "dash"}, **ends
    )
    made.add_scatter(
        x=[budget_per_h],
        y=[threshold.point],
        name="point estimate at the allowed rate",
        mode="markers",
        marker={"color": INK, "symbol": "diamond", "size": 10},
    )
    lay_out(made, "events, tail fit and threshold", _HEIGHT)
    made.update_xaxes(title="events an hour that exceed the level", type="log", dtick=1, exponentformat="power")
    unit = f", {signal['unit']}" if signal["unit"] else ""
    made.update_yaxes(title=f"difference{unit}", rangemode="tozero")
    yield "events, tail fit and threshold", made


def _tradeoff(signal: dict[str, Any]) -> Iterator[tuple[str, go.Figure]]:
    """Yield two pictures, a line a filter: threshold and smallest offset, and the share of faults isolated.

    Designs with one persistence are bars, one for each filter.
    """
    kinds = dict.fromkeys(map(_kind, signal["designs"]))
    of_kind = {kind: [design for design in signal["designs"] if _kind(design) == kind] for kind in kinds}
    several = len({design["persistence"] for design in signal["designs"]}) > 1
    sizes, shares = (_lines if several else _bars)(of_kind)
    unit = f", {signal['unit']}" if signal["unit"] else ""
    axes = {"threshold and smallest isolated offset": f"size{unit}", "injected faults correctly isolated": "share, %"}
    for figure, (what, axis) in zip((sizes, shares), axes.items(), strict=True):
        if figure.to_dict()["data"]:
            lay_out(figure, what, _HEIGHT)
            if several:
                figure.update_xaxes(title="persistence, frames", tickformat="d")
            else:
                frames = signal["designs"][0]["persistence"]
                figure.update_xaxes(title=f"persistence {frames} frames", type="category", tickangle=0)
            drawn = [value for trace in figure.to_dict()["data"] for value in trace["y"] if value]
            if axis != "share, %" and drawn and max(drawn) > _WIDE * min(drawn):
                figure.update_yaxes(title=f"{axis}, logarithmic", type="log", exponentformat="power")
            else:
                figure.update_yaxes(title=axis, range=[0, 102] if axis == "share, %" else None, rangemode="tozero")
            yield what, figure


def _lines(of_kind: dict[str, list[Design]]) -> tuple[go.Figure, go.Figure]:
    """Draw sizes and shares over the persistence."""
    sizes, shares = go.Figure(), go.Figure()
    for i, (kind, designs) in enumerate(of_kind.items()):
        frames = [each["persistence"] for each in designs]
        marker = {"symbol": _MARKS[i % len(_MARKS)], "size": 8, "color": series_colour(i)}
        line = {"mode": "lines+markers", "line_color": series_colour(i), "marker": marker}
        offsets = {"line_dash": "dash", **line}
        sizes.add_scatter(x=frames, y=_values(designs, _upper), name=kind, **_heading("threshold"), **line)
        sizes.add_scatter(x=frames, y=_values(designs, _offset), name=kind, **_heading("smallest offset"), **offsets)
        shares.add_scatter(x=frames, y=_values(designs, _share), name=kind, **line)
    return sizes, shares


def _heading(text: str) -> dict[str, Any]:
    """Return the heading of a legend entry."""
    return {"legendgrouptitle": {"text": text}}


def _bars(of_kind: dict[str, list[Design]]) -> tuple[go.Figure, go.Figure]:
    """Draw sizes and shares of designs with one persistence."""
    sizes, shares = go.Figure(), go.Figure()
    kinds = [kind.replace(", ", ",<br>") for kind in of_kind]
    designs = [each[0] for each in of_kind.values()]
    width = min(0.3, 0.15 * len(kinds))
    for what, value, colour in (("threshold", _upper, BLUE), ("smallest isolated offset", _offset, GREEN)):
        sizes.add_bar(x=kinds, y=_values(designs, value), name=what, marker_color=colour, width=width)
    shares.add_bar(x=kinds, y=_values(designs, _share), name="correctly isolated", marker_color=BLUE, width=width)
    return sizes, shares


def _values(designs: list[Design], value: Callable[[Design], float | None]) -> list[float | None]:
    return [value(each) for each in designs]


def _upper(design: Design) -> float:
    return next(iter(design["levels"].values()))["upper"]


def _offset(design: Design) -> float | None:
    return (design["tradeoff"] or {}).get("smallest_offset")


def _share(design: Design) -> float | None:
    share = (design["tradeoff"] or {}).get("correctly_isolated")
    return None if share is None else 100.0 * share


def _kind(design: Design) -> str:
    """Return the rules of a design: filter, CUSUM."""
    words = [f"filter {design['filter_s']:g} s" if design["filter_s"] else "no filter"]
    words += [f"CUSUM to {design['slow_limit']:.3g}"] if design["slow_limit"] else []
    return ", ".join(words)
