"""``rig score`` and ``rig report``: one flight as tables and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from typer import echo

from rig.cli.common import AllowCode, Json, LogFile, UnitFile, emit, flag, opt
from rig.cli.fly import conclusion
from rig.cli.printing import MOST_LINES, counts, field, line, rest, table
from rig.cli.requirements_option import Requirements, show_verdicts
from rig.cli.working import working
from rig.core.column import Column
from rig.core.console import styled
from rig.core.outputs import require_apart, require_page
from rig.core.text import plain
from rig.core.units.quantities import moment

if TYPE_CHECKING:
    from rich.text import Text

    from rig.verdict.of_log import Scored
    from rig.verdict.score_records import Deviation, FlightScore, Isolation, Score, Transients

WIDTH: Final = 18  # of the labels
_STYLES: Final = {"detected": "green", "missed": "red", "undetectable": "", "not executed": "yellow"}


def score(
    log: LogFile,
    no_baseline: Annotated[
        bool, flag("--no-baseline", "Skip the fault-free baseline; the score has no transients.")
    ] = False,
    transient_load_factor: Annotated[
        float, opt("G", "Limit of the load-factor transient of a fault, g.", min=1e-9)
    ] = 0.5,
    transient_pitch_rate_rad_s: Annotated[
        float, opt("RAD_S", "Limit of the body-rate transient of a fault, rad/s.", min=1e-9, show_default="10 deg/s")
    ] = radians(10.0),
    transient_window_s: Annotated[float, opt("S", "Length of the transient after each onset, s.", min=1e-9)] = 2.0,
    requirements: Requirements = None,
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Score a flight against the true values: detected and missed faults, false isolations, votes and transients."""
    from rig.core.settings import build
    from rig.unit.running_unit import running
    from rig.verdict.of_log import score_log
    from rig.verdict.requirements.along import measure_scored, plain
    from rig.verdict.requirements.requirement import load_requirements
    from rig.verdict.score_records import Yardstick

    limits = {
        "load_factor": transient_load_factor,
        "pitch_rate_rad_s": transient_pitch_rate_rad_s,
        "window_s": transient_window_s,
    }
    with working("reading the log", not as_json), running(unit) as tested:
        asked = load_requirements(requirements or ())
        scored = score_log(log, build(Yardstick, limits, "--transient"), not no_baseline, allow_code, tested)
        verdicts, remark = measure_scored(scored, asked, not no_baseline, tested, allow_code)
    measured = {"requirements": [plain(verdict) for verdict in verdicts]} if verdicts else {}

    def text() -> None:
        _show(scored)
        show_verdicts(verdicts)
        if remark:
            field("remark", remark, width=WIDTH, style="yellow")

    emit(as_json, lambda: {**scored.as_dict(), **measured}, text)


def report(
    log: LogFile,
    out: Annotated[Path | None, opt("FILE", "Page to write, .html.", show_default="<log>.html")] = None,
    requirements: Requirements = None,
    as_json: Json = False,
) -> None:
    """Write the report of a flight as one HTML page that opens offline and can be printed."""
    from rig.show.pages.flight_page import report as write

    target = out or log.with_suffix(".html")
    require_apart({"--out": target}, [log, *(requirements or ())])
    require_page("--out", out)
    with working("reading the log", not as_json):
        facts = write(log, target, requirements or ())

    def text() -> None:
        for sentence in facts["conclusion"][:MOST_LINES]:
            line(sentence)
        rest(len(facts["conclusion"]), MOST_LINES)
        echo(plain(f"report   {target}"))

    emit(as_json, facts, text)


def _show(scored: Scored) -> None:
    """Print all parts of a score."""
    from rig.verdict.score_tables import tables

    score, scenario = scored.score, scored.scenario
    parts = tables(score, scenario.rate_hz)
    line((scenario.title or scenario.aircraft, "bold"), f"  seed {scenario.seed}, {scored.voter}  {scored.log}")
    conclusion(scored.conclusion)
    if not score.faults:
        field("faults", "none in the scenario", width=WIDTH)
    faults = parts["faults"]
    table(faults.rows, faults.columns, MOST_LINES, lambda row: _STYLES[row.of.outcome])
    _isolations("false alarms", score.false_alarms, scenario.rate_hz)
    _isolations("wrong isolations", score.wrong_isolations, scenario.rate_hz)
    _isolations("isolated with LRU", score.failed_with_box, scenario.rate_hz, by_design=True)
    _isolations("isolated by rule", score.failed_by_rule, scenario.rate_hz, by_design=True)
    for name in ("suspects", "actuators", "computers", "law", "tie_break"):
        table(parts[name].rows, parts[name].columns, None if name == "tie_break" else MOST_LINES)
        if name == "suspects":
            line(f"{len(score.suspects) - len(parts[name].rows)} channels were never suspect")
    if score.episodes:
        line(
            f"{len(score.episodes)} splits, {score.unresolved} unresolved; "
            "answered = correct + wrong + open; open: the split ended before a channel was isolated"
        )
    votes = parts["votes"]
    table(votes.rows, votes.columns)
    for name, seconds in score.wrong_votes_s.items():
        if seconds > 0:
            field("voted", f"{name}: wrong for {seconds:g} s", width=WIDTH)
    quiet, of = len(score.vote_error) - len(votes.rows), len(score.vote_error)
    line(f"Voted values within their error limits, unaffected by faults: {quiet} of {of} signals")
    _flight(score.flight, scenario.rate_hz)
    _coverage(score)
    _times(scored)


