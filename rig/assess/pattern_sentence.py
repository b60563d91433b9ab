"""Patterns without a majority in sentences: who was asked, what each answered and why, who settled it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.agreement import in_use
from rig.assess.context import Context, channels
from rig.assess.record import Episode
from rig.assess.votes import difference
from rig.computer.redundancy.reference_monitor import reference_threshold
from rig.frame import INDEX, SIGNALS, Ilm, Pattern
from rig.units.quantities import duration, quantity, seconds

_APART_S: Final = 1.0  # episodes of one signal that follow each other sooner are told as one
_NAMES: Final = {"ilm": "in-line monitors"}
_OUTCOMES: Final = {"right": "correctly", "wrong": "wrongly: a healthy channel was failed"}


def pattern_sentences(about: Context) -> list[str]:
    """Return one sentence for each pattern without a majority, in order of time; quick successions as one."""
    return [_sentence(group, about) for group in _groups(about.score.episodes, about.rate_hz)]


def _groups(episodes: Sequence[Episode], rate_hz: float) -> Iterator[list[Episode]]:
    """Episodes of one signal and one pattern that follow each other within _APART_S, in order of the first."""
    open_groups: dict[tuple[str, str], list[Episode]] = {}
    groups: list[list[Episode]] = []
    for episode in episodes:
        key = episode.signal, episode.pattern
        group = open_groups.get(key)
        if group is None or episode.first_frame - _end(group[-1]) > _APART_S * rate_hz:
            group = open_groups[key] = []
            groups.append(group)
        group.append(episode)
    yield from groups


def _end(episode: Episode) -> int:
    return episode.first_frame + episode.frames


def _sentence(group: Sequence[Episode], about: Context) -> str:
    told = next((episode for episode in group if episode.failed), group[-1])  # the one that was decided
    first, rate_hz = group[0], about.rate_hz
    length = duration(_end(group[-1]) - first.first_frame, rate_hz)
    how_often = f" {len(group)} times" if len(group) > 1 else ""
    head = f"{first.signal} had no majority ({first.pattern}){how_often} from {seconds(first.first_frame, rate_hz)}"
    return f"{head} for {length}: {'; '.join((*_answers(told, about), _settled(told)))}"


def _settled(episode: Episode) -> str:
    if episode.resolver == "unresolved":
        return "nobody settled it: the vote was held"
    who = _NAMES.get(episode.resolver, episode.resolver)
    if not episode.failed:
        return f"settled by {who}, and the pattern went by before a channel was failed"
    return f"settled by {who}: {channels(list(episode.failed))} failed, {_OUTCOMES[episode.verdict]}"


def _answers(episode: Episode, about: Context) -> Iterator[str]:
    """Each resolver that was asked, with what it had to go by in the last frame of the episode."""
    k, s = _end(episode) - 1, INDEX[episode.signal]
    used = np.flatnonzero(in_use(about.rows, s, k, k + 1, about.params[s])[0])
    row = about.rows[k]
    told = {"ilm": _ilm, "trend": _trend, "reference": _reference}
    for name in episode.asked:
        answered = "answered" if name == episode.resolver else "no answer"
        why = told[name](row, s, used, about.params[s]) if name in told else ""
        yield f"{_NAMES.get(name, name)}: {answered}{f' ({why})' if why else ''}"


def _ilm(row: Any, s: int, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    said = row["ilm"][s][used]
    if (said == Ilm.ABSENT).all():
        return "none fitted"
    bad, good = ((used[said == flag] + 1).tolist() for flag in (Ilm.BAD, Ilm.GOOD))
    return f"{channels(bad)} bad, {channels(good)} good"


def _trend(row: Any, s: int, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    high, low, frames = int(row["trend_high"][s]), int(row["trend_low"][s]), int(p["trend_frames"])
    if high == low == (1 << frames) - 1:
        return f"both halves rose for {frames} frames, so the lower one is wrong"
    if high == low == 0:
        return f"neither half rose for {frames} frames, so the higher one is wrong"
    return f"the halves did not move alike for {frames} frames"


def _reference(row: Any, s: int, used: NDArray[np.intp], p: NDArray[np.void]) -> str:
    value = float(row["reference"][s])
    if not np.isfinite(value):
        return "there is none"
    if row["reference_usable"][s] == 0:
        return "not usable"
    limit = float(reference_threshold(value, p))
    off = difference(row["channels"][s][used], np.full(len(used), value), SIGNALS[s].wraps)
    behind = ", compared behind a low-pass" if p["filter_gain"] > 0 else ""
    unit = SIGNALS[s].unit
    return f"{quantity(value, unit)}, {_lies(row, s, used, off, limit, quantity(limit, unit))}{behind}"


def _lies(row: Any, s: int, used: NDArray[np.intp], off: NDArray[np.float64], limit: float, shown: str) -> str:
    """Where the reference lies among the samples, which are ``off`` it by so much: what its answer follows from."""
    halves, half = row["pattern"][s] in (Pattern.P2_2, Pattern.P1_1), len(used) // 2
    order = np.argsort(off)
    low, high = (sorted((used[part] + 1).tolist()) for part in (order[:half], order[half:]))
    if halves and off[order[half]] <= 0:
        return f"on the side of {channels(high)}, above {channels(low)}"
    if halves and off[order[half - 1]] >= 0:
        return f"on the side of {channels(low)}, below {channels(high)}"
    near = (used[np.abs(off) <= limit] + 1).tolist()
    return f"{'between the halves, ' if halves else ''}within its threshold of {shown} of {channels(near)}"
