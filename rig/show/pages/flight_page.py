"""The report of one flight: one HTML file with everything in it, for a browser without a network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from rig.computer.redundancy.managers import ManagerKind, manager_kind
from rig.core.column import columns
from rig.core.ending import ending
from rig.core.frame import INDEX, SIGNALS, SURFACES
from rig.core.outputs import require_apart, require_page
from rig.core.progress import tell
from rig.core.units.quantities import duration, quantity, seconds
from rig.flight.flight_result import Flight
from rig.log import LogFile, scenario_of, unit_of
from rig.log.info import FILE, overrides
from rig.log.schema import SCHEMA_VERSION
from rig.show.pages import flight_figures as draw
from rig.show.pages import lane_figures as computers
from rig.show.pages import servo_figures as actuators
from rig.show.pages.course import FIELDS, Course, Moment, affected, limit, moment, signals_of
from rig.show.pages.decision_figure import began, of_moment
from rig.show.pages.lines import errors, line, of_signal, of_surface
from rig.show.pages.page import DASH, write_page
from rig.show.pages.requirement_figures import Robustness
from rig.show.pages.timeline import MOST_GROUPS, groups, spans, timeline
from rig.show.viewer.series import threshold
from rig.unit.unit_facts import what_it_reads
from rig.verdict import score_tables as cells
from rig.verdict.context import Context
from rig.verdict.counting import another
from rig.verdict.of_log import Scored, score_log
from rig.verdict.requirements.along import plain
from rig.verdict.score_records import Yardstick

MOST_SIGNALS: Final = 8  # that are drawn
MOST_MOMENTS: Final = 4
MOST_ROWS: Final = 300  # of a table
QUIETEST: Final = 4  # signals whose voted value is drawn if no signal had an event


def report(path: Path, out: Path, requirements: Sequence[str] = ()) -> dict[str, Any]:
    """Write the report of the log at ``path`` to ``out``; return its content as plain data.

    requirements : bundled sets and files, beside those of the scenario

    The log is read block by block.  BadInput or BadLog, one line: the file is no log of ``rig fly``, or has no verdict.
    """
    log = LogFile.open(path)
    scored = score_log(path, Yardstick(), baseline=False, log=log)
    robustness = Robustness.of(log, scored.scenario, requirements)
    tell("searching for events")
    course = Course(log.table(FIELDS), len(scored.scenario.faults))
    names = affected(scored, course)
    moments = [found for name in names if (found := moment(scored, course, name)) is not None][:MOST_MOMENTS]
    drawn = _figures(log, scored, course, names, moments) | robustness.figures()
    about = {
        **_about(log, scored, course, names, moments),
        "requirements": cells.violated_first(robustness.verdicts),
        "unmeasured": robustness.remark,
    }
    counted = any("yaxis2" in drawn[f"moment-{one.signal}"].layout for one in moments)
    write_page(out, "flight.html", drawn, {}, drawn=list(drawn), counted=counted, **about)
    told = {"shown": names, "moments": [one._asdict() for one in moments], "overrides": about["sets"]}
    told |= {"requirements": [plain(one) for one in robustness.verdicts]} if robustness.verdicts else {}
    return {"report": str(out), **told, **scored.as_dict()}


class Decision(NamedTuple):
    """The conclusion of a flight, its pictures by id, and its manager, for a page on another subject."""

    conclusion: list[str]
    figures: dict[str, go.Figure]
    manager: ManagerKind


def decision_of(path: Path) -> Decision:
    """Return the first decision of the flight whose log is at ``path``, and the errors of its voted values."""
    log = LogFile.open(path)
    scored = score_log(path, Yardstick(), baseline=False, log=log)
    course = Course(log.table(FIELDS), len(scored.scenario.faults))
    names = affected(scored, course)
    moments = [found for name in names if (found := moment(scored, course, name)) is not None][:1]
    figures = _moments(scored, course, moments) | {"votes": _votes(scored, course, names[:MOST_SIGNALS])}
    return Decision(list(scored.conclusion), figures, manager_kind(scored.scenario.redundancy.manager))


def write_report(flight: Flight | Path | str, out: Path | str | None = None, requirements: Sequence[str] = ()) -> Path:
    """Write the report of a flight as one HTML file that opens offline, and return its path.

    flight : flight, or file of its log
    out : file to write; None: beside the log, with its name
    requirements : bundled sets and files of requirements to measure
    BadInput, one line: no log of a flight, no flight summary in it, an ``out`` that is the log or no HTML file.
    """
    log = flight.log if isinstance(flight, Flight) else Path(flight)
    target = log.with_suffix(".html") if out is None else Path(out)
    require_apart({"out": target}, [log, *requirements])
    require_page("out", None if out is None else target)
    report(log, target, requirements)
    return target


def _figures(
    log: LogFile, scored: Scored, course: Course, names: Sequence[str], moments: Sequence[Moment]
) -> dict[str, go.Figure]:
    """Draw the pictures by the id of their element, in the order of the page; names : signals with an event."""
    shown, flight, acting = names[:MOST_SIGNALS], course.flight, _acting(course, scored)
    rate_hz, resolved = log.rate_hz, scored.scenario.resolved()
    surfaces = actuators.happened(scored) if "servo" in log.parts else []
    lanes, labels = computers.happened(scored, log.events), [fault.label for fault in scored.scenario.faults]
    beside = computers.states(course, rate_hz, scored.scenario.computers.count) if lanes else []
    health = [span for span in beside if span.row.startswith("lane ") or span.row == "leading lane"]
    states = spans(course, rate_hz, names, labels, [*health, *actuators.states(course, rate_hz)])
    found = {"timeline": timeline(states, course.frames / rate_hz)} if states else {}
    found |= _moments(scored, course, moments)
    for name in shown:
        found[f"signal-{name}"] = draw.of_flight(
            of_signal(flight, rate_hz, name, threshold(resolved, name)), rate_hz, name, acting[name]
        )
    for one in surfaces:
        found[f"actuator-{one.surface}"] = actuators.of_actuator(flight[one.begin : one.end], scored, one)
    if lanes is not None:
        found["computers"] = timeline(beside, course.frames / rate_hz)
        found["commands"] = computers.commands(flight[lanes.begin : lanes.end], scored, lanes)
    found["votes"] = _votes(scored, course, shown)
    found["surfaces"] = draw.surfaces([of_surface(flight, rate_hz, i) for i in range(len(SURFACES))])
    return found


def _moments(scored: Scored, course: Course, moments: Sequence[Moment]) -> dict[str, go.Figure]:
    """Draw each decision, by the id of its element."""
    resolved, rate_hz, acting = scored.scenario.resolved(), scored.scenario.rate_hz, _acting(course, scored)
    found = {}
    for one in moments:
        acts = acting[one.signal][one.begin : one.end]
        about = one, limit(resolved, one.signal), acts, _waits(scored, one.signal)
        found[f"moment-{one.signal}"] = of_moment(course.flight[one.begin : one.end].rows, rate_hz, *about)
    return found


def _votes(scored: Scored, course: Course, names: Sequence[str]) -> go.Figure:
    """Draw voted minus true values of ``names``, or of those with the largest error in limits."""
    flight, thresholds = course.flight, _thresholds(scored, names)
    time_s = flight["frame"] / scored.scenario.rate_hz
    shares = {name: line(time_s, errors(flight, name) / limit) for name, limit in thresholds.items()}
    return draw.vote_errors(shares, thresholds)


def _acting(course: Course, scored: Scored) -> dict[str, NDArray[np.bool_]]:
    """Return (n,) by signal: a fault on the signal, or on its reference, acts."""
    on: dict[str, list[int]] = {signal.name: [] for signal in SIGNALS}
    for fault in scored.score.faults:
        for name in signals_of(fault, scored.scenario):
            on[name].append(fault.index)
    acting, faults = course.acting, np.zeros((len(SIGNALS), 8 * course.acting.shape[1]), np.uint8)
    for s, numbers in enumerate(on.values()):
        faults[s, numbers] = 1
    masks = np.packbits(faults, axis=1, bitorder="little")
    return {name: (acting & masks[s]).any(axis=1) for s, name in enumerate(on)}


def _thresholds(scored: Scored, names: Sequence[str]) -> dict[str, float]:
    """Return the error limits of ``names``; without names, of the signals with the largest error in limits."""
    signals = scored.scenario.resolved()["redundancy"]["signals"]
    limits = {name: float(signals[name]["threshold"]) for name in INDEX}
    found = scored.score.vote_error
    ranked = sorted(INDEX, key=lambda name: -found[name].peak / limits[name])
    return {name: limits[name] for name in names or ranked[:QUIETEST]}


def _waits(scored: Scored, name: str) -> dict[str, int]:
    """Return the persistences of a signal in frames, by name; empty if the manager has no isolation threshold."""
    evidence, kind = scored.score.evidence, manager_kind(scored.scenario.redundancy.manager)
    if evidence.by_unit or not kind.has_threshold:
        return {}
    p = evidence.params[INDEX[name]]
    splits = {"split persistence": int(p["split_persistence"])} if kind.compares else {}
    return {"persistence": int(p["persistence"]), **splits}


def _about(
    log: LogFile, scored: Scored, course: Course, names: Sequence[str], moments: Sequence[Moment]
) -> dict[str, Any]:
    """Return the texts and tables of the page."""
    alike = groups(course, names)
    scenario, score, rate_hz = scored.scenario, scored.score, log.rate_hz
    text = log.attachments.get(FILE, b"").decode(errors="replace")
    return {
        "title": scenario.title or scenario.aircraft,
        "scored": scored,
        "score": score,
        "point": scenario.airframe.point(scenario.flight_point).name,
        "sets": overrides(text, scenario_of(log.metadata, scored.log)),
        "voter": scored.voter,
        "reads": what_it_reads(unit_of(log.metadata)),
        "ended": ending(score.flight.survived, score.flight.end_reason, score.flight.frames, rate_hz),
        "cards": _cards(scored, rate_hz),
        "moments": _sentences(scored, course, moments, rate_hz),
        "manager": manager_kind(scenario.redundancy.manager),
        "actuators": actuators.happened(scored) if "servo" in log.parts else [],
        "computers": computers.happened(scored, log.events),
        "signals": names[:MOST_SIGNALS],
        "alike": [one for one in alike[:MOST_GROUPS] if len(one) > 1],
        "not_in_timeline": [name for one in alike[MOST_GROUPS:] for name in one],
        "left_out": names[MOST_SIGNALS:],
        "limits": _limits(scored, names[:MOST_SIGNALS]),
        "tables": [table for table in cells.tables(score, rate_hz).values() if table.rows],
        "peaks": cells.peaks(score.flight),
        "columns": {"requirements": cells.VERDICTS, "events": columns("time", "level", "event", "what")},
        "events": [(seconds(one.frame, rate_hz), one.level, one.name, one.text) for one in log.events],
        "most": MOST_ROWS,
        "flown_by": {key: text for key, text in log.metadata.items() if key.startswith(("version ", "git", "machine"))},
        "schema": f"{log.metadata['schema_version']} (this rig writes {SCHEMA_VERSION})",
    }


def _sentences(scored: Scored, course: Course, moments: Sequence[Moment], rate_hz: float) -> list[tuple[Moment, str]]:
    """Return each decision with its sentence."""
    silent = "" if Context(scored.scenario, scored.score).isolates(next(iter(INDEX))) else scored.voter
    starts = [began(course.flight[one.begin : one.end].rows, one) for one in moments]
    return [(one, _decided(one, start, rate_hz, silent)) for one, start in zip(moments, starts, strict=True)]


def _decided(one: Moment, start: str, rate_hz: float, silent: str) -> str:
    """Return start and isolation of a decision as text.

    start : as of the picture; silent : a voter that never isolates
    """
    first = f"{start} at {seconds(one.first, rate_hz)}"
    if one.isolated is None:
        return f"{first}; {f'the {silent} isolates no channel' if silent else 'no channel isolated'}"
    frames = one.isolated - one.first
    if not frames:
        return f"{first}, isolated in the same frame"
    later = f"{duration(frames, rate_hz)} later ({frames + 1} frames)"
    return f"{first}, isolated at {seconds(one.isolated, rate_hz)}, {later}"


def _cards(scored: Scored, rate_hz: float) -> list[tuple[str, str, bool]]:
    """Return the figure, the description and a mark for a bad value of each card."""
    score = scored.score
    context = Context(scored.scenario, score)
    found = [fault for fault in score.faults if fault.outcome == "detected"]
    detected = [fault for fault in found if another(fault, context) is None]
    missed = sum(fault.outcome == "missed" for fault in score.faults) + len(found) - len(detected)
    wrong = len(score.false_alarms) + len(score.wrong_isolations)
    delays = [fault.delay_from_exceeded_frames for fault in detected if fault.delay_from_exceeded_frames is not None]
    off = [name for name, error in score.vote_error.items() if error.above_threshold_s > 0]
    failed = [(fault.failed_frame or fault.law_frame or 0, fault.decided_by) for fault in detected if fault.decided_by]
    failed += [(each.frame, each.decided_by) for _, each in score.isolations]
    deciders = dict.fromkeys(decided_by for _, decided_by in sorted(failed))
    lost = sum(signal.level_at_end == 0 for signal in score.signals.values())
    slow_faults = sum(suspect.slow_faults for suspect in score.suspects)
    return [
        (f"{len(detected)} of {len(detected) + missed}", "detectable faults detected", missed > 0),
        (duration(max(delays), rate_hz) if delays else DASH, "longest delay after the threshold was exceeded", False),
        (str(wrong), "healthy channels isolated", wrong > 0),
        (", ".join(deciders) or DASH, "detected the faults or isolated the channels", False),
        (str(len(off)), _off_by(scored, off), bool(off)),
        (str(lost), "signals without a usable channel at the end", lost > 0),
        *([(str(slow_faults), "channels suspect in many frames, never isolated", True)] if slow_faults else []),
    ]


def _off_by(scored: Scored, names: Sequence[str]) -> str:
    """Return the description of the card of wrong voted values, with the error limits of these signals."""
    limits = [
        f"{name} {quantity(value, SIGNALS[INDEX[name]].unit)}" for name, value in _thresholds(scored, names).items()
    ]
    which = f": {', '.join(limits[:QUIETEST])}" if names else ""
    return f"signals with a voted value beyond its error limit{which}"


def _limits(scored: Scored, names: Sequence[str]) -> list[str]:
    """Return the error limit of each signal with an event."""
    shown = _thresholds(scored, names).items() if names else ()
    return [f"{name}: error limit {quantity(value, SIGNALS[INDEX[name]].unit)}" for name, value in shown]
