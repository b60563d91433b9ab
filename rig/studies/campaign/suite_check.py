"""Check a suite: fly or read every case, measure its requirements, compare its decisions with the reference.

The results are also written as JUnit XML for continuous integration.
"""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple
from xml.etree import ElementTree as Xml

from rig.core.errors import BadInput, RigError
from rig.core.event import Event
from rig.core.files import write_text
from rig.core.text import plain
from rig.core.units.quantities import quantity, seconds
from rig.flight.events import NOT_EXECUTED
from rig.flight.fly import managed
from rig.log import LogFile
from rig.scenario.overrides import override_texts
from rig.scenario.scenario import load
from rig.studies.campaign import campaign_file as config
from rig.studies.campaign.flying import fly
from rig.studies.campaign.plan import Plan, rig_identity
from rig.studies.campaign.suite import Case, Suite
from rig.studies.campaign.worker import Orders, flown_with, fly_run
from rig.unit.unit_file import Unit
from rig.verdict.requirements.measure import check_log, check_rows
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.requirement_recorder import Verdict
from rig.verdict.requirements.robustness import number_of, robustness_text

Result = Literal["met", "violated", "not applicable", "equal", "differs", "no reference", "failed", "did not act"]
GOOD: Final = ("met", "not applicable", "equal", "no reference")
DECISIONS: Final = "decisions"
FAULTS: Final = "faults"
_TOLD: Final = 3  # faults of a case that were not executed, by name
TIMEOUT_S: Final = 300.0  # of one flight of a campaign
# Names of the events that are decisions: which channel was isolated, when, by which rule.
_DECIDED: Final = ("channel failed", "actuator channel failed", "shut-off valve", "lane failed")


class Checked(NamedTuple):
    """One test: a requirement of a case on one signal, the decisions of a case, or a fault that did not act."""

    case: str
    id: str  # of the requirement; DECISIONS, FAULTS
    signal: str
    result: Result
    robustness: float | None
    text: str  # the reason
    command: str  # that shows the same

    @property
    def good(self) -> bool:
        """Return True if a suite passes with this test."""
        return self.result in GOOD


@dataclass(frozen=True, slots=True)
class CaseResult:
    """The tests of a case, its decisions, and its duration."""

    name: str
    tests: list[Checked]
    decisions: list[str] | None  # None: it was not flown to its end
    seconds: float


class _Outcome(NamedTuple):
    verdicts: list[tuple[Verdict, str]]  # and where: "", or the run of a campaign
    decisions: list[str]
    idle: list[str]  # faults that were not executed, and why


def check(suite: Suite, unit: Unit | None, tell: Callable[[str], None] = lambda _: None) -> Iterator[CaseResult]:
    """Yield the result of each case of a suite, in order; tell : called with the name of each case when it begins.

    unit : under test, which flies scenarios and campaigns
    BadInput: a case cannot be flown or read.
    """
    reference = suite.decisions()
    for case in suite.cases:
        tell(case.called)
        began, requirements = time.perf_counter(), suite.requirements[case.called]
        command = _command(case, suite.names_of(case), unit)
        try:
            outcome = _measured(case, requirements, unit)
            if unit is not None:
                unit.require_unchanged()
        except BadInput as error:
            raise BadInput(f"{suite.path}: {case.called}: {error}") from None
        except RigError as error:
            failed = Checked(case.called, DECISIONS, "", "failed", None, str(error), command)
            yield CaseResult(case.called, [failed], None, time.perf_counter() - began)
            continue
        tests = [_checked(case.called, verdict, where, command) for verdict, where in outcome.verdicts]
        tests += _acted(case, outcome.idle, command)
        tests.append(_compared(case.called, outcome.decisions, reference, command))
        yield CaseResult(case.called, tests, outcome.decisions, time.perf_counter() - began)


def _measured(case: Case, requirements: tuple[Requirement, ...], unit: Unit | None) -> _Outcome:
    if case.kind == "log":
        return _of_log(case.path, requirements)
    if case.kind == "campaign":
        return _of_campaign(case, requirements, unit)
    scenario = load(case.path, case.set, case.seed)
    if unit is not None and unit.is_manager:
        scenario, unit = managed(scenario, unit), None
    with flown_with(unit) as tested:
        flight = fly(scenario, tested)
        verdicts = check_rows(flight.table.rows, flight.scenario, requirements, None, tested)
    events = [*flight.events, *flight.ended]
    return _Outcome([(verdict, "") for verdict in verdicts], _decided(events, scenario.rate_hz), _idle(events))


