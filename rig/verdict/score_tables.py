"""The tables of a score, with units and times in seconds: every column once, for the terminal and for a report."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from math import degrees, isfinite
from typing import Any, Final, NamedTuple

from rig.core.column import Column
from rig.core.frame import INDEX, SIGNALS
from rig.core.units.quantities import duration, moment, number, quantity, unit_shown
from rig.verdict.context import error_unit, place_label
from rig.verdict.requirements.requirement_recorder import Verdict
from rig.verdict.requirements.robustness import robustness_text
from rig.verdict.score_records import FlightScore, Score

ROUNDING: Final = 1e-12  # of angles, which are voted near another angle
FEW: Final = 4  # quantities of a line on the terminal
_ORDER: Final = ("violated", "met", "not applicable")


class Row(NamedTuple):
    """A row: a part of a score, its name, and the frames a second of the flight."""

    of: Any
    name: str
    rate_hz: float


class ScoreTable(NamedTuple):
    """A table of a score; ``title`` on a page."""

    title: str
    columns: Sequence[Column]
    rows: Sequence[Any]


def _at(frame: str) -> Callable[[Row], str]:
    """Return the moment of a part's frame."""
    return lambda row: moment(getattr(row.of, frame), row.rate_hz)


def _peak_error(row: Row) -> str:
    return number(row.of.peak_error, error_unit(row.of))


def _error_unit(row: Row) -> str:
    return unit_shown(error_unit(row.of))


FAULTS: Final = (
    Column("fault", "of.id"),
    Column("on", lambda r: r.of.signal if r.of.channel is None else f"{r.of.signal}.{r.of.channel}", worth=2),
    *(Column("onset", _at("onset_frame"), worth=4), Column("threshold exceeded", _at("exceeded_frame"), worth=1)),
    Column("detected", lambda r: _at("law_frame" if r.of.failed_frame is None else "failed_frame")(r), worth=7),
    Column("delay", lambda r: duration(r.of.delay_from_onset_frames, r.rate_hz)),
    Column("from threshold", lambda r: duration(r.of.delay_from_exceeded_frames, r.rate_hz), worth=3),
    Column("by", "of.decided_by"),
    Column("peak error", lambda r: f"{_peak_error(r)} {_error_unit(r)}", worth=6, page=None),
    *(Column("peak error", _peak_error, worth=0), Column("unit", _error_unit, worth=0)),
    Column("outcome", lambda r: f"{r.of.outcome}, shorter than the persistence" if r.of.tolerated else r.of.outcome),
)
TIE_BREAKS: Final = (
    *(Column("pattern"), Column("decided_by", page="decided by"), Column("asked", worth=3)),
    Column("answered", worth=5, page="decided"),
    *(Column("correct"), Column("wrong"), Column("open", worth=4)),
)
ISOLATIONS: Final = (
    *(Column("isolation", "name"), Column("channel", lambda r: place_label(r.of.signal, [r.of.channel]))),
    *(Column("at", _at("frame")), Column("by", "of.decided_by")),
)
SUSPECTS: Final = (
    *(Column("suspect", lambda one: place_label(one.signal, [one.channel])), Column("in frames", "rows")),
    Column("share", lambda one: f"{100 * one.share:.3g} %"),
    Column("isolated", lambda one: "yes" if one.failed else "never"),
)
ACTUATORS: Final = tuple(map(Column, ("actuator", "channel", "shut off", "by", "for")))
COMPUTERS: Final = tuple(map(Column, ("computer", "failed", "by", "for", "cause")))
LAW: Final = (
    *(Column("fault-tolerant law", "of.finding"), Column("at", _at("frame"), worth=3)),
    Column("for", lambda r: f"faults on {', '.join(r.of.signals)}" if r.of.signals else "no fault"),
    *(Column("named", "of.named"), Column("named at", _at("named_frame"))),
)


def _vote(figure: str, none: str = "") -> Callable[[Row], str]:
    """Return a figure of an error of the voted value; ``none`` if it was never a number."""
    return lambda r: none if r.of.peak_frame is None else number(getattr(r.of, figure), _unit(r))


def _unit(row: Row) -> str:
    return SIGNALS[INDEX[row.name]].unit


VOTES: Final = (
    *(Column("vote error", "name"), Column("unit", lambda r: unit_shown(_unit(r)))),
    *(Column("peak", _vote("peak", "no vote")), Column("at", _at("peak_frame"), worth=3)),
    *(Column("RMS", _vote("rms"), worth=4), Column("above error limit", lambda r: f"{r.of.above_threshold_s:g} s")),
    Column("after onset", lambda r: f"{r.of.above_threshold_after_onset_s:g} s", worth=2),
    Column("due to faults, peak", _vote("clean_peak"), worth=5),
)


