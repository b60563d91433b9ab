"""The report: one HTML file that opens without a network, the assumptions at its top."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import plotly.graph_objects as go

from rig.reliability.plot import TITLES, picture
from rig.reliability.result import TARGETS, WHAT, Result
from rig.reliability.words import decided_by, interval
from rig.report.page import render
from rig.util.files import write_text


def write_report(found: Sequence[Result], assumptions: Sequence[str], path: Path) -> None:
    """Write the page of ``found``, which has a result at least.  BadInput or RigError: the file cannot be written."""
    pictures = _pictures(found)
    text = render(
        "reliability/report.html",
        pictures,
        {"interval": interval, "decided_by": decided_by},
        signal=found[0].signal,
        found=found,
        titles={name: title for name, title in TITLES.items() if any(name in one.estimates for one in found)},
        targets=TARGETS,
        assumptions=assumptions,
        pictures=list(pictures),
    )
    write_text(path, text)


def _pictures(found: Sequence[Result]) -> dict[str, go.Figure]:
    """Draw every picture: an outcome at one rate and share of common mode."""
    sweep = dict.fromkeys((one.case.per_hour, one.case.beta) for one in found)
    shown = [what for what in WHAT if any(what in one.estimates for one in found)]
    figures = (picture(found, what, *pair) for pair in sweep for what in shown)
    return {f"picture-{i}": figure for i, figure in enumerate(figures)}
