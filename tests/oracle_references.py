"""The oracle's rules of references: their own monitor, the pair that extremes leave, two references against all."""

from __future__ import annotations

from dataclasses import dataclass, field

from oracle_answers import Settings, View

FAR = 1.5  # reference thresholds, of what a reference speaks against


@dataclass
class References:
    """Memory of one signal's; ``rules`` are those that the frame reached."""

    s: Settings
    trusted: bool = True
    against: int = 0  # frames that speak against the reference's standing
    suspected: bool = False  # the pair that extremes left
    pair_off: int = 0  # frames for which a reference has spoken against both of it
    contradicted: int = 0
    second_off: int = 0  # frames for which the second reference has been off the vote
    standing: bool = False  # the samples of all channels in use repeat
    rules: set[str] = field(default_factory=set)

    # Section 7.

    def monitor(self, view: View) -> None:
        """Untrusted after ``persistence`` frames off both voting ranks, trusted after as many near one of them."""
        if view.reference is None or len(view.use) < 2 or ":" in view.pattern:
            return
        if self.suspected or self.standing:
            self.rules.add(f"reference not monitored by {'a suspected pair' if self.suspected else 'who stands still'}")
            return
        agrees = self.off_ranks(view, view.reference) <= self.s.reference_threshold
        self.against = self.against + 1 if agrees != self.trusted else 0
        if self.against >= self.s.persistence:
            self.trusted, self.against = agrees, 0

    def off_ranks(self, view: View, reference: float) -> float:
        """How far the reference is from the nearer of the two voting ranks."""
        return min(self.s.apart(x, reference) for x in view.ranks)

    # Section 8: the pair that extremes left may be bad too.

    def cuts(self, view: View) -> bool:
        """Whether a reference has been off both of it for ``persistence`` frames in which they agree."""
        reference, off = view.usable_reference, False
        if self.suspected and view.pattern == "normal" and len(view.use) == 2 and reference is not None:
            off = self.off_ranks(view, reference) > max(FAR * self.s.reference_threshold, self.s.within(2))
        self.pair_off = self.pair_off + 1 if off else 0
        if self.pair_off >= self.s.persistence:
            self.rules.add("the pair of extremes cut")
        return self.pair_off >= self.s.persistence

    def level_changed(self, left_by_extremes: bool = False) -> None:
        """A pair is under suspicion from where extremes left it to the next change of the level."""
        self.suspected, self.pair_off = left_by_extremes, 0

    # Two references against all channels.

    def lost(self, view: View, vote: float, second: float | None, all_in_use: bool, in_dispute: bool) -> bool:
        """Count the frames in which both references contradict all channels; by choice the signal is lost then.

        The count does not begin while what they read is in dispute.
        """
        off = second is not None and len(view.use) > 1 and self.second_is_off(view, vote, second)
        self.second_off = self.second_off + 1 if off else 0
        contradict, begun = off and all_in_use and self.contradict(view, vote, second), self.contradicted > 0
        if contradict and in_dispute and not begun:
            self.rules.add("common mode: in dispute")
        self.contradicted = self.contradicted + 1 if contradict and (begun or not in_dispute) else 0
        if self.common and self.s.common_fails:
            self.rules.add("common mode: lost")
            self.trusted, self.against = True, 0
            return True
        if self.common:
            self.rules.add("common mode: reported")
        return False

    @property
    def common(self) -> bool:
        return self.contradicted >= self.s.common_persistence

    def contradict(self, view: View, vote: float, second: float | None) -> bool:
        """All agree, two references agree, and the former do not with the latter; ``second`` does not."""
        s, first = self.s, view.reference
        if view.pattern != "normal" or first is None or second is None:
            return False
        off = s.apart(vote, first) > max(FAR * s.reference_threshold, s.within(len(view.use)))
        near = s.apart(first, second) <= s.reference_threshold + s.second_threshold
        if off and not near:
            self.rules.add("common mode: references apart")
        return off and near

    def second_is_off(self, view: View, vote: float, second: float) -> bool:
        return self.s.apart(vote, second) > max(FAR * self.s.second_threshold, self.s.within(len(view.use)))

    @property
    def in_dispute(self) -> bool:
        """Whether what they say of other signals cannot be relied on, as of the last frame."""
        return self.s.tells != 0 and (not self.trusted or self.second_off >= self.s.persistence)
