"""The monitor once more, in plain Python and from the requirement alone: an independent expectation.

Nothing here is taken from rig.redundancy; where the two differ, one of them misread redundancy.md.
Samples are given as lists of four, None for one that cannot be compared.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi


@dataclass
class Settings:
    threshold: float = 1.0
    persistence: int = 8
    singular_persistence: int = 10
    resolvers: tuple[str, ...] = ("ilm", "trend", "reference")
    trend_frames: int = 3
    reference_threshold: float = 1.0
    channels: int = 4
    turn: float = 0.0  # a full turn for an angle, 0 for anything else


@dataclass
class Frame:
    voted: float
    states: list[str]
    level: int
    pattern: str
    resolver: str
    trend: tuple[int, int]
    usable: bool


@dataclass
class Oracle:
    """One signal; ``step`` takes a frame's samples and returns what the monitor must say."""

    s: Settings
    vote: float | None = None
    failed: set[int] = field(default_factory=set)
    counts: list[int] = field(default_factory=lambda: [0] * 4)
    pattern: str = ""
    lasted: int = 0
    ranks: tuple[float, float] | None = None
    ranked: int = 0
    bits: tuple[list[int], list[int]] = field(default_factory=lambda: ([], []))
    trusted: bool = True
    against: int = 0

    def near(self, x: float, base: float) -> float:
        """``x`` on the turn of ``base``."""
        turn = self.s.turn
        return base + ((x - base + pi) % turn - pi) if turn else x

    def step(self, samples: list[float | None], ilm: list[str], reference: float | None) -> Frame:
        s = self.s
        base = self.vote if self.vote is not None else next((x for x in samples if x is not None), 0.0)
        use = {c: self.near(x, base) for c, x in enumerate(samples) if x is not None and c not in self.failed}
        if reference is not None:
            reference = self.near(reference, base)
        ascending = sorted(use, key=lambda c: use[c])
        lonely = {c for c in use if len(use) > 1 and all(abs(use[c] - use[d]) > s.threshold for d in use if d != c)}
        self.name(use, ascending, lonely)
        rises = self.remember(use, ascending)
        resolver, vote, blamed = self.answer(use, ascending, lonely, rises, ilm, reference, base)
        singular = ":" in self.pattern
        if reference is not None and len(use) >= 2 and not singular:
            off = abs(self.near(vote, reference) - reference)
            self.judge_reference(off <= s.reference_threshold)
        for c in set(range(s.channels)) - self.failed:
            if c not in use:
                self.counts[c] += 1
            elif not singular:
                self.counts[c] = self.counts[c] + 1 if c in lonely else 0
        self.failed |= {c for c in range(s.channels) if self.counts[c] >= s.persistence}
        if singular and self.lasted >= s.singular_persistence:
            self.failed |= blamed
        silent = {c for c in range(s.channels) if c not in use}
        suspects = lonely | blamed | silent | {c for c in range(4) if self.counts[c]}
        states = ["failed" if c in self.failed else "suspect" if c in suspects else "ok" for c in range(s.channels)]
        self.vote = vote
        whole = tuple(sum(bit << i for i, bit in enumerate(reversed(b))) for b in self.bits)
        usable = self.trusted and reference is not None
        return Frame(vote, states, s.channels - len(self.failed), self.pattern, resolver, (whole[0], whole[1]), usable)

    def name(self, use: dict[int, float], ascending: list[int], lonely: set[int]) -> None:
        """The pattern of section 2, and for how many frames it has lasted."""
        apart = [abs(use[a] - use[b]) > self.s.threshold for i, a in enumerate(ascending) for b in ascending[i + 1 :]]
        if not use:
            pattern = "lost"
        elif len(use) > 1 and all(apart):
            pattern = ":".join("1" * len(use))
        elif len(use) == 4 and apart == [False, True, True, True, True, False]:
            pattern = "2:2"
        else:
            pattern = "isolated" if lonely else "normal"
        self.lasted = self.lasted + 1 if pattern == self.pattern else 1
        self.pattern = pattern

    def remember(self, use: dict[int, float], ascending: list[int]) -> tuple[float, float]:
        """The trend bytes of section 4; returns the changes of the larger and the smaller rank."""
        n = len(ascending)
        if not n:
            self.ranks, self.ranked, self.bits = None, 0, ([], [])
            return 0.0, 0.0
        now = (use[ascending[n // 2]], use[ascending[(n - 1) // 2]])
        rises = (0.0, 0.0)
        if self.ranks is not None and n == self.ranked:
            last = self.ranks
            rises = (self.near(now[0], last[0]) - last[0], self.near(now[1], last[1]) - last[1])
            for byte, rise in zip(self.bits, rises, strict=True):
                byte.append(1 if rise > 0 else 0)
                del byte[: -self.s.trend_frames]
        else:
            self.bits = ([], [])
        self.ranks, self.ranked = now, n
        return rises

    def answer(
        self,
        use: dict[int, float],
        ascending: list[int],
        lonely: set[int],
        rises: tuple[float, float],
        ilm: list[str],
        reference: float | None,
        base: float,
    ) -> tuple[str, float, set[int]]:
        """Resolver, vote and who is blamed: sections 3 to 6."""
        x = [use[c] for c in ascending]
        n = len(x)
        if self.pattern == "lost":
            return "none", base if self.vote is not None else 0.0, set()
        if self.pattern == "1:1:1:1":
            return "extremes", (x[1] + x[2]) / 2, {ascending[0], ascending[3]}
        if self.pattern == "1:1:1":
            return "middle", x[1], {ascending[0], ascending[2]}
        if self.pattern in ("2:2", "1:1"):
            return self.settle(ascending, x, rises, ilm, reference)
        if n == 4 and ascending[2] in lonely:
            return "none", x[1], set()
        if n == 4 and ascending[1] in lonely:
            return "none", x[2], set()
        return "none", {1: x[0], 2: sum(x[:2]) / 2, 3: x[n // 2], 4: sum(x[1:3]) / 2}[n], set()

    def settle(
        self, ascending: list[int], x: list[float], rises: tuple[float, float], ilm: list[str], reference: float | None
    ) -> tuple[str, float, set[int]]:
        """A split in two halves: section 4."""
        half = len(x) // 2
        low, high = set(ascending[:half]), set(ascending[half:])
        mean = {"low": sum(x[:half]) / half, "high": sum(x[half:]) / half}
        for name in self.s.resolvers:
            if name == "ilm":
                says = [{ilm[c] for c in side} for side in (low, high)]
                if says == [{"good"}, {"bad"}]:
                    return name, mean["low"], high
                if says == [{"bad"}, {"good"}]:
                    return name, mean["high"], low
            if name == "trend" and len(self.bits[0]) == self.s.trend_frames:
                both = self.bits[0] + self.bits[1]
                if all(both):
                    return name, mean["high"], low
                if not any(both):
                    return name, mean["low"], high
            if name == "reference" and reference is not None and self.trusted:
                return (name, *self.triplex(x[half], x[half - 1], reference, low, high))
        if self.vote is None:
            return "unresolved", (x[half - 1] + x[half]) / 2, set()
        return "unresolved", self.vote + (rises[0] + rises[1]) / 2, set()

    def triplex(
        self, above: float, below: float, reference: float, low: set[int], high: set[int]
    ) -> tuple[float, set[int]]:
        """The middle of {above, below, reference} and who fails for it."""
        if reference >= above:
            return above, low
        if reference <= below:
            return below, high
        blamed = high if above - reference > self.s.reference_threshold else set()
        return reference, blamed | (low if reference - below > self.s.reference_threshold else set())

    def judge_reference(self, agrees: bool) -> None:
        """Untrusted after ``persistence`` frames off a healthy vote, trusted after as many on it."""
        self.against = self.against + 1 if agrees != self.trusted else 0
        if self.against >= self.s.persistence:
            self.trusted, self.against = agrees, 0


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
