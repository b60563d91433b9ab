"""Votes that a reference must not learn: who moves apart from the vote, and when that is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.computer.analytic import references
from rig.computer.analytic.apart import LEARNING, RECENT_S, USUAL_S, stand_still, still_within
from rig.core.frame import State, nested, new_block

RATE_HZ, STILL = 100.0, 0.5
BIASES = np.array([0.0, 1.0, 2.0, 9.0])


def told(samples: NDArray[np.float64], failed: Any = (), back: int | None = None) -> NDArray[np.bool_]:
    """Return (n,) whether the first of LEARNING counts as agreed, of (n, 4) samples and their middle as vote.

    failed : (frame, channel from 0) that is failed from there on, until ``back``
    """
    s, block = LEARNING[0], new_block(len(samples))
    block["valid"], block["channels"][:, s] = 1, samples
    for frame, c in failed:
        block["state"][frame:back, s, c] = State.FAILED
    there = block["state"][:, s] < State.FAILED
    block["level"][:, s] = there.sum(axis=1)
    block["voted"][:, s] = np.nanmedian(np.where(there, samples, np.nan), axis=1)
    p, st = np.zeros(1, references.PARAM)[0], np.zeros(1, references.STATE)[0]
    p["recent_frames"], p["usual_frames"], p["still"] = RECENT_S * RATE_HZ, USUAL_S * RATE_HZ, STILL
    agreed = np.empty(len(samples), bool)
    for k, row in enumerate(nested(block)):
        st["agreed"] = 1 << s
        stand_still(0, s, row["bus"], row["fcc"], p, st)
        agreed[k] = st["agreed"] != 0
    return agreed


def drifting(begins: int, rate: float, frames: int = 6000) -> NDArray[np.float64]:
    """Four channels with biases, of which the last drifts from a frame on; rate : a second."""
    samples = np.tile(BIASES, (frames, 1))
    samples[begins:, 3] += rate / RATE_HZ * np.arange(frames - begins)
    return samples


@pytest.mark.requirement("references", "slow faults are not learned")
def test_channels_that_keep_their_distances_are_learned():
    noise = 0.1 * np.random.default_rng(1).standard_normal((6000, 4))
    assert told(np.tile(BIASES, (6000, 1)) + noise).all()


@pytest.mark.requirement("references", "slow faults are not learned")
@pytest.mark.parametrize("rate", [0.1, -0.1, 1.0])
def test_a_channel_that_drifts_is_told_before_it_is_far_and_to_the_end(rate: float):
    agreed = told(drifting(2000, rate))
    first = int(np.argmin(agreed))
    assert first > 2000 and abs(rate) * (first - 2000) / RATE_HZ < 3.0 * STILL
    assert not agreed[first:].any()


def test_the_distances_go_on_with_the_channels_that_are_left():
    """Two fail at 20 s: the vote leaps from 1.5 to 4.5, and the distances are -4.5 and 4.5 at once."""
    gone = [(2000, 1), (2000, 2)]
    assert told(np.tile(BIASES, (6000, 1)), gone).all()
    three = told(np.tile(BIASES, (6000, 1)), gone[:1])
    assert three.all()


@pytest.mark.requirement("references", "slow faults are not learned")
@pytest.mark.parametrize("gone", [(1, 2), (1,)])
def test_a_drift_that_begins_as_another_channel_fails_is_told_as_soon(gone: tuple[int, ...]):
    failed = [(2000, c) for c in gone]
    share = 0.5 if len(gone) == 2 else 1.0  # of the drift, by which the last is off the vote
    first = int(np.argmin(told(drifting(2000, 0.1 / share), failed)))
    assert abs(first - int(np.argmin(told(drifting(2000, 0.1))))) <= 2


def test_with_a_channel_more_the_distances_begin_again():
    """One is out from 20 s to 30 s, and 5 off what it was when it comes back: another vote, which is learned."""
    samples = np.tile(BIASES, (6000, 1))
    samples[2500:, 3] += 5.0
    assert told(samples, [(2000, 3)], back=3000).all()
    assert not told(samples).all()


def test_what_is_still_is_the_noise_or_a_sixtieth_of_the_threshold():
    found = still_within(np.array([60.0, 60.0]), np.array([0.5, 2.0]))
    assert found.tolist() == [1.0, 2.0]
