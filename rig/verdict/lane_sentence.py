"""What became of a fault of a computer or of a link, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rig.core.frame import ActuatorMonitor
from rig.core.units.quantities import duration, seconds
from rig.flight.servo_events import monitor_name
from rig.verdict.context import Context
from rig.verdict.lane_tally import LINK, RELAYS, UNIT
from rig.verdict.score_records import FaultScore
from rig.verdict.servo_sentence import listed
from rig.world.faults import KINDS
from rig.world.faults.places import OF_LANES, site

_BY: Final = {
    LINK: "the receivers, who had no message for so long",
    RELAYS: "the relays, which outvoted it",
    "vote of commands": "the vote of commands",
    "clock": "the other lanes, for its clock",
    **{
        monitor_name(monitor): f"the monitor {monitor_name(monitor)} of its servo channel"
        for monitor in ActuatorMonitor
    },
}


def on_lanes(fault: FaultScore) -> bool:
    """Return True if a fault sits on a computer, a link or a bus, and on no channel."""
    return fault.channel is None and site(fault.signal) in OF_LANES


def lane_result(fault: FaultScore, context: Context) -> str:
    """Return what became of a fault on lanes: ``was found by its watchdog after 10 ms``."""
    if fault.outcome != "detected":
        return f"was not found: {KINDS[fault.kind].unseen or 'nothing left its threshold for long enough'}"
    after = duration(fault.delay_from_onset_frames, context.rate_hz)
    return f"was found by {_BY.get(fault.resolver or '', f'its own {fault.resolver}')} after {after}"


def of_unit(context: Context) -> Iterator[str]:
    """Yield a sentence for what was failed because its software, or its lane's, is the unit under test."""
    rate_hz = context.rate_hz
    for each in () if context.score.computers is None else context.score.computers.failures:
        if each.cause == UNIT:
            lanes = f"computer{'s' if len(each.accusers) > 1 else ''} {listed(each.accusers)}" if each.accusers else ""
            by = f"by {lanes} ({each.test})" if lanes else f"by its own {each.test}"
            at = seconds(each.frame, rate_hz)
            yield f"computer {each.lane}, whose software is the unit under test, was failed at {at} {by}"
    for name, score in context.score.actuators.items():
        for failure in score.failures:
            if failure.cause == UNIT:
                at = seconds(failure.frame, rate_hz)
                of = f"{name} channel {failure.channel}"
                yield f"{of}, which the unit under test drives, was failed at {at} by {failure.monitor}"


def computers_lost(context: Context) -> str:
    """Return the computers that failed and the back-up: ``computers A and B failed; the back-up flew from ..``."""
    score = context.score.computers
    if score is None:
        return ""
    names = sorted({failure.lane for failure in score.failures})
    parts = [f"computer{'s' if len(names) > 1 else ''} {listed(tuple(names))} failed"] if names else []
    if score.backup_frame is not None:
        parts.append(f"the back-up flew from {seconds(score.backup_frame, context.rate_hz)} on ({score.backup_reason})")
    return "; ".join(parts)
