"""The results of a suite as JUnit XML, which continuous integration reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as Xml

from rig.campaign.check import CaseResult, Checked
from rig.text import plain
from rig.util.files import write_text


def write_junit(path: Path, title: str, results: Sequence[CaseResult]) -> None:
    """Write one <testsuite> for each case and one <testcase> for each requirement and for the decisions."""
    counts = _counts([one for each in results for one in each.tests])
    root = Xml.Element("testsuites", {"name": plain(title), **counts})
    root.set("time", f"{sum(each.seconds for each in results):.3f}")
    for each in results:
        about = {"name": plain(each.name), "time": f"{each.seconds:.3f}", **_counts(each.tests)}
        suite = Xml.SubElement(root, "testsuite", about)
        for one in each.tests:
            _test(suite, one, each.seconds / len(each.tests))
    Xml.indent(root)
    write_text(path, Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n")


def _counts(tests: Sequence[Checked]) -> dict[str, str]:
    failed = sum(not one.good and one.result != "failed" for one in tests)
    errors = sum(one.result == "failed" for one in tests)
    skipped = sum(_is_skipped(one) for one in tests)
    return {"tests": str(len(tests)), "failures": str(failed), "errors": str(errors), "skipped": str(skipped)}


def _is_skipped(one: Checked) -> bool:
    return one.result in ("not applicable", "no reference")


def _test(suite: Xml.Element, one: Checked, seconds: float) -> None:
    """Add a <testcase>: id and signal, the margin as a property, the command as its output."""
    named = f"{one.id} {one.signal}".rstrip()
    test = Xml.SubElement(suite, "testcase", name=plain(named), classname=plain(one.case), time=f"{seconds:.3f}")
    known = Xml.SubElement(test, "properties")
    Xml.SubElement(known, "property", name="id", value=plain(one.id))
    if one.margin is not None:
        Xml.SubElement(known, "property", name="margin", value=repr(one.margin))
    Xml.SubElement(known, "property", name="command", value=plain(one.command))
    if _is_skipped(one):
        Xml.SubElement(test, "skipped", message=plain(one.text or one.result))
    elif not one.good:
        kind = "error" if one.result == "failed" else "failure"
        Xml.SubElement(test, kind, message=plain(f"{named}: {one.text}"), type=one.result)
    Xml.SubElement(test, "system-out").text = plain(one.command)
