"""Words about faults of computers, links and buses: who detected them when, and which lanes were lost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rig.core.frame import ActuatorMonitor
from rig.core.units.quantities import seconds
from rig.flight.conclusion_rows import Row
from rig.flight.servo_events import monitor_name
from rig.verdict.context import Context, after, channels, listed
from rig.verdict.lane_tally import LINK, RELAYS, UNIT
from rig.verdict.score_records import FaultScore
from rig.verdict.servo_words import monitor_words
from rig.world.faults import KINDS

_BY: Final = {
    LINK: "the message timeout of the receivers",
    RELAYS: "the relayed copies, which outvoted it",
    "vote of commands": "the vote of commands",
    "clock": "the other lanes, which compare its clock",
    "watchdog": "its own watchdog",
    **{
        monitor_name(monitor): f"the {monitor_words(monitor_name(monitor))} of its servo channel"
        for monitor in ActuatorMonitor
    },
}


def lane_result(fault: FaultScore, context: Context) -> str:
    """Return the outcome of a fault on lanes: ``detected after 10 ms by its own watchdog``."""
    if fault.outcome != "detected":
        return f"not detected: {KINDS[fault.kind].unseen or 'no threshold was exceeded for long enough'}"
    return f"detected {after(fault.delay_from_onset_frames, context.rate_hz)} by {test_words(fault.decided_by or '')}"


def test_words(test: str) -> str:
    """Return the test that a lane or a link failed: ``its own watchdog``, ``the vote of commands``."""
    return _BY.get(test, f"its own {test} test")


def lane_rows(context: Context) -> Iterator[Row]:
    """Yield rows for lanes lost to a fault elsewhere, for readmitted lanes, and for leading lanes."""
    history, rate_hz = context.score.evidence.lanes, context.rate_hz
    yield from _lost_rows(context)
    for frame, name in history.readmitted:
        yield Row(f"computer {name}", (f"readmitted at {seconds(frame, rate_hz)}",))
    if history.leading:
        leads = (f"computer {name} from {seconds(frame, rate_hz)} on" for frame, name in history.leading)
        yield Row("leading lane", (", ".join(leads),))


def _lost_rows(context: Context) -> Iterator[Row]:
    """Yield a row for lanes that were lost together and have no row as a computer with a fault: of a link, of a bus."""
    told = {fault.signal.removeprefix("computer.") for fault in context.score.faults}
    together: dict[tuple[int, str, tuple[str, ...]], list[str]] = {}
    for each in () if context.score.computers is None else context.score.computers.failures:
        if each.cause == "own fault" and not told & {each.lane, "all"}:
            together.setdefault((each.frame, each.test, tuple(each.accusers)), []).append(each.lane)
    for (frame, test, accusers), lanes in together.items():
        at = seconds(frame, context.rate_hz)
        others = f"computer{'s' if len(accusers) > 1 else ''} {listed(accusers)}"
        by = test_words(test).replace("its own", "their own" if len(lanes) > 1 else "its own")
        how = f"voted out at {at} by {others}" if accusers else f"lost at {at}, detected by {by}"
        yield Row(f"computer{'s' if len(lanes) > 1 else ''} {listed(lanes)}", (how,))


def backup_rows(context: Context) -> Iterator[Row]:
    """Yield a row if the back-up took over."""
    score = context.score.computers
    if score is not None and score.backup_frame is not None:
        text = f"flies from {seconds(score.backup_frame, context.rate_hz)} on: {score.backup_reason}"
        yield Row("back-up", (text,))


def unit_rows(context: Context) -> Iterator[Row]:
    """Yield a row for what was isolated because its software, or that of its lane, is the unit under test."""
    rate_hz = context.rate_hz
    for each in () if context.score.computers is None else context.score.computers.failures:
        if each.cause == UNIT:
            lanes = f"computer{'s' if len(each.accusers) > 1 else ''} {listed(each.accusers)}" if each.accusers else ""
            by = f"by {lanes} ({each.test})" if lanes else f"by its own {each.test}"
            text = f"the unit under test, isolated at {seconds(each.frame, rate_hz)} {by}"
            yield Row(f"computer {each.lane}", (text,))
    for name, score in context.score.actuators.items():
        for failure in score.failures:
            if failure.cause == UNIT:
                by = f"isolated at {seconds(failure.frame, rate_hz)} by the {monitor_words(failure.monitor)}"
                yield Row(f"{name} servo, {channels([failure.channel])}", (f"driven by the unit under test, {by}",))
