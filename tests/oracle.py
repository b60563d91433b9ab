"""The monitor once more, in plain Python and from the requirement alone: an independent expectation.

Nothing here is taken from rig.computer.redundancy; where the two differ, one of them misread redundancy.md.
Samples are given as lists of four, None for one that cannot be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from oracle_answers import Settings, View, first_answer
from oracle_lasting import Lasting

LAST_CHANNEL = 1.5  # reference thresholds


@dataclass
class Frame:
    voted: float
    states: list[str]
    level: int
    pattern: str
    resolver: str
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
    failed: set[int] = field(default_factory=set)
    counts: list[int] = field(default_factory=lambda: [0] * 4)
    pattern: str = ""
    lasted: int = 0
    run: int = 0
    freeze: int = 0
    ranks: tuple[float, float] | None = None
    ranked: int = 0
    rises: tuple[float, float] = (0.0, 0.0)
    bits: tuple[list[int], list[int]] = field(default_factory=lambda: ([], []))
    memory: dict[str | int, float] = field(default_factory=dict)  # of the filter: channels, the reference, the vote
    base: float = 0.0
    trusted: bool = True
    against: int = 0
    contradicted: int = 0
    accused: set[int] = field(default_factory=set)
    rules: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.lasting = Lasting(self.s)

    def step(
        self, samples: list[float | None], ilm: Sequence[str], reference: float | None, second: float | None = None
    ) -> Frame:
        self.rules = set()
        view = self.view(samples, ilm, reference)
        disputed_by = self.disputed_by(view)
        view.lonely = set(view.use) if disputed_by else self.miscomparing(view.seen) or self.outliers(view.seen)
        self.name(view)
        stale = self.lasting.stale(samples) & set(view.use)
        self.reached("stale in the middle", stale and stale & set(view.middle_two) and not view.lonely)
        view.lonely = view.lonely | stale
        self.remember(view)
        view.pattern, view.bits = self.pattern, self.bits
        resolver, vote, wrong = self.decide(view, disputed_by)
        self.monitor_reference(view, vote)
        resolver = self.compare_references(view, vote, second, resolver)
        self.accused = self.evidence(view, resolver, wrong)
        self.count(view)
        resolver = self.fail_and_learn(view, resolver, wrong)
        self.vote = vote
        states = [self.state(c, view, wrong) for c in range(self.s.channels)]
        high, low = (sum(bit << i for i, bit in enumerate(reversed(byte))) for byte in self.bits)
        usable = self.trusted and reference is not None
        level, common = self.s.channels - len(self.failed), self.contradicted >= self.s.common_persistence
        return Frame(vote, states, level, self.pattern, resolver, (high, low), usable, common)

    def view(self, samples: list[float | None], ilm: Sequence[str], reference: float | None) -> View:
        """The frame's comparable samples, those of an angle on the turn of the last vote."""
        base = self.vote if self.vote is not None else next((x for x in samples if x is not None), 0.0)
        self.base, near = base, self.s.near
        here = {c: None if x is None else near(x, base) for c, x in enumerate(samples)}
        smooth = {c: self.smooth(c, x) for c, x in here.items()}
        use = {c: x for c, x in here.items() if x is not None and c not in self.failed}
        beside = {c: x for c, x in smooth.items() if x is not None and c in use}
        seen = {c: x - self.lasting.bias[c] for c, x in beside.items()}
        reference = None if reference is None else near(reference, base)
        return View(self.s, use, seen, beside, ilm, reference, self.smooth("reference", reference), self.trusted)

    def smooth(self, key: str | int, x: float | None) -> float | None:
        """The next value behind the filter: a share of the way to ``x``; it begins with ``x``, after a gap too."""
        if x is None:
            self.memory.pop(key, None)
            return None
        last, near = self.memory.get(key), self.s.near
        if self.s.filter_share and last is not None:
            step = min(max(near(x, last) - last, -3.0 * self.s.threshold), 3.0 * self.s.threshold)
            x = near(last + self.s.filter_share * step, self.base)
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

    def outliers(self, use: dict[int, float]) -> set[int]:
        """Of samples that all agree, those far from all others while at least two are close to each other."""
        limit, ranked = self.s.outlier_of(len(use)), sorted(use.values())
        agree = all(above - below <= self.s.within(len(use)) for below, above in pairwise(ranked))
        if limit is None or not agree:
            return set()
        self.reached("outlier: biases not learned", not self.lasting.settled(use))
        if not self.lasting.settled(use):
            return set()
        close = {c for c in use for d in use if d != c and abs(use[c] - use[d]) <= limit}
        self.reached("outlier", close and len(close) < len(use))
        self.reached("outlier: no two are close", not close)
        return set(use) - close if close else set()

    def disputed_by(self, view: View) -> str:
        """Who disputes the only sample left: its in-line monitor, else a usable reference."""
        if len(view.use) != 1:
            return ""
        ((c, x),) = view.use.items()
        reference, far = view.usable_reference, LAST_CHANNEL * self.s.reference_threshold
        off = reference is not None and self.s.apart(x, reference) > far
        self.reached("last channel: ilm and reference", off and view.ilm[c] == "bad")
        return "ilm" if view.ilm[c] == "bad" else "reference" if off else ""

    @property
    def singular(self) -> bool:
        """Whether the frame's pattern has no majority."""
        return ":" in self.pattern

    def still(self) -> bool:
        """Whether the counts stand still: in a singular run of r frames and for min(r, limit) frames after it."""
        if self.singular:
            self.run += 1
            return True
        after = min(self.run, self.s.singular_persistence)
        self.reached("freeze: what was left is longer", 0 < after < self.freeze)
        left, self.run = max(self.freeze, after), 0
        self.freeze = max(left - 1, 0)
        return left > 0

    def count(self, view: View) -> None:
        """The ordinary counts: one more for a miscompare, none after a frame without one."""
        still = self.still()
        for c in set(range(self.s.channels)) - self.failed:
            moves = c in view.lonely or self.counts[c] > 0
            if c not in view.use:
                self.reached("freeze: not comparable", still)
                self.counts[c] += 1
            elif still and len(view.use) > 1:
                after = moves and not self.singular
                self.reached("freeze: miscompare not counted" if c in view.lonely else "freeze: count kept", after)
            else:
                self.reached("freeze: last channel exempt", still and moves)
                self.counts[c] = self.counts[c] + 1 if c in view.lonely else 0

    def fail(self, view: View, resolver: str, wrong: set[int]) -> None:
        """Latch who has miscompared for long enough, and who is wrong in a singular pattern that has lasted."""
        late = {c for c in range(self.s.channels) if self.counts[c] >= self.s.persistence}
        self.reached(f"last channel: failed by {resolver}", len(view.use) == 1 and set(view.use) <= late)
        self.failed |= late
        if self.singular and self.lasted >= self.s.singular_persistence:
            self.reached(f"{self.pattern} settled by {resolver}", wrong)
            self.failed |= wrong

    def fail_and_learn(self, view: View, resolver: str, wrong: set[int]) -> str:
        """Latch, those of small deviations too; what is summed begins again then, else biases move."""
        view.trusted = self.trusted  # as this frame left it
        slow = self.lasting.summed(view) if resolver != "common" else set()
        self.reached("slow", slow)
        self.reached("ranked by the bias", len(view.use) > 1 and view.by_seen != view.ascending)
        self.failed |= slow
        self.fail(view, resolver, wrong)
        if not self.lasting.level_changed(self.failed):
            self.reached("bias learned", self.s.bias_bound and len(view.use) > 1 and self.pattern == "normal")
            self.lasting.learn(view, view.lonely | wrong | {c for c in view.use if self.counts[c]})
        return "slow" if slow else resolver

    # Section 2, and the trend bytes of section 4.

    def name(self, view: View) -> None:
        """The pattern, and for how many frames it has lasted."""
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
        self.lasted = self.lasted + 1 if pattern == self.pattern else 1
        self.pattern = pattern

    def remember(self, view: View) -> None:
        """The changes of the two ranks and their bytes, both over frames of as many samples."""
        n, last = len(view.x), self.ranks
        self.rises = (0.0, 0.0)
        if not n:
            self.ranks, self.ranked, self.bits = None, 0, ([], [])
            return
        if last is not None and n == self.ranked:
            above, below = view.ranks
            self.rises = (self.s.near(above, last[0]) - last[0], self.s.near(below, last[1]) - last[1])
            for byte, rise in zip(self.bits, self.rises, strict=True):
                byte.append(1 if rise > 0 else 0)
                del byte[: -self.s.trend_frames]
        else:
            self.bits = ([], [])
        self.ranks, self.ranked = view.ranks, n

    # Section 3: the vote.

    def decide(self, view: View, disputed_by: str) -> tuple[str, float, set[int]]:
        """Resolver, vote and who is wrong."""
        n = len(view.x)
        if not n:
            return "none", self.vote if self.vote is not None else 0.0, set()
        if disputed_by:
            return self.instead_of_the_last(view, disputed_by)
        if self.singular:
            return self.resolve(view)
        if n in (2, 4) and view.ascending[n // 2] in view.lonely:
            return "none", view.x[n // 2 - 1], set()
        if n in (2, 4) and view.ascending[n // 2 - 1] in view.lonely:
            return "none", view.x[n // 2], set()
        return "none", sum(view.ranks) / 2, set()

    def instead_of_the_last(self, view: View, disputed_by: str) -> tuple[str, float, set[int]]:
        """While the last channel miscompares: the reference if usable, else the last vote."""
        reference = view.usable_reference
        self.reached(f"last channel: {disputed_by}, {'reference voted' if reference is not None else 'vote held'}")
        if reference is None:
            reference = view.x[0] if self.vote is None else self.vote
        return disputed_by, reference, set()

    def resolve(self, view: View) -> tuple[str, float, set[int]]:
        """The answer of the resolvers; without one the last vote, moved as the ranks have moved in this pattern."""
        answer = first_answer(view)
        self.reached(f"{self.pattern} by {answer[0] if answer else 'nobody'}")
        if answer is not None:
            return answer
        if self.vote is None:
            return "unresolved", sum(view.ranks) / 2, set()
        first = self.lasted == 1
        self.reached("unresolved: change of the first frame left out", first and sum(self.rises))
        return "unresolved", self.vote + (0.0 if first else sum(self.rises) / 2), set()

    # Section 4: the reference's own monitor.

    def monitor_reference(self, view: View, vote: float) -> None:
        """Untrusted after ``persistence`` frames off a healthy vote, trusted after as many on it; not at level 1."""
        if view.reference is None or len(view.use) < 2 or self.singular:
            return
        agrees = self.s.apart(vote, view.reference) <= self.s.reference_threshold
        self.against = self.against + 1 if agrees != self.trusted else 0
        if self.against >= self.s.persistence:
            self.trusted, self.against = agrees, 0

    # Two references against all channels.

    def compare_references(self, view: View, vote: float, second: float | None, resolver: str) -> str:
        """Count the frames in which both references contradict all channels; by choice the signal is lost then."""
        self.contradicted = self.contradicted + 1 if self.contradict(view, vote, second) else 0
        if self.contradicted < self.s.common_persistence or not self.s.common_fails:
            self.reached("common mode: reported", self.contradicted >= self.s.common_persistence)
            return resolver
        self.reached("common mode: lost")
        self.failed = set(range(self.s.channels))
        self.trusted, self.against = True, 0
        return "common"

    def contradict(self, view: View, vote: float, second: float | None) -> bool:
        """All channels in use agree, two references agree, and the former do not with the latter."""
        s, first = self.s, view.reference
        all_agree = self.pattern == "normal" and set(view.use) == set(range(s.channels)) - self.failed
        if first is None or second is None or len(view.use) < 2 or not all_agree:
            return False
        limits = (s.reference_threshold, s.second_threshold)
        far = [
            s.apart(vote, r) > max(1.5 * limit, s.within(len(view.use)))
            for r, limit in zip((first, second), limits, strict=True)
        ]
        near = s.apart(first, second) <= sum(limits)
        self.reached("common mode: references apart", all(far) and not near)
        return all(far) and near

    # Boxes: oracle_boxes.py asks for every signal.

    def evidence(self, view: View, resolver: str, wrong: set[int]) -> set[int]:
        """The channels in use against which this frame speaks."""
        silent = set(range(self.s.channels)) - self.failed - set(view.use)
        if self.singular:
            return silent | (wrong if resolver in ("ilm", "reference") else set())
        return silent | (view.lonely - self.failed)


@dataclass
class DiscreteSettings:
    fail_safe: int = 0
    persistence: int = 8
    readmit_frames: int = 100
    channels: int = 4


@dataclass
class DiscreteOracle:
    """One discrete; samples are True, False or None for one that its flag or its own monitor declares bad."""

    s: DiscreteSettings
    failed: set[int] = field(default_factory=set)
    wrong: list[int] = field(default_factory=lambda: [0] * 4)
    right: list[int] = field(default_factory=lambda: [0] * 4)

    def step(self, samples: list[bool | None], reset: set[int]) -> tuple[int, list[str], int]:
        """Vote, states and level of a frame; ``reset`` are the channels commanded to be readmitted in it."""
        s, fitted = self.s, range(self.s.channels)
        back = {c for c in reset & self.failed if self.right[c] >= s.readmit_frames}
        self.failed -= back
        for c in back:
            self.wrong[c] = self.right[c] = 0
        votes = [samples[c] for c in fitted if c not in self.failed and samples[c] is not None]
        yes, no = votes.count(True), votes.count(False)
        vote = s.fail_safe if yes == no else int(yes > no)
        for c in fitted:
            same = samples[c] is not None and int(bool(samples[c])) == vote
            self.right[c] = self.right[c] + 1 if same and c in self.failed else 0
            self.wrong[c] = 0 if same else self.wrong[c] + 1
        self.failed |= {c for c in fitted if self.wrong[c] >= s.persistence}
        states = ["failed" if c in self.failed else "suspect" if self.wrong[c] else "ok" for c in fitted]
        return vote, states + ["absent"] * (4 - s.channels), s.channels - len(self.failed)
