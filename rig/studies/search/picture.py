"""The page of a search: robustness over flights, the worst case with its faults in words, and how to fly it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.core.frame import INDEX, SIGNALS
from rig.core.palette import BLUE, INK, ORANGE, RED, SOFT, faint
from rig.core.units.quantities import number, unit_of_name, unit_shown
from rig.show.pages.flight_page import Decision
from rig.show.pages.page import lay_out, write_page
from rig.studies.search.objective import Measured
from rig.studies.search.search_plan import SearchPlan
from rig.verdict.requirements.robustness import robustness_text
from rig.world.faults import KINDS

Table = Mapping[str, Any]
MOST: Final = 30.0  # drawn of a robustness
_FAULT: Final = re.compile(r"faults\.(\d+)\.(\w+)")


def figure(plan: SearchPlan, found: Sequence[Measured], worst: int) -> go.Figure:
    """Draw the robustness of each draw over flights; ``worst``: run of the worst case."""
    robustness = np.array([each.robustness for each in found])
    shown = np.clip(robustness, -MOST, MOST)
    flights = (np.arange(len(robustness)) + 1) * plan.of_one_draw
    names = [plan.arms[draw.arm].name for draw in plan.draws]
    made = go.Figure()
    for label, part, colour, symbol in (
        ("random", slice(0, plan.random), SOFT, "circle"),
        ("chosen", slice(plan.random, len(robustness)), BLUE, "diamond"),
    ):
        hover = "flight %{x}: robustness %{customdata}<extra>" + label + "</extra>"
        marks: dict[str, Any] = {
            "mode": "markers",
            "marker": {"color": faint(colour, 0.8), "size": 6, "symbol": symbol},
        }
        texts = [
            f"{robustness_text(robustness) or 'none'}<br>{name}"
            for robustness, name in zip(robustness[part], names[part], strict=True)
        ]
        made.add_scatter(x=flights[part], y=shown[part], name=label, customdata=texts, hovertemplate=hover, **marks)
    line: dict[str, Any] = {"mode": "lines", "line": {"color": INK, "width": 2, "shape": "hv"}}
    made.add_scatter(x=flights, y=np.minimum.accumulate(shown), name="least so far", hoverinfo="skip", **line)
    place: dict[str, Any] = {"x": flights[worst // plan.of_one_draw], "y": shown[worst // plan.of_one_draw]}
    made.add_annotation(**place, text="worst case", ax=28, ay=-24, xanchor="left", arrowhead=2, arrowcolor=INK)
    least = float(shown[: plan.random].min())
    below = least < 0.0
    line = {"color": ORANGE, "width": 1.5, "dash": "dash"}
    _level(made, least, "least of the random flights", line, above=not below)
    difference = plan.asked.against is not None
    zero = "no difference" if difference else "violated below 0"
    _level(made, 0.0, zero, {"color": RED, "width": 1}, above=below)
    lay_out(made, "Robustness of the flights of the search", 420)
    made.update_xaxes(title="flight")
    made.update_yaxes(title="difference of robustness" if difference else "robustness")
    return made


def _level(figure: go.Figure, robustness: float, text: str, line: dict[str, Any], above: bool) -> None:
    """Draw a level with its text above or below its right end."""
    figure.add_hline(y=robustness, line=line)
    place: dict[str, Any] = {"x": 1.0, "xref": "paper", "xanchor": "right", "yanchor": "bottom" if above else "top"}
    figure.add_annotation(y=robustness, text=text, showarrow=False, **place)


def write(
    out: Path,
    plan: SearchPlan,
    found: Sequence[Measured],
    figures: dict[str, Any],
    simplest: Table,
    decision: Decision,
) -> None:
    """Write the page of a search; ``simplest``: table of the minimal scenario; ``decision``: of the worst flight."""
    title, varied = plan.campaign.title or plan.source, figures["worst"]["varied"]
    table = plan.data(figures["worst"]["run"])
    write_page(
        out, "search.html", {"robustness": figure(plan, found, figures["worst"]["run"]), **decision.figures}, {},
        decision=decision, folder=out.parent, title=title, asked=plan.asked, results=figures,
        requirements=[each for each in plan.requirements if each.id in plan.asked.requirements],
        varied={key: shown(key, value, table) for key, value in varied.items()},
        least=robustness_text(figures["robustness"]) or "none", worst=robustness_text(figures["worst"]["robustness"]),
        faults=fault_sentences(table), simplest=fault_sentences(simplest),
        flight=", ".join(filter(None, map(str, (simplest.get("aircraft"), simplest.get("flight_point"))))),
    )  # fmt: skip


def fault_sentences(table: Table) -> list[str]:
    """Return the faults of a scenario, a line each: kind, size, place and onset."""
    lines = []
    for i, fault in enumerate(table.get("faults", [])):
        sizes = [name for name in KINDS[fault["kind"]].sizes if name in fault]
        size = f" of {shown(f'faults.{i}.{sizes[0]}', fault[sizes[0]], table)}" if sizes else ""
        channels = fault.get("channels") or []
        which = f"{'s' if len(channels) > 1 else ''} {', '.join(map(str, channels))}"
        place = ", ".join(filter(None, [fault.get("signal"), f"channel{which}" if channels else ""]))
        onset = f" from {fault['start_s']:.3g} s on" if "start_s" in fault else ""
        lines.append(f"{fault['kind'].replace('_', ' ')}{size}{f': {place}' if place else ''}{onset}")
    return lines


def shown(key: str, value: object, table: Mapping[str, Any]) -> str:
    """Return the value of a varied key with three digits and its unit; angles are in degrees.

    table : the scenario that has the key
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    unit, of_fault = unit_of_name(key) or ("s" if key.endswith("_s") else ""), _FAULT.fullmatch(key)
    if of_fault is not None:
        fault = table["faults"][int(of_fault[1])]
        field = KINDS[fault["kind"]].model_fields.get(of_fault[2])
        declared = field.json_schema_extra if field is not None else None
        unit = str(declared.get("unit", unit)) if isinstance(declared, dict) else unit
        if unit.startswith("signal") and fault.get("signal") in INDEX:
            of_signal = SIGNALS[INDEX[fault["signal"]]].unit
            shown_in = unit.replace("signal", unit_shown(of_signal), 1).replace("/s/s", "/s²")
            return f"{number(value, of_signal)} {shown_in}".rstrip()
    return f"{number(value, unit)} {unit_shown(unit)}".rstrip()
