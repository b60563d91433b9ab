"""Splits of a flight in words: how long there was no majority, and which tie-break rule settled it by what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.reference_monitor import reference_threshold
from rig.core.frame import CHANNELS, INDEX, SIGNALS, Ilm, Pattern
from rig.core.units.angles import differences
from rig.core.units.quantities import duration, quantity, seconds
from rig.flight.conclusion_rows import Row
from rig.verdict.context import Context, channels, comparable, named
from rig.verdict.score_records import Episode

OfFaults = dict[tuple[int, str], list[str]]  # by index of the fault and signal: texts
RULES: Final = {
    "ilm": "in-line monitors",
    "lane": "failures of the computers",
    "trend": "trend",
    "reference": "reference",
    "extremes": "rule of the extremes",
    "middle": "rule of the middle channel",
    "box": "LRU rule",
}
_APART_S: Final = 1.0  # splits of one signal that follow each other sooner are told as one
_MOST: Final = 2  # texts of a fault about splits


def splits(context: Context) -> tuple[OfFaults, list[Row]]:
    """Return the texts about splits that a fault began, by the fault; and rows about others."""
    of_faults: OfFaults = {}
    alone: dict[tuple[str, str], list[list[Episode]]] = {}
    for group in _groups(context.score.episodes, context.rate_hz):
        signal, first = group[0].signal, group[0].first_frame
        begun = [
            fault
            for fault in context.score.faults
            if fault.signal == signal and fault.onset_frame is not None and fault.onset_frame <= first
        ]
        fault = max(begun, key=lambda each: each.onset_frame or 0, default=None)
        if fault is None:
            alone.setdefault((signal, group[0].pattern), []).append(group)
        else:
            of_faults.setdefault((fault.index, signal), []).append(_told(group, context))
    rows = [Row(named(signal), (*_alone(groups, context),)) for (signal, _), groups in alone.items()]
    return {key: _few(texts) for key, texts in of_faults.items()}, rows


def _alone(groups: Sequence[list[Episode]], context: Context) -> list[str]:
    """Return the texts about splits of one pattern that no fault began: each decision, all others together."""
    at = [f"at {seconds(group[0].first_frame, context.rate_hz)}" for group in groups]
    decided = [f"{when}: {_told(group, context)}" for when, group in zip(at, groups, strict=True) if _failed(group)]
    without = [when for when, group in zip(at, groups, strict=True) if not _failed(group)]
    if not without:
        return _few(decided)
    longest = max(episode.frames for group in groups for episode in group)
    when = without[0] if len(without) == 1 else f"{len(without)} times, first {without[0]}"
    text = f"no majority ({groups[0][0].pattern}) {when}, for at most {duration(longest, context.rate_hz)}"
    return _few([*decided, f"{text}; no channel was isolated"])


def _failed(group: Sequence[Episode]) -> bool:
    return any(episode.failed for episode in group)


def _few(texts: list[str]) -> list[str]:
    """Return the first texts, and how many more there are."""
    more = len(texts) - _MOST
    return texts if more <= 0 else [*texts[:_MOST], f"and {more} more split{'s' if more > 1 else ''}"]


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


def _told(group: Sequence[Episode], context: Context) -> str:
    """Return how long there was no majority, and what settled it."""
    decided = next((episode for episode in group if episode.failed), group[-1])
    length = duration(_end(group[-1]) - group[0].first_frame, context.rate_hz)
    often = f"for {length}" if len(group) == 1 else f"{len(group)} times within {length}"
    return f"no majority ({group[0].pattern}) {often}; {_settled(decided, context)}"


def _settled(episode: Episode, context: Context) -> str:
    if episode.decided_by == "unresolved":
        return f"no tie-break rule settled it{_why_not(episode, context)}; the voted value was held"
    if episode.decided_by == "given_up":
        return f"no tie-break rule settled it{_why_not(episode, context)}; the signal was given up"
    answer = _answer(episode, context)
    if not episode.failed:
        return f"{answer}; it ended before a channel was isolated"
    return f"settled wrongly: {answer}" if episode.verdict == "wrong" else answer


def _why_not(episode: Episode, context: Context) -> str:
    """Return why each rule that was asked had no answer."""
    row, used, p = _last(episode, context)
    reasons = {"ilm": _ilm, "trend": _trend, "reference": _reference}
    told = (f"{RULES[name]}: {reasons[name](row, used, p)}" for name in episode.asked if name in reasons)
    text = ", ".join(told)
    return f" ({text})" if text else ""


def _answer(episode: Episode, context: Context) -> str:
    """Return what the rule that settled a split went by in its last frame."""
    row, used, p = _last(episode, context)
    answers = {"ilm": _by_ilm, "trend": _by_trend, "reference": _by_reference}
    if episode.decided_by in answers:
        return answers[episode.decided_by](row, used, p)
    return f"settled by the {RULES.get(episode.decided_by, episode.decided_by)}"


def _last(episode: Episode, context: Context) -> tuple[Any, NDArray[np.intp], NDArray[np.void]]:
    """Return the last record of an episode, the channels that were compared in it, and its config.PARAMS."""
    row, p = episode.last, context.params[INDEX[episode.signal]]
    fitted = np.arange(CHANNELS) < p["fitted"]
    out = (row["failed"] >> np.arange(CHANNELS) & 1).astype(bool) | ~fitted
    return row, np.flatnonzero(comparable(row["channels"], row["valid"] != 0, out, p)), p


def _flagged(row: Any, used: NDArray[np.intp], flag: Ilm) -> list[int]:
    return (used[row["ilm"][used] == flag] + 1).tolist()


def _ilm(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    if (row["ilm"][used] == Ilm.ABSENT).all():
        return "not fitted"
    bad, good = _flagged(row, used, Ilm.BAD), _flagged(row, used, Ilm.GOOD)
    if not bad:
        return "no fault reported"
    return f"{channels(bad)} faulty, {channels(good)} good"


def _by_ilm(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    return f"the in-line monitors reported {channels(_flagged(row, used, Ilm.BAD))} faulty"


def _trend(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    return f"the sides did not move alike for {int(p['trend_frames'])} frames"


def _by_trend(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    high, low, frames = int(row["trend_high"]), int(row["trend_low"]), int(p["trend_frames"])
    if high == low == 0:
        return f"the trend decided for the lower side, as neither side rose for {frames} frames"
    if high == low == (1 << frames) - 1:
        return f"the trend decided for the upper side, as both sides rose for {frames} frames"
    return "settled by the trend"


def _reference(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    if not np.isfinite(float(row["reference"])):
        return "none"
    if row["reference_usable"] == 0:
        return "not usable"
    limit = quantity(_limit(row, p), SIGNALS[row["signal"]].unit)
    near = (used[np.abs(_off(row, used, p)) <= _limit(row, p)] + 1).tolist()
    return f"within its threshold of {limit} of {channels(near)}"


def _by_reference(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    """Return which side the reference took, as opinions.by_reference does."""
    off, limit, half = _off(row, used, p), _limit(row, p), len(used) // 2
    after = ", after the low-pass" if p["filter_gain"] > 0 else ""
    near = (used[np.abs(off) <= limit] + 1).tolist()
    if row["pattern"] not in (Pattern.P2_2, Pattern.P1_1):
        return f"the reference agreed with {channels(near)}{after}"
    order = np.argsort(off)
    low, high = (sorted((used[part] + 1).tolist()) for part in (order[:half], order[half:]))
    below, above = off[order[half - 1]], off[order[half]]
    side = high if above <= 0 else low if below >= 0 else high if above <= limit else low if -below <= limit else []
    if not side:
        return f"the reference agreed with no side{after}"
    agreed = "agreed with" if set(side) & set(near) else "was on the side of"
    return f"the reference {agreed} {channels(side)}{after}"


def _off(row: Any, used: NDArray[np.intp], p: NDArray[np.void]) -> NDArray[np.float64]:
    """Return how far each channel that was compared is above the reference."""
    value = float(row["reference"])
    return differences(row["channels"][used], np.full(len(used), value), bool(p["wraps"]))


def _limit(row: Any, p: NDArray[np.void]) -> float:
    return float(reference_threshold(float(row["reference"]), p))
