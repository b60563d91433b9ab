"""The rows of one run, from its flight and its score."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final, get_args

from rig.assess import FaultScore, Score
from rig.assess.record import ISOLATIONS, Outcome
from rig.assess.words import PUBLIC
from rig.campaign.servos import run_columns
from rig.faults import Fault
from rig.faults.places import site
from rig.frame import CHANNELS, INDEX, SIGNALS
from rig.log import unit_of
from rig.record.histogram import binned
from rig.scenario import Scenario

if TYPE_CHECKING:
    from rig.campaign.flying import CampaignFlight

Row = dict[str, Any]
Rows = dict[str, list[Row]]  # by table
TABLES: Final[tuple[str, ...]] = ("runs", "faults", "alarms", "episodes", "signals")  # columns: table.py
OUTCOMES: Final = {outcome: outcome.replace(" ", "_") for outcome in get_args(Outcome)}  # and their columns in ``runs``


def run_row(number: int, flown: CampaignFlight, scored: Score) -> Row:
    """Return the row of table ``runs``."""
    scenario, verdict = flown.scenario, flown.verdict
    outcomes, transients = [fault.outcome for fault in scored.faults], scored.flight.transients
    return {
        "run": number,
        "seed": scenario.seed,
        "aircraft": scenario.aircraft,
        "flight_point": scenario.airframe.point(scenario.flight_point).name,
        "manager": scenario.redundancy.manager,
        "outcome": "flown",
        "digest": verdict.digest,
        "frames": verdict.frames,
        "duration_s": verdict.frames / scenario.rate_hz,
        "survived": verdict.survived,
        "end_reason": flown.end_reason,
        **{name: value if math.isfinite(value) else None for name, value in asdict(verdict.peaks).items()},
        **{column: outcomes.count(outcome) for outcome, column in OUTCOMES.items()},
        **{column: len(getattr(scored, column)) for column in ISOLATIONS.values()},
        "suspect_channels": sum(suspect.lasting for suspect in scored.suspects),
        "channel_hours": channel_hours(scenario, verdict.frames, scored),
        "vote_above_threshold_s": sum(error.above_threshold_s for error in scored.vote_error.values()),
        "unresolved": scored.unresolved,
        "out_of_limits_s": None if transients is None else transients.out_of_limits_s,
        "coverage": _coverage(scored),
        **run_columns(scenario, flown.coils_failed, unit_of(flown.unit).get("lane")),
        "replies": binned(flown.timing["reply_us"]).tolist() if flown.unit else None,
    }


def _coverage(scored: Score) -> str:
    """Return as JSON, without the signals of which nothing but normal was seen."""
    seen = {name: asdict(c) for name, c in scored.coverage.items() if len(c.patterns) > 1 or len(c.levels) > 1}
    return json.dumps({**seen, "overall": asdict(scored.coverage["overall"])}, sort_keys=True)


def channel_hours(scenario: Scenario, frames: int, scored: Score) -> float:
    """Return the hours of fitted channels of signals without a fault: each counts until the first fault acts on it."""
    onsets: dict[tuple[str, int], int] = {}
    for fault in scored.faults:
        if fault.signal in INDEX and fault.channel is not None and fault.onset_frame is not None:
            place = fault.signal, fault.channel
            onsets[place] = min(onsets.get(place, frames), fault.onset_frame)
    channels = sum(getattr(scenario.sensors, signal.name).channels for signal in SIGNALS)
    faulty = sum(frames - onset for onset in onsets.values())
    return (channels * frames - faulty) / scenario.rate_hz / 3600.0


def fault_rows(number: int, scenario: Scenario, scored: Score) -> list[Row]:
    """Return the rows of table ``faults``: one a fault and channel."""
    return [_fault_row(number, scenario, fault) for fault in scored.faults]


def _fault_row(number: int, scenario: Scenario, fault: FaultScore) -> Row:
    period_s = 1.0 / scenario.rate_hz
    time_s = lambda frame: None if frame is None else frame * period_s  # noqa: E731 # a frame's time, where there is one
    return {
        "run": number,
        "fault": fault.index,
        **_of(fault, "id", "signal", "channel", "kind", "outcome", "resolver"),
        "magnitude": magnitude(scenario.faults[fault.index], scenario),
        "onset_s": time_s(fault.onset_frame),
        "exceeded_s": time_s(fault.exceeded_frame),
        "failed_s": time_s(fault.failed_frame),
        "law_s": time_s(fault.law_frame),
        "delay_from_onset_s": time_s(fault.delay_from_onset_frames),
        "delay_from_exceeded_s": time_s(fault.delay_from_exceeded_frames),
        "isolation": PUBLIC["campaign"][fault.word],
        "pattern": fault.pattern,
        **_followed(fault),
    }


def _followed(fault: FaultScore) -> Row:
    """Return the columns of what followed a fault on a channel of a signal; all empty for another."""
    window = fault.window
    if window is None:
        return {}
    return {
        **_of(window, "good_before", "latent_before", "lost_s"),
        "vote_above_threshold_s": window.above_threshold_s,
        "vote_error_max": window.error_max,
        "vote_kept": window.kept,
        "wrong_vote_first": window.wrong_vote_first,
    }


def _of(scored: Any, *names: str) -> Row:
    """Return the columns that are called as in the score."""
    return {name: getattr(scored, name) for name in names}


def magnitude(fault: Fault, scenario: Scenario) -> float | None:
    """Return how large a fault is, without its sign: by its setting, of a scale its distance from 1.

    A size in thresholds is told in the unit of the signal, as any other; not that of a link, which is of all signals.
    """
    size = fault.magnitude
    if size is None or not size.thresholds or site(fault.signal) == "ccdl":
        return None if size is None else size.value
    return size.value * getattr(scenario.redundancy.signals, fault.signal.removeprefix("reference.")).threshold


def alarm_rows(number: int, scenario: Scenario, scored: Score) -> list[Row]:
    """Return the rows of table ``alarms``: healthy channels that were failed."""
    period_s = 1.0 / scenario.rate_hz
    return [
        {"run": number, "kind": kind, "time_s": alarm.frame * period_s, **_of(alarm, "signal", "channel", "resolver")}
        for kind, alarm in scored.isolations
    ]


def episode_rows(number: int, scenario: Scenario, scored: Score) -> list[Row]:
    """Return the rows of table ``episodes``: stretches without a majority, who was asked and the result."""
    return [
        {
            "run": number,
            "begin_s": episode.first_frame / scenario.rate_hz,
            "asked": list(episode.asked),
            "failed": list(episode.failed),
            **_of(episode, "signal", "pattern", "frames", "resolver", "verdict"),
        }
        for episode in scored.episodes
    ]


def signal_rows(number: int, scored: Score) -> list[Row]:
    """Return the rows of table ``signals``: one a signal, how it stood over the run."""
    return [
        {
            "run": number,
            "signal": name,
            "vote_above_threshold_s": scored.vote_error[name].above_threshold_s,
            "vote_error_max": scored.vote_error[name].peak,
            **_of(signal, "level_at_end", "lost_s", "unresolved_s"),
            **by_level("channel_hours", signal.channel_hours),
            **by_level("false_isolations", signal.false_isolations),
        }
        for name, signal in scored.signals.items()
    ]


def by_level(name: str, values: Sequence[Any]) -> Row:
    """Return columns ``name_level_4`` to ``name_level_1``."""
    return {f"{name}_level_{CHANNELS - i}": value for i, value in enumerate(values)}
