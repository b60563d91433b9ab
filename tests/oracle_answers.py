"""The oracle's frame and its tie-break rules: sections 4 to 6 of the requirement, each as one plain function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf, pi

from oracle_trend import Trend

PAIRS = ("2:2", "1:1")
LAST_ASKED = ("extremes", "middle")  # the paper's rules of likelihood

Answer = tuple[float, set[int]]  # the vote, and the channels that are wrong


@dataclass
class Settings:
    threshold: float = 1.0
    threshold_triplex: float | None = None  # of three compared samples, and of two; threshold where not given
    threshold_duplex: float | None = None
    filter_share: float = 0.0  # of a new sample in what is compared; 0: the sample itself
    slow_allowance: float = 0.0
    slow_limit: float = 0.0  # unit times frames
    stale_frames: int = 0
    slow_means: float = 0.0  # factors of the slow-fault tests; 0: none
    slow_squares: float = 1.0
    slow_halves: float = 1.0
    slow_bias: float = 0.0
    slow_scale: float = 0.0
    slow_noise: float = 0.0
    slow_skew: float = 0.0
    slow_reference: float = 0.0
    slow_reference_frames: float = 0.0
    persistence: int = 8
    split_persistence: int = 10
    count_down: float = 0.0  # what an agreeing frame takes off a count; 0: all of it
    unresolved_frames: int = 0  # of a split that no rule answers, until it is given up; 0: never
    tie_break: tuple[str, ...] = ("ilm", "lane", "reference", "trend", "extremes", "middle")
    trend_frames: int = 8
    trend_small: float = -1.0  # changes up to which one frame is trend enough; below zero: none
    trend_tumbles: bool = False  # bytes begun again every trend_frames
    trend_beside_reference: bool = False
    referred: bool = False  # a reference is configured
    weighted: bool = False  # means by the trend
    reference_threshold: float = 1.0
    second_threshold: float = 1.0
    common_persistence: int = 10
    common_fails: bool = False
    channels: int = 4
    turn: float = 0.0  # a full turn for an angle, 0 for anything else
    low: float = -inf  # the sensor's range
    high: float = inf
    box: int = 1  # which box measures the signal; 0: none
    tells: int = 0  # the bit of a signal whose references tell of those of others
    sources: int = 0  # the bits of those that tell of its own

    def within(self, compared: int) -> float:
        """How far two of ``compared`` samples may be apart and agree."""
        return {3: self.threshold_triplex, 2: self.threshold_duplex}.get(compared) or self.threshold

    def near(self, x: float, base: float) -> float:
        """``x`` on the turn of ``base``."""
        return base + ((x - base + pi) % self.turn - pi) if self.turn else x

    def change(self, x: float, last: float) -> float:
        return self.near(x, last) - last

    def limited(self, x: float | None) -> float | None:
        """What a healthy sensor would show of ``x``."""
        return x if x is None or self.turn else min(max(x, self.low), self.high)

    def apart(self, x: float, reference: float) -> float:
        """How far ``x`` is from ``reference``, the short way round."""
        return abs(self.near(x, reference) - reference)


@dataclass
class View:
    """One frame as the monitor sees it: the comparable samples of the channels in use, ranked.

    What is compared (``seen``, ``seen_reference``) is behind the filter where there is one; what is voted is not.
    """

    s: Settings
    use: dict[int, float]
    seen: dict[int, float]
    ilm: Sequence[str]
    reference: float | None  # finite
    seen_reference: float | None
    trusted: bool  # whether the reference has not been declared unusable
    lanes: Sequence[int] = ()  # channels whose computers are failed
    before: dict[int, float] = field(default_factory=dict)  # comparable samples of the last frame
    rise: float = 0.0  # the last change of the vote
    suspected: bool = False  # a pair that extremes left
    trend: Trend = field(default_factory=Trend)
    pattern: str = ""
    lonely: set[int] = field(default_factory=set)  # who miscompares

    def __post_init__(self) -> None:
        self.by_seen = sorted(self.seen, key=lambda c: (self.seen[c], self.use[c]))  # equals by their samples
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
        half = len(self.by_seen) // 2
        return set(self.by_seen[:half]), set(self.by_seen[half:])

    @property
    def middle_two(self) -> tuple[int, int]:
        """The channels at the two voting ranks of what is compared, the larger first."""
        return self.by_seen[len(self.by_seen) // 2], self.by_seen[(len(self.by_seen) - 1) // 2]

    def mean(self, side: set[int]) -> float:
        """Section 4: of a pair the plain mean, or the mean weighted by its changes."""
        if len(side) == 1 or not self.s.weighted:
            return sum(self.use[c] for c in side) / len(side)
        lower, higher = (c for c in self.by_seen if c in side)
        share = 0.5
        if lower in self.before and higher in self.before:
            rises = [self.s.change(self.use[c], self.before[c]) for c in (higher, lower)]
            share = share_of_larger(rises[0], rises[1], self.rise)
        return self.use[lower] + share * (self.use[higher] - self.use[lower])

    def mean_of_ranks(self) -> float:
        """The mean of the two voting ranks, weighted by their changes where that is chosen."""
        above, below = self.ranks
        share = share_of_larger(*self.trend.rises, self.rise) if self.s.weighted else 0.5
        return below + share * (above - below)


def share_of_larger(rise_larger: float, rise_smaller: float, rise_vote: float) -> float:
    """What the larger of two weighs: the more, the nearer its change is to the vote's, if both move the same way."""
    larger, smaller = abs(rise_larger - rise_vote), abs(rise_smaller - rise_vote)
    if not rise_larger * rise_smaller > 0 or larger + smaller == 0:
        return 0.5
    return smaller / (larger + smaller)


