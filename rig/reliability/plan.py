"""How many flights or trials a target needs: half of the budget for each number of good channels.

None bad seen in N trials gives a chance below 3 / N with 95 %.
Source: docs/reliability.md, 'How many'; the rules of thumb of 'The model' for four channels.
"""

from __future__ import annotations

from math import ceil, comb, log
from typing import Final, NamedTuple

NONE_SEEN: Final = -log(0.05)
BUDGET: Final = 0.5  # of the target, for one cell


class Needed(NamedTuple):
    """What one cell must show."""

    good_before: int
    chance: float  # that the fault is not kept, at most; from 1 on any will do
    trials: int  # without a bad one among them
    open_loop: bool  # whether trials will do, or flights are needed


def needed(target_per_hour: float, per_hour: float, channels: int = 4, hours: float = 1.0) -> list[Needed]:
    """Return the cells of a chain of ``channels``, the first fault first.

    In a flight of T hours k + 1 of n channels fail with a chance of C(n, k + 1) (lambda T)^(k + 1); the last of them
    takes the signal with it when it is not kept.
    """
    found = []
    for k in range(channels - 1):
        good = channels - k
        weight = comb(channels, k + 1) * (per_hour * hours) ** (k + 1) / hours
        chance = BUDGET * target_per_hour / weight
        found.append(Needed(good, chance, 0 if chance >= 1.0 else ceil(NONE_SEEN / chance), good >= 3))
    return found
