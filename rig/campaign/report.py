"""The report: one HTML file with everything in it, for a browser without a network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rig.campaign.figures import delay_curves, heat_maps, reply_times
from rig.campaign.folder import Folder
from rig.campaign.magnitudes import magnitude_shown, magnitude_unit
from rig.campaign.summary import acted, summary
from rig.errors import BadInput
from rig.report.page import DASH, render
from rig.util.files import write_text


def report(folder: Folder, out: Path) -> dict[str, Any]:
    """Write the report of a campaign to ``out``; its figures as plain data. BadInput when nothing was flown yet."""
    if folder.tables["runs"].is_empty():
        raise BadInput(f"{folder.path}: no run is done yet, there is nothing to report")
    found = summary(folder)
    maps = {f"map-{i}": figure for i, figure in enumerate(heat_maps(found["by_place"]))}
    delays = {f"delay-{i}": figure for i, figure in enumerate(delay_curves(acted(folder.tables)))}
    replies = {} if found["replies"] is None else {"replies-0": reply_times(found["replies"])}
    figures = {**maps, **delays, **replies}
    filters = {"magnitude": lambda *of: magnitude_shown(*of) or DASH, "magnitude_unit": magnitude_unit}
    html = render("campaign/report.html", figures, filters, found=found, maps=list(maps), delays=list(delays))
    write_text(out, html)
    return found
