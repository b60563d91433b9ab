"""The oracle's noisy channel of two that are left, by second differences: its own memory, as the page has it."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import ClassVar

from oracle_answers import Settings


@dataclass
class SecondDifferences:
    """The last three of the middle and of D, and the three means over 100 frames."""

    s: Settings
    since: ClassVar[int] = 3  # frames since the middle moved as no aircraft does
    middles: list[float] = field(default_factory=list)  # changes of the middle, the newest last
    apart: list[float] = field(default_factory=list)  # D
    straight: int = 0  # frames in a row whose change of the middle counts
    counted: int = 0  # second differences in the means
    both: float = 0.0
    of_d: float = 0.0
    product: float = 0.0
    roughest: float = 0.0

    def begin(self) -> None:
        """Another number of channels."""
        self.straight, self.counted = -1, 0
        self.both, self.of_d, self.product = 0.0, 0.0, 0.0

    def watch(self, change: float, y: dict[int, float], learned: int, noise: float) -> set[int]:
        """The noisy one of two channels; noise : variance of a healthy one."""
        self.middles = [*self.middles, change][-2:]
        a, b = (min(y), max(y)) if len(y) == 2 else (0, 0)
        self.apart = [*self.apart, y[a] - y[b] if len(y) == 2 else 0.0][-3:]
        if self.straight < self.since:
            return set()
        self.counted += 1
        turn = self.middles[1] - self.middles[0]
        d = (self.apart[2] - self.apart[1]) - (self.apart[1] - self.apart[0])
        usual = 6.0 * noise
        self.both += (turn**2 - d**2 / 4.0 - self.both) / 100.0
        shared = max(self.both - 0.3 * usual, 0.0)
        self.roughest = max(0.9999 * self.roughest, shared)
        if len(y) > 2:
            return set()
        return self.noisy(turn, d, (a, b), (usual, shared, learned))

    def noisy(self, turn: float, d: float, pair: tuple[int, int], known: tuple[float, float, int]) -> set[int]:
        usual, shared, learned = known
        floor = max(0.6 * self.s.slow_halves * usual, 2.0 * self.roughest)
        most = 5.0 * floor
        self.of_d += (min(d * d, 2.0 * most) - self.of_d) / 100.0
        self.product += (max(-most, min(most, d * turn)) - self.product) / 100.0
        rough, smooth = self.of_d / 2.0 + abs(self.product), self.of_d / 2.0 - abs(self.product)
        limit = 0.6 * self.s.slow_halves * sqrt(self.of_d * shared + usual**2)
        healthy = max(usual, 6.0 * (2.0 * self.s.slow_noise) ** 2)
        found = abs(self.product) > max(floor, limit, smooth) and rough > healthy * (1.0 + 0.85 * self.s.slow_halves)
        if not found or self.counted < 200 or learned < 500:
            return set()
        return {pair[0] if self.product > 0.0 else pair[1]}