def _there(verdict: Verdict, most: int | None = None) -> str:
    """Return the quantities of a verdict's instant, ``most`` of them."""
    if not isfinite(verdict.robustness):
        return ""
    there = [f"{name} {quantity(value, unit)}" for name, (value, unit) in verdict.values.items()]
    return ", ".join([*there[:most], *(["..."] if len(there) > len(there[:most]) else [])])


VERDICTS: Final = (
    *(Column("requirement"), Column("on", "signal", worth=3), Column("verdict", "status")),
    Column("robustness", lambda verdict: robustness_text(verdict.robustness) or None, "s"),
    Column("at", lambda verdict: f"{verdict.instant_s:.2f} s" if isfinite(verdict.robustness) else None, "s", worth=4),
    *(Column("there", lambda v: _there(v, FEW), worth=1, page=None), Column("there", _there, worth=0)),
)


def violated_first(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return verdicts in the order in which they are listed."""
    return sorted(verdicts, key=lambda verdict: _ORDER.index(verdict.status))


def tables(score: Score, rate_hz: float) -> dict[str, ScoreTable]:
    """Return the tables of a score by name, in the order of a page."""
    rows = lambda parts: [Row(part, name, rate_hz) for name, part in parts]  # noqa: E731
    suspects = [one for one in score.suspects if one.rows]
    off = ((name, e) for name, e in score.vote_error.items() if e.above_threshold_s > 0 or e.clean_peak > ROUNDING)
    return {
        "faults": ScoreTable("Faults", FAULTS, rows((fault.id, fault) for fault in score.faults)),
        "actuators": ScoreTable("Channels of actuators", ACTUATORS, [*_actuators(score, rate_hz)]),
        "computers": ScoreTable("Computers and links", COMPUTERS, [*_computers(score, rate_hz)]),
        "law": ScoreTable("The fault-tolerant law", LAW, rows((each.finding, each) for each in score.law)),
        "suspects": ScoreTable("Suspect channels", SUSPECTS, suspects),
        "isolations": ScoreTable("Isolated healthy channels", ISOLATIONS, rows(score.isolations)),
        "tie_break": ScoreTable("Splits", TIE_BREAKS, _tie_break(score)),
        "votes": ScoreTable("Votes", VOTES, rows(off)),
    }


def _tie_break(score: Score) -> list[dict[str, Any]]:
    """Return the tie-break rules that were asked, by pattern."""
    return [
        {"pattern": pattern, "decided_by": name, **asdict(asked)}
        for pattern, tie_break in score.tie_break_by_pattern.items()
        for name, asked in tie_break.items()
        if asked.asked
    ]


def _actuators(score: Score, rate_hz: float) -> Iterator[dict[str, Any]]:
    """Yield the channels of actuators that were shut off, and the surfaces bypassed."""
    for name, actuator in score.actuators.items():
        for one in actuator.failures:
            yield {**_off(name, one.channel, one.frame, rate_hz), "by": one.monitor, "for": one.cause}
        for number_from_1, frame in actuator.valves_differ.items():
            yield {**_off(name, number_from_1, frame, rate_hz), "by": "valve", "for": "differs"}
        if actuator.bypassed_frame is not None:
            yield {**_off(name, "all", actuator.bypassed_frame, rate_hz), "by": "", "for": "bypassed"}


def _off(actuator: str, number: int | str, frame: int, rate_hz: float) -> dict[str, Any]:
    return {"actuator": actuator, "channel": number, "shut_off": moment(frame, rate_hz)}


def _computers(score: Score, rate_hz: float) -> Iterator[dict[str, Any]]:
    """Yield the computers and links that failed, and the back-up."""
    if (computers := score.computers) is None:
        return
    for one in computers.failures:
        told = {"by": ", ".join(one.accusers) or "itself", "for": one.test, "cause": one.cause}
        yield {"computer": f"lane {one.lane}", "failed": moment(one.frame, rate_hz), **told}
    for way, frame in computers.links_failed.items():
        told = {"by": way[-1], "for": "silence", "cause": ""}
        yield {"computer": f"link {way}", "failed": moment(frame, rate_hz), **told}
    if computers.backup_frame is not None:
        told = {"by": "", "for": computers.backup_reason, "cause": ""}
        yield {"computer": "back-up engaged", "failed": moment(computers.backup_frame, rate_hz), **told}


def peaks(flight: FlightScore) -> str:
    """Return the extremes of the truth over the flight as a sentence."""
    pitch = f"{degrees(flight.pitch_angle_min_rad):.1f} to {degrees(flight.pitch_angle_max_rad):.1f} deg"
    return (
        f"load factor {flight.load_factor_min:.2f} to {flight.load_factor_max:.2f} g, "
        f"pitch rate {degrees(flight.pitch_rate_max_rad_s):.2f} deg/s, pitch angle {pitch}, "
        f"roll angle {degrees(flight.roll_angle_max_rad):.1f} deg"
    )
