"""The results of a suite as JUnit XML, which continuous integration reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as Xml

from rig.core.files import write_text
from rig.core.text import plain
from rig.studies.campaign.suite_check import CaseResult, Checked


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
    """Add a <testcase>: id and signal, the margin as a property, the command as its output."""
    named = f"{checked.id} {checked.signal}".rstrip()
    test = Xml.SubElement(suite, "testcase", name=plain(named), classname=plain(checked.case), time=f"{seconds:.3f}")
    properties = Xml.SubElement(test, "properties")
    Xml.SubElement(properties, "property", name="id", value=plain(checked.id))
    if checked.margin is not None:
        Xml.SubElement(properties, "property", name="margin", value=repr(checked.margin))
    Xml.SubElement(properties, "property", name="command", value=plain(checked.command))
    if _is_skipped(checked):
        Xml.SubElement(test, "skipped", message=plain(checked.text or checked.result))
    elif not checked.good:
        kind = "error" if checked.result == "failed" else "failure"
        Xml.SubElement(test, kind, message=plain(f"{named}: {checked.text}"), type=checked.result)
    Xml.SubElement(test, "system-out").text = plain(checked.command)
