"""A bias of each channel, learned while all channels are calm, for every manager that compares residuals.

A constant difference of a channel from the others is no fault while it stays within a bound.  y = x - bias is
compared, with the middle of y and not of x, which jumps by a bias when a channel leaves.
The vote stays that of x.  A bias is the mean of its residuals for as many frames as the time constant has, then it
follows with that time constant; a step counts with at most the bound, and so does the bias.  It stands while a
statistic is above half its limit.

This project's description of what the built-in manager and flight control systems do under the name of equalisation.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.redundancy.compare import sort_again
from rig.computer.redundancy.slow_faults import middle
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

BIAS_STATE: Final = (
    ("learned_bias", "f8", (CHANNELS,)),
    ("learned_frames", "i8", (CHANNELS,)),
    ("y", "f8", (CHANNELS,)),  # ranked samples less the bias
    ("y_order", "i8", (CHANNELS,)),
)
CALM: Final = 0.5  # of a limit


@kernel
def take_off(n, reference, p, st):
    """Write ``y`` of the ``n`` ranked samples; return its ``slow_faults.middle``, the last vote for none."""
    y, order = st["y"], st["y_order"]
    if n == 0:
        return st["vote"]
    for i in range(n):
        c = st["order"][i]
        y[c], order[i] = st["x"][c] - st["learned_bias"][c], c
    if p["bias_bound"] > 0.0:
        sort_again(y, order, n)
    return middle(y, order, n, reference)


@kernel
def learn(n, middle, calm, p, st):
    """Move the biases of the ``n`` ranked channels towards what differs of x from the ``middle`` of y, if ``calm``."""
    bound = p["bias_bound"]
    if bound <= 0.0 or n < 2:
        return
    for i in range(n):
        c = st["order"][i]
        gain, frames, bias = p["bias_gain"], st["learned_frames"][c], st["learned_bias"]
        if not calm and frames > 0:  # a first sample counts: what is not learned at all may never be calm
            continue
        if frames * gain < 1.0:
            gain = max(gain, 1.0 / (frames + 1.0))
        off = st["x"][c] - middle - bias[c]
        if np.isfinite(off):  # clipped: a burst may not be learned
            bias[c] = min(max(bias[c] + gain * min(max(off, -bound), bound), -bound), bound)
        st["learned_frames"][c] = frames + 1


@kernel
def are_calm(n, limit, st):
    """Return True if no statistic of the ``n`` ranked channels is above half of ``limit``."""
    calm = True
    for i in range(n):
        calm &= st["statistic"][st["order"][i]] <= CALM * limit
    return calm
