"""Kernels that add up each channel and the voted value of one signal, row by row.

They take one signal's fields (states (4,), voted, truth, level) and nothing of the frame around them, so that flights,
recordings and trials of one signal share them.  Sets of channels are bits, bit 0 is channel 1.

The order within a row: ``mark_wrong``, then ``mark_failed``, then ``count_healthy``, then ``count_vote``.
Outcomes of many trials follow from the frames in which their channels were isolated: ``trial_words``.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, State
from rig.core.kernels import kernel
from rig.verdict.words import PRIOR, fault_words

LEVELS: Final = CHANNELS + 1
NEVER: Final = -1
LONG_AGO: Final = -(2**62)
SIGNAL: Final = np.dtype(
    [
        # Its monitor.
        ("threshold", "f8"),  # of a single channel; a vote is off by more than the one of PARAMS
        ("fitted", "i8"),
        ("box", "i8"),
        ("box_needed", "i8"),  # signals of the box that must accuse a channel until it is failed on all; 0: never
        ("linger", "i8"),  # frames for which a fault that has ceased can be the cause of a failure
        # Its channels.
        ("error", "f8", (CHANNELS,)),  # injected, in this row; NaN where the sample is lost
        ("failed_at", "i8", (CHANNELS,)),  # first frame in which it was failed, or NEVER
        ("wrong_at", "i8", (CHANNELS,)),  # last frame in which its sample was wrong or a fault acted on it
        ("error_at", "i8", (CHANNELS,)),  # last in which its sample was wrong
        ("disturbed", "i8"),  # last frame in which a channel in use was wrong
        ("acting", "u1"),  # channels on which a fault acts in this row,
        ("acted", "u1"),  # or ever did
        ("faulty", "u1"),  # once wrong, never healthy again
        ("failed", "u1"),  # in the row before
        # All of it.
        ("level", "u1"),  # known_level in the row before; before the first the channels that are fitted
        ("pattern", "u1"),  # in the row before
        ("usable", "u1"),  # its reference, in the row before
        ("reported", "u1"),  # whether any channel ever had a state
        ("off", "u1"),  # whether the vote was off by more than its threshold in the last row
        ("span", "i8"),  # that goes on
        ("lost", "i8"),  # frames at level 0
        ("unresolved", "i8"),  # frames
        ("wrong_votes", "i8"),  # frames, of a discrete
        ("healthy_frames", "i8", (LEVELS,)),  # of healthy channels in use, undisturbed, by the level of the row before
        ("false_isolations", "i8", (LEVELS,)),  # of them failed
    ],
    align=True,
)
VOTE: Final = np.dtype(
    [("peak", "f8"), ("at", "i8"), ("squares", "f8"), ("finite", "i8"), ("above", "i8"), ("above_after", "i8")]
)


def first_failed(failed: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return (..., 4) the first frame in which each channel is ``failed``, (..., n, 4), or NEVER."""
    return np.where(failed.any(axis=-2), failed.argmax(axis=-2), NEVER)


def trial_words(
    failed_at: NDArray[np.int64], onsets: NDArray[np.int64], tested: NDArray[np.bool_], healthy: NDArray[np.bool_]
) -> tuple[NDArray[np.str_], NDArray[np.float64]]:
    """Return (T,) the outcome of the tested fault of each trial, and the frames from its onset to the last isolation.

    failed_at : (T, 4) first frame in which each channel was isolated, or NEVER; onsets : (T,)
    tested, healthy : (4,) or (T, 4) channels of the tested fault, and those without any
    One of words.INJECTED, or PRIOR: one of these channels was isolated before the onset.  Frames are NaN if the fault
    is not isolated.
    """
    failed, last = failed_at != NEVER, np.where(tested, failed_at, NEVER).max(axis=1)
    prior = (failed & (tested | healthy) & (failed_at < onsets[:, None])).any(axis=1)
    words = fault_words(True, (failed | ~tested).all(axis=1), True, (failed & healthy).any(axis=1))
    words = np.where(prior, PRIOR, words)
    return words, np.where(words == "isolated", last - onsets, np.nan)


@kernel
def channel_bits(states):
    """Return the channels of ``states`` (4,) that are isolated, as bits."""
    bits = 0
    for c in range(CHANNELS):
        bits |= (states[c] == State.FAILED) << c
    return bits


@kernel
def known_level(level, states):
    """Return ``level``; LEVELS where none of ``states`` (4,) is known, as of a unit that returns surfaces alone."""
    for c in range(CHANNELS):
        if states[c] != State.ABSENT:
            return np.int64(level)
    return LEVELS


@kernel
def mark_wrong(channels, frame, signal):
    """Mark ``channels``, bits, as wrong in this row: a fault acts on them, or their samples are in error."""
    signal["faulty"] |= channels
    for c in range(CHANNELS):
        if (channels >> c) & 1:
            signal["wrong_at"][c] = frame
            if (signal["failed"] >> c) & 1 == 0:
                signal["disturbed"] = frame


@kernel
def mark_failed(failed, frame, signal):
    """Mark the channels ``failed`` in this row; return those that have become so, as bits."""
    became = failed & ~np.int64(signal["failed"])
    for c in range(CHANNELS):
        if (became >> c) & 1 and signal["failed_at"][c] == NEVER:
            signal["failed_at"][c] = frame
    signal["failed"] = failed
    return became


@kernel
def in_use(signal, before, channels):
    """Return how many of the fitted ``channels`` were not failed ``before``; both bits."""
    count = 0
    for c in range(signal["fitted"]):
        count += (channels >> c) & 1 & ~(before >> c)
    return count


@kernel
def count_healthy(became, before, level, signal, healthy_frames, false_isolations):
    """Count the healthy channels in use, and those of them that became failed, by the ``level`` of the row before.

    became : channels that were isolated, but by design; before : channels that were out in the row before
    healthy_frames, false_isolations : (5,), in place
    """
    if level < LEVELS:
        healthy = ~np.int64(signal["faulty"])
        healthy_frames[level] += in_use(signal, before, healthy)
        false_isolations[level] += in_use(signal, before, healthy & became)


@kernel
def all_out(frame, signal):
    """Return True if every faulty channel has been out for ``linger`` frames, in use again or not."""
    last, wait = NEVER, False
    for c in range(CHANNELS):
        if (signal["faulty"] >> c) & 1:
            last = max(last, signal["failed_at"][c])
            wait = wait or signal["failed_at"][c] == NEVER
    return not wait and 0 <= last <= frame - signal["linger"]


@kernel
def count_vote(total, frame, off, counts, threshold, after_onset):
    """Add one vote, ``off`` by so much, to ``total``, a VOTE; return True if it is above the threshold, as NaN is.

    counts : whether there is a truth to be off
    """
    if math.isfinite(off):
        total["finite"] += 1
        total["squares"] += off * off
        if off > total["peak"]:
            total["peak"], total["at"] = off, frame
    above = counts and not off <= threshold
    total["above"] += above
    total["above_after"] += above and after_onset
    return above
