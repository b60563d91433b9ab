"""The two settings of a page, light and dark, and what a screen reader reads of a figure.

A figure is drawn in the colours of rig/core/palette.py; base.html replaces them by those of DARK on a dark screen.
Paper is light.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from rig.core import palette as of

CSS: Final = {"ground": of.WHITE, **of.CSS}
DARK: Final = {
    **{of.WHITE: "#12171d", of.INK: "#e6edf3", of.SOFT: "#a3aeb9", of.LINE: "#3d4650", of.QUIET: "#2b333c"},
    **{of.PALE: "#1c232b", of.UNUSED: "#56606b", of.TRUTH: "#8a949e"},
    **{of.BLUE: "#5cb4e9", of.GREEN: "#3cbe6e", of.VIOLET: "#a58cff", of.BROWN: "#be8755", of.TEAL: "#4cc4ba"},
    **{of.MAGENTA: "#f050b4", of.SERIES[-1]: "#b0b0b0", of.RED: "#f0695f", of.ORANGE: "#f0a040", of.YELLOW: "#e3b341"},
    **{of.MID_BLUE: "#3f86b3", of.LIGHT_BLUE: "#24506b", of.PALE_BLUE: "#24435c", of.PALE_RED: "#5f332e"},
}
DARK_CSS: Final = {name: DARK[colour] for name, colour in CSS.items()}
_AXIS: Final[dict[str, Any]] = {
    "automargin": True,
    "gridcolor": of.LINE,
    "zerolinecolor": of.LINE,
    "zerolinewidth": 1,
    "ticks": "",
    "title": {"standoff": 12, "font": {"size": 13}},
}
_CLEAR: Final = "rgba(0, 0, 0, 0)"
TEMPLATE: Final[dict[str, Any]] = {
    "layout": {
        "paper_bgcolor": _CLEAR,
        "plot_bgcolor": _CLEAR,
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": of.INK},
        "title": {"font": {"size": 15}, "x": 0.01},
        "hovermode": "closest",
        "xaxis": _AXIS,
        "yaxis": _AXIS,
    },
    "data": {"heatmap": [{"type": "heatmap", "colorbar": {"outlinewidth": 0, "title": {"font": {"size": 13}}}}]},
}


def alternative(figure: Mapping[str, Any]) -> str:
    """Return the text alternative of a figure, given as plain data: title, axes and the names of what is drawn."""
    layout = figure["layout"]
    title = (layout.get("title") or {}).get("text") or "figure"
    axes = list(dict.fromkeys(_axis_titles(layout)))
    names = list(dict.fromkeys(trace["name"] for trace in figure["data"] if trace.get("name")))
    parts = [title, f"axes: {'; '.join(axes)}" if axes else "", f"drawn: {'; '.join(names)}" if names else ""]
    return ". ".join(part for part in parts if part)


def _axis_titles(layout: Mapping[str, Any]) -> Iterator[str]:
    for key, value in layout.items():
        if key.startswith(("xaxis", "yaxis")) and (text := (value.get("title") or {}).get("text")):
            yield text
