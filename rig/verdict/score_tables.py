"""The tables of a score as rows of text with units, times in seconds: for the terminal and for a report."""

from __future__ import annotations

from math import degrees
from typing import Final

from rig.core.frame import INDEX, SIGNALS
from rig.core.units.quantities import duration, moment, number, unit_shown
from rig.scenario.scenario import Scenario
from rig.verdict.context import channel, error_unit
from rig.verdict.score_records import FaultScore, FlightScore, Score

Row = tuple[str, ...]
FAULTS: Final = (
    *("fault", "on", "onset", "left threshold", "found", "delay", "from threshold", "by", "peak error", "unit"),
    "outcome",
)
RESOLVERS: Final = ("pattern", "resolver", "asked", "answered", "correct", "wrong", "open")
VOTES: Final = ("vote error", "unit", "peak", "at", "RMS", "above threshold", "after onset", "due to faults, peak")
ACTUATORS: Final = ("actuator", "channel", "shut off", "by", "for")
COMPUTERS: Final = ("computer", "failed", "by", "for", "cause")
LAW: Final = ("fault-tolerant law", "at", "for", "named", "named at")
SUSPECTS: Final = ("suspect", "in frames", "share", "failed")
ISOLATIONS: Final = ("what", "channel", "at", "by")
ROUNDING: Final = 1e-12  # of angles, which are voted near another angle


def fault_row(fault: FaultScore, scenario: Scenario) -> Row:
    """Return one fault under the heads FAULTS."""
    rate_hz, unit = scenario.rate_hz, error_unit(fault)
    place = fault.signal if fault.channel is None else f"{fault.signal}.{fault.channel}"
    outcome = f"{fault.outcome}, shorter than the persistence" if fault.tolerated else fault.outcome
    found = fault.law_frame if fault.failed_frame is None else fault.failed_frame
    frames = (moment(frame, rate_hz) for frame in (fault.onset_frame, fault.exceeded_frame, found))
    delays = (fault.delay_from_onset_frames, fault.delay_from_exceeded_frames)
    cells = (*frames, *(duration(delay, rate_hz) for delay in delays), fault.resolver or "")
    return (fault.id, place, *cells, number(fault.peak_error, unit), unit_shown(unit), outcome)


def resolver_rows(score: Score) -> list[Row]:
    """Return the resolvers that were asked, by pattern, under the heads RESOLVERS."""
    return [
        (pattern, name, *map(str, (r.asked, r.answered, r.right, r.wrong, r.open)))
        for pattern, resolvers in score.resolvers_by_pattern.items()
        for name, r in resolvers.items()
        if r.asked
    ]


def vote_rows(score: Score, rate_hz: float) -> list[Row]:
    """Return the signals whose vote was above the threshold or not that of healthy channels, under the heads VOTES."""
    rows = []
    for name, e in score.vote_error.items():
        if e.above_threshold_s > 0 or e.clean_peak > ROUNDING:
            unit = SIGNALS[INDEX[name]].unit
            seconds = (f"{e.above_threshold_s:g} s", f"{e.above_threshold_after_onset_s:g} s")
            peak = (number(e.peak, unit), moment(e.peak_frame, rate_hz), number(e.rms, unit))
            off = (*peak, *seconds, number(e.clean_peak, unit))
            none = ("no vote", "", "", *seconds, "")
            rows.append((name, unit_shown(unit), *(none if e.peak_frame is None else off)))
    return rows


def isolation_rows(score: Score, rate_hz: float) -> list[Row]:
    """Return the healthy channels that were failed, under the heads ISOLATIONS."""
    return [
        (kind, channel(each.signal, each.channel), moment(each.frame, rate_hz), each.resolver)
        for kind, each in score.isolations
    ]


def suspect_rows(score: Score) -> list[Row]:
    """Return the channels that were ever suspect, under the heads SUSPECTS."""
    return [
        (channel(one.signal, one.channel), str(one.rows), f"{100 * one.share:.3g} %", "yes" if one.failed else "never")
        for one in score.suspects
        if one.rows
    ]


def actuator_rows(score: Score, rate_hz: float) -> list[Row]:
    """Return the channels of actuators that were shut off, and the surfaces bypassed, under the heads ACTUATORS."""
    rows = []
    for name, actuator in score.actuators.items():
        rows += [
            (name, str(each.channel), moment(each.frame, rate_hz), each.monitor, each.cause)
            for each in actuator.failures
        ]
        rows += [
            (name, str(c), moment(frame, rate_hz), "valve", "differs") for c, frame in actuator.valves_differ.items()
        ]
        if actuator.bypassed_frame is not None:
            rows.append((name, "all", moment(actuator.bypassed_frame, rate_hz), "", "bypassed"))
    return rows


def computer_rows(score: Score, rate_hz: float) -> list[Row]:
    """Return the computers and links that failed, and the back-up, under the heads COMPUTERS."""
    if (computers := score.computers) is None:
        return []
    rows = [
        (f"lane {each.lane}", moment(each.frame, rate_hz), ", ".join(each.accusers) or "itself", each.test, each.cause)
        for each in computers.failures
    ]
    rows += [
        (f"link {way}", moment(frame, rate_hz), way[-1], "silence", "") for way, frame in computers.links_failed.items()
    ]
    if computers.backup_frame is not None:
        rows.append(("back-up engaged", moment(computers.backup_frame, rate_hz), "", computers.backup_reason, ""))
    return rows


def law_rows(score: Score, rate_hz: float) -> list[Row]:
    """Return what the fault-tolerant law found, under the heads LAW."""
    return [
        (
            each.finding,
            moment(each.frame, rate_hz),
            f"faults on {', '.join(each.signals)}" if each.signals else "no fault",
            each.named or "",
            moment(each.named_frame, rate_hz),
        )
        for each in score.law
    ]


def peaks(flight: FlightScore) -> str:
    """Return the extremes of the truth over the flight as a sentence."""
    pitch = f"{degrees(flight.pitch_angle_min_rad):.1f} to {degrees(flight.pitch_angle_max_rad):.1f} deg"
    return (
        f"load factor {flight.load_factor_min:.2f} to {flight.load_factor_max:.2f} g, "
        f"pitch rate {degrees(flight.pitch_rate_max_rad_s):.2f} deg/s, pitch angle {pitch}, "
        f"roll angle {degrees(flight.roll_angle_max_rad):.1f} deg"
    )
