"""An FMEA as a file: CSV for a spreadsheet, or one HTML page with the look of all reports."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rig.core.errors import BadInput
from rig.core.files import write_text
from rig.show.pages.page import write_page
from rig.studies.safety.fmea import NOT_FLOWN, Line

GROUPS: Final = {  # columns of the page, each with some of a line's texts under each other
    "item and mode": ("id", "item", "function", "mode"),
    "cause and rate": ("cause", "rate", "source", "phase", "exposure"),
    "effects": ("local_effect", "next_effect", "end_effect", "severity"),
    "detection": ("detection", "time_to_detection", "latent_share", "compensating_provision"),
    "flights": ("flights", "not_kept", "worst_flight", "remarks"),
}
ENDINGS: Final = (".csv", ".html", ".htm")


def require_ending(out: Path) -> None:
    """Raise BadInput unless the name says whether a table or a page is wanted."""
    if out.suffix.lower() not in ENDINGS:
        raise BadInput(f"--out {out}: its name must end with .csv or .html")


def write(lines: Sequence[Line], out: Path) -> None:
    """Write the lines.  BadInput or RigError: the file cannot be written."""
    if out.suffix.lower() != ".csv":
        write_page(
            out, "fmea.html", {}, {}, lines=[line.as_dict() for line in lines], shown=shown(lines), groups=groups()
        )
        return
    text = io.StringIO()
    writer = csv.DictWriter(text, list(titles()), lineterminator="\n")
    writer.writeheader()
    writer.writerows(line.as_dict() for line in lines)
    write_text(out, text.getvalue())


def titles() -> dict[str, str]:
    """Return the titles of the columns, by their names."""
    return {name: name.replace("_", " ") for name in Line.__dataclass_fields__}


def groups() -> dict[str, dict[str, str]]:
    """Return the titles of a line's texts by their names, in the columns of the page."""
    every = titles()
    return {title: {name: every[name] for name in names} for title, names in GROUPS.items()}


def shown(lines: Sequence[Line]) -> str:
    """Return how many of the lines rest on flights."""
    flown = sum(line.flights != "0" for line in lines)
    share = 100 * flown / max(len(lines), 1)
    return f"{flown} of {len(lines)} lines are flown ({share:.0f} %), the others say {NOT_FLOWN!r}"
