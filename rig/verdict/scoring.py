"""The score of one flight: tables over the records that its outcome added up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import zip_longest
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import manager_kind
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, DISCRETES, INDEX, SIGNALS, Block, DecidedBy, Pattern, Table
from rig.scenario.scenario import Scenario
from rig.verdict.flight_tally import FlightOutcome
from rig.verdict.law_tally import completed
from rig.verdict.monitored_places import allowed_frames, channels_of, monitor
from rig.verdict.patterns import by_pattern, coverage, episodes, tally
from rig.verdict.score_records import (
    ISOLATIONS,
    Evidence,
    FaultScore,
    Isolation,
    LaneHistory,
    Outcome,
    Score,
    SignalScore,
    VoteError,
    Window,
    Yardstick,
)
from rig.verdict.servo_kernels import MONITORS
from rig.verdict.servo_tally import finder
from rig.verdict.signal_kernels import LEVELS, NEVER
from rig.verdict.tally_records import COMPARISON
from rig.verdict.transients import Apart, Deviations, apart_from, flight_score, transients
from rig.verdict.unfaulted import MeasuredAgain, laid_out
from rig.verdict.words import PUBLIC, Cause, FaultWord, IsolationKind, fault_word

__all__ = ["monitor", "score", "score_blocks", "score_of"]
_YARDSTICK = Yardstick()
_DISCRETE_NAMES = [discrete.name for discrete in DISCRETES]
_SIGNAL_NAMES = [signal.name for signal in SIGNALS]
_FROM_0 = "a flight is scored from its frame 0 on"
_FRAMES = ("onset", "exceeded_at", "failed_at")
OUTCOMES: Final[Mapping[FaultWord, Outcome]] = PUBLIC["score"]  # pyright: ignore[reportAssignmentType]


def score(
    scenario: Scenario,
    table: Table,
    baseline: Block | None = None,
    yardstick: Yardstick = _YARDSTICK,
    unit_lane: str | None = None,
    unit_votes: bool = True,
) -> Score:
    """Score a flight of ``scenario`` against the truth in its ``table``, from frame 0 on.

    baseline : rows of the same flight without faults (``fly_baseline``); without it there are no transients
    unit_lane : of several computers, the one whose software is a unit under test, A to D
    unit_votes : False if a unit under test replaces the control law alone
    Without its clean channels the sensors are run again over the recorded truth.
    BadInput when these sensors cannot have given the rows, or the baseline is that of another flight.
    """
    return score_blocks(scenario, [table], None if baseline is None else [baseline], yardstick, unit_lane, unit_votes)


def score_blocks(
    scenario: Scenario,
    blocks: Iterable[Table],
    baseline: Iterable[Block] | None = None,
    yardstick: Yardstick = _YARDSTICK,
    unit_lane: str | None = None,
    unit_votes: bool = True,
) -> Score:
    """Score a flight whose frames come in blocks, as ``score`` does.

    baseline : as many frames at a time, fewer where it ends
    """
    outcome, again, apart = FlightOutcome(scenario, yardstick.window_s, unit_lane, unit_votes), None, list[Apart]()
    for table, other in zip_longest(blocks, baseline or ()):
        rows = laid_out(table.rows)
        if outcome.frames == 0 and len(rows) and rows["frame"][0] != 0:
            raise BadInput(_FROM_0)
        if table.clean is None:
            again = again or MeasuredAgain(scenario)  # it takes a tenth of a score to set up
            for part in again.of(Table(rows, table.beside)):
                outcome.add(part)
        else:
            outcome.add(Table(rows, table.beside, clean=table.clean))
        if baseline is not None:
            apart.append(apart_from(rows, other))
    if outcome.frames == 0:
        raise BadInput(_FROM_0)
    return score_of(outcome, None if baseline is None else Deviations.of(apart, yardstick))


def score_of(outcome: FlightOutcome, off: Deviations | None = None) -> Score:
    """Return the score of the flight that was added up; off : from its baseline, for the transients."""
    scenario, records = outcome.scenario, outcome.records
    names = [name for name, signal in zip(_SIGNAL_NAMES, records.signals, strict=True) if not signal["reported"]]
    faults, listed = _faults(outcome), episodes(outcome)
    isolations = {field: _isolations(outcome, kind, faults) for kind, field in ISOLATIONS.items()}
    acted_from = int(records.flight["acted_from"][0])
    measured = None if off is None else transients(off, faults, acted_from, scenario.rate_hz)
    alone = scenario.computers.count == 1  # not one lane of several
    by_unit = bool(records.flight["unit"][0]) and alone and outcome.unit_votes
    return Score(
        faults=faults,
        **isolations,
        episodes=listed,
        tie_break=tally(listed),
        tie_break_by_pattern=by_pattern(listed),
        unresolved=sum(episode.decided_by == "unresolved" for episode in listed),
        vote_error=_vote_errors(outcome),
        signals=_signals(outcome),
        flight=flight_score(scenario, records.flight[0], measured),
        coverage=coverage(records.patterns, records.levels, records.params["fitted"]),
        wrong_votes_s=dict(
            zip(_DISCRETE_NAMES, (records.discretes["wrong_votes"] / scenario.rate_hz).tolist(), strict=True)
        ),
        actuators={} if outcome.actuators is None else outcome.actuators.scores(),
        computers=None if outcome.computers is None else outcome.computers.score(faults),
        law=outcome.law,
        suspects=outcome.suspects,
        evidence=Evidence(
            outcome.params,
            by_unit,
            frozenset(names),
            outcome.kept,
            tuple(_channel_isolations(outcome, None)),
            LaneHistory() if outcome.computers is None else outcome.computers.history,
        ),
    )


def _faults(outcome: FlightOutcome) -> list[FaultScore]:
    """Return one entry for each fault and channel, or for the fault where it sits on none, in order of the scenario."""
    scored = []
    faults, takes_back = outcome.scenario.faults, manager_kind(outcome.scenario.redundancy.manager).takes_back
    places = [place for fault in faults for place in channels_of(fault) or [(fault.signal, None)]]
    for record, (place, channel) in zip(outcome.records.faults, places, strict=True):
        number = int(record["number"])
        fault, (onset, exceeded, failed) = faults[number], (_frame(record[name]) for name in _FRAMES)
        executed = bool(record["executed"])
        window, run = _window(outcome, record), int(record["longest_run"])
        word = outcome.word(record, window.correct if window is not None and takes_back else None)
        of_its_own = fault_word(executed, failed is not None, exceeded is not None)  # whatever became of healthy ones
        scored.append(
            FaultScore(
                id=fault.label,
                signal=place,
                channel=channel,
                kind=fault.kind,
                onset_frame=onset,
                exceeded_frame=exceeded,
                failed_frame=failed,
                outcome=OUTCOMES[of_its_own],
                delay_from_onset_frames=None if failed is None or onset is None else failed - onset,
                delay_from_exceeded_frames=None if failed is None or exceeded is None else failed - exceeded,
                decided_by=None if failed is None else rule_name(record["decided_by"]),
                peak_error=_number(record["peak"]),
                exceeded_run_frames=run,
                tolerated=of_its_own == "missed" and run < _persistence(outcome, record),
                index=number,
                word=word,
                window=window,
                load_factor_change=_number(record["load_factor_change"]),
                load_factor_change_s=_looked_at_s(outcome, onset),
                sample=_number(record["sample"]),
                pattern=_pattern(record),
            )
        )
    if (servos := outcome.actuators) is not None:
        scored = [servos.completed(n, fault) for n, fault in enumerate(scored)]
    if (lanes := outcome.computers) is not None:
        scored = [lanes.completed(fault) for fault in scored]
    if not (found := outcome.law):
        return scored
    until = [_last_cause(outcome, record) for record in outcome.records.faults]
    return [completed(fault, last, found) for fault, last in zip(scored, until, strict=True)]


def _last_cause(outcome: FlightOutcome, record: np.void) -> int:
    """Return the last frame in which a fault on a channel of a signal can be the cause of what is found."""
    if record["signal"] == NEVER or record["discrete"]:
        return NEVER
    return int(record["acted_at"]) + int(outcome.records.signals["linger"][record["signal"]])


def _frame(value: int) -> int | None:
    return None if value == NEVER else int(value)


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def rule_name(code: int) -> str:
    """Return who failed a channel, as the kernels write it."""
    if code >= MONITORS:
        return finder(int(code))
    return "comparison" if code == COMPARISON else DecidedBy(code).name.lower()


def _persistence(outcome: FlightOutcome, record: np.void) -> int:
    """Return for how many frames an error must last to be found; of several references the longest."""
    persistence = outcome.params["persistence"]
    if record["discrete"]:
        return int(outcome.records.discretes["linger"][record["signal"]])
    if record["signal"] != NEVER:
        return int(persistence[record["signal"]])
    return max((int(n) for s, n in enumerate(persistence) if int(record["references"]) >> s & 1), default=1)


def _looked_at_s(outcome: FlightOutcome, onset: int | None) -> float | None:
    """Return for how long after an onset the load factor was looked at."""
    if onset is None:
        return None
    last = min(onset + int(outcome.records.flight["window"][0]), outcome.frames - 1)
    return (last - onset) / outcome.scenario.rate_hz


def _pattern(record: np.void) -> str | None:
    """Return how the channels were in the frame before a failure, else the first split."""
    if record["onset"] == NEVER or record["signal"] == NEVER or record["discrete"]:
        return None
    if record["failed_at"] != NEVER:
        return Pattern(record["pattern"]).label
    return Pattern(record["in_split"] or record["worst"]).label


def _window(outcome: FlightOutcome, record: np.void) -> Window | None:
    """Return what followed a fault on a channel of a signal, up to the next onset on it: the spans up to there."""
    if record["onset"] == NEVER or record["signal"] == NEVER or record["discrete"]:
        return None
    records, onset, rate_hz = outcome.records, int(record["onset"]), outcome.scenario.rate_hz
    end = outcome.next_onset(record)
    spans = records.spans[: records.flight["spans"][0]]
    within = (spans["signal"] == record["signal"]) & (spans["begin"] >= onset) & (spans["begin"] < end)
    spans = spans[within & (np.arange(len(spans)) >= len(SIGNALS))]
    above, last = int(spans["above"].sum()), spans[-1]
    allowed = allowed_frames(outcome.params[record["signal"]])
    return Window(
        end_frame=end,
        good_before=int(spans[0]["good"]),
        latent_before=int(spans[0]["latent"]),
        above_threshold_s=float(above / rate_hz),
        error_max=float(spans["error_max"].max()),
        correct=not last["off"] and above <= allowed,
        lost_s=float(spans["lost"].sum() / rate_hz),
        wrong_vote_first=_above_before_loss(spans) > allowed,
    )


def _above_before_loss(spans: NDArray[np.void]) -> int:
    """Return the frames in which the vote was off up to the first one at level 0; 0 where there is none."""
    above = 0
    for span in spans:
        if span["lost"]:
            return above + int(span["above_lost"])
        above += int(span["above"])
    return 0


def _isolations(outcome: FlightOutcome, kind: IsolationKind, faults: list[FaultScore]) -> list[Isolation]:
    """Return the healthy channels that were failed so, of signals, discretes, actuators, then lanes."""
    of_servos = [] if outcome.actuators is None else outcome.actuators.isolations(kind)
    lanes = outcome.computers
    of_lanes = [] if lanes is None else lanes.isolations(kind, faults)
    return [*_channel_isolations(outcome, kind), *of_servos, *of_lanes]


def _channel_isolations(outcome: FlightOutcome, kind: IsolationKind | None) -> list[Isolation]:
    """Return the channels of signals, then of discretes, that were isolated so; None: for a fault of their own."""
    return [
        Isolation(
            (_DISCRETE_NAMES if each["discrete"] else _SIGNAL_NAMES)[each["signal"]],
            int(each["channel"]) + 1,
            int(each["frame"]),
            rule_name(each["decided_by"]),
            tuple(c + 1 for c in range(CHANNELS) if int(each["erring"]) >> c & 1),
        )
        for each in sorted(outcome.failures, key=lambda failure: int(failure["discrete"]))
        if Cause(each["cause"]).kind == kind
    ]


def _vote_errors(outcome: FlightOutcome) -> dict[str, VoteError]:
    """Return of every signal how far the vote was from the truth, and from the vote of healthy channels.

    A vote that is no number is above any threshold, and no part of peak and RMS; nor is a truth that is none.
    """
    votes, rate_hz = outcome.records.votes, outcome.scenario.rate_hz
    rms = np.sqrt(votes["squares"] / np.maximum(votes["finite"], 1))
    return {
        name: VoteError(
            peak=float(from_truth["peak"]),
            peak_frame=int(from_truth["at"]) if from_truth["finite"] else None,
            rms=float(of_both[0]),
            above_threshold_s=float(from_truth["above"] / rate_hz),
            above_threshold_after_onset_s=float(from_truth["above_after"] / rate_hz),
            clean_peak=float(from_clean["peak"]),
            clean_rms=float(of_both[1]),
            clean_above_threshold_s=float(from_clean["above"] / rate_hz),
        )
        for name, (from_truth, from_clean), of_both in zip(_SIGNAL_NAMES, votes, rms, strict=True)
    }


def _signals(outcome: FlightOutcome) -> dict[str, SignalScore]:
    """Return the totals of every signal."""
    signals, rate_hz = outcome.records.signals, outcome.scenario.rate_hz
    hours = signals["healthy_frames"][:, :0:-1] / (rate_hz * 3600.0)
    isolations = signals["false_isolations"][:, :0:-1]
    lost_s, unresolved_s = signals["lost"] / rate_hz, signals["unresolved"] / rate_hz
    at_end = np.where(signals["level"] < LEVELS, signals["level"], 0)
    columns = (at_end, lost_s, unresolved_s, hours, isolations)
    return {
        name: SignalScore(level, lost, unresolved, tuple(healthy), tuple(failed))
        for name, level, lost, unresolved, healthy, failed in zip(INDEX, *(c.tolist() for c in columns), strict=True)
    }