def by_ilm(view: View) -> Answer | None:
    """The half, or the one channel, that alone is good when all others are bad."""
    sides = view.halves if view.pattern in PAIRS else [{c} for c in view.ascending]
    for side in sides:
        rest = set(view.use) - side
        if {view.ilm[c] for c in side} == {"good"} and {view.ilm[c] for c in rest} == {"bad"}:
            return view.mean(side), rest
    return None


def by_reference(view: View) -> Answer | None:
    """The middle of {ranks, reference}; where no channels agree, the only sample within the reference threshold."""
    reference = view.seen_reference
    if view.usable_reference is None or reference is None:
        return None
    if view.pattern in PAIRS:
        return triplex(view, reference)
    within = [c for c in view.seen if view.s.apart(view.seen[c], reference) <= view.s.reference_threshold]
    if len(within) != 1:
        return None
    return view.use[within[0]], set(view.use) - set(within)


def triplex(view: View, reference: float) -> Answer | None:
    """Section 4.3: the middle, and who fails for it."""
    (above, below), (low, high) = (view.seen[c] for c in view.middle_two), view.halves
    vote = sorted([*(view.use[c] for c in view.middle_two), view.reference or 0.0])[1]
    if reference >= above:
        return vote, low
    if reference <= below:
        return vote, high
    wrong = high if above - reference > view.s.reference_threshold else set()
    return vote, wrong | (low if reference - below > view.s.reference_threshold else set())


def by_lane(view: View) -> Answer | None:
    """The half without a failed computer, if the other half has one."""
    if view.pattern not in PAIRS:
        return None
    bad = [side for side in view.halves if side & set(view.lanes)]
    if len(bad) != 1:
        return None
    good = set(view.use) - bad[0]
    return view.mean(good), bad[0]


def by_trend(view: View) -> Answer | None:
    """Both ranks rising throughout: the larger half; neither rising in any frame: the smaller."""
    s, (low, high) = view.s, view.halves
    if view.pattern not in PAIRS or (s.referred and not s.trend_beside_reference):
        return None
    says = view.trend.says(s)
    if says == "both wrong":
        return (sum(view.ranks) / 2, low | high) if view.suspected else None
    if not says:
        return None
    good, wrong = (high, low) if says == "larger" else (low, high)
    if s.weighted and view.pattern == "1:1":
        return view.mean_of_ranks(), wrong
    return view.mean(good), wrong


def by_extremes(view: View) -> Answer | None:
    """Section 5, when no earlier rule settles it."""
    if view.pattern != "1:1:1:1":
        return None
    return sum(view.use[c] for c in view.middle_two) / 2, {view.by_seen[0], view.by_seen[3]}


def by_middle(view: View) -> Answer | None:
    """Section 6, when no earlier rule settles it."""
    if view.pattern != "1:1:1":
        return None
    return view.use[view.by_seen[1]], {view.by_seen[0], view.by_seen[2]}


TIE_BREAKS: dict[str, Callable[[View], Answer | None]] = {
    "ilm": by_ilm,
    "lane": by_lane,
    "reference": by_reference,
    "trend": by_trend,
    "extremes": by_extremes,
    "middle": by_middle,
}


def first_answer(view: View) -> tuple[str, float, set[int]] | None:
    """The first answer in the configured order, extremes and middle after all others."""
    for name in sorted(view.s.tie_break, key=lambda name: name in LAST_ASKED):
        answer = TIE_BREAKS[name](view)
        if answer is not None:
            return (name, *answer)
    return None
