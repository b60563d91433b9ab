"""The oracle's trend bytes: section 6 of the requirement, table 1."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from oracle_answers import Settings


@dataclass
class Trend:
    """Changes of the two voting ranks, the larger first, over frames of as many samples."""

    ranks: tuple[float, float] | None = None
    ranked: int = 0  # samples
    rises: tuple[float, float] = (0.0, 0.0)
    bits: tuple[list[int], list[int]] = field(default_factory=lambda: ([], []))
    still: list[int] = field(default_factory=lambda: [0, 0])  # frames in a row without any change
    seen: int = 0  # changes
    standing: str = ""  # the verdict of the last whole window

    def remember(self, ranks: tuple[float, float] | None, n: int, s: Settings) -> None:
        """One frame more; ``ranks`` are None where there is no sample."""
        if ranks is None or self.ranks is None or n != self.ranked:
            self.rises, self.bits, self.still, self.seen, self.standing = (0.0, 0.0), ([], []), [0, 0], 0, ""
        else:
            self.shift((s.change(ranks[0], self.ranks[0]), s.change(ranks[1], self.ranks[1])), s)
        self.ranks, self.ranked = ranks, n

    def shift(self, rises: tuple[float, float], s: Settings) -> None:
        self.rises = rises
        if s.trend_tumbles and self.seen % s.trend_frames == 0:
            self.bits = ([], [])
        for i, (byte, rise) in enumerate(zip(self.bits, rises, strict=True)):
            byte.append(1 if rise > 0 else 0)
            del byte[: -s.trend_frames]
            self.still[i] = self.still[i] + 1 if rise == 0 else 0
        self.seen += 1
        if self.seen % s.trend_frames == 0:
            self.standing = self.verdict(s.trend_frames)

    def verdict(self, frames: int) -> str:
        """What the last so many changes say: which half is right, that both are wrong, or nothing."""
        frozen = [count >= frames for count in self.still]
        if self.seen < frames or frozen[0] != frozen[1]:
            return ""
        larger, smaller = (set(byte[-frames:]) for byte in self.bits)
        verdicts: dict[tuple[int, ...], str] = {(1, 1): "larger", (0, 0): "smaller", (0, 1): "both wrong"}
        return verdicts.get((*larger, *smaller), "") if len(larger) == len(smaller) == 1 else ""

    def says(self, s: Settings) -> str:
        if s.trend_tumbles:
            return self.standing
        small = all(abs(rise) <= s.trend_small for rise in self.rises)
        return self.verdict(1 if small else s.trend_frames)
