"""Requirements on the command line: their option, and how verdicts are printed."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, Final

from rig.cli import complete
from rig.cli.common import flag, opt
from rig.cli.printing import MOST_LINES, Column, field, line, table
from rig.core.units.quantities import quantity

if TYPE_CHECKING:
    from rig.scenario.scenario import Scenario
    from rig.verdict.requirements import Requirement, Verdict

FEW: Final = 4  # quantities of a line
Requirements = Annotated[
    list[str] | None,
    opt(
        "NAME|FILE",
        "Requirements to measure: a bundled set or a file; repeatable.",
        "--requirements",
        autocompletion=complete.requirements,
    ),
]
Strict = Annotated[bool, flag("--strict", "Exit code 1 where a requirement is violated.")]
_STYLES: Final = {"met": "green", "violated": "red", "not applicable": ""}
_COLUMNS: Final = (
    *(Column("requirement", 1), Column("on", 2, worth=3), Column("verdict", 0)),
    *(Column("margin", 3), Column("at", 4, worth=4), Column("there", 5, worth=1)),
)


def show_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print verdicts, the violated ones first."""
    if not verdicts:
        return
    line(("requirements", "bold"))
    order = ("violated", "met", "not applicable")
    listed = sorted(verdicts, key=lambda verdict: order.index(verdict.status))
    table([_row(verdict) for verdict in listed], _COLUMNS, MOST_LINES, lambda row: _STYLES[row[0]])


def show_notes(requirements: Sequence[Requirement], scenario: Scenario) -> None:
    """Print which comparisons of the requirements are decided before a flight of the scenario."""
    from rig.verdict.requirements.settled_comparisons import notes

    for note in notes(requirements, scenario):
        field("note", note, style="yellow")


def _row(verdict: Verdict) -> tuple[Any, ...]:
    from rig.verdict.requirements import margin_text

    if not isfinite(verdict.margin):
        return (verdict.status, verdict.requirement, verdict.signal, "", "", "")
    there = [f"{name} {quantity(value, unit)}" for name, (value, unit) in verdict.values.items()]
    more = ["..."] if len(there) > FEW else []
    return (
        *(
            verdict.status,
            verdict.requirement,
            verdict.signal,
            margin_text(verdict.margin),
            f"{verdict.instant_s:.2f} s",
        ),
        ", ".join([*there[:FEW], *more]),
    )
