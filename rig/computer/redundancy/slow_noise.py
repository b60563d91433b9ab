"""Which of the last two channels is the noisy one: the one whose second differences are rougher than its noise.

Noise and fast oscillation of a channel are in its own second differences.  The motion of the aircraft is in both, and
it is smooth: it is hardly there.  The product of the second differences of D, first channel less second, and of their
middle is half of what the first is rougher by than the second.  No reference is needed.
Added: docs/explanation/decisions.md, 'Slow-fault tests'.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.redundancy.slow_halves import LEAST, MEANS_FROM, SLOW, SQUARES_FROM, known_noise
from rig.core.kernels import kernel

KEPT: Final = 10000.0  # frames of the memory of the roughest motion
TURN: Final = 6.0  # variance of a second difference of white noise of variance 1
# White noise of variance 1 leaves in a mean of squared second differences, over SLOW frames, TURN times 0.1 of standard
# deviation, and 0.14 where they are not products of two channels.
PRODUCT: Final = 0.6  # six of the former
OWN: Final = 0.85  # six of the latter
MIDDLE: Final = 0.3  # variance of the median of four channels
LIMITED: Final = 5.0  # of the least limit: the 15 second differences of a burst of 13 frames reach 0.7 of it
SURE: Final = 2.0  # of the roughest motion: a product beyond is no motion that one of two channels misses
NOISE: Final = (
    ("change", "f8"),  # of the middle, from the last frame
    ("last_change", "f8"),
    ("last_apart", "f8"),  # D of the last frame
    ("last_moved", "f8"),  # and its change
    ("turns", "i8"),  # frames since the middle last moved as no aircraft does, or none was known (slow_tests.py)
    ("turned", "i8"),  # frames that the means have counted
    ("shared", "f8"),  # mean product of the second differences of both channels; of more: square of the middle's
    ("roughest", "f8"),  # largest one, less its noise
    ("rough", "f8"),  # mean square of the second differences of D, of limited steps
    ("rougher", "f8"),  # mean of those of D times those of the middle, of limited steps
)


@kernel
def begin_noise(t):
    """Begin all means again."""
    t["turns"] = t["turned"] = 0
    t["shared"] = t["rough"] = t["rougher"] = 0.0


@kernel
def isolate_noisy(n, p, t):
    """Move the means of the second differences by a frame; return the bit of the noisy one of two channels, 0 for none.

    With more channels only the motion is followed.  ``change`` and ``apart`` are of this frame.
    """
    turn = t["change"] - t["last_change"]
    moved = t["apart"][0] - t["last_apart"] if n == 2 else 0.0
    apart = moved - t["last_moved"]
    t["last_change"], t["last_apart"], t["last_moved"] = t["change"], t["apart"][0], moved
    t["turns"] += 1
    if t["turns"] <= 3:  # a second difference needs three frames, and the way out of a split is none
        return 0
    t["turned"] += 1
    usual = TURN * known_noise(n, p, t)
    t["shared"] += (turn * turn - 0.25 * apart * apart - t["shared"]) * (1.0 / SLOW)
    common = max(t["shared"] - MIDDLE * usual, 0.0)
    t["roughest"] = max(t["roughest"] * (1.0 - 1.0 / KEPT), common)
    if n > 2:
        return 0
    product = PRODUCT * p["slow_halves"]
    least = max(product * usual, SURE * t["roughest"])
    step = LIMITED * least
    t["rough"] += (min(apart * apart, 2.0 * step) - t["rough"]) * (1.0 / SLOW)
    t["rougher"] += (min(max(apart * turn, -step), step) - t["rougher"]) * (1.0 / SLOW)
    by = abs(t["rougher"])
    own, other = 0.5 * t["rough"] + by, 0.5 * t["rough"] - by
    limit = max(least, other, product * math.sqrt(t["rough"] * common + usual * usual))
    if t["turned"] < MEANS_FROM or t["learned"] < SQUARES_FROM or by <= limit:
        return 0
    if own <= max(usual, TURN * (p["slow_noise"] * LEAST) ** 2) * (1.0 + OWN * p["slow_halves"]):
        return 0
    first, second = min(t["order"][0], t["order"][1]), max(t["order"][0], t["order"][1])
    return 1 << (first if t["rougher"] > 0.0 else second)
