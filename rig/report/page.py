"""What every report shares: the page's frame, plotly's library inlined once, figures as data, numbers as text."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, Final

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from rig.util.versions import versions

COLOURS: Final = ("#2166ac", "#b2182b", "#4d9221", "#8073ac", "#e08214", "#35978f", "#c51b7d", "#666666")
LAYOUT: Final[dict[str, Any]] = {
    "template": "plotly_white",
    "font": {"family": "system-ui, sans-serif", "size": 13},
    "title": {"font": {"size": 15}},
    "margin": {"l": 10, "r": 10, "t": 40, "b": 10},
    "xaxis": {"automargin": True},
    "yaxis": {"automargin": True},
}
DASH: Final = "–"  # noqa: RUF001 # in a table, where there is nothing


def render(
    template: str, figures: Mapping[str, go.Figure], filters: Mapping[str, Callable[..., str]], **data: Any
) -> str:
    """Return the page of ``template``, like ``campaign/report.html``, a file of a room that extends report/base.html.

    figures : drawn into the elements with their names as id
    data : names in the template; one that it uses and is not given is an error
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("rig", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "percent": percent, "rate": rate, **filters}
    drawn = {name: json.loads(figure.to_json() or "null") for name, figure in figures.items()}
    text = json.dumps(drawn, allow_nan=False).replace("<", "\\u003c")  # nothing in it can end the script element
    about = {"plotly": get_plotlyjs(), "versions": versions()}
    return environment.get_template(template).render(figures=text, **about, **data)


def percent(value: float | None) -> str:
    """Return a share as a reader would say it."""
    return DASH if value is None else f"{100 * value:.3g} %"


def rate(found: Mapping[str, Any]) -> str:
    """Return a share with its interval; ``found`` has value, low and high."""
    if found["value"] is None:
        return DASH
    return f"{percent(found['value'])} ({percent(found['low'])} to {percent(found['high'])})"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number as a reader would say it."""
    return DASH if value is None else f"{value:.{digits}g}"
