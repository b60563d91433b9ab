"""The three figures of the study, as in the paper and from the complete experiment: one page, one picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import plotly.graph_objects as go
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rig.core.files import replaced, reported
from rig.core.outputs import require_apart
from rig.core.palette import BLUE, GREEN, INK, TRUTH, VIOLET
from rig.show.pages.page import lay_out, write_page
from rig.studies.papers.ding2015 import FAULT_S, Matrix, Study

_TITLES: Final = (
    "Attitude: pitch angle",
    "Control: elevator, from that of the reference (linear model without stops)",
    "Tracking: the output that the loop brings to 1",
)
_UNITS: Final = ("share of a unit step", "rad per rad of step", "share of a unit step")
_HEAD: Final = "Ding, Xiao and Jiang (2015): as printed, and with the dropped term of the fault (F = 0.5 from 5 s)"
_LEGENDS: Final = ((1.0, 0.87), (1.0, 1.0), (1.0, 0.38))  # upper right corner, share of the panel


@dataclass(frozen=True)
class _Line:
    name: str
    x: Matrix
    y: Matrix
    colour: str
    width: float = 2.0
    dash: bool = False
    legend: bool = True


def _panels(study: Study) -> list[list[_Line]]:
    """Return the lines of the three figures, from bottom to top."""
    paper, complete, truth = study.error_system, study.complete, study.with_truth
    t, one = paper.time_s, np.ones_like(paper.time_s)
    off = "the paper's error system, A, B, C off by 10 %"
    attitude = [_Line(off, t, run.pitch, TRUTH, 0.7, legend=i == 0) for i, run in enumerate(study.perturbed)]
    control = [_Line(off, t, run.elevator, TRUTH, 0.7, legend=False) for run in study.perturbed]
    return [
        [
            *attitude,
            _Line("the paper's error system", t, paper.pitch, BLUE),
            _Line("complete: true", t, complete.pitch, GREEN),
            _Line("complete: measured", t, complete.followed, VIOLET, dash=True),
            _Line("complete: true, with the true state given to the law", t, truth.pitch, INK, 1.2),
        ],
        [
            *control,
            _Line("the paper's error system", t, paper.elevator, BLUE),
            _Line("complete", t, complete.elevator, GREEN),
        ],
        [
            _Line("command, y_r", t, one, INK, 1.0, dash=True),
            _Line("the paper's error system: estimated", t, paper.followed, BLUE),
            _Line("complete: measured", t, complete.followed, VIOLET),
        ],
    ]


def write(study: Study, folder: Path) -> list[Path]:
    """Write ding2015.html (needs no network) and ding2015.png in the existing ``folder``; RigError: a write fails."""
    page, picture = folder / "ding2015.html", folder / "ding2015.png"
    require_apart({page.name: page, picture.name: picture})
    refused = reported(folder, what="the figures cannot be written")
    figures = dict(_figures(study))
    write_page(page, "ding2015.html", figures, {}, title=_HEAD, pictures=list(figures))
    with replaced(picture) as of_picture, refused:
        _picture(study).savefig(of_picture, dpi=110, format="png")
    return [page, picture]


def _figures(study: Study) -> Iterator[tuple[str, go.Figure]]:
    """Yield the three figures of the page by their titles."""
    for title, lines, unit in zip(_TITLES, _panels(study), _UNITS, strict=True):
        figure = go.Figure()
        for line in lines:
            style = {"color": line.colour, "width": line.width, "dash": "dash" if line.dash else "solid"}
            figure.add_scatter(x=line.x, y=line.y, mode="lines", name=line.name, line=style, showlegend=line.legend)
        figure.add_vline(x=FAULT_S, line={"color": TRUTH, "dash": "dot"})
        names = ", ".join(dict.fromkeys(line.name for line in lines))
        lay_out(figure, "", 320, meta={"alternative": f"{title}; {unit} over time, s: {names}"})
        figure.update_xaxes(title_text="time, s")
        figure.update_yaxes(title_text=unit)
        yield title, figure


def _picture(study: Study) -> Figure:
    figure = Figure(figsize=(10.0, 11.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 1, sharex=True)
    for axis, lines, unit, title, corner in zip(axes, _panels(study), _UNITS, _TITLES, _LEGENDS, strict=True):
        for line in lines:
            label, style = line.name if line.legend else None, "--" if line.dash else "-"
            axis.plot(line.x, line.y, style, color=line.colour, linewidth=0.8 * line.width, label=label)
        axis.axvline(FAULT_S, color=TRUTH, linestyle=":")
        axis.set(title=title, ylabel=unit)
        axis.grid(alpha=0.25)
        axis.legend(loc="upper right", bbox_to_anchor=corner, fontsize="small")
    axes[-1].set(xlabel="time, s", xlim=(0.0, study.complete.time_s[-1]))
    figure.suptitle(_HEAD)
    return figure
