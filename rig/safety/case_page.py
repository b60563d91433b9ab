"""The safety case as one HTML page: sets, tree beside chain, FMEA, and how the sets were flown again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rig.errors import BadInput
from rig.report.page import write_page
from rig.safety.confirm import read_rows, read_sets
from rig.safety.cutset_plan import read_asked
from rig.safety.fmea import Line
from rig.safety.fmea_file import groups, shown
from rig.safety.tree_picture import picture
from rig.safety.tree_result import TreeResult


def write_case(
    sets: Path, signal: str, tree: TreeResult, lines: Sequence[Line], assumptions: Sequence[str], out: Path
) -> None:
    """Write the page.

    sets : a folder of cut sets of ``signal``, confirmed or not; BadInput where it is of another, or not whole
    """
    asked = read_asked(sets)
    if asked.signal != signal:
        raise BadInput(f"{sets}: cut sets of {asked.signal}, the tree is of {signal}")
    found, again = read_sets(sets), read_rows(sets)
    flown = ", ".join(
        f"{name}: {of['flights']} flights of {of['sequences']} sequences" for name, of in found["flown"].items()
    )
    write_page(
        out,
        "safety.html",
        {},
        {},
        signal=f"{signal}, {asked.aircraft}",
        assumptions=assumptions,
        flown=flown,
        sets=found["sets"],
        tree=tree,
        picture=picture(tree.tree, tree.at[0].hours),
        lines=[line.as_dict() for line in lines],
        groups=groups(),
        shown=shown(lines),
        rows=again,
    )
