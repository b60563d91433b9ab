"""Patterns without a majority: which resolvers were asked, who answered, and whether rightly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from rig.assess.isolations import Failure
from rig.assess.record import BY_DESIGN, Episode, ResolverScore
from rig.frame import SIGNALS, Block, Pattern, Resolver

RESOLVERS: Final = ("ilm", "trend", "reference", "extremes", "middle", "box")
PATTERNS: Final = tuple(pattern for pattern in Pattern if pattern.is_singular)
_CODES: Final = frozenset(map(int, Resolver))
_LAST_RESORT: Final = {Pattern.P1_1_1_1: Resolver.EXTREMES, Pattern.P1_1_1: Resolver.MIDDLE}


def episodes(rows: Block, params: NDArray[np.void], failures: Sequence[Failure]) -> list[Episode]:
    """Every run of frames in which a signal kept one singular pattern, in order of time."""
    patterns = np.ascontiguousarray(rows["pattern"])
    singular = (patterns >= Pattern.P2_2) & (patterns <= Pattern.P1_1)
    found = [
        _episode(rows, params[s], [f for f in failures if f.signal == s], int(s), first, last)
        for s in np.flatnonzero(singular.any(axis=0))
        for first, last in runs(patterns[:, s], singular[:, s])
    ]
    return sorted(found, key=lambda episode: episode.first_frame)


def runs(values: NDArray[np.uint8], wanted: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last row of every run of one value, where ``wanted``."""
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    firsts = np.concatenate([[0], edges])
    lasts = np.concatenate([edges - 1, [len(values) - 1]])
    for first, last in zip(firsts, lasts, strict=True):
        if wanted[first]:
            yield int(first), int(last)


def _episode(rows: Block, p: NDArray[np.void], failures: Sequence[Failure], s: int, first: int, last: int) -> Episode:
    pattern = Pattern(rows["pattern"][first, s])
    said = [_resolver(code) for code in np.unique(rows["resolver"][first : last + 1, s])]
    stood = _resolver(rows["resolver"][last, s])
    by_resolver = [f for f in failures if first <= f.frame <= last and f.resolver in RESOLVERS]
    verdict: Literal["right", "wrong", "open"] = "open"
    if by_resolver:
        verdict = "right" if all(f.own or f.kind in BY_DESIGN for f in by_resolver) else "wrong"
    return Episode(
        signal=SIGNALS[s].name,
        pattern=pattern.label,
        first_frame=first,
        frames=last - first + 1,
        asked=_asked(pattern, said, p),
        resolver=stood.name.lower() if stood is not Resolver.NONE else Resolver.UNRESOLVED.name.lower(),
        failed=tuple(sorted(f.channel + 1 for f in by_resolver)),
        verdict=verdict,
    )


def _resolver(code: int) -> Resolver:
    return Resolver(code) if code in _CODES else Resolver.NONE


def _asked(pattern: Pattern, said: Sequence[Resolver], p: NDArray[np.void]) -> tuple[str, ...]:
    """The resolvers asked in any frame: in their order, up to the one that answered, all when nobody did."""
    order = _order(pattern, [Resolver(code) for code in p["resolvers"] if code])
    reached = [order.index(r) + 1 if r in order else len(order) for r in said]
    return tuple(r.name.lower() for r in order[: max(reached)]) + (("box",) if Resolver.BOX in said else ())


def _order(pattern: Pattern, configured: Sequence[Resolver]) -> list[Resolver]:
    """Who is asked of a pattern: monitors and reference as configured, trend of halves only, the rule of rank last."""
    halves = pattern not in _LAST_RESORT
    rules = _LAST_RESORT.values()
    asked = [r for r in configured if r not in rules and (halves or r is not Resolver.TREND)]
    return asked if halves else [*asked, *(r for r in configured if r is _LAST_RESORT[pattern])]


def tally(found: Sequence[Episode]) -> dict[str, ResolverScore]:
    """What the episodes say of each resolver."""
    scores = {name: ResolverScore() for name in RESOLVERS}
    for episode in found:
        for name in episode.asked:
            scores[name].asked += 1
        if episode.resolver in scores:
            score = scores[episode.resolver]
            score.answered += 1
            score.right += episode.verdict == "right"
            score.wrong += episode.verdict == "wrong"
            score.open += episode.verdict == "open"
    return scores


def by_pattern(found: Sequence[Episode]) -> dict[str, dict[str, ResolverScore]]:
    """The same for each pattern that was seen."""
    seen = {pattern.label: [e for e in found if e.pattern == pattern.label] for pattern in PATTERNS}
    return {label: tally(some) for label, some in seen.items() if some}
