"""The short way through a frame, of a signal all of whose channels agree: the same bits as the long one, sooner.

In such a frame no channel is suspect, counted or faded, and all fitted channels are ranked.
"""

from __future__ import annotations

from rig.computer.redundancy.compare import threshold
from rig.core.frame import CHANNELS, Pattern
from rig.core.kernels import kernel


@kernel
def is_quiet(n, p, st):
    """Return True if all channels of the signal agree, and nothing of earlier frames is pending.

    Then no channel is suspect, counted or faded, which is nearly every frame of a flight.
    """
    if n < 2 or n != p["fitted"] or n != st["level"] or st["pattern"] != Pattern.NORMAL or not st["started"]:
        return False
    if p["filter_gain"] > 0.0 or st["split_run"] != 0 or st["freeze"] != 0 or st["fade_left"] != 0:
        return False
    x, order, within = st["x"], st["order"], threshold(n, p)
    for i in range(n - 1):
        if not x[order[i + 1]] - x[order[i]] <= within:  # True for NaN, of an angle near the largest number
            return False
    pending = False
    for c in range(CHANNELS):
        pending |= st["count"][c] != 0 or st["miscomparing"][c] != 0 or st["blamed"][c] != 0
    return not pending
