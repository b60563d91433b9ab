"""Other readings of what holds while no rule decides, and a maker of flights that tell them apart."""

from __future__ import annotations

import random

from oracle_answers import Settings, View
from oracle_flights import build, held
from oracle_split import Split
from vector_flights import Flown, slow_faults
from vector_rules import Other


def held_in_gaps(seed: int) -> Flown:
    """A random split with samples missing, answers of few frames and channels that jump."""
    draw = random.Random(f"held {seed}")
    return Flown(slow_faults(held(build(draw.choice), draw.choice)))


class _AnyAnswer(Split):
    def not_held(self, s: Settings) -> None:
        super().not_held(s)
        self.open = 0 if self.in_split else self.open


class AnsweredOnce(Other):
    """Any answer ends the wait of a split."""

    splits = _AnyAnswer


class _AnyFrame(Split):
    def not_held(self, s: Settings) -> None:
        super().not_held(s)
        self.open = self.open if self.in_split else 0


class EndedByMissing(Other):
    """A frame in which a sample is missing ends the wait of a split."""

    splits = _AnyFrame


class _Steady(Split):
    def hold(self, view: View, vote: float | None) -> float:
        if self.ranked == set(view.use):
            self.gap = view.use[self.shares[1]] - view.use[self.shares[0]]
        return super().hold(view, vote)


class KeptThroughJumps(Other):
    """A held channel keeps its share where it jumps."""

    splits = _Steady
