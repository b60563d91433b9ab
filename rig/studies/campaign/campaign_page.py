"""The report of a campaign: one self-contained HTML file, for a browser without a network.

Magnitudes have the unit of their signal, angles are in degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import plotly.graph_objects as go
import polars as pl

from rig.core.ending import ending
from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS
from rig.core.palette import DASHES, INK, LINE, SERIES, SHARE_SCALE, WHITE, series_colour
from rig.core.units.quantities import number, unit_shown
from rig.show.pages.page import DASH, lay_out, write_page
from rig.studies.campaign.campaign_summary import RANKED, TABLES, summary, until_words
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.group_rates import OF_RUN, acted, groups
from rig.world.faults.scenario_faults import KINDS

MOST_MAPS: Final = 12  # heat maps of one report
_LABELS_PX, _CELL_PX = 120, 46  # of a map: its flight points, a cell with its count
_RATE: Final = "signal/s"  # units of settings, as the catalogue has them
_SIGNAL: Final = ("signal", _RATE)
Rows = list[dict[str, Any]]


def report(folder: Folder, out: Path) -> dict[str, Any]:
    """Write the report of a campaign to ``out``; return its figures as plain data.  BadInput: no run is done yet."""
    if folder.tables["runs"].is_empty():
        raise BadInput(f"{folder.path}: no run is done yet; fly some with rig campaign run")
    results = summary(folder)
    maps = {f"map-{i}": figure for i, figure in enumerate(heat_maps(results["by_place"]))}
    delays = {f"delay-{i}": figure for i, figure in enumerate(delay_curves(acted(folder.tables, ["manager"])))}
    replies = {} if results["replies"] is None else {"replies-0": reply_times(results["replies"])}
    filters = {"magnitude": lambda *of: magnitude_shown(*of) or DASH, "magnitude_unit": magnitude_unit}
    filters |= {"ending": ended, "until": until_words}
    levels = [
        {**row, "level": level_shown(row["key"], row["level"], folder.tables["faults"])} for row in results["by_varied"]
    ]
    names = results["by_name"]
    several = {"by_kind": bool(names), "by_varied": "manager" in names}  # a column of one value is left out
    columns = {
        name: [column for column in of if column.name != "of" or several.get(name, True)] for name, of in TABLES.items()
    }
    figures = {**maps, **delays, **replies}
    widths = {name: _LABELS_PX + _CELL_PX * len(figure.to_dict()["data"][0]["x"]) for name, figure in maps.items()}
    shown = {"columns": columns, "ranked": RANKED, "levels": levels, "maps": widths, "delays": list(delays)}
    write_page(out, "campaign.html", figures, filters, results=results, **shown)
    return results


def ended(run: dict[str, Any]) -> str:
    """Return the end of a flown run in words."""
    rate_hz = round(run["frames"] / run["duration_s"], 6) if run["duration_s"] else 1.0
    return ending(run["survived"], run["end_reason"], run["frames"], rate_hz)


def heat_maps(rows: Rows) -> list[go.Figure]:
    """Draw detection over magnitude and flight point, one map for each signal and kind.

    rows : as ``by_place`` of the summary
    """
    by_kind: dict[tuple[str, str], Rows] = {}
    for row in rows:
        by_kind.setdefault((row["signal"], row["kind"]), []).append(row)
    return [_heat_map(*key, part) for key, part in list(by_kind.items())[:MOST_MAPS]]


def _heat_map(signal: str, kind: str, rows: Rows) -> go.Figure:
    """Draw the detected share of the detectable faults as a colour; grey: no fault was detectable."""
    places = sorted({row["place"] or "" for row in rows}, reverse=True)
    sizes, unit = sorted({row["size"] for row in rows}), magnitude_unit(signal, kind)
    axes = {"x": [magnitude_shown(size, signal, kind) for size in sizes], "y": places, "xgap": 2, "ygap": 2}
    hover = f"%{{y}}<br>magnitude %{{x}} {unit}<br>%{{customdata}}<extra></extra>"
    shared = {**axes, "zmin": 0.0, "zmax": 1.0, "hovertemplate": hover, "hoverongaps": False}
    cells = {(row["place"] or "", row["size"]): row for row in rows}
    grid = [[cells.get((place, size)) for size in sizes] for place in places]
    scale = {"colorscale": SHARE_SCALE, "colorbar": {"title": "detected", "thickness": 12, "tickformat": ".0%"}}
    figure = go.Figure(go.Heatmap(**_colours(grid, detectable=True), **shared, **scale))
    grey = {"colorscale": [[0.0, LINE], [1.0, LINE]], "showscale": False}
    figure.add_heatmap(**_colours(grid, detectable=False), **shared, **grey)
    figure.add_scatter(**_counts(rows, signal, kind))
    lay_out(figure, f"{kind} of {signal}", 150 + 34 * len(places))
    figure.update_xaxes(title=f"magnitude, {unit}" if unit else "magnitude", type="category")
    figure.update_yaxes(type="category")
    return figure


def _colours(grid: Sequence[Sequence[dict[str, Any] | None]], detectable: bool) -> dict[str, Any]:
    """Return shares and hover texts of the cells that are, or are not, ``detectable``; other cells stay empty."""
    kept = [[cell if cell and bool(cell["detection"]["of"]) == detectable else None for cell in line] for line in grid]
    return {
        "z": [[cell and (cell["detection"]["value"] or 0.0) for cell in line] for line in kept],
        "customdata": [[cell and _hover_text(cell) for cell in line] for line in kept],
    }


def _counts(rows: Rows, signal: str, kind: str) -> dict[str, Any]:
    """Return the counts as texts at the places of their cells; a heat map omits some of its own texts."""
    dark = [bool(row["detection"]["of"]) and abs(row["detection"]["value"] - 0.5) > 0.3 for row in rows]
    return {
        "x": [magnitude_shown(row["size"], signal, kind) for row in rows],
        "y": [row["place"] or "" for row in rows],
        "text": [_counted(row) for row in rows],
        "mode": "text",
        "textfont": {"color": [WHITE if each else INK for each in dark]},
        "hoverinfo": "skip",
        "showlegend": False,
    }


def _counted(cell: dict[str, Any]) -> str:
    share = cell["detection"]
    return f"{share['count']}/{share['of']:.0f}" if share["of"] else f"({cell['acted']})"


def _hover_text(cell: dict[str, Any]) -> str:
    """Return the hover text of a cell of a heat map."""
    share = cell["detection"]
    never = cell["acted"] - int(share["of"])
    below = f"{never} undetectable: error within the threshold" if never else ""
    if not share["of"]:
        return below
    detected = f"detected {_counted(cell)} (95 %: {share['low']:.3f} to {share['high']:.3f})"
    return f"{detected}<br>{below}" if below else detected


def delay_curves(faults: pl.DataFrame) -> list[go.Figure]:
    """Draw the distribution of delays by signal, kind and manager, from the threshold and from onset."""
    detected = faults.filter(pl.col("outcome") == "detected")
    columns = {"delay_from_exceeded_s": "from the first frame beyond the threshold", "delay_from_onset_s": "from onset"}
    return [_curves(detected, column, title) for column, title in columns.items() if len(detected)]


def _curves(detected: pl.DataFrame, column: str, title: str) -> go.Figure:
    figure = go.Figure()
    all_delays = [0.0, *detected[column].drop_nulls().to_list()]
    begin, end = (
        1.1 * min(all_delays),
        1.1 * max(all_delays),
    )  # below 0: isolated before the threshold
    managers = ["manager"] if f"{OF_RUN}manager" in detected.columns else []
    for i, (key, part) in enumerate(groups(detected, ["signal", "kind"], managers)):
        counts = part[column].drop_nulls().value_counts().sort(column)
        if counts.is_empty():
            continue
        share = (counts["count"].cum_sum() / counts["count"].sum()).to_list()
        delays = counts[column].to_list()
        figure.add_scatter(
            x=[begin, *delays, end],
            y=[0.0, *share, share[-1]],
            mode="lines",
            line={"shape": "hv", "color": series_colour(i), "width": 2, "dash": DASHES[i % len(DASHES)]},
            name=" ".join(filter(None, (f"{key['kind']} of {key['signal']}", key.get("of"), f"({len(part)})"))),
            hovertemplate="%{x:.2f} s: %{y:.3f}<extra>%{fullData.name}</extra>",
        )
    lay_out(figure, f"Delay {title}", 340)
    figure.update_xaxes(title="delay, s", range=[begin, end or 1.0])  # room behind the last step
    figure.update_yaxes(title="share of detections", range=[0, 1.02])
    return figure


def reply_times(replies: dict[str, Any]) -> go.Figure:
    """Draw the distribution of the reply time of a unit under test; ``replies`` as of the summary."""
    share = [100.0 * count / max(replies["frames"], 1) for count in replies["counts"]]
    hover = "%{x} µs: %{customdata} frames, %{y:.3g} %<extra></extra>"
    bars = {"x": replies["bins_us"], "y": share, "customdata": replies["counts"], "hovertemplate": hover}
    figure = go.Figure(go.Bar(**bars, marker={"color": SERIES[0]}))
    lay_out(figure, "Reply time", 340)
    figure.update_xaxes(title="reply time, µs", type="category")
    figure.update_yaxes(title="% of frames, logarithmic", type="log")
    return figure


def magnitude_unit(signal: str, kind: str) -> str:
    """Return the display unit of the magnitudes of a kind on a signal, such as ``deg/s``; "" if they have none."""
    unit = _setting(kind)
    if unit not in _SIGNAL:
        return unit_shown(unit)
    shown = unit_shown(_of_signal(signal))
    if unit != _RATE:
        return shown
    return f"{shown.removesuffix('/s')}/s²" if shown.endswith("/s") else f"{shown or '1'}/s"


def magnitude_shown(value: float | None, signal: str, kind: str) -> str:
    """Return a magnitude, SI, in ``magnitude_unit``; "" for None."""
    return number(value, _of_signal(signal) if _setting(kind) in _SIGNAL else "")


def level_shown(key: str, level: Any, faults: pl.DataFrame) -> str:
    """Return a level of a varied key, rounded; the magnitude of a fault in the unit of its signal.

    faults : table of the campaign, with the signal of each fault
    """
    if not isinstance(level, float):
        return str(level)
    parts = key.split(".")
    if parts[0] == "faults" and len(parts) == 3:
        kinds = [kind for kind, model in KINDS.items() if model.sizes and model.sizes[0] == parts[2]]
        signals = faults.filter(pl.col("fault").cast(pl.String) == parts[1])["signal"].unique()
        if kinds and len(signals) == 1:
            unit = magnitude_unit(signals[0], kinds[0])
            return f"{magnitude_shown(level, signals[0], kinds[0])} {unit}".rstrip()
    return number(level)


def _of_signal(signal: str) -> str:
    return SIGNALS[INDEX[signal]].unit if signal in INDEX else ""


def _setting(kind: str) -> str:
    """Return the unit of the setting that gives the magnitude of a kind."""
    model = KINDS.get(kind)
    extra = model.model_fields[model.sizes[0]].json_schema_extra if model is not None and model.sizes else None
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""
