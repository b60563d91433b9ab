"""A score as tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from rich.table import Table

from rig.assess import cells
from rig.assess.missed_frames import Miss
from rig.assess.of_log import Scored
from rig.assess.record import Deviation, FlightScore, Isolation, Score, Transients
from rig.cli.show import conclusion
from rig.units.quantities import moment
from rig.util.console import Screen, console, styled

MOST = 40  # lines of one kind on the terminal; all are in --json
_STYLES = {"detected": "green", "missed": "red", "undetectable": "", "not executed": "yellow"}


def show(scored: Scored) -> None:
    """Print all parts of a score."""
    screen, score = console(), scored.score
    title = scored.scenario.title or scored.scenario.aircraft
    screen.print(styled((title, "bold"), f"  seed {scored.scenario.seed}  {scored.log}"), soft_wrap=True)
    conclusion(scored.conclusion)
    _faults(screen, scored)
    _isolations(screen, "false alarms", score.false_alarms, scored.scenario.rate_hz)
    _isolations(screen, "wrong isolations", score.wrong_isolations, scored.scenario.rate_hz)
    _isolations(screen, "failed with box", score.failed_with_box, scored.scenario.rate_hz, by_design=True)
    _isolations(screen, "failed by rule", score.failed_by_rule, scored.scenario.rate_hz, by_design=True)
    _resolvers(screen, score)
    _votes(screen, scored)
    _flight(screen, score.flight, scored.scenario.rate_hz)
    _coverage(screen, score)
    _times(screen, scored)


def _times(screen: Screen, scored: Scored) -> None:
    """What became of the exchanges with a unit under test, and the wall clock of a paced flight."""
    if scored.unit is not None:
        counts = ", ".join(
            f"{value} {name.replace('_', ' ')}" for name, value in scored.unit.items() if _counted(value)
        )
        screen.print(f"unit              {scored.unit['name']}: {counts}")
    for miss in scored.misses[:MOST]:
        screen.print(f"unit fault        {miss.status} {_span(miss, scored.scenario.rate_hz)}", style="red")
    _more(screen, len(scored.misses), "faults of the unit")
    for name, bins in scored.times.items():
        told = ", ".join(f"{count} {bin.replace('_', ' ')}" for bin, count in bins.items() if count)
        screen.print(f"{name:17} {told}")


def _span(miss: Miss, rate_hz: float) -> str:
    return f"from {moment(miss.first_frame, rate_hz)} to {moment(miss.last_frame, rate_hz)}"


def _counted(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value > 0


def _faults(screen: Screen, scored: Scored) -> None:
    faults = scored.score.faults
    if not faults:
        screen.print("faults            none in the scenario")
        return
    table = Table(*cells.FAULTS, box=None)
    for fault in faults[:MOST]:
        table.add_row(*cells.fault_row(fault, scored.scenario), style=_STYLES[fault.outcome])
    screen.print(table)
    _more(screen, len(faults), "faults")


def _isolations(
    screen: Screen, title: str, found: Sequence[Isolation], rate_hz: float, *, by_design: bool = False
) -> None:
    """Print a line for each; that there is none too, but not of those failed ``by_design``, which few flights have."""
    if not found and not by_design:
        screen.print(f"{title:17} none")
    for each in found[:MOST]:
        text = f"{each.signal}.{each.channel} at {moment(each.frame, rate_hz)} by {each.resolver}"
        screen.print(f"{title:17} {text}", style="" if by_design else "red")
    _more(screen, len(found), title)


def _more(screen: Screen, count: int, what: str) -> None:
    if count > MOST:
        screen.print(f"and {count - MOST} more {what}; --json has all")


def _resolvers(screen: Screen, score: Score) -> None:
    if not score.episodes:
        return
    screen.table(cells.RESOLVERS, cells.resolver_rows(score))
    screen.print(
        f"{len(score.episodes)} patterns without a majority, {score.unresolved} unresolved; "
        "answered = correct + wrong + open, open: the pattern went by before a channel was failed"
    )


def _votes(screen: Screen, scored: Scored) -> None:
    """Signals whose vote was above the threshold or not that of healthy channels; one line for the others."""
    score, rows = scored.score, cells.vote_rows(scored.score, scored.scenario.rate_hz)
    if rows:
        screen.table(cells.VOTES, rows)
    for name, seconds in score.wrong_votes_s.items():
        if seconds > 0:
            screen.print(f"{'vote':17} {name} voted wrong for {seconds:g} s")
    quiet = len(score.vote_error) - len(rows)
    screen.print(f"{quiet} signals voted as healthy channels would have, within their threshold of the truth")


def _flight(screen: Screen, flight: FlightScore, rate_hz: float) -> None:
    verdict = ("survived", "green") if flight.survived else ("lost", "red")
    reason = f": {flight.end_reason} ({flight.frames} frames, {flight.duration_s:g} s)"
    screen.print(styled("flight            ", verdict, reason))
    screen.print(f"peaks             {cells.peaks(flight)}")
    if flight.transients is not None:
        _transients(screen, flight.transients, rate_hz)


def _transients(screen: Screen, found: Transients, rate_hz: float) -> None:
    y = found.limits
    limits = f"{y['load_factor']:g} g and {degrees(y['pitch_rate_rad_s']):g} deg/s within {y['window_s']:g} s"
    rows = []
    for window in found.windows[:MOST]:
        verdict = styled(("within", "green") if window.within_limits else ("beyond", "red"))
        rows.append(
            (f"{', '.join(window.faults)} at {moment(window.onset_frame, rate_hz)}", *_peaks(window.peaks), verdict)
        )
    rows.append(("whole flight", *_peaks(found.overall), f"{found.out_of_limits_s:g} s beyond"))
    screen.table(
        ("against the fault-free run", "load factor", "pitch rate", "pitch", "roll", f"limits: {limits}"), rows
    )
    _more(screen, len(found.windows), "transients")


def _peaks(p: Deviation) -> tuple[str, ...]:
    return (
        f"{p.load_factor:.3f} g",
        f"{degrees(p.pitch_rate_rad_s):.2f} deg/s",
        f"{degrees(p.pitch_angle_rad):.2f} deg",
        f"{degrees(p.roll_angle_rad):.2f} deg",
    )


def _coverage(screen: Screen, score: Score) -> None:
    c = score.coverage["overall"]
    screen.print(
        f"coverage          {len(c.patterns)} of {c.patterns_possible} patterns ({', '.join(c.patterns)}), "
        f"{len(c.levels)} of {c.levels_possible} levels, "
        f"{len(c.pattern_transitions)} of {c.pattern_transitions_possible} pattern transitions, "
        f"{len(c.level_transitions)} of {c.level_transitions_possible} level transitions"
    )
