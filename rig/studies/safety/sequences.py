"""Enumerate the sequences of fault modes on one signal, and draw the flights of each in a condition.

A mode is a kind of fault of a channel, or of the reference.  Channels are drawn for every flight, so a sequence counts
modes, not channels.  The reference is one item and fails once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.random import Generator, SeedSequence

from rig.studies.reliability.tally import LATENT
from rig.world.faults import KINDS as FAULT_KINDS
from rig.world.faults.fault_settings import in_thresholds

MOST: Final = 3  # faults of a sequence: four are all channels of a quadruplex signal
KINDS: Final = ("hardover", "stuck", "offset", "drift", "dropout")  # of those with channels, the flown ones
REFERENCE: Final = ("reference offset", "reference dropout")
MODES: Final = (*KINDS, *REFERENCE)
LEAST, LARGEST = 1.2, 24.0  # thresholds, or thresholds a second
NEAR_S: Final = 0.15  # from one onset to the next, at most
Modes = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Condition:
    """The manoeuvre, and the times of the faults, s."""

    name: str
    gap: str  # settled or near
    duration_s: float
    manoeuvre_s: tuple[float, float] | None  # begin and duration
    first_s: tuple[float, float]  # of the first onset
    gaps_s: tuple[float, float]

    @property
    def slug(self) -> str:
        """Return the name of the condition's folder."""
        return f"{self.name.replace(' ', '-')}-{self.gap}"


CONDITIONS: Final = {
    each.slug: each
    for each in (
        Condition("manoeuvre", "settled", 8.0, (2.0, 6.0), (2.2, 3.2), (1.0, 1.5)),
        Condition("manoeuvre", "near", 8.0, (2.0, 6.0), (2.2, 5.0), (0.0, NEAR_S)),
        Condition("level", "settled", 8.0, None, (2.2, 3.2), (1.0, 1.5)),
        Condition(LATENT, "settled", 9.5, (4.2, 5.0), (0.8, 1.3), (0.8, 1.2)),
    )
}


def sequences(order: int, modes: Sequence[str] = MODES) -> list[Modes]:
    """Return all sequences of up to ``order`` modes, short ones first; the reference fails at most once."""
    return [
        sequence
        for length in range(1, order + 1)
        for sequence in product(modes, repeat=length)
        if sum(mode in REFERENCE for mode in sequence) <= 1
    ]


def faults(signal: str, sequence: Modes, channels: Sequence[int], when: Condition, rng: Generator) -> list[Any]:
    """Draw the faults of one flight, as tables of a scenario; ``channels``: of the signal."""
    free = iter(rng.permutation(channels).tolist())
    at_s = rng.uniform(*when.first_s)
    drawn = []
    for mode in sequence:
        kind = mode.split()[-1]
        place = {"signal": f"reference.{signal}"} if mode in REFERENCE else {"signal": signal, "channels": [next(free)]}
        drawn.append({"kind": kind, **place, "start_s": round(at_s, 2), **_size(kind, rng)})
        at_s += rng.uniform(*when.gaps_s)
    return drawn


def _size(kind: str, rng: Generator) -> dict[str, Any]:
    model = FAULT_KINDS[kind]
    if "direction" in model.model_fields:
        return {"direction": "high" if rng.random() < 0.5 else "low"}
    if not model.sizes:
        return {}
    size = float(np.exp(rng.uniform(np.log(LEAST), np.log(LARGEST))))
    return {in_thresholds(model.sizes[0]): round(size if rng.random() < 0.5 else -size, 4)}


def flights(
    signal: str, sequence: Modes, channels: Sequence[int], when: Condition, count: int, seed: int
) -> list[list[Any]]:
    """Draw the faults of ``count`` flights of one sequence, from the seed, sequence and condition alone."""
    name = hashlib.sha256("; ".join([when.slug, signal, *sequence]).encode()).digest()
    rng = np.random.default_rng(SeedSequence(seed, spawn_key=tuple(name[:8])))
    return [faults(signal, sequence, channels, when, rng) for _ in range(count)]
