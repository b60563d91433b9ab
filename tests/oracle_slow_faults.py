"""The oracle's slow-fault rules: sums of small deviations, samples that repeat."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median

from oracle_answers import Settings, View
from oracle_references import FAR


@dataclass
class SlowFaults:
    """Memory of one signal beside the oracle's; channels are keys."""

    s: Settings
    sums: dict[tuple[int, int], float] = field(default_factory=dict)  # by channel and sign
    last: dict[int, float] = field(default_factory=dict)  # comparable samples
    last_reference: float | None = None  # of the last frame, as given
    repeats: dict[int, int] = field(default_factory=dict)
    standing: bool = False  # the samples of all channels in use repeat
    rules: set[str] = field(default_factory=set)  # that the frame reached
    out: int = 0  # channels that were failed when the sums last began, or since

    def hear(self, failed: set[int]) -> None:
        """With another number of failed channels than before the sums begin again."""
        if len(failed) != self.out:
            self.out = len(failed)
            self.sums.clear()

    def stale(self, samples: list[float | None], in_use: set[int], reference: float | None, trusted: bool) -> set[int]:
        """Channels whose sample has been the same for too long, while half of the others have moved.

        A reference that is ``trusted`` and far off it tells the same, at the stop and of those that all stand still.
        """
        if not self.s.stale_frames and not self.s.slow_means:
            return set()
        there = {c: x for c, x in enumerate(samples) if x is not None}
        moved = {c for c in there if c in in_use and self.last.get(c) != there[c]}
        self.standing = not moved and self.s.stale_frames > 0
        against = self.s.limited(reference) if trusted else None
        reference_moved = reference is not None and reference != self.last_reference
        for c, x in there.items():
            others = set(there) & in_use - {c}
            witnessed = 2 * len(moved) >= len(others) if others else reference_moved
            at_the_stop = not self.s.turn and not self.s.low < x < self.s.high
            far = against is not None and self.s.apart(x, against) > FAR * self.s.reference_threshold
            if self.last.get(c) == x and far:
                self.repeats[c] += 1
                self.rules.add("a repeat that the reference tells")
            elif self.last.get(c) != x or at_the_stop:
                self.repeats[c] = 0
            elif witnessed:
                self.repeats[c] += 1
            elif moved:
                self.rules.add("a repeat of which too few tell")
            self.last[c] = x
        self.last_reference = reference
        return {c for c in there if 0 < self.s.stale_frames <= self.repeats[c]}

    def residuals(self, view: View, bias: dict[int, float]) -> dict[int, float]:
        """How far each sample without its ``bias`` is from the median of all, where the tests learn biases.

        Else how far each is from the middle, in which a usable reference may stand between two halves.
        """
        if self.s.slow_means:
            y = {c: x - bias[c] for c, x in view.use.items()}
            return {c: x - median(y.values()) for c, x in y.items()}
        above, below = view.ranks
        middle = (above + below) / 2
        if len(view.x) % 2 == 0 and view.usable_reference is not None:
            middle = sorted([above, below, view.usable_reference])[1]
        return {c: x - middle for c, x in view.use.items()}

    def summed(self, view: View, bias: dict[int, float]) -> set[int]:
        """The channel with the largest sum above the limit, while most are below half of it.

        Where the tests stop near an end of the range, the sums stand still.
        """
        if not self.s.slow_limit or len(view.use) < 3 or ":" in view.pattern:
            return set()
        reached: dict[int, float] = {}
        for c, r in self.residuals(view, bias).items():
            for sign in (1, -1):
                step = sign * r - self.s.slow_allowance
                step = min(step, self.s.slow_limit / (self.s.persistence - 0.5))
                self.sums[c, sign] = max(0.0, self.sums.get((c, sign), 0.0) + step)
            reached[c] = max(self.sums[c, 1], self.sums[c, -1])
        worst = max(view.ascending, key=lambda c: reached[c])  # of equals the least sample
        calm = sum(x < self.s.slow_limit / 2 for x in reached.values())
        return {worst} if reached[worst] > self.s.slow_limit and calm > len(reached) / 2 else set()
