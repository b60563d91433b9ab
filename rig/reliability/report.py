"""The report: one HTML file that opens without a network, the assumptions at its top."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from plotly.offline import get_plotlyjs

from rig.campaign.report import page
from rig.files import write_text
from rig.reliability.plot import TITLES, picture
from rig.reliability.result import TARGETS, WHAT, Result
from rig.reliability.words import decided_by, interval
from rig.versions import versions


def write_report(found: Sequence[Result], assumptions: Sequence[str], path: Path) -> None:
    """Write the page of ``found``, which has a result at least.  BadInput or RigError: the file cannot be written."""
    template = page("rig.reliability", {"interval": interval, "decided_by": decided_by})
    pictures = _pictures(found)
    text = template.render(
        signal=found[0].signal,
        found=found,
        titles={name: title for name, title in TITLES.items() if any(name in one.estimates for one in found)},
        targets=TARGETS,
        assumptions=assumptions,
        pictures=list(pictures),
        figures=json.dumps(pictures, allow_nan=False).replace("<", "\\u003c"),  # nothing can end the script element
        plotly=get_plotlyjs(),
        versions=versions(),
    )
    write_text(path, text)


def _pictures(found: Sequence[Result]) -> dict[str, object]:
    """Every picture as plain data: an outcome at one rate and share of common mode."""
    sweep = dict.fromkeys((one.case.per_hour, one.case.beta) for one in found)
    shown = [what for what in WHAT if any(what in one.estimates for one in found)]
    figures = (picture(found, what, *pair) for pair in sweep for what in shown)
    return {f"picture-{i}": json.loads(figure.to_json() or "null") for i, figure in enumerate(figures)}
