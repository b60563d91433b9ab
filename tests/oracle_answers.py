"""The oracle's frame and its resolvers: sections 4 to 6 of the requirement, each as one plain function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi

PAIRS = ("2:2", "1:1")
LAST_ASKED = ("extremes", "middle")  # the paper's rules of likelihood

Answer = tuple[float, set[int]]  # the vote, and the channels that are wrong


@dataclass
class Settings:
    threshold: float = 1.0
    persistence: int = 8
    singular_persistence: int = 10
    resolvers: tuple[str, ...] = ("ilm", "reference", "trend", "extremes", "middle")
    trend_frames: int = 8
    reference_threshold: float = 1.0
    second_threshold: float = 1.0
    common_persistence: int = 10
    common_fails: bool = False
    channels: int = 4
    turn: float = 0.0  # a full turn for an angle, 0 for anything else

    def near(self, x: float, base: float) -> float:
        """``x`` on the turn of ``base``."""
        return base + ((x - base + pi) % self.turn - pi) if self.turn else x

    def apart(self, x: float, reference: float) -> float:
        """How far ``x`` is from ``reference``, the short way round."""
        return abs(self.near(x, reference) - reference)


@dataclass
class View:
    """One frame as the monitor sees it: the comparable samples of the channels in use, ranked."""

    s: Settings
    use: dict[int, float]
    ilm: Sequence[str]
    reference: float | None  # finite
    trusted: bool  # whether the reference has not been declared unusable
    bits: tuple[list[int], list[int]] = ([], [])
    pattern: str = ""
    lonely: set[int] = field(default_factory=set)  # who miscompares

    def __post_init__(self) -> None:
        self.ascending = sorted(self.use, key=lambda c: self.use[c])
        self.x = [self.use[c] for c in self.ascending]

    @property
    def usable_reference(self) -> float | None:
        return self.reference if self.trusted else None

    @property
    def ranks(self) -> tuple[float, float]:
        """The two voting ranks, the larger first; of an odd number twice the middle value."""
        return self.x[len(self.x) // 2], self.x[(len(self.x) - 1) // 2]

    @property
    def halves(self) -> tuple[set[int], set[int]]:
        """The channels of the smaller and of the larger half."""
        half = len(self.ascending) // 2
        return set(self.ascending[:half]), set(self.ascending[half:])

    def mean(self, side: set[int]) -> float:
        return sum(self.use[c] for c in side) / len(side)


def by_ilm(view: View) -> Answer | None:
    """The half, or the one channel, that alone is good when all others are bad."""
    sides = view.halves if view.pattern in PAIRS else [{c} for c in view.ascending]
    for side in sides:
        rest = set(view.use) - side
        if {view.ilm[c] for c in side} == {"good"} and {view.ilm[c] for c in rest} == {"bad"}:
            return view.mean(side), rest
    return None


def by_reference(view: View) -> Answer | None:
    """The middle of {ranks, reference}; where nobody agrees, the only sample within the reference threshold."""
    reference = view.usable_reference
    if reference is None:
        return None
    if view.pattern in PAIRS:
        return triplex(view, reference)
    within = [c for c in view.use if view.s.apart(view.use[c], reference) <= view.s.reference_threshold]
    if len(within) != 1:
        return None
    return view.use[within[0]], set(view.use) - set(within)


def triplex(view: View, reference: float) -> Answer:
    """Section 4.3: the middle, and who fails for it."""
    (above, below), (low, high) = view.ranks, view.halves
    if reference >= above:
        return above, low
    if reference <= below:
        return below, high
    wrong = high if above - reference > view.s.reference_threshold else set()
    return reference, wrong | (low if reference - below > view.s.reference_threshold else set())


def by_trend(view: View) -> Answer | None:
    """Both ranks rising throughout: the larger half; neither rising in any frame: the smaller."""
    if view.pattern not in PAIRS or len(view.bits[0]) < view.s.trend_frames:
        return None
    low, high = view.halves
    both = view.bits[0] + view.bits[1]
    if all(both):
        return view.mean(high), low
    return None if any(both) else (view.mean(low), high)


def by_extremes(view: View) -> Answer | None:
    """Section 5, when nobody else answers."""
    if view.pattern != "1:1:1:1":
        return None
    return sum(view.ranks) / 2, {view.ascending[0], view.ascending[3]}


def by_middle(view: View) -> Answer | None:
    """Section 6, when nobody else answers."""
    if view.pattern != "1:1:1":
        return None
    return view.x[1], {view.ascending[0], view.ascending[2]}


RESOLVERS: dict[str, Callable[[View], Answer | None]] = {
    "ilm": by_ilm,
    "reference": by_reference,
    "trend": by_trend,
    "extremes": by_extremes,
    "middle": by_middle,
}


def first_answer(view: View) -> tuple[str, float, set[int]] | None:
    """The first answer in the configured order, extremes and middle after all others."""
    for name in sorted(view.s.resolvers, key=lambda name: name in LAST_ASKED):
        answer = RESOLVERS[name](view)
        if answer is not None:
            return (name, *answer)
    return None
