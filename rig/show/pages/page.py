"""Parts of every report: the frame of the page, plotly's library inlined once, the look of figures, numbers as text."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from rig.core.column import COUNT, INSTANT, PLAIN, RATE, SECONDS, SHARE, Column
from rig.core.files import NOT_WHOLE, reported, write_text
from rig.core.versions import versions
from rig.show.pages.themes import CSS, DARK, DARK_CSS, TEMPLATE, alternative

LAYOUT: Final[dict[str, Any]] = {"margin": {"l": 10, "r": 10, "t": 40, "b": 10}, "showlegend": False}
DASH: Final = "–"  # noqa: RUF001 # in a table, where there is nothing


def lay_out(figure: go.Figure, title: str, height: int, **layout: Any) -> None:
    """Give a figure the look of all reports; base.html writes its legend below it.

    A legend entry stands below the heading ``legendgrouptitle_text`` of its trace.  The text alternative is that of
    themes.alternative, or ``meta={"alternative": text}``.
    """
    figure.layout.template = TEMPLATE  # an update would merge it with plotly's own
    figure.update_layout(**LAYOUT)
    head: dict[str, Any] = {"title_text": title} if title else {"margin_t": 10}
    figure.update_layout(height=height, **head, **layout)


def write_page(
    out: Path, template: str, figures: Mapping[str, go.Figure], filters: Mapping[str, Callable[..., str]], **data: Any
) -> None:
    """Write the page of ``template``, like ``campaign.html``, which extends base.html of this folder.

    figures : drawn into the elements with their names as id
    data : names in the template; a missing name is an error

    BadInput or RigError: the file cannot be written.
    """
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_template),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "percent": percent, "rate": rate, "cell": cell, **filters}
    drawn = {name: _plain(figure) for name, figure in figures.items()}
    text = json.dumps(drawn, allow_nan=False).replace("<", "\\u003c")  # nothing in it can end the script element
    about = {"plotly": get_plotlyjs(), "versions": versions(), "palette": CSS, "dark_palette": DARK_CSS, "dark": DARK}
    write_text(out, environment.get_template(template).render(figures=text, **about, **data))


def _plain(figure: go.Figure) -> dict[str, Any]:
    """Return a figure as plain data, with its text alternative."""
    found: dict[str, Any] = json.loads(figure.to_json() or "null")
    about = found["layout"].setdefault("meta", {})
    about.setdefault("alternative", alternative(found))
    return found


def _template(name: str) -> str:
    """Return the text of a template of this folder.  RigError: the file is missing, or cannot be read."""
    path = Path(__file__).with_name(name)
    with reported(path, what=NOT_WHOLE):
        return path.read_text(encoding="utf-8")


def percent(value: float | None) -> str:
    """Return a share in per cent, with three digits."""
    return DASH if value is None else f"{100 * value:.3g} %"


def rate(share: Mapping[str, Any]) -> str:
    """Return a share with its interval; ``share`` has value, low and high."""
    if share["value"] is None:
        return DASH
    return f"{percent(share['value'])} ({percent(share['low'])} to {percent(share['high'])})"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with ``digits`` digits; a dash for None."""
    return DASH if value is None else f"{value:.{digits}g}"


def cell(row: Any, column: Column) -> str:
    """Return what a column shows of a row."""
    value = column.of(row)
    return DASH if value is None and column.format else column.text(value, _WORDS)


_WORDS: Final[dict[str, Callable[[Any], str]]] = {
    SHARE: rate,
    COUNT: rate,
    RATE: lambda rate: f"{number(rate['value'])} ({number(rate['low'])} to {number(rate['high'])})",
    SECONDS: number,
    INSTANT: lambda value: number(value, 4),
    PLAIN: str,
}