def _of_log(path: Path, requirements: tuple[Requirement, ...]) -> _Outcome:
    log = LogFile.open(path)
    verdicts = check_log(path, requirements)
    return _Outcome([(verdict, "") for verdict in verdicts], _decided(log.events, log.rate_hz), _idle(log.events))


def _decided(events: list[Event], rate_hz: float) -> list[str]:
    """Return the decisions among events: time, channel and rule."""
    return [f"{seconds(event.frame, rate_hz)} {event.text}" for event in events if event.name in _DECIDED]


def _idle(events: list[Event]) -> list[str]:
    """Return the faults that did not act, with the reasons."""
    return [event.text for event in events if event.name == NOT_EXECUTED]


def _of_campaign(case: Case, requirements: tuple[Requirement, ...], unit: Unit | None) -> _Outcome:
    """Fly the runs of a campaign; for each requirement the run with the least robustness counts."""
    plan = Plan(config.read(case.path, case.set), str(case.path))
    plan.check()
    build = "" if unit is None else unit.build()
    asked = (
        *requirements,
        *(each for each in plan.requirements if each.id not in {requirement.id for requirement in requirements}),
    )
    orders = Orders("none", len(plan), "", TIMEOUT_S, plan.campaign.baseline, rig_identity(), unit, build, asked)
    least: dict[tuple[str, str], tuple[Verdict, str]] = {}
    decided: list[str] = []
    idle: list[str] = []
    for number in range(plan.count(case.runs)):
        rows = fly_run(plan[number], orders)
        row = rows["runs"][0]
        if row["outcome"] != "flown":
            raise RigError(f"run {number}: {row['outcome']}: {row['reason']}")
        for fields in json.loads(row["requirements"]) if asked else ():
            verdict = _told(fields)
            key = verdict.requirement, verdict.signal
            if key not in least or _before(verdict, least[key][0]):
                least[key] = verdict, f"run {number}"
        decided += _decided_in(number, rows)
        idle += _idle_in(number, rows)
    return _Outcome(list(least.values()), decided, idle)


def _told(fields: dict[str, Any]) -> Verdict:
    robustness, at_s = (float("nan") if fields[key] is None else fields[key] for key in ("robustness", "instant_s"))
    return Verdict(fields["requirement"], fields["signal"], fields["status"], robustness, at_s, {})


def _before(one: Verdict, other: Verdict) -> bool:
    """Return True if ``one`` counts before ``other``: less robustness first, none last."""
    if not isfinite(one.robustness):
        return False
    return not isfinite(other.robustness) or (one.robustness, one.status == "met") < (
        other.robustness,
        other.status == "met",
    )


def _decided_in(number: int, rows: dict[str, list[dict[str, Any]]]) -> list[str]:
    """Return the decisions of a run: isolated channels, faulty and healthy."""
    failed = [(each["failed_s"], each) for each in rows["faults"] if each["failed_s"] is not None]
    failed += [(each["time_s"], each) for each in rows["alarms"]]
    named = [(at_s, f"{each['signal']}.{each['channel']} isolated by {each['decided_by']}") for at_s, each in failed]
    return [f"run {number}: {at_s:.3f} s {text}" for at_s, text in sorted(named)]


def _idle_in(number: int, rows: dict[str, list[dict[str, Any]]]) -> list[str]:
    """Return the faults of a run that did not act on any of their channels."""
    acted = {each["fault"] for each in rows["faults"] if each["outcome"] != "not executed"}
    idle = {each["fault"]: each["id"] for each in rows["faults"] if each["fault"] not in acted}
    return [f"run {number}: {name}" for name in idle.values()]


def _acted(case: Case, idle: list[str], command: str) -> list[Checked]:
    """Return the test of a case in which a fault did not act: a flight without its fault proves nothing."""
    if not idle:
        return []
    more = f" and {len(idle) - _TOLD} more" if len(idle) > _TOLD else ""
    text = f"fault without effect: {'; '.join(idle[:_TOLD])}{more}"
    if case.may_not_act:
        return [Checked(case.called, FAULTS, "", "not applicable", None, f"{text}; permitted by may_not_act", command)]
    return [Checked(case.called, FAULTS, "", "did not act", None, f"{text}; may_not_act = true permits it", command)]


