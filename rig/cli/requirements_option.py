"""Requirements on the command line: their option, and how verdicts are printed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final

from typer import Option

from rig.cli import complete
from rig.cli.printing import MOST_LINES, field, line, table

if TYPE_CHECKING:
    from rig.scenario.scenario import Scenario
    from rig.verdict.requirements import Requirement, Verdict

Requirements = Annotated[
    list[str] | None,
    Option(
        "--requirements",
        metavar="NAME|FILE",
        help="Requirements to measure: a bundled set or a file; repeatable.",
        autocompletion=complete.requirements,
    ),
]
Strict = Annotated[bool, Option("--strict", help="Exit code 1 where a requirement is violated.")]
_STYLES: Final = {"met": "green", "violated": "red", "not applicable": ""}


def show_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print verdicts, the violated ones first."""
    if not verdicts:
        return
    from rig.verdict.score_tables import VERDICTS, violated_first

    line(("requirements", "bold"))
    table(violated_first(verdicts), VERDICTS, MOST_LINES, lambda verdict: _STYLES[verdict.status])


def show_notes(requirements: Sequence[Requirement], scenario: Scenario) -> None:
    """Print which comparisons of the requirements are decided before a flight of the scenario."""
    from rig.verdict.requirements.settled_comparisons import notes

    for note in notes(requirements, scenario):
        field("note", note, style="yellow")
