"""Requirements on the command line: the options, and printing of the verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final

from rig.cli import complete
from rig.cli.common import flag, opt
from rig.cli.printing import MOST_LINES, field, line, table

if TYPE_CHECKING:
    from rig.scenario.scenario import Scenario
    from rig.verdict.requirements.requirement import Requirement
    from rig.verdict.requirements.requirement_recorder import Verdict

Requirements = Annotated[
    list[str] | None,
    opt(
        "NAME|FILE",
        "Requirements to measure: bundled set or file. Repeatable.",
        "--requirements",
        autocompletion=complete.requirements,
    ),
]
Strict = Annotated[bool, flag("--strict", "Exit with code 1 if a requirement is violated.")]
_STYLES: Final = {"met": "green", "violated": "red", "not applicable": ""}


def show_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print verdicts, the violated ones first."""
    if not verdicts:
        return
    from rig.verdict.score_tables import VERDICTS, violated_first

    line(("requirements", "bold"))
    table(violated_first(verdicts), VERDICTS, MOST_LINES, lambda verdict: _STYLES[verdict.status])


def show_notes(requirements: Sequence[Requirement], scenario: Scenario) -> None:
    """Print the comparisons of the requirements that the scenario decides before the flight."""
    from rig.verdict.requirements.settled_comparisons import notes

    for note in notes(requirements, scenario):
        field("note", note, style="yellow")
