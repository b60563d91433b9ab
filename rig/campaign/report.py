"""The report: one HTML file with everything in it, for a browser without a network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from rig.campaign.figures import delay_curves, heat_maps, reply_times
from rig.campaign.folder import Folder
from rig.campaign.summary import acted, summary
from rig.errors import BadInput
from rig.files import write_text
from rig.versions import versions


def report(folder: Folder, out: Path) -> dict[str, Any]:
    """Write the report of a campaign to ``out``; its figures as plain data. BadInput when nothing was flown yet."""
    if folder.tables["runs"].is_empty():
        raise BadInput(f"{folder.path}: no run is done yet, there is nothing to report")
    found = summary(folder)
    replies = [] if found["replies"] is None else [reply_times(found["replies"])]
    html = _page(found, heat_maps(found["by_place"]), delay_curves(acted(folder.tables)), replies)
    write_text(out, html)
    return found


def _page(found: dict[str, Any], maps: list[go.Figure], delays: list[go.Figure], replies: list[go.Figure]) -> str:
    template = page("rig.campaign", {"rate": rate, "number": number, "percent": percent})
    figures = {f"map-{i}": figure for i, figure in enumerate(maps)}
    figures |= {f"delay-{i}": figure for i, figure in enumerate(delays)}
    figures |= {f"replies-{i}": figure for i, figure in enumerate(replies)}
    data = json.dumps(
        {name: json.loads(figure.to_json() or "null") for name, figure in figures.items()}, allow_nan=False
    )
    return template.render(
        found=found,
        maps=[name for name in figures if name.startswith("map")],
        delays=[name for name in figures if name.startswith("delay")],
        figures=data.replace("<", "\\u003c"),  # nothing in it can end the script element
        plotly=get_plotlyjs(),
        versions=versions(),
    )


def page(package: str, filters: dict[str, Any]) -> jinja2.Template:
    """The template ``report.html`` of a package, in which a name that is not given is an error."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package, "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters
    return environment.get_template("report.html")


def percent(value: float | None) -> str:
    """A share as a reader would say it."""
    return "–" if value is None else f"{100 * value:.3g} %"  # noqa: RUF001 # a dash in a table


def rate(found: dict[str, Any]) -> str:
    """A share with its interval."""
    if found["value"] is None:
        return "–"  # noqa: RUF001 # a dash in a table
    return f"{percent(found['value'])} ({percent(found['low'])} to {percent(found['high'])})"


def number(value: float | None, digits: int = 3) -> str:
    """A number as a reader would say it."""
    return "–" if value is None else f"{value:.{digits}g}"  # noqa: RUF001 # a dash in a table