def _checked(case: str, verdict: Verdict, where: str, command: str) -> Checked:
    """Return the test of one verdict."""
    if not isfinite(verdict.robustness):
        return Checked(case, verdict.requirement, verdict.signal, "not applicable", None, "", command)
    there = ", ".join(f"{name} {quantity(value, unit)}" for name, (value, unit) in verdict.values.items())
    when = f"at {verdict.instant_s:.3f} s{f' of {where}' if where else ''}"
    shown = robustness_text(verdict.robustness)
    text = f"{f'robustness {shown} ' if shown else ''}{when}{f': {there}' if there else ''}"
    robustness = number_of(verdict.robustness)
    return Checked(case, verdict.requirement, verdict.signal, verdict.status, robustness, text, command)


def _compared(case: str, decided: list[str], reference: dict[str, list[str]] | None, command: str) -> Checked:
    """Return the test of the decisions of a case."""
    if reference is None:
        return Checked(case, DECISIONS, "", "no reference", None, "no reference; --update writes it", command)
    if case not in reference:
        return Checked(case, DECISIONS, "", "differs", None, "not in the reference; --update writes it", command)
    moved = difference(reference[case], decided)
    text = "; ".join(moved) if moved else f"{len(decided)} decisions"
    return Checked(case, DECISIONS, "", "differs" if moved else "equal", None, text, command)


def difference(before: list[str], after: list[str]) -> list[str]:
    """Return the missing decisions, ``-``, and the new decisions, ``+``."""
    gone, new = ([line for line in one if line not in other] for one, other in ((before, after), (after, before)))
    return [*(f"- {line}" for line in gone), *(f"+ {line}" for line in new)]


def _command(case: Case, names: list[str], unit: Unit | None) -> str:
    """Return the command that flies or reads a case again."""
    asked = [word for name in names for word in ("--requirements", name)]
    sets = [word for text in override_texts(case.set) for word in ("--set", text)]
    with_unit = [] if unit is None else ["--unit", unit.unit_file]
    if case.kind == "log":
        words = ["rig", "score", str(case.path), *asked]
    elif case.kind == "campaign":
        runs = [] if case.runs is None else ["--runs", str(case.runs)]
        words = ["rig", "campaign", "run", str(case.path), "--out", "DIR", *sets, *runs, *with_unit]
    else:
        seed = [] if case.seed is None else ["--seed", str(case.seed)]
        words = ["rig", "fly", str(case.path), *sets, *seed, *with_unit, *asked]
    return shlex.join(words)


def write_junit(path: Path, title: str, results: Sequence[CaseResult]) -> None:
    """Write one <testsuite> for each case and one <testcase> for each requirement and for the decisions."""
    counts = _counts([checked for each in results for checked in each.tests])
    root = Xml.Element("testsuites", {"name": plain(title), **counts})
    root.set("time", f"{sum(each.seconds for each in results):.3f}")
    for each in results:
        attributes = {"name": plain(each.name), "time": f"{each.seconds:.3f}", **_counts(each.tests)}
        suite = Xml.SubElement(root, "testsuite", attributes)
        for checked in each.tests:
            _test(suite, checked, each.seconds / len(each.tests))
    Xml.indent(root)
    write_text(path, Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n")


def _counts(tests: Sequence[Checked]) -> dict[str, str]:
    failed = sum(not checked.good and checked.result != "failed" for checked in tests)
    errors = sum(checked.result == "failed" for checked in tests)
    skipped = sum(_is_skipped(checked) for checked in tests)
    return {"tests": str(len(tests)), "failures": str(failed), "errors": str(errors), "skipped": str(skipped)}


def _is_skipped(checked: Checked) -> bool:
    return checked.result in ("not applicable", "no reference")


def _test(suite: Xml.Element, checked: Checked, seconds: float) -> None:
    """Add a <testcase>: id and signal, the robustness as a property, the command as its output."""
    named = f"{checked.id} {checked.signal}".rstrip()
    test = Xml.SubElement(suite, "testcase", name=plain(named), classname=plain(checked.case), time=f"{seconds:.3f}")
    properties = Xml.SubElement(test, "properties")
    Xml.SubElement(properties, "property", name="id", value=plain(checked.id))
    if checked.robustness is not None:
        Xml.SubElement(properties, "property", name="robustness", value=repr(checked.robustness))
    Xml.SubElement(properties, "property", name="command", value=plain(checked.command))
    if _is_skipped(checked):
        Xml.SubElement(test, "skipped", message=plain(checked.text or checked.result))
    elif not checked.good:
        kind = "error" if checked.result == "failed" else "failure"
        Xml.SubElement(test, kind, message=plain(f"{named}: {checked.text}"), type=checked.result)
    Xml.SubElement(test, "system-out").text = plain(checked.command)
