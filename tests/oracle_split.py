"""The oracle's memory of a pattern without a majority: how long it lasts, who has answered, what is held meanwhile."""

from __future__ import annotations

from dataclasses import dataclass

from oracle_answers import Settings, View


@dataclass
class Split:
    pattern: str = ""
    lasted: int = 0  # frames of the pattern
    answer: tuple[str, frozenset[int]] | None = None  # of the last frame: the rule, and whom it blames
    stood: int = 0  # frames for which that has been so
    open: int = 0  # frames in a row that nobody has answered
    held: bool = False  # whether the last frame was one
    closed: bool = False  # behind a filter: the samples of the split are together again
    ranked: frozenset[int] = frozenset()  # the channels of which the shares are
    shares: tuple[int, int, float] = (0, 0, 0.0)  # two channels, and the share of the second

    def name(self, pattern: str, closed: bool = False) -> None:
        if pattern != self.pattern:
            self.lasted, self.answer, self.stood = 1, None, 0
        elif not closed:
            self.lasted += 1
        self.pattern, self.closed = pattern, closed

    @property
    def singular(self) -> bool:
        """Whether the pattern has no majority."""
        return ":" in self.pattern

    def hear(self, resolver: str, wrong: set[int], s: Settings) -> None:
        """The frame's answer: it has stood for one frame more, or begins to."""
        self.held = resolver == "unresolved"
        if self.closed:
            return
        answer = (resolver, frozenset(wrong)) if self.singular else None
        if answer is not None and answer == self.answer:
            self.stood += 1
        else:
            covered = min(self.open, self.lasted - 1, s.trend_frames - 1)
            self.stood = 1 + (covered if resolver == "trend" else 0)
        self.answer = answer
        self.open = self.open + 1 if resolver == "unresolved" else 0

    def settled(self, s: Settings) -> bool:
        wait = s.singular_persistence
        return self.singular and not self.closed and self.lasted >= wait and 2 * self.stood >= wait

    def given_up(self, s: Settings) -> bool:
        return 0 < s.unresolved_frames <= self.open

    def hold(self, view: View, vote: float | None) -> float:
        """Where the last vote stood between two neighbours, it stays, as those two move."""
        if vote is None:
            return sum(view.ranks) / 2
        if not self.held or self.lasted == 1 or self.ranked != set(view.use):
            order, place = view.ascending, 0
            while place < len(order) - 2 and view.use[order[place + 1]] < vote:
                place += 1
            low, high = order[place], order[place + 1]
            gap = view.use[high] - view.use[low]
            share = (vote - view.use[low]) / gap if gap > 0 else 0.5
            self.shares, self.ranked = (low, high, min(max(share, 0.0), 1.0)), frozenset(view.use)
        low, high, share = self.shares
        return view.use[low] + share * (view.use[high] - view.use[low])