def _isolations(title: str, isolations: Sequence[Isolation], rate_hz: float, *, by_design: bool = False) -> None:
    """Print a line for each isolation, or that there is none; nothing if there is none ``by_design``."""
    if not isolations and not by_design:
        field(title, "none", width=WIDTH)
    for isolation in isolations[:MOST_LINES]:
        text = f"{isolation.signal}.{isolation.channel} at {moment(isolation.frame, rate_hz)} by {isolation.decided_by}"
        field(title, text, style="" if by_design else "red", width=WIDTH)
    rest(len(isolations), MOST_LINES)


def _flight(flight: FlightScore, rate_hz: float) -> None:
    from rig.core.ending import ending
    from rig.verdict.score_tables import peaks

    verdict = ("survived", "green") if flight.survived else ("lost", "red")
    end = ending(flight.survived, flight.end_reason, flight.frames, rate_hz).removeprefix(verdict[0])
    field("flight", verdict, f"{end} ({flight.frames} frames)", width=WIDTH)
    field("peaks", peaks(flight), width=WIDTH)
    if flight.transients is not None:
        _transients(flight.transients, rate_hz)


def _transients(transients: Transients, rate_hz: float) -> None:
    """Print the transient after each onset, the whole flight last."""
    y = transients.limits
    limits = f"{y['load_factor']:g} g and {degrees(y['pitch_rate_rad_s']):g} deg/s within {y['window_s']:g} s"
    rows: list[tuple[str, Deviation, str | Text]] = []
    for window in transients.windows[:MOST_LINES]:
        verdict = styled(("within", "green") if window.within_limits else ("exceeded", "red"))
        rows.append((f"{', '.join(window.faults)} at {moment(window.onset_frame, rate_hz)}", window.peaks, verdict))
    rows.append(("whole flight", transients.overall, f"exceeded for {transients.out_of_limits_s:g} s"))
    peaks = (
        Column("load factor", lambda row: f"{row[1].load_factor:.3f} g"),
        Column("pitch rate", lambda row: f"{degrees(row[1].pitch_rate_rad_s):.2f} deg/s"),
        Column("pitch", lambda row: f"{degrees(row[1].pitch_angle_rad):.2f} deg", worth=5),
        Column("roll", lambda row: f"{degrees(row[1].roll_angle_rad):.2f} deg", worth=4),
    )
    line(f"compared with the fault-free baseline; limits: {limits}")
    table(rows, (Column("after", 0), *peaks, Column("limits", 2)))
    rest(len(transients.windows), MOST_LINES)


def _coverage(score: Score) -> None:
    c = score.coverage["overall"]
    field(
        "coverage",
        f"{len(c.patterns)} of {c.patterns_possible} patterns ({', '.join(c.patterns)}), "
        f"{len(c.levels)} of {c.levels_possible} levels, "
        f"{len(c.pattern_transitions)} of {c.pattern_transitions_possible} pattern transitions, "
        f"{len(c.level_transitions)} of {c.level_transitions_possible} level transitions",
        width=WIDTH,
    )


def _times(scored: Scored) -> None:
    """Print the exchanges with a unit under test, and the wall-clock times of a paced flight."""
    rate_hz = scored.scenario.rate_hz
    if scored.unit is not None:
        field("unit", f"{scored.unit['name']}: {', '.join(counts(scored.unit))}", width=WIDTH)
    for miss in scored.misses[:MOST_LINES]:
        span = f"from {moment(miss.first_frame, rate_hz)} to {moment(miss.last_frame, rate_hz)}"
        field("unit fault", f"{miss.status} {span}", style="red", width=WIDTH)
    rest(len(scored.misses), MOST_LINES)
    for name, bins in scored.times.items():
        field(name, ", ".join(counts(bins)), width=WIDTH)
