"""``rig check``: a suite of scenarios, logs and campaigns against requirements and reference decisions."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Exit

from rig.cli.common import Json, UnitFile, arg, emit, flag, opt
from rig.cli.printing import MOST_LINES, field, line, rest, table
from rig.cli.working import working
from rig.core.column import Column
from rig.core.outputs import require_apart, require_ending
from rig.core.progress import tell

if TYPE_CHECKING:
    from rig.studies.campaign.suite import Suite
    from rig.studies.campaign.suite_check import CaseResult
    from rig.unit.unit_file import Unit

_FAILED = (
    *(Column("case", "case"), Column("test", lambda test: f"{test.id} {test.signal}".rstrip())),
    *(Column("result", "result"), Column("why", "text")),
)


def check(
    suite: Annotated[Path, arg("SUITE", "Suite file, or name of a bundled suite.")],
    unit: UnitFile = None,
    junit: Annotated[Path | None, opt("FILE.xml", "File for the results, JUnit XML.", show_default=False)] = None,
    update: Annotated[
        bool, flag("--update", "Keep the decisions as the new reference, and print what changed.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Check the scenarios, logs and campaigns of a suite against requirements and reference decisions.

    Exit code 0: all requirements are met and no decision changed. Exit code 1: a test failed.
    """
    from rig.studies.campaign.suite import read_suite
    from rig.studies.campaign.suite_check import check as check_suite
    from rig.studies.campaign.suite_check import write_junit
    from rig.unit.unit_file import read_unit

    read = read_suite(suite)
    require_apart({"--junit": junit}, [*read.inputs, unit])
    require_ending("--junit", junit, "JUnit XML", ".xml")
    tested = None if unit is None else read_unit(unit)
    differs = read.of_another_unit(tested)
    with working("starting", not as_json):
        results = list(check_suite(read, tested, lambda name: tell(f"checking {name}")))
    moved = _updated(read, results, tested) if update else {}
    if junit is not None:
        write_junit(junit, read.title, results)
    bad = [test for each in results for test in each.tests if not (test.good or (update and test.result == "differs"))]
    data = lambda: {**_data(read, results, moved), "unit_differs": differs}  # noqa: E731 # read once
    emit(as_json, data, lambda: _show(read, results, moved, update, differs))
    if bad:
        raise Exit(1)


def _updated(suite: Suite, results: list[CaseResult], unit: Unit | None) -> dict[str, list[str]]:
    """Write the reference decisions; return the changed ones, by case."""
    from rig.studies.campaign.suite_check import difference

    before = suite.decisions() or {}
    after = {each.name: before.get(each.name, []) if each.decisions is None else each.decisions for each in results}
    suite.keep(after, unit)
    names = dict.fromkeys([*before, *after])
    changed = {name: difference(before.get(name, []), after.get(name, [])) for name in names}
    return {name: lines for name, lines in changed.items() if lines}


def _data(suite: Suite, results: list[CaseResult], moved: dict[str, list[str]]) -> dict[str, object]:
    tests = [test._asdict() for each in results for test in each.tests]
    return {
        "suite": str(suite.path),
        "cases": len(results),
        "tests": tests,
        "seconds": sum(each.seconds for each in results),
        "moved": moved,
    }


def _show(
    suite: Suite, results: list[CaseResult], moved: dict[str, list[str]], update: bool, differs: list[str]
) -> None:
    tests = [test for each in results for test in each.tests]
    wrong = [test for test in tests if not (test.good or (update and test.result == "differs"))]
    line((suite.title, "bold"), f"  {suite.path}")
    for text in differs:
        line(f"  unit: not as in the reference: {text}", style="yellow")
    table(wrong, _FAILED, MOST_LINES, lambda _: "red")
    for name, lines in moved.items():
        for text in lines[:MOST_LINES]:
            line(f"  {name}: {text}")
        rest(len(lines), MOST_LINES, "  and {} more")
    if update:
        field("kept", f"{suite.decisions_file}: {len(moved)} of {len(results)} cases changed")
    counts = Counter(test.result for test in tests)
    seconds = sum(each.seconds for each in results)
    field("cases", f"{len(results)} in {seconds:.1f} s: {', '.join(f'{n} {result}' for result, n in counts.items())}")
    field("result", ("FAIL", "red") if wrong else ("PASS", "green"), f": {len(tests)} tests, {len(wrong)} failed")
