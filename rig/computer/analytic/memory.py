"""What a reference keeps of the agreed past: a straight line through it, of growing and then of fading memory.

    x += g off;   drift -= h off / dt     g = 2 (2 n + 1) / ((n + 1)(n + 2)),   h = 6 / ((n + 1)(n + 2))

``off`` is the agreed value less x.  With n the frames seen this is the least-squares line through all of them; n stops
at a bound, and what is older fades.  Source: Brookner, Tracking and Kalman Filtering Made Easy, section 1.2.10.
"""

from __future__ import annotations

from typing import Final

from rig.kernels import kernel

LONG_S: Final = 300.0  # memory of what is learned of the signal itself: a fault is settled long before
ASTRAY_S: Final = 30.0  # off an agreed vote for so long, a memory begins again


@kernel
def level_gain(frames):
    """g, the share of ``off`` that the value takes."""
    return 2.0 * (2.0 * frames + 1.0) / ((frames + 1.0) * (frames + 2.0))


@kernel
def slope_gain(frames):
    """h, the share of ``off`` that the slope takes in a frame."""
    return 6.0 / ((frames + 1.0) * (frames + 2.0))


@kernel
def frames_of(seconds, rate_hz):
    """``seconds`` in frames, at least one."""
    return max(1, int(seconds * rate_hz + 0.5))
