"""The conclusion of a flight as a person would say it: a sentence for each fault, each pattern, each wrong isolation,
and one for the flight.

Made from the score alone, so that every command that shows a flight prints the same sentences.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from shlex import quote
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.reference_monitor import reference_threshold
from rig.core.frame import CHANNELS, COMPUTERS, INDEX, SIGNALS, Ilm, Pattern
from rig.core.units.angles import differences
from rig.core.units.quantities import duration, quantity, seconds
from rig.scenario.scenario import Scenario
from rig.verdict.context import Context, channel, channels, comparable, place
from rig.verdict.counting import another
from rig.verdict.fault_sentence import fault_sentences
from rig.verdict.lane_tally import computers_lost, of_unit
from rig.verdict.law_tally import false_findings
from rig.verdict.score_records import Episode, Isolation, Score
from rig.verdict.servo_sentence import bypassed, listed
from rig.verdict.words import BY_DESIGN
from rig.world.faults.places import site

if TYPE_CHECKING:
    from rig.flight.flight_result import Flight

_APART_S: Final = 1.0  # episodes of one signal that follow each other sooner are told as one
_NAMES: Final = {"ilm": "in-line monitors"}


def conclusion(scenario: Scenario, score: Score) -> list[str]:
    """Return the sentences: faults, patterns, healthy channels that were failed, suspects that remain, the flight."""
    context = Context(scenario, score)
    return [
        *fault_sentences(context),
        *(_pattern_sentence(group, context) for group in _groups(score.episodes, context.rate_hz)),
        *(
            _isolated(each, f"at {seconds(each.frame, context.rate_hz)} by {each.decided_by}")
            for each in (*score.false_alarms, *score.wrong_isolations)
        ),
        *of_unit(context),
        *false_findings(context),
        *_by_design(score, context),
        *(f"{channel(one.signal, one.channel)} was suspect {one.text()}" for one in score.suspects if one.slow_faults),
        _flight(context),
    ]


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


def _isolated(isolation: Isolation, how: str) -> str:
    """Return a sentence of a healthy channel, or of a computer without a fault on it, and which were faulty."""
    faulty = list(isolation.faulty)
    if site(isolation.signal) == "computer":
        lanes = tuple(COMPUTERS[number - 1] for number in faulty)
        of = (
            f", although the fault was on {'computers' if len(lanes) > 1 else 'computer'} {listed(lanes)}"
            if lanes
            else ""
        )
        return f"{place(isolation.signal)} was failed {how} without a fault on it{of}"
    which = f"{channels(faulty)} {'were' if len(faulty) > 1 else 'was'}" if faulty else "no channel of it was"
    return f"{channel(isolation.signal, isolation.channel)} was healthy and was failed {how}, although {which} faulty"


def _by_design(score: Score, context: Context) -> Iterator[str]:
    """Yield a sentence for each channel number and frame in which a rule failed it for faults elsewhere."""
    whys = {"failed with its box": "with its box, which was faulty on others", "failed by rule": "by rule: common mode"}
    groups: dict[tuple[str, int, int], list[str]] = {}
    for kind, each in score.isolations:
        if kind in BY_DESIGN:
            groups.setdefault((whys[kind], each.channel, each.frame), []).append(each.signal)
    for (why, number, frame), signals in groups.items():
        yield f"channel {number} was failed {why}, at {seconds(frame, context.rate_hz)} on {', '.join(signals)}"


def _flight(context: Context) -> str:
    flight, score = context.score.flight, context.score
    ended = seconds(flight.frames, context.rate_hz)
    if not flight.survived:
        head = f"the aircraft was lost at {ended}: {flight.end_reason}"
    else:
        head = f"the aircraft survived ({flight.end_reason}, {ended})"
    lost = [name for name, signal in score.signals.items() if signal.level_at_end == 0 and not context.silent(name)]
    if lost:
        head += f"; no channel left of {', '.join(lost)}"
    for more in filter(None, (bypassed(context), computers_lost(context))):
        head += f"; {more}"
    return f"{head}; {_counted(context)}"


def _counted(context: Context) -> str:
    """Return how many of the detectable faults, counted by channel, were detected, and what was failed wrongly."""
    outcomes = [fault.outcome for fault in context.score.faults]
    if not outcomes:
        detections = "no fault was in the scenario"
    else:
        possible = outcomes.count("detected") + outcomes.count("missed")
        beside = sum(another(fault, context) is not None for fault in context.score.faults)
        detected = outcomes.count("detected") - beside
        detections = (
            f"{detected} of {possible} detectable faults detected" if possible else "no fault could be detected"
        )
        if beside:
            detections += f", {beside} more on channels failed for another fault"
    wrong = len(context.score.false_alarms) + len(context.score.wrong_isolations)
    by_design = "".join(
        f", {count} {kind}" for kind in BY_DESIGN if (count := [k for k, _ in context.score.isolations].count(kind))
    )
    return f"{detections}, {wrong or 'no'} healthy channel{'s' if wrong > 1 else ''} failed{by_design}"


def _groups(episodes: Sequence[Episode], rate_hz: float) -> list[list[Episode]]:
    """Group episodes of one signal and one pattern that follow each other within _APART_S, in order of the first."""
    latest: dict[tuple[str, str], list[Episode]] = {}
    groups: list[list[Episode]] = []
    for episode in episodes:
        key = episode.signal, episode.pattern
        if key not in latest or episode.first_frame - _end(latest[key][-1]) > _APART_S * rate_hz:
            latest[key] = []
            groups.append(latest[key])
        latest[key].append(episode)
    return groups


def _end(episode: Episode) -> int:
    return episode.first_frame + episode.frames


def _pattern_sentence(group: Sequence[Episode], context: Context) -> str:
    decided = next((episode for episode in group if episode.failed), group[-1])  # the one that was decided
    first, rate_hz = group[0], context.rate_hz
    length = duration(_end(group[-1]) - first.first_frame, rate_hz)
    how_often = f" {len(group)} times" if len(group) > 1 else ""
    head = f"{first.signal} had no majority ({first.pattern}){how_often} from {seconds(first.first_frame, rate_hz)}"
    return f"{head} for {length}: {'; '.join((*_answers(decided, context), _settled(decided, context)))}"


def _settled(episode: Episode, context: Context) -> str:
    if episode.decided_by == "unresolved":
        return "nobody settled it: the vote was held"
    if episode.decided_by == "given_up":
        return "nobody settled it, and the signal was given up"
    who = _NAMES.get(episode.decided_by, episode.decided_by)
    if not episode.failed:
        return f"settled by {who}, and the pattern went by before a channel was failed"
    how = "correctly" if episode.verdict == "right" else f"wrongly: {_healthy_of(episode, context)}"
    return f"settled by {who}: {channels(list(episode.failed))} failed, {how}"


def _healthy_of(episode: Episode, context: Context) -> str:
    """Return which of the channels that an episode failed were healthy: ``channels 1 and 2 were healthy``."""
    score = context.score
    failed = {
        each.channel
        for each in (*score.false_alarms, *score.wrong_isolations)
        if each.signal == episode.signal and episode.first_frame <= each.frame <= _end(episode)
    }
    healthy = sorted(failed & set(episode.failed))
    return f"{channels(healthy or list(episode.failed))} {'were' if len(healthy) > 1 else 'was'} healthy"


def _answers(episode: Episode, context: Context) -> Iterator[str]:
    """Yield each rule that was asked, with what it had to go by in the last frame of the episode."""
    row, p = episode.last, context.params[INDEX[episode.signal]]
    fitted = np.arange(CHANNELS) < p["fitted"]
    out = (row["failed"] >> np.arange(CHANNELS) & 1).astype(bool) | ~fitted
    used = np.flatnonzero(comparable(row["channels"], row["valid"] != 0, out, p))
    sentences = {"ilm": _ilm, "trend": _trend, "reference": _reference}
    for name in episode.asked:
        answered = "answered" if name == episode.decided_by else "no answer"
        why = sentences[name](row, used, p) if name in sentences else ""
        yield f"{_NAMES.get(name, name)}: {answered}{f' ({why})' if why else ''}"


def _ilm(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    flags = row["ilm"][used]
    if (flags == Ilm.ABSENT).all():
        return "none fitted"
    bad, good = ((used[flags == flag] + 1).tolist() for flag in (Ilm.BAD, Ilm.GOOD))
    return f"{channels(bad)} bad, {channels(good)} good"


def _trend(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    high, low, frames = int(row["trend_high"]), int(row["trend_low"]), int(p["trend_frames"])
    if high == low == (1 << frames) - 1:
        return f"both halves rose for {frames} frames, so the lower one is wrong"
    if high == low == 0:
        return f"neither half rose for {frames} frames, so the higher one is wrong"
    return f"the halves did not move alike for {frames} frames"


def _reference(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    value = float(row["reference"])
    if not np.isfinite(value):
        return "there is none"
    if row["reference_usable"] == 0:
        return "not usable"
    limit = float(reference_threshold(value, p))
    off = differences(row["channels"][used], np.full(len(used), value), bool(p["wraps"]))
    behind = ", compared behind a low-pass" if p["filter_gain"] > 0 else ""
    unit = SIGNALS[row["signal"]].unit
    return f"{quantity(value, unit)}, {_lies(row, used, off, limit, quantity(limit, unit))}{behind}"


def _lies(row: Any, used: NDArray[np.intp], off: NDArray[np.float64], limit: float, shown: str) -> str:
    """Return where the reference lies among the samples, which are ``off`` it by so much."""
    halves, half = row["pattern"] in (Pattern.P2_2, Pattern.P1_1), len(used) // 2
    order = np.argsort(off)
    low, high = (sorted((used[part] + 1).tolist()) for part in (order[:half], order[half:]))
    if halves and off[order[half]] <= 0:
        return f"on the side of {channels(high)}, above {channels(low)}"
    if halves and off[order[half - 1]] >= 0:
        return f"on the side of {channels(low)}, below {channels(high)}"
    near = (used[np.abs(off) <= limit] + 1).tolist()
    return f"{'between the halves, ' if halves else ''}within its reference threshold of {shown} of {channels(near)}"
