"""Halves of the channels: what is learned of a reference, and the noise where four channels were never in use."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_redundancy_slow_tests import SEEDS, SIGMA, noise, truth, vote

from rig.core.frame import DecidedBy

FRAMES = 4000
PAIRS = [[1, 2], [0, 3]]


def a_pair_off(seed: int, pair: list[int]) -> Any:
    samples = noise(seed, FRAMES)
    samples[1500:, pair] += 0.12
    return samples


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize(
    ("off", "frames"), [(-1.2, 100), (1.2, 100), (3.0, 100), (-100.0, 1), (100.0, 1), (0.9, 40), (-0.9, 40)]
)
def test_a_reference_that_was_off_before_a_fault_blames_no_healthy_pair(pair: list[int], off: float, frames: int):
    """Its bias is learned from usable references only, and no frame of it counts beyond the threshold."""
    for seed in SEEDS:
        reference = truth(seed, FRAMES)
        reference[1300 : 1300 + frames] = off
        failed = vote(a_pair_off(seed, pair), reference).failed_at()
        assert [failed[c] for c in range(4) if c not in pair] == [None, None], (seed, failed)
        if abs(off) > 1.0:
            assert all(1500 < (failed[c] or 0) < 1800 for c in pair), (seed, failed)


def left_of(fitted: int, samples: Any) -> list[int]:
    """Leave two channels of ``fitted`` in use; return them."""
    samples[:, fitted:] = np.nan
    for frame, c in {4: [(400, 1), (500, 3)], 3: [(400, 1)], 2: []}[fitted]:
        samples[frame:, c] += 9.0
    return {4: [0, 2], 3: [0, 2], 2: [0, 1]}[fitted]


@pytest.mark.parametrize("fitted", [4, 3, 2])
@pytest.mark.parametrize("kind", ["offset", "drift", "noise"])
def test_the_wrong_one_of_two_is_isolated_however_many_were_fitted(fitted: int, kind: str):
    """With 2 or 3 fitted the noise of a half was half of the data sheet's: all was suspected, and nothing learned."""
    for seed in SEEDS:
        samples, k = noise(seed, 6000), np.arange(3500)
        left = left_of(fitted, samples)
        samples[2500:, left[0]] += {
            "offset": 0.15,
            "drift": 0.0003 * k,
            "noise": np.random.default_rng(seed + 500).normal(0.0, 4.0 * SIGMA, len(k)),
        }[kind]
        out = vote(samples, truth(seed, 6000), channels=fitted)
        failed = out.failed_at()
        assert 2500 < (failed[left[0]] or 0) < 3700 and failed[left[1]] is None, (seed, failed)
        rule = DecidedBy(int(out.decided_by[(failed[left[0]] or 0) - 1]))
        assert rule in (DecidedBy.SLOW_SQUARES if kind == "noise" else DecidedBy.SLOW_HALVES, DecidedBy.SLOW_HALVES)


@pytest.mark.parametrize("fitted", [3, 2])
def test_two_healthy_channels_are_kept_however_many_were_fitted(fitted: int):
    for seed in SEEDS:
        samples = noise(seed, 20_000)
        left = left_of(fitted, samples)
        out = vote(samples, truth(seed, 20_000), channels=fitted, tests={"reference_error": 0.0093})
        assert [out.failed_at()[c] for c in left] == [None, None], seed
