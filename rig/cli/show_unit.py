"""What ``rig unit check`` prints for people."""

from __future__ import annotations

from rig.bench.unit_check import Checked
from rig.util.console import console, styled


def checked(found: Checked) -> None:
    """One line a requirement, and the grade."""
    screen = console()
    rows = [(one.part, "passed" if one.passed else "FAILED", one.name, one.detail) for one in found.requirements]
    screen.table(("part", "", "requirement", ""), rows)
    word = (found.grade, "red" if found.grade == "failed" else "green")
    missed = sum(not one.passed for one in found.requirements)
    screen.print(styled(f"{found.unit}: ", word, f", {len(rows)} requirements, {missed} not met"))
