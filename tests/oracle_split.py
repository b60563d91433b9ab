"""The oracle's memory of a split: how long it lasts, who has answered, what is held meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, field

from oracle_answers import Settings, View


@dataclass
class Split:
    pattern: str = ""
    lasted: int = 0  # frames of the pattern
    answer: tuple[str, frozenset[int]] | None = None  # of the last frame: the rule, and whom it blames
    stood: int = 0  # frames for which that has been so
    silent: int = 0  # frames in a row that no rule has settled
    open: int = 0  # frames that no rule has settled since all agreed, or an answer stood
    whole: bool = False  # whether all channels in use were compared in this frame
    basis: bool = False  # whether the last vote may be the start of a hold
    closed: bool = False  # behind a filter: the samples of the split are together again
    ranked: frozenset[int] = frozenset()  # the channels of which the shares are; empty: none are kept
    shares: tuple[int, int, float] = (0, 0, 0.0)  # two channels, and the share of the second
    gap: float = 0.0  # from the first to the second, when the shares were last used
    rules: set[str] = field(default_factory=set)  # that the frame reached

    def name(self, pattern: str, closed: bool = False) -> None:
        if pattern != self.pattern:
            self.lasted, self.answer, self.stood = 1, None, 0
        elif not closed:
            self.lasted += 1
        self.pattern, self.closed = pattern, closed

    @property
    def in_split(self) -> bool:
        """Whether the pattern has no majority."""
        return ":" in self.pattern

    def hear(self, decided_by: str, wrong: set[int], s: Settings) -> None:
        """The frame's answer: it has stood for one frame more, or begins to."""
        held, over = decided_by == "unresolved", self.whole and not self.in_split
        self.basis = held or over
        if over:
            self.open, self.ranked = 0, frozenset()
        if self.closed:
            return
        answer = (decided_by, frozenset(wrong)) if self.in_split else None
        if answer is not None and answer == self.answer:
            self.stood += 1
        else:
            covered = min(self.silent, self.lasted - 1, s.trend_frames - 1)
            self.stood = 1 + (covered if decided_by == "trend" else 0)
        self.answer = answer
        self.silent = self.silent + 1 if held else 0
        if held:
            self.open += 1
        elif self.open:
            self.not_held(s)

    def not_held(self, s: Settings) -> None:
        """The count of frames without an answer ends with an answer that has stood, and else goes on later."""
        if not self.in_split:
            self.rules.add("open: kept in a frame with a gap")
        elif 2 * self.stood >= s.split_persistence:
            self.rules.add("open: an answer has stood")
            self.open = 0
        else:
            self.rules.add("open: kept beside a young answer")

    def settled(self, s: Settings) -> bool:
        wait = s.split_persistence
        return self.in_split and not self.closed and self.lasted >= wait and 2 * self.stood >= wait

    def given_up(self, s: Settings) -> bool:
        return 0 < s.unresolved_frames <= self.open

    def hold(self, view: View, vote: float | None) -> float:
        """A fixed mean of two channels, whose shares give the last vote, until one of the two jumps."""
        if vote is None:
            return sum(view.ranks) / 2
        use, kept = view.use, self.ranked == set(view.use)
        low, high, share = self.shares
        if not kept or abs(use[high] - use[low] - self.gap) > view.s.within(len(use)):
            low, high, share = around(vote, view) if self.basis else halves(view)
            self.rules.add("hold: jumped" if kept else "hold: from the last vote" if self.basis else "hold: halves")
        elif not self.basis:
            self.rules.add("hold: goes on after a gap or an answer")
        self.shares, self.ranked, self.gap = (low, high, share), frozenset(use), use[high] - use[low]
        return use[low] + share * self.gap


def around(vote: float, view: View) -> tuple[int, int, float]:
    """The neighbours in rank between which ``vote`` lies, and the share of the second that gives it."""
    order, place = view.ascending, 0
    while place < len(order) - 2 and view.use[order[place + 1]] < vote:
        place += 1
    low, high = order[place], order[place + 1]
    gap = view.use[high] - view.use[low]
    return low, high, min(max((vote - view.use[low]) / gap, 0.0), 1.0) if gap > 0 else 0.5


def halves(view: View) -> tuple[int, int, float]:
    """Half each of the two voting ranks: of three the middle one."""
    order = view.ascending
    return order[(len(order) - 1) // 2], order[len(order) // 2], 0.5
