"""The monitor once more, in plain Python and from the requirement alone: an independent expectation.

Nothing here is taken from rig.computer.redundancy; where the two differ, one of them misread decisions.md.
Samples are given as lists of four, None for one that cannot be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from statistics import median

from oracle_answers import Settings, View, first_answer
from oracle_references import FAR, References
from oracle_slow_faults import SlowFaults
from oracle_slow_tests import SlowTests
from oracle_split import Split
from oracle_trend import Trend


@dataclass
class Frame:
    voted: float
    states: list[str]
    level: int
    pattern: str
    decided_by: str
    trend: tuple[int, int]
    usable: bool
    common: bool = False


@dataclass
class Oracle:
    """One signal; ``step`` takes a frame's samples and returns what the monitor must say.

    ``rules`` names the rules for few votes that the last frame reached, for a survey of what a test covers.
    """

    s: Settings
    vote: float | None = None
    rise: float = 0.0  # of the vote
    failed: set[int] = field(default_factory=set)
    counts: list[float] = field(default_factory=lambda: [0.0] * 4)
    run: int = 0
    freeze: int = 0
    split: Split = field(default_factory=Split)
    trend: Trend = field(default_factory=Trend)
    comparable: list[float | None] = field(default_factory=list)  # samples of the frame
    before: dict[int, float] = field(default_factory=dict)  # those of the last frame, an angle on its turn
    memory: dict[str | int, float] = field(default_factory=dict)  # of the filter: channels, the reference, the vote
    base: float = 0.0
    start: float | None = None  # where a filter begins in this frame; None: with its own value
    accused: set[int] = field(default_factory=set)
    readmitted: bool = False  # in this frame: with which the count of a common mode begins again
    rules: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.slow_faults, self.references = SlowFaults(self.s), References(self.s)
        self.slow_tests = SlowTests(self.s, repeats=self.slow_faults.repeats)

    def step(
        self,
        samples: list[float | None],
        ilm: Sequence[str],
        reference: float | None,
        second: float | None = None,
        lanes: Sequence[int] = (),
        in_dispute: bool = False,
    ) -> Frame:
        """``lanes``: channels whose computers are failed; ``in_dispute``: what a reference of the signal reads."""
        self.rules = self.references.rules = self.split.rules = self.slow_faults.rules = self.slow_tests.rules = set()
        self.comparable = self.without_stale(samples, reference)
        view = self.view(self.comparable, ilm, self.s.limited(reference), lanes)
        level = self.level
        disputed_by = self.disputed_by(view)
        view.lonely = set(view.use) if disputed_by else self.miscomparing(view.seen)
        self.name(view)
        self.trend.remember(view.ranks if view.x else None, len(view.x), self.s)
        self.reached("frozen side", self.in_split and self.trend.still.count(0) == 1)
        decided_by, vote, wrong = self.decide(view, disputed_by)
        self.split.whole = len(view.use) == level
        self.split.hear(decided_by, wrong, self.s)
        decided_by = self.refer(view, vote, self.s.limited(second), decided_by, in_dispute)
        self.accused = self.evidence(view, decided_by, wrong)
        self.count(view, vote)
        decided_by = self.fail_all(view, decided_by, wrong)
        if self.level != level:
            self.references.level_changed(decided_by == "extremes" and self.split.settled(self.s) and self.level == 2)
        self.rise = 0.0 if self.vote is None else self.s.change(vote, self.vote)
        if view.use or self.vote is not None:  # until there is a sample there is nothing to hold
            self.vote = vote
            self.smooth("vote", vote)
        states = [self.state(c, view, wrong) for c in range(self.s.channels)]
        high, low = (sum(bit << i for i, bit in enumerate(reversed(byte))) for byte in self.trend.bits)
        usable, common = self.references.trusted and reference is not None, self.references.common
        return Frame(vote, states, self.level, self.split.pattern, decided_by, (high, low), usable, common)

    @property
    def level(self) -> int:
        return self.s.channels - len(self.failed)

    @property
    def in_use(self) -> set[int]:
        return set(range(self.s.channels)) - self.failed

    def without_stale(self, samples: list[float | None], reference: float | None) -> list[float | None]:
        """The samples that can be compared: those that repeat for too long cannot."""
        stale = self.slow_faults.stale(samples, self.in_use, reference, self.references.trusted)
        self.references.standing = self.slow_faults.standing
        self.reached("stale", stale)
        self.reached("stale in a split", stale and self.in_split)
        return [None if c in stale else x for c, x in enumerate(samples)]

    def view(
        self, samples: list[float | None], ilm: Sequence[str], reference: float | None, lanes: Sequence[int]
    ) -> View:
        """The frame's comparable samples, those of an angle on the turn of the last vote."""
        base = self.first([x for x in samples if x is not None]) if self.vote is None else self.vote
        self.base, near = base, self.s.near
        here = {c: None if x is None else near(x, base) for c, x in enumerate(samples)}
        use = {c: x for c, x in here.items() if x is not None and c not in self.failed}
        self.start = self.memory.get("vote", median(use.values()) if use else None)
        smooth = {c: self.smooth(c, x) for c, x in here.items()}
        seen = {c: x for c, x in smooth.items() if x is not None and c in use}
        reference = None if reference is None else near(reference, base)
        smooth_reference, refs = self.smooth("reference", reference), self.references
        view = View(self.s, use, seen, ilm, reference, smooth_reference, refs.trusted)
        view.lanes, view.trend, view.rise, view.suspected = lanes, self.trend, self.rise, refs.suspected
        view.before, self.before = self.before, {c: x for c, x in here.items() if x is not None}
        return view

    def first(self, samples: list[float]) -> float:
        """What angles are taken near to while there is no vote: the sample that has least of the others opposite."""
        base, least = 0.0, inf
        for x in samples:
            seen = [self.s.near(other, x) for other in samples] if self.s.turn else [x]
            across = max(seen) - min(seen)
            if least == inf or across < least - self.s.threshold:
                self.reached("begun around the circle", least != inf)
                base, least = x, across
        return base

    def smooth(self, key: str | int, x: float | None) -> float | None:
        """The next value behind the filter, a share of the way to ``x``; it begins, after a gap too, at the vote's."""
        if x is None:
            self.memory.pop(key, None)
            return None
        last, near = self.memory.get(key, None if key == "vote" else self.start), self.s.near
        if self.s.filter_share and key not in self.memory:
            where = "beside the smoothed vote" if "vote" in self.memory else "at first"
            self.reached(f"filter begun {where}", last is not None and x != last)
        if self.s.filter_share and last is not None:
            most = self.s.threshold / (self.s.persistence - 0.5)
            x = near(last + min(max(self.s.filter_share * self.s.change(x, last), -most), most), self.base)
        self.memory[key] = x
        return x

    def state(self, c: int, view: View, wrong: set[int]) -> str:
        if c in self.failed:
            return "failed"
        suspect = c not in view.use or c in view.lonely | wrong or self.counts[c]
        return "suspect" if suspect else "ok"

    def reached(self, rule: str, condition: object = True) -> None:
        if condition:
            self.rules.add(rule)

    # Section 1: who miscompares, and for how long.

    def miscomparing(self, use: dict[int, float]) -> set[int]:
        """Channels that disagree with all others."""
        far = self.s.within(len(use))
        return {c for c in use if len(use) > 1 and all(abs(use[c] - use[d]) > far for d in use if d != c)}

    def disputed_by(self, view: View) -> str:
        """Who disputes the only sample left: its in-line monitor, else a usable reference."""
        if len(view.use) != 1:
            return ""
        ((c, x),) = view.use.items()
        reference, far = view.usable_reference, FAR * self.s.reference_threshold
        off = reference is not None and self.s.apart(x, reference) > far
        self.reached("last channel: ilm and reference", off and view.ilm[c] == "bad")
        return "ilm" if view.ilm[c] == "bad" else "reference" if off else ""

    @property
    def in_split(self) -> bool:
        """Whether the frame's pattern has no majority."""
        return self.split.in_split

    def still(self) -> bool:
        """Whether the counts stand still: in a run of splits of r frames and for min(r, limit) frames after it."""
        if self.in_split:
            self.run += 1
            return True
        after = min(self.run, self.s.split_persistence)
        self.reached("freeze: what was left is longer", 0 < after < self.freeze)
        left, self.run = max(self.freeze, after), 0
        self.freeze = max(left - 1, 0)
        return left > 0

    def count(self, view: View, vote: float) -> None:
        """The ordinary counts: one more for a miscompare, none after a frame without one."""
        still = self.still()
        for c in set(range(self.s.channels)) - self.failed:
            moves = c in view.lonely or self.counts[c] > 0
            if c not in view.use:
                self.reached("freeze: not comparable", still)
                self.counts[c] += 1
            elif still and len(view.use) > 1:
                after = moves and not self.in_split
                self.reached("freeze: miscompare not counted" if c in view.lonely else "freeze: count kept", after)
            else:
                self.reached("freeze: last channel exempt", still and moves)
                self.reached("counted down", 0.0 < self.s.count_down < self.counts[c] and c not in view.lonely)
                down = self.s.count_down or self.counts[c]
                if c in view.lonely and self.s.filter_share and len(view.use) > 1 and not self.off(c, view, vote):
                    self.reached("counted down: the rest of a burst", self.counts[c])
                    self.counts[c] = max(self.counts[c] - 1, 0.0)
                else:
                    self.counts[c] = self.counts[c] + 1 if c in view.lonely else max(self.counts[c] - down, 0.0)

    def off(self, c: int, view: View, vote: float) -> bool:
        """Whether the sample itself is off the vote, by more than it may be."""
        return abs(self.s.change(view.use[c], vote)) > self.s.within(len(view.use))

    def fail(self, view: View, decided_by: str, wrong: set[int]) -> None:
        """Latch who has miscompared for long enough, and who is wrong in a split that has lasted."""
        late = {c for c in range(self.s.channels) if self.counts[c] >= self.s.persistence}
        self.reached(f"last channel: failed by {decided_by}", len(view.use) == 1 and set(view.use) <= late)
        self.failed |= late
        if self.split.settled(self.s):
            self.reached(f"{self.split.pattern} settled by {decided_by}", wrong)
            self.failed |= wrong
        elif self.in_split and self.split.lasted >= self.s.split_persistence:
            self.reached("an answer too young", wrong)

    def fail_all(self, view: View, decided_by: str, wrong: set[int]) -> str:
        """Latch, those of small deviations too; what is summed begins again then."""
        view.trusted = self.references.trusted  # as this frame left it
        slow, tested = set[int](), set[int]()
        if decided_by != "common":
            slow = set() if self.slow_tests.at_end(view) else self.slow_faults.summed(view, self.slow_tests.bias)
            tested = self.slow_tests.isolated(view, view.trusted, self.split.whole)
            self.reached("slow beside the tests", slow and self.s.slow_means)
        slow, by = slow | tested, self.slow_tests.by if tested else "slow"
        self.reached("slow", slow)
        self.failed |= slow
        self.fail(view, decided_by, wrong)
        decided_by = by if slow else decided_by
        if self.split.given_up(self.s):
            self.reached("given up")
            self.failed, decided_by = set(range(self.s.channels)), "given_up"
        self.slow_faults.hear(self.failed)
        return decided_by

    # Section 2.

    def name(self, view: View) -> None:
        x, n = [view.seen[c] for c in view.by_seen], len(view.x)
        apart = [abs(a - b) > self.s.within(n) for i, a in enumerate(x) for b in x[i + 1 :]]
        if not n:
            pattern = "lost"
        elif n > 1 and all(apart):
            pattern = ":".join("1" * n)
        elif n == 4 and apart == [False, True, True, True, True, False]:
            pattern = "2:2"
        else:
            pattern = "isolated" if n > 1 and view.lonely else "normal"
        view.pattern = pattern
        closed = ":" in pattern and self.s.filter_share > 0 and self.together(view)
        self.reached("split closed behind the filter", closed)
        self.split.name(pattern, closed)

    def together(self, view: View) -> bool:
        """Whether the samples of a split agree again that what is compared still shows."""
        x, apart = [view.use[c] for c in view.by_seen], self.s.apart
        gaps = [apart(above, below) for below, above in pairwise(x)]
        return min(gaps if len(x) == 3 else [gaps[len(x) // 2 - 1]]) <= self.s.within(len(x))

    # Section 3: the vote.

    def decide(self, view: View, disputed_by: str) -> tuple[str, float, set[int]]:
        """DecidedBy, vote and who is wrong."""
        n = len(view.x)
        if not n:
            return "none", self.vote if self.vote is not None else self.s.limited(0.0) or 0.0, set()
        if disputed_by:
            return self.instead_of_the_last(view, disputed_by)
        if self.in_split:
            return self.resolve(view)
        if n in (2, 4) and view.ascending[n // 2] in view.lonely:
            return "none", view.x[n // 2 - 1], set()
        if n in (2, 4) and view.ascending[n // 2 - 1] in view.lonely:
            return "none", view.x[n // 2], set()
        return "none", view.mean_of_ranks(), set()

    def instead_of_the_last(self, view: View, disputed_by: str) -> tuple[str, float, set[int]]:
        """While the last channel miscompares: the reference if usable, else the last vote."""
        reference = view.usable_reference
        self.reached(f"last channel: {disputed_by}, {'reference voted' if reference is not None else 'vote held'}")
        if reference is None:
            reference = view.x[0] if self.vote is None else self.vote
        return disputed_by, reference, set()

    def resolve(self, view: View) -> tuple[str, float, set[int]]:
        """The answer of the tie-break rules; without one the vote stays where it stood between two channels."""
        answer = first_answer(view)
        self.reached(f"{view.pattern} by {answer[0] if answer else 'no rule'}")
        if answer is None:
            return "unresolved", self.split.hold(view, self.vote), set()
        self.reached("both of a pair wrong by trend", answer[0] == "trend" and answer[2] == set(view.use))
        return answer

    # What references say: oracle_references.py.

    def refer(self, view: View, vote: float, second: float | None, decided_by: str, in_dispute: bool) -> str:
        """Fail the pair of extremes, or all channels, for their references; return who decided then."""
        if self.references.cuts(view):
            self.failed |= set(view.use)
            decided_by = "reference"
        self.references.monitor(view)
        all_in_use = len(view.use) > 1 and set(view.use) == self.in_use
        if self.references.lost(view, vote, second, all_in_use and not self.readmitted, in_dispute):
            self.failed = set(range(self.s.channels))
            return "common"
        return decided_by

    # Boxes: oracle_boxes.py asks for every signal.

    def evidence(self, view: View, decided_by: str, wrong: set[int]) -> set[int]:
        """The channels in use against which this frame speaks."""
        silent = self.in_use - set(view.use)
        if self.in_split:
            return silent | (wrong if decided_by in ("ilm", "reference") else set())
        return silent | (view.lonely - self.failed)
