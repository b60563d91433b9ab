"""A tree beside its chain: both probabilities by flight time, the accuracy of the tree, and the files of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rig.core.column import Column
from rig.core.files import write_text
from rig.studies.safety.fault_tree import FaultTree, cut_sets, direct_sum, open_psa, probability
from rig.studies.safety.signal_chain import Transitions, chain_file, lost
from rig.studies.safety.tree_picture import picture

EXACT: Final = 1e-4  # of the chain: a tree that differs by less is called exact
AT: Final = (
    *(Column("hours", format="g"), Column("tree", format=".6g"), Column("chain", format=".6g")),
    Column("tree differs", lambda at: f"{100 * at.differs:+.4f} %"),
    Column(
        "direct sum of the sets", lambda at: f"{at.direct_sum:.6g} ({100 * at.sum_differs:+.2f} %)", worth=7, page=None
    ),
    Column("direct sum", format=".6g", worth=0),
)


@dataclass(frozen=True, slots=True)
class AtHours:
    """The probability of the loss after ``hours``; differences are relative to the chain, the sum's to the tree."""

    hours: float
    tree: float
    chain: float
    differs: float
    direct_sum: float
    sum_differs: float


@dataclass(frozen=True, slots=True)
class TreeResult:
    """A tree and the same model as a chain."""

    tree: FaultTree
    chain: Transitions
    cut_sets: int
    at: tuple[AtHours, ...]
    not_correct: Mapping[str, float]

    @property
    def static(self) -> str:
        """Return "exact", "upper bound" (at all times) or "approximate"."""
        if all(abs(each.differs) <= EXACT for each in self.at):
            return "exact"
        return "upper bound" if all(each.differs >= -EXACT for each in self.at) else "approximate"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, by hours as text."""
        by_hours = {
            name: {f"{each.hours:g}": getattr(each, name) for each in self.at}
            for name in ("tree", "chain", "differs", "direct_sum")
        }
        return {**by_hours, "static": self.static, "cut_sets": self.cut_sets, "not_correct": dict(self.not_correct)}


def solve(tree: FaultTree, chain: Transitions, hours: Sequence[float], not_correct: Mapping[str, float]) -> TreeResult:
    """Return both probabilities at all ``hours``."""
    sets = cut_sets(tree)
    at = [_at(each, probability(tree, each), lost(chain, each), direct_sum(tree, sets, each)) for each in hours]
    return TreeResult(tree, chain, len(sets), tuple(at), not_correct)


def _at(hours: float, of_tree: float, of_chain: float, of_sum: float) -> AtHours:
    differs = of_tree / of_chain - 1.0 if of_chain > 0.0 else 0.0
    sum_differs = of_sum / of_tree - 1.0 if of_tree > 0.0 else 0.0
    return AtHours(hours, of_tree, of_chain, differs, of_sum, sum_differs)


def write(result: TreeResult, out: Path, chain: Path | None, svg: Path | None) -> None:
    """Write the tree, the chain at the first time, and the picture.  BadInput or RigError: a file cannot be written."""
    write_text(out, open_psa(result.tree))
    if chain is not None:
        write_text(chain, chain_file(result.chain, result.at[0].hours, result.tree.name))
    if svg is not None:
        write_text(svg, picture(result.tree, result.at[0].hours))
