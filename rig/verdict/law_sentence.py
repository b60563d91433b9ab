"""What the fault-tolerant law found, in words: which fault, when, and what it flew on from then on."""

from __future__ import annotations

from collections.abc import Iterator

from rig.core.units.quantities import seconds
from rig.verdict.context import Context
from rig.verdict.law_tally import CORRECTED
from rig.verdict.score_records import FaultScore, LawFinding


def law_result(fault: FaultScore, context: Context) -> str:
    """Return what the law did about a fault that it found: ``which flew on its estimate from 30.86 s on``."""
    finding = next(each for each in context.score.law if each.frame == fault.law_frame and fault.signal in each.signals)
    return _did(finding, context)


def _did(finding: LawFinding, context: Context) -> str:
    at = seconds(finding.frame, context.rate_hz)
    if finding.finding != CORRECTED:
        return f"which called a rate biased at {at} and flew on the pitch-angle sensor"
    named = ""
    if finding.named_frame is not None:
        named = f" and named it a fault of {finding.named} at {seconds(finding.named_frame, context.rate_hz)}"
    return f"which flew on its estimate of the pitch angle from {at} on{named}"


def false_findings(context: Context) -> Iterator[str]:
    """Yield a sentence for each finding that no fault was the cause of."""
    for finding in context.score.law:
        if not finding.signals:
            what = "corrected the pitch angle" if finding.finding == CORRECTED else "called a rate biased"
            at = seconds(finding.frame, context.rate_hz)
            yield f"the fault-tolerant law {what} at {at}, although no fault had moved what it tests"
