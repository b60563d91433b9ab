"""A plant as the subject of requirements: its columns, and formulas over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isnan
from typing import Any, Final, NamedTuple

import numpy as np

from rig.core.errors import BadInput
from rig.core.text import choices, quoted
from rig.studies.search.plants.plant_call import Columns
from rig.verdict.requirements.formula import COMPARISONS, Formula, Node, read_formula
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.robustness import MOST, Held, decisive, number, refuse_empty_windows, values
from rig.world.faults.grammar import Op, Refused

NOT_DECIDED: Final = MOST  # robustness where nothing was there to decide on
_UNLIKE: Final = 100.0  # times that the sides of two comparisons may differ without a scale


class PlantVerdict(NamedTuple):
    """Verdict on one requirement; robustness and instant as of a flight's."""

    requirement: str
    status: str  # met, violated, not applicable
    robustness: float
    instant_s: float


@dataclass(frozen=True, slots=True)
class Asked:
    """A requirement bound to the columns of a plant."""

    requirement: Requirement
    formula: Formula
    scales: tuple[float, ...]


class PlantSubject:
    """Requirements over the columns of a plant."""

    def __init__(
        self, requirements: Sequence[Requirement], columns: Columns, rate_hz: float, duration_s: float
    ) -> None:
        """Bind them to the columns of a first simulation.  BadInput: a name that is no column, windows too long."""
        self.rate_hz, self.duration_s = rate_hz, duration_s
        self._yes_no = {name: of.dtype.kind == "b" for name, of in columns.items()}
        self.asked = [self._bound(each) for each in requirements]
        self.names = tuple(dict.fromkeys(name for each in self.asked for name in each.formula.names))

    def _bound(self, requirement: Requirement) -> Asked:
        where = f"requirement {requirement.id}: formula"
        try:
            formula = read_formula(
                requirement.formula,
                lambda name: self._yes_no.get(name) is False,
                lambda name: self._yes_no.get(name) is True,
                self._unknown,
                self.duration_s,
            )
            refuse_empty_windows(formula.root, self.rate_hz)
        except Refused as refused:
            raise BadInput(f"{where}: column {refused.column}: {refused}") from None
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None
        if not formula.names:
            raise BadInput(f"{where}: names no column; the plant has {', '.join(sorted(self._yes_no))}")
        given, count = requirement.scale, formula.comparisons
        if isinstance(given, list) and len(given) != count:
            raise BadInput(f"requirement {requirement.id}: scale: {len(given)} values for {count} comparisons")
        scales = tuple(given) if isinstance(given, list) else (given or 1.0,) * count
        return Asked(requirement, formula, scales)

    def _unknown(self, name: str) -> str:
        if self._yes_no.get(name):
            return f"{quoted(name)} is a yes or no, not a number"
        return f"the plant has no column {quoted(name)}, {choices(name, sorted(self._yes_no))}"

    def verdicts(self, columns: Mapping[str, Any]) -> list[PlantVerdict]:
        """Return the verdict on each requirement from columns (n,)."""
        with np.errstate(all="ignore"):
            return [self._verdict(each, columns) for each in self.asked]

    def _held(self, asked: Asked, columns: Mapping[str, Any]) -> Held:
        names = asked.formula.names
        frames = len(next(iter(columns.values())))
        table = np.array([columns[name] for name in names], float).reshape(len(names), frames)
        rows = tuple(np.array([i]) for i in range(len(names)))
        return Held(table, 0, rows, asked.scales, self.rate_hz, frames=frames, seen={})

    def _verdict(self, asked: Asked, columns: Mapping[str, Any]) -> PlantVerdict:
        held = self._held(asked, columns)
        verdict, robustness = values(asked.formula.root, 0, 0, held)[:, 0, 0].tolist()
        if isnan(robustness):
            return PlantVerdict(asked.requirement.id, "not applicable", NOT_DECIDED, 0.0)
        at_s = decisive(asked.formula.root, 0, held) / self.rate_hz
        status = "met" if verdict > 0.0 else "violated"
        return PlantVerdict(asked.requirement.id, status, robustness + 0.0, at_s)

    def unlike(self, columns: Mapping[str, Any]) -> str:
        """Return a warning if comparisons without a scale have sides of very different size; "" if not."""
        sizes = [
            (size, f"{asked.requirement.id}: {_shown(node, asked.formula)}")
            for asked in self.asked
            if asked.requirement.scale is None
            for node, size in self._sizes(asked, columns)
            if 0.0 < size < inf
        ]
        if not sizes or (most := max(sizes))[0] <= _UNLIKE * (least := min(sizes))[0]:
            return ""
        return (
            f"no scale is given, and the sides of {most[1]} are up to {most[0]:.3g}, of {least[1]} {least[0]:.3g}: the "
            "larger ones hide the others; give scale = [...] in the requirement, one value for each comparison"
        )

    def _sizes(self, asked: Asked, columns: Mapping[str, Any]) -> list[tuple[Node, float]]:
        held, nodes = self._held(asked, columns), [n for n in asked.formula.root.walk() if n.op in COMPARISONS]
        last = held.end - 1
        with np.errstate(all="ignore"):
            return [(n, max(float(np.max(np.abs(number(part, 0, last, held)))) for part in n.parts)) for n in nodes]


def _shown(node: Node, formula: Formula) -> str:
    """Return the names in a comparison."""
    return ", ".join(dict.fromkeys(formula.names[each.place] for each in node.walk() if each.op == Op.QUANTITY))
