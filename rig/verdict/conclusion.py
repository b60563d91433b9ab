"""The conclusion of a flight: its outcome, wrong decisions, faults, splits, voted values, the aircraft.

Made from the score alone, so that every command that shows a flight prints the same rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from shlex import quote
from typing import TYPE_CHECKING

from rig.core.ending import lost_at, why_lost
from rig.flight.conclusion_rows import LOST, NOT_SCORED, SURVIVED, Conclusion, Row
from rig.scenario.scenario import Scenario
from rig.verdict.context import Context, place_label
from rig.verdict.counting import another
from rig.verdict.fault_rows import fault_rows
from rig.verdict.flight_rows import aircraft_row, voted_rows
from rig.verdict.isolation_rows import by_design, lost_with_lane, wrong_isolations
from rig.verdict.lane_words import backup_rows, lane_rows, unit_rows
from rig.verdict.law_tally import false_findings
from rig.verdict.score_records import Score
from rig.verdict.servo_words import bypass_rows
from rig.verdict.split_rows import splits
from rig.verdict.words import BY_DESIGN
from rig.world.faults.places import site

if TYPE_CHECKING:
    from rig.flight.flight_result import Flight


def conclusion(scenario: Scenario, score: Score) -> Conclusion:
    """Return the conclusion of a scored flight: wrong decisions first, then faults and what else happened."""
    context = Context(scenario, score)
    of_faults, alone = splits(context)
    rows = [
        *wrong_isolations(context),
        *false_findings(context),
        *unit_rows(context),
        *backup_rows(context),
        *bypass_rows(context),
        *fault_rows(context, of_faults),
        *lost_with_lane(context),
        *lane_rows(context),
        *by_design(context),
        *alone,
        *_suspects(context),
    ]
    outcome = SURVIVED if score.flight.survived else LOST
    return Conclusion(outcome, _summary(context), tuple(rows), (*voted_rows(context), aircraft_row(context)))


def not_scored(why: str) -> Conclusion:
    """Return the conclusion of a flight that cannot be scored."""
    return Conclusion(NOT_SCORED, why)


def next_commands(flight: Flight) -> list[str]:
    """Return the commands that show more of a flight, as they are typed: score, view, replay.

    Those that vote again name the unit under test, or allow the code, that voted.
    """
    log, again, fly = quote(str(flight.log)), "", ""
    if flight.unit_file:
        again = f" --unit {quote(flight.unit_file)}"
        fly = " --fly" if (flight.unit or {}).get("lane") else ""  # one lane of several is not replayed
    elif ":" in flight.scenario.redundancy.manager:
        again = " --allow-code"
    return [f"rig score {log}{again}", f"rig view {log}", f"rig replay {log}{again}{fly}"]


def _summary(context: Context) -> str:
    """Return how long the flight was or why it was lost, the faults detected, the healthy channels isolated."""
    flight = context.score.flight
    counts = f"{_detected(context)}, {_isolated(context)}"
    if not flight.survived:
        return f"at {lost_at(flight.frames, context.rate_hz)}: {why_lost(flight.end_reason)}; {counts}"
    planned = context.scenario.frames
    of = f" of {planned / context.rate_hz:g} s" if flight.frames < planned else ""
    return f"{flight.duration_s:g} s{of} flown, {counts}"


def _detected(context: Context) -> str:
    """Return how many of the faults were detected, each channel of a fault counted."""
    faults = context.score.faults
    if not faults:
        return "no fault injected"
    outcomes = Counter(fault.outcome for fault in faults)
    beside = sum(another(fault, context) is not None for fault in faults)
    possible = outcomes["detected"] + outcomes["missed"]
    detectable = " detectable" if outcomes["undetectable"] else ""
    text = f"{outcomes['detected'] - beside} of {possible}{detectable} faults detected"
    if not possible:
        text = "no detectable fault" if outcomes["undetectable"] else "no fault acted"
    skipped = f", {outcomes['not executed']} not executed" if outcomes["not executed"] and possible else ""
    others = f", {beside} more on channels isolated for another fault" if beside else ""
    return f"{text}{others}{skipped}"


def _isolated(context: Context) -> str:
    """Return how many healthy channels and computers were isolated by mistake."""
    wrong = (*context.score.false_alarms, *context.score.wrong_isolations)
    computers = sum(site(each.signal) == "computer" for each in wrong)
    parts = [
        f"{count} healthy {name}{'s' if count > 1 else ''} isolated"
        for count, name in ((len(wrong) - computers, "channel"), (computers, "computer"))
        if count
    ]
    text = ", ".join(parts) or "no healthy channel isolated"
    by_rule = sum(kind in BY_DESIGN for kind, _ in context.score.isolations)
    return f"{text} by mistake, {by_rule} by design" if by_rule else text


def _suspects(context: Context) -> Iterator[Row]:
    """Yield a row for each channel that was suspect for long and never isolated."""
    for one in context.score.suspects:
        if one.slow_faults:
            yield Row(place_label(one.signal, [one.channel]), (f"suspect {one.text()}",))
