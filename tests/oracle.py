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
from oracle_split import Split
from oracle_trend import Trend

FAR = 1.5  # reference thresholds, of what a reference speaks against


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
    trusted: bool = True
    against: int = 0
    suspected: bool = False  # the pair that extremes left
    pair_off: int = 0  # frames for which a reference has spoken against both of it
    contradicted: int = 0
    second_off: int = 0  # frames for which the second reference has been off the vote
    accused: set[int] = field(default_factory=set)
    rules: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.lasting = Lasting(self.s)

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
        self.rules = set()
        self.comparable = self.without_stale(samples, reference)
        view = self.view(self.comparable, ilm, self.s.limited(reference), lanes)
        level = self.level
        disputed_by = self.disputed_by(view)
        view.lonely = set(view.use) if disputed_by else self.miscomparing(view.seen) or self.outliers(view.seen)
        self.name(view)
        self.trend.remember(view.ranks if view.x else None, len(view.x), self.s)
        self.reached("frozen side", self.singular and self.trend.still.count(0) == 1)
        resolver, vote, wrong = self.decide(view, disputed_by)
        self.split.hear(resolver, wrong, self.s)
        resolver = self.cut_the_pair(view) or resolver
        self.monitor_reference(view)
        resolver = self.compare_references(view, vote, self.s.limited(second), resolver, in_dispute)
        self.accused = self.evidence(view, resolver, wrong)
        self.count(view, vote)
        resolver = self.fail_and_learn(view, resolver, wrong)
        self.suspect_what_is_left(level, resolver)
        self.rise = 0.0 if self.vote is None else self.s.change(vote, self.vote)
        self.vote = vote
        states = [self.state(c, view, wrong) for c in range(self.s.channels)]
        high, low = (sum(bit << i for i, bit in enumerate(reversed(byte))) for byte in self.trend.bits)
        usable, common = self.trusted and reference is not None, self.contradicted >= self.s.common_persistence
        return Frame(vote, states, self.level, self.split.pattern, resolver, (high, low), usable, common)

    @property
    def level(self) -> int:
        return self.s.channels - len(self.failed)

    @property
    def in_use(self) -> set[int]:
        return set(range(self.s.channels)) - self.failed

    def without_stale(self, samples: list[float | None], reference: float | None) -> list[float | None]:
        """The samples that can be compared: those that repeat for too long cannot."""
        stale = self.lasting.stale(samples, self.in_use, reference)
        self.reached("stale", stale)
        self.reached("stale in a split", stale and self.singular)
        return [None if c in stale else x for c, x in enumerate(samples)]

    def view(
        self, samples: list[float | None], ilm: Sequence[str], reference: float | None, lanes: Sequence[int]
    ) -> View:
        """The frame's comparable samples, those of an angle on the turn of the last vote."""
        base = self.vote if self.vote is not None else next((x for x in samples if x is not None), 0.0)
        self.base, near = base, self.s.near
        here = {c: None if x is None else near(x, base) for c, x in enumerate(samples)}
        smooth = {c: self.smooth(c, x) for c, x in here.items()}
        use = {c: x for c, x in here.items() if x is not None and c not in self.failed}
        beside = {c: x for c, x in smooth.items() if x is not None and c in use}
        seen = {c: x - self.lasting.bias[c] for c, x in beside.items()}
        reference = None if reference is None else near(reference, base)
        view = View(self.s, use, seen, beside, ilm, reference, self.smooth("reference", reference), self.trusted)
        view.lanes, view.trend, view.rise, view.suspected = lanes, self.trend, self.rise, self.suspected
        view.before, self.before = self.before, {c: x for c, x in here.items() if x is not None}
        return view

    def smooth(self, key: str | int, x: float | None) -> float | None:
        """The next value behind the filter: a share of the way to ``x``; it begins with ``x``, after a gap too."""
        if x is None:
            self.memory.pop(key, None)
            return None
        last, near = self.memory.get(key), self.s.near
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
        reference, far = view.usable_reference, FAR * self.s.reference_threshold
        off = reference is not None and self.s.apart(x, reference) > far
        self.reached("last channel: ilm and reference", off and view.ilm[c] == "bad")
        return "ilm" if view.ilm[c] == "bad" else "reference" if off else ""

    @property
    def singular(self) -> bool:
        """Whether the frame's pattern has no majority."""
        return self.split.singular

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

    def count(self, view: View, vote: float) -> None:
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
                self.reached("counted down", 0.0 < self.s.count_down < self.counts[c] and c not in view.lonely)
                down = self.s.count_down or self.counts[c]
                if c in view.lonely and self.s.filter_share and len(view.use) > 1 and not self.off(c, view, vote):
                    self.reached("counted down: the rest of a burst", self.counts[c])
                    self.counts[c] = max(self.counts[c] - 1, 0.0)
                else:
                    self.counts[c] = self.counts[c] + 1 if c in view.lonely else max(self.counts[c] - down, 0.0)

    def off(self, c: int, view: View, vote: float) -> bool:
        """Whether the sample itself is off the vote, by more than it may be."""
        n, limit = len(view.use), None
        if self.lasting.settled(view.use):
            limit = self.s.outlier_of(n)
        return abs(self.s.change(view.use[c], vote) - self.lasting.bias[c]) > (limit or self.s.within(n))

    def fail(self, view: View, resolver: str, wrong: set[int]) -> None:
        """Latch who has miscompared for long enough, and who is wrong in a singular pattern that has lasted."""
        late = {c for c in range(self.s.channels) if self.counts[c] >= self.s.persistence}
        self.reached(f"last channel: failed by {resolver}", len(view.use) == 1 and set(view.use) <= late)
        self.failed |= late
        if self.split.settled(self.s):
            self.reached(f"{self.split.pattern} settled by {resolver}", wrong)
            self.failed |= wrong
        elif self.singular and self.split.lasted >= self.s.singular_persistence:
            self.reached("an answer too young", wrong)

    def fail_and_learn(self, view: View, resolver: str, wrong: set[int]) -> str:
        """Latch, those of small deviations too; what is summed begins again then, else biases move."""
        view.trusted = self.trusted  # as this frame left it
        slow = self.lasting.summed(view) if resolver != "common" else set()
        self.reached("slow", slow)
        self.reached("ranked by the bias", len(view.use) > 1 and view.by_seen != view.ascending)
        self.failed |= slow
        self.fail(view, resolver, wrong)
        if self.split.given_up(self.s):
            self.reached("given up")
            self.failed, resolver = set(range(self.s.channels)), "given_up"
        if not self.lasting.level_changed(self.failed):
            self.reached("bias learned", self.s.bias_bound and len(view.use) > 1 and view.pattern == "normal")
            self.lasting.learn(view, view.lonely | wrong | {c for c in view.use if self.counts[c]})
        return "slow" if slow else resolver

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
        x, within = [view.use[c] for c in view.by_seen], self.s.within(len(view.use))
        if len(x) == 3:
            return min(abs(x[1] - x[0]), abs(x[2] - x[1])) <= within
        return abs(x[len(x) // 2] - x[len(x) // 2 - 1]) <= within

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
        return "none", view.mean_of_ranks(), set()

    def instead_of_the_last(self, view: View, disputed_by: str) -> tuple[str, float, set[int]]:
        """While the last channel miscompares: the reference if usable, else the last vote."""
        reference = view.usable_reference
        self.reached(f"last channel: {disputed_by}, {'reference voted' if reference is not None else 'vote held'}")
        if reference is None:
            reference = view.x[0] if self.vote is None else self.vote
        return disputed_by, reference, set()

    def resolve(self, view: View) -> tuple[str, float, set[int]]:
        """The answer of the resolvers; without one the vote stays where it stood between two channels."""
        answer = first_answer(view)
        self.reached(f"{view.pattern} by {answer[0] if answer else 'nobody'}")
        if answer is None:
            return "unresolved", self.split.hold(view, self.vote), set()
        self.reached("both of a pair wrong by trend", answer[0] == "trend" and answer[2] == set(view.use))
        return answer

    # Section 4: the reference's own monitor.

    def monitor_reference(self, view: View) -> None:
        """Untrusted after ``persistence`` frames off both voting ranks, trusted after as many near one of them."""
        if view.reference is None or len(view.use) < 2 or self.singular or self.suspected:
            self.reached("reference not judged by a suspected pair", self.suspected and view.reference is not None)
            return
        agrees = self.off_ranks(view) <= self.s.reference_threshold
        self.against = self.against + 1 if agrees != self.trusted else 0
        if self.against >= self.s.persistence:
            self.trusted, self.against = agrees, 0

    def off_ranks(self, view: View) -> float:
        """How far the reference is from the nearer of the two voting ranks."""
        return min(self.s.apart(x, view.reference or 0.0) for x in view.ranks)

    # Section 5: the pair that extremes left may be bad too.

    def cut_the_pair(self, view: View) -> str:
        """Fail both of it after ``persistence`` frames in which they agree and a reference is off both."""
        off = False
        if self.suspected and view.pattern == "normal" and len(view.use) == 2 and view.usable_reference is not None:
            off = self.off_ranks(view) > max(FAR * self.s.reference_threshold, self.s.within(2))
        self.pair_off = self.pair_off + 1 if off else 0
        if self.pair_off < self.s.persistence:
            return ""
        self.reached("the pair of extremes cut")
        self.failed |= set(view.use)
        return "reference"

    def suspect_what_is_left(self, level: int, resolver: str) -> None:
        """A pair is under suspicion from where extremes left it to the next change of the level."""
        if self.level != level:
            self.suspected = resolver == "extremes" and self.split.settled(self.s) and self.level == 2
            self.pair_off = 0

    # Two references against all channels.

    def compare_references(self, view: View, vote: float, second: float | None, resolver: str, in_dispute: bool) -> str:
        """Count the frames in which both references contradict all channels; by choice the signal is lost then.

        The count does not begin while what they read is in dispute.
        """
        off = second is not None and len(view.use) > 1 and self.second_is_off(view, vote, second)
        self.second_off = self.second_off + 1 if off else 0
        contradict, begun = self.contradict(view, vote, second), self.contradicted > 0
        self.reached("common mode: in dispute", contradict and in_dispute and not begun)
        self.contradicted = self.contradicted + 1 if contradict and (begun or not in_dispute) else 0
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
        all_agree = view.pattern == "normal" and set(view.use) == self.in_use
        if first is None or second is None or len(view.use) < 2 or not all_agree:
            return False
        off = s.apart(vote, first) > max(FAR * s.reference_threshold, s.within(len(view.use)))
        off = off and self.second_is_off(view, vote, second)
        near = s.apart(first, second) <= s.reference_threshold + s.second_threshold
        self.reached("common mode: references apart", off and not near)
        return off and near

    def second_is_off(self, view: View, vote: float, second: float) -> bool:
        return self.s.apart(vote, second) > max(FAR * self.s.second_threshold, self.s.within(len(view.use)))

    @property
    def in_dispute(self) -> bool:
        """Whether what the signal's references say of others cannot be relied on, as of the last frame."""
        return self.s.tells != 0 and (not self.trusted or self.second_off >= self.s.persistence)

    # Boxes: oracle_boxes.py asks for every signal.

    def evidence(self, view: View, resolver: str, wrong: set[int]) -> set[int]:
        """The channels in use against which this frame speaks."""
        silent = self.in_use - set(view.use)
        if self.singular:
            return silent | (wrong if resolver in ("ilm", "reference") else set())
        return silent | (view.lonely - self.failed)
