"""Requirements: formulas over a flight with windows in time, each with a verdict and a margin.

requirement.py  what a file says of one; bundled sets: faults/requirements/
formula.py      its tree, within bounds, by the grammar of triggers (rig/world/faults/grammar.py)
subject.py      what there is to measure: signals, thresholds, faults, limits; quantity_columns.py: taken out of rows
margins.py      verdict and margin of a tree over frames, by sliding minima; as they are shown
along.py        beside the conclusion of a flight while it is flown; verdicts as plain data
settled_comparisons.py  comparisons that are decided before the flight
requirement_recorder.py  blocks of rows in, verdicts out; measure.py: of flights, logs and rows

docs/margins.md defines every quantity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.verdict.requirements.along import MeasuredConclusion, events, measure_scored, plain, violated
    from rig.verdict.requirements.margins import margin_text, number_of
    from rig.verdict.requirements.measure import check_log, check_rows, fly_requirements, names_twin, recorder_of
    from rig.verdict.requirements.requirement import Requirement, find_requirements, load_requirements
    from rig.verdict.requirements.requirement_recorder import RequirementsRecorder, Verdict
    from rig.verdict.requirements.subject import Subject, of_flight, of_recording

_HOME = {
    **dict.fromkeys(("MeasuredConclusion", "events", "measure_scored", "plain", "violated"), "along"),
    **dict.fromkeys(("check_log", "check_rows", "fly_requirements", "names_twin", "recorder_of"), "measure"),
    **dict.fromkeys(("RequirementsRecorder", "Verdict"), "requirement_recorder"),
    **dict.fromkeys(("margin_text", "number_of"), "margins"),
    **dict.fromkeys(("Requirement", "find_requirements", "load_requirements"), "requirement"),
    **dict.fromkeys(("Subject", "of_flight", "of_recording"), "subject"),
}
__all__ = [
    "MeasuredConclusion",
    "Requirement",
    "RequirementsRecorder",
    "Subject",
    "Verdict",
    "check_log",
    "check_rows",
    "events",
    "find_requirements",
    "fly_requirements",
    "load_requirements",
    "margin_text",
    "measure_scored",
    "names_twin",
    "number_of",
    "of_flight",
    "of_recording",
    "plain",
    "recorder_of",
    "violated",
]


def __getattr__(name: str) -> Any:
    """Import on first use: reading a file of requirements needs no flight."""
    if name not in _HOME:
        raise AttributeError(f"module 'rig.verdict.requirements' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"rig.verdict.requirements.{_HOME[name]}"), name)
