"""Patterns of a flight: splits, the tie-break rules asked and whether they were correct; coverage of patterns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import SIGNALS, DecidedBy, Pattern
from rig.verdict.flight_tally import FlightOutcome
from rig.verdict.score_records import Coverage, Episode, RuleScore
from rig.verdict.signal_kernels import LEVELS
from rig.verdict.tally_records import PATTERNS
from rig.verdict.words import Cause

TIE_BREAKS: Final = ("ilm", "lane", "trend", "reference", "extremes", "middle", "box")
SPLITS: Final = tuple(pattern for pattern in Pattern if pattern.is_split)
_CODES: Final = frozenset(map(int, DecidedBy))
_LAST_RESORT: Final = {Pattern.P1_1_1_1: DecidedBy.EXTREMES, Pattern.P1_1_1: DecidedBy.MIDDLE}
_RIGHT: Final = (Cause.OWN_FAULT, Cause.WITH_ITS_BOX, Cause.BY_RULE)
# What a voter of so many channels can meet; a sample that is lost for a frame makes any number below possible.
POSSIBLE: Final = {
    2: (Pattern.NORMAL, Pattern.P1_1, Pattern.LOST),
    3: (Pattern.NORMAL, Pattern.ISOLATED, Pattern.P1_1_1, Pattern.P1_1, Pattern.LOST),
    4: tuple(Pattern),
}


def episodes(outcome: FlightOutcome) -> list[Episode]:
    """Return every run of frames in which a signal kept one split, in order of time."""
    failures = outcome.failures
    failures = failures[failures["discrete"] == 0]
    return [_episode(record, outcome.params[record["signal"]], failures) for record in outcome.episodes]


def _episode(record: np.void, p: NDArray[np.void], failures: NDArray[Any]) -> Episode:
    pattern = Pattern(record["pattern"])
    reported = [decided_by for decided_by in DecidedBy if int(record["tie_break"]) >> decided_by & 1]
    stood = DecidedBy(record["decided_by"]) if record["decided_by"] in _CODES else DecidedBy.NONE
    within = (record["first"] <= failures["frame"]) & (failures["frame"] <= record["last"])
    within &= failures["signal"] == record["signal"]
    by_rule = [f for f in failures[within] if DecidedBy(f["decided_by"]).name.lower() in TIE_BREAKS]
    verdict: Literal["correct", "wrong", "open"] = "open"
    if by_rule:
        verdict = "correct" if all(f["cause"] in _RIGHT for f in by_rule) else "wrong"
    return Episode(
        signal=SIGNALS[record["signal"]].name,
        pattern=pattern.label,
        first_frame=int(record["first"]),
        frames=int(record["last"] - record["first"]) + 1,
        asked=_asked(pattern, reported, p),
        decided_by=stood.name.lower() if stood is not DecidedBy.NONE else DecidedBy.UNRESOLVED.name.lower(),
        failed=tuple(sorted(int(f["channel"]) + 1 for f in by_rule)),
        verdict=verdict,
        last=record,
    )


def _asked(pattern: Pattern, reported: Sequence[DecidedBy], p: NDArray[np.void]) -> tuple[str, ...]:
    """Return the rules asked in any frame: in their order, up to the one that answered, or all."""
    order = _order(pattern, [DecidedBy(code) for code in p["tie_break"] if code])
    reached = [order.index(r) + 1 if r in order else len(order) for r in reported]
    return tuple(r.name.lower() for r in order[: max(reached)]) + (("box",) if DecidedBy.BOX in reported else ())


def _order(pattern: Pattern, configured: Sequence[DecidedBy]) -> list[DecidedBy]:
    """Return who is asked of a pattern: monitors and reference as configured, trend of halves, the rank last."""
    halves = pattern not in _LAST_RESORT
    rules = _LAST_RESORT.values()
    asked = [r for r in configured if r not in rules and (halves or r is not DecidedBy.TREND)]
    return asked if halves else [*asked, *(r for r in configured if r is _LAST_RESORT[pattern])]


def tally(listed: Sequence[Episode]) -> dict[str, RuleScore]:
    """Count the episodes of each rule."""
    scores = {name: RuleScore() for name in TIE_BREAKS}
    for episode in listed:
        for name in episode.asked:
            scores[name].asked += 1
        if episode.decided_by in scores:
            score = scores[episode.decided_by]
            score.answered += 1
            score.correct += episode.verdict == "correct"
            score.wrong += episode.verdict == "wrong"
            score.open += episode.verdict == "open"
    return scores


def by_pattern(listed: Sequence[Episode]) -> dict[str, dict[str, RuleScore]]:
    """Count them for each pattern that was seen."""
    seen = {pattern.label: [e for e in listed if e.pattern == pattern.label] for pattern in SPLITS}
    return {label: tally(some) for label, some in seen.items() if some}


def coverage(patterns: NDArray[np.int64], levels: NDArray[np.int64], fitted: NDArray[np.int64]) -> dict[str, Coverage]:
    """Return what each signal met, and ``overall`` what any did.

    patterns : (S, 7, 7) and levels : (S, 5, 5) frames, by what was before and now; fitted : (S,) channels
    """
    met, levels_met, any_of = patterns > 0, levels > 0, np.logical_or.reduce
    by_signal = {signal.name: _coverage(met[s], levels_met[s], int(fitted[s])) for s, signal in enumerate(SIGNALS)}
    overall = _coverage(any_of(met, axis=0), any_of(levels_met, axis=0), int(fitted.max()))
    return {**by_signal, "overall": overall}


def _coverage(met: NDArray[np.bool_], levels_met: NDArray[np.bool_], fitted: int) -> Coverage:
    return _of_flags(met.tobytes(), levels_met.tobytes(), fitted)


@cache
def _of_flags(met: bytes, levels_met: bytes, fitted: int) -> Coverage:
    """Return the coverage of (7, 7) and (5, 5) flags [before, now]; nearly all signals are alike."""
    patterns = np.frombuffer(met, bool).reshape(PATTERNS, PATTERNS)
    levels = np.frombuffer(levels_met, bool).reshape(LEVELS, LEVELS)
    kinds = len(POSSIBLE[fitted])
    return Coverage(
        patterns=tuple(Pattern(i).label for i in np.flatnonzero(patterns.any(axis=0))),
        patterns_possible=kinds,
        levels=tuple(np.flatnonzero(levels.any(axis=0)).tolist()[::-1]),
        levels_possible=fitted + 1,
        pattern_transitions=tuple(f"{Pattern(a).label}>{Pattern(b).label}" for a, b in _moves(patterns)),
        pattern_transitions_possible=kinds * (kinds - 1),
        level_transitions=tuple(f"{a}>{b}" for a, b in _moves(levels)),
        level_transitions_possible=fitted * (fitted + 1),
    )


def _moves(seen: NDArray[np.bool_]) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in np.argwhere(seen) if a != b]
