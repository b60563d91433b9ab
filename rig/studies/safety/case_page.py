"""The safety case as one HTML page: cut sets, fault tree beside the chain, FMEA, and confirmation with new seeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig.core.errors import BadInput
from rig.show.pages.page import write_page
from rig.studies.safety.confirm_sets import CONFIRMED_ROWS, read_rows, read_sets
from rig.studies.safety.cutset_plan import read_asked
from rig.studies.safety.fmea import Row, groups, shown
from rig.studies.safety.tree_picture import picture
from rig.studies.safety.tree_result import AT, TreeResult


class Flown(NamedTuple):
    """The content of a folder of cut sets."""

    of: str  # signal and aircraft
    found: dict[str, Any]
    again: list[dict[str, Any]]  # empty if they were not confirmed


def read_flown(sets: Path, signal: str) -> Flown:
    """Read a folder of cut sets, confirmed or not.  BadInput: it is of another signal, or not complete."""
    asked = read_asked(sets)
    if asked.signal != signal:
        raise BadInput(f"{sets}: has cut sets of {asked.signal}, but the tree is of {signal}")
    return Flown(f"{signal}, {asked.aircraft}", read_sets(sets), read_rows(sets))


def write_case(sets: Flown, tree: TreeResult, lines: Sequence[Row], assumptions: Sequence[str], out: Path) -> None:
    """Write the page of a safety case."""
    flown = ", ".join(
        f"{name}: {of['flights']} flights of {of['sequences']} sequences" for name, of in sets.found["flown"].items()
    )
    write_page(
        out,
        "safety.html",
        {},
        {},
        signal=sets.of,
        assumptions=assumptions,
        flown=flown,
        sets=sets.found["sets"],
        tree=tree,
        picture=picture(tree.tree, tree.at[0].hours),
        lines=lines,
        groups=groups(),
        shown=shown(lines),
        rows=sets.again,
        columns={"at": AT, "again": CONFIRMED_ROWS},
    )
