"""Votes that a reference must not learn: those of channels that move apart.

The references of static pressure and heading remember the votes of those signals (strapdown.py).  One of two
channels that drifts, or two of four alike, agree with the others until they are a threshold apart, and would be learned
up to there.  Added: docs/explanation/decisions.md, 'References'.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, SIGNALS, State, sig
from rig.core.kernels import kernel
from rig.core.units.angles import difference

LEARNING: Final = (sig.P_S, sig.PSI)  # signals whose own references remember their votes (sources.REMEMBERED)
RECENT_S, USUAL_S = 0.5, 10.0  # of the means of how far the channels are from the vote
_FORGETTING: Final = 1000.0  # times as slow while they are apart
_WRAPS: Final = np.array([1 if signal.wraps else 0 for signal in SIGNALS])
APART: Final = (  # of each of LEARNING, in the state of the references
    ("recent", "f8", (len(LEARNING), CHANNELS)),  # how far each channel is from the vote,
    ("usual", "f8", (len(LEARNING), CHANNELS)),  # and how far it usually is
    ("told_level", "i8", (len(LEARNING),)),  # channels in use of which that is
    ("told_frames", "i8", (len(LEARNING),)),
)


def still_within(thresholds: NDArray[np.float64], noise_std: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (S,) what the half-second means of healthy channels stay within, from each one's usual [unit].

    The noise of one sample; a sixtieth of the threshold for sensors with less, whose biases move by more than that.
    """
    return np.maximum(noise_std, thresholds / 60.0)


@kernel
def stand_still(i, s, bus, fcc, p, st):
    """Let signal s not count as agreed while its channels move apart: a slow fault would be learned (added).

    The distance of each channel to the vote, its mean over ``RECENT_S``, is compared with its own mean of up to
    ``USUAL_S``, which hardly moves on while any is off by more than ``still``.  With fewer channels in use than before
    both continue from the middle of those; with more they start again.  One channel has none to compare with.
    """
    recent, usual = st["recent"][i], st["usual"][i]
    if fcc["level"][s] < st["told_level"][i]:
        from_their_middle(recent, fcc["state"][s], fcc["level"][s])
        from_their_middle(usual, fcc["state"][s], fcc["level"][s])
    elif fcc["level"][s] > st["told_level"][i]:
        st["told_frames"][i] = 0
    st["told_level"][i] = fcc["level"][s]
    if fcc["level"][s] < 2:
        return
    seen, apart = st["told_frames"][i], 0.0
    for c in range(CHANNELS):
        sample = bus["channels"][s, c]
        if fcc["state"][s, c] >= State.FAILED or bus["valid"][s, c] == 0 or not math.isfinite(sample):
            continue
        off = difference(sample, fcc["voted"][s], _WRAPS[s])
        if seen == 0:
            recent[c] = usual[c] = 0.0
        recent[c] += (off - recent[c]) / min(seen + 1.0, p["recent_frames"])
        if seen < p["recent_frames"]:
            usual[c] = recent[c]
        apart = max(apart, abs(recent[c] - usual[c]))
    moved = apart > p["still"][i]
    frames = _FORGETTING * p["usual_frames"] if moved else min(seen + 1.0, p["usual_frames"])
    for c in range(CHANNELS):
        usual[c] += (recent[c] - usual[c]) / frames
    st["told_frames"][i] = seen + 1
    if moved:
        st["agreed"] &= ~(1 << s)


@kernel
def from_their_middle(off, states, level):
    """Take the middle of the channels in use off their distances (4,): two or three are left, and their vote is it."""
    low, high, total = math.inf, -math.inf, 0.0
    for c in range(CHANNELS):
        if states[c] < State.FAILED:
            low, high, total = min(low, off[c]), max(high, off[c]), total + off[c]
    middle = total - low - high if level == 3 else total / level if level == 2 else 0.0
    for c in range(CHANNELS):
        off[c] -= middle
