"""Write docs/project/requirements.md: each requirement with the tests that hold it, from the markers in the tests.

    python tests/tools/requirements.py

A test says what it holds, ``@pytest.mark.requirement("redundancy", "one agreeing frame resets the count")``; a whole
file does by ``pytestmark``.  The order is that of the first test of each requirement.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "docs" / "project" / "requirements.md"
PAGES: Final = {
    "redundancy": ("How a decision is made", "explanation/decisions.md"),
    "references": ("References", "explanation/decisions.md"),
    "fault-tolerant": ("The fault-tolerant pitch law", "explanation/fault-tolerant-law.md"),
    "ding2015": ("Ding, Xiao and Jiang (2015), reproduced", "results/incidents-and-worst-cases.md"),
}
HEAD: Final = """# Requirements and tests

Each requirement of a page and the tests that prove it. `make requirements` writes this page from the markers in the
tests; a test compares the two.
"""
Held = dict[str, dict[str, list[str]]]  # page: requirement: tests


def markers(node: ast.expr) -> Iterator[tuple[str, str]]:
    """Page and text of ``pytest.mark.requirement(page, text)``, also within a list."""
    for call in ast.walk(node):
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "pytest.mark.requirement":
            page, text = (ast.literal_eval(argument) for argument in call.args)
            yield page, text


def collect(folder: Path) -> Held:
    """Every requirement of the tests in ``folder``; KeyError for a page that PAGES does not name."""
    held: Held = {page: {} for page in PAGES}
    for path in sorted(folder.glob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                found = ((node.name, marked) for decorator in node.decorator_list for marked in markers(decorator))
            elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark":
                found = ((f"tests/{path.name}", marked) for marked in markers(node.value))
            else:
                continue
            for name, (page, text) in found:
                held[page].setdefault(text, []).append(name)
    return held


def written(held: Held) -> str:
    """The page."""
    parts = [HEAD]
    for page, (title, link) in PAGES.items():
        rows = [f"| {text} | {', '.join(f'`{name}`' for name in names)} |" for text, names in held[page].items()]
        table = "\n".join(["| requirement | test |", "|---|---|", *rows])
        parts.append(f"## {page}\n\nPage: [{title}](../{link}).\n\n{table}\n")
    return "\n".join(parts)


def main() -> int:
    """Write it."""
    PAGE.write_text(written(collect(ROOT / "tests")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
