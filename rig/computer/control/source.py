"""Source of each signal: its vote, its reference, or its degraded mode, in this order.

A signal is lost when the redundancy manager has no channel of it left (level 0).  Every change of
source is faded: the jump between the last value and the new one is taken out over ``fade_frames``.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.core.frame import SIGNALS, S, Source, sig
from rig.core.kernels import kernel
from rig.core.units.angles import difference, limit

_LOW: Final = np.array([signal.low for signal in SIGNALS])
_HIGH: Final = np.array([signal.high for signal in SIGNALS])
_WRAPS: Final = np.array([1 if signal.wraps else 0 for signal in SIGNALS])


@kernel
def select(fcc, param, state):
    """Take every signal that is known, and write to ``fcc["source"]`` where from.  Return how many are lost.

    fcc : an FCC record, reads voted, level, reference, reference_usable; writes source
    param, state : one record of PARAM and of STATE; writes measured of what is Source.VOTED or Source.REFERENCE, except
                   body rates by reference: those are estimated, see degraded.estimate
    A value that is not finite is not taken: the last one stays.
    """
    voted, level, sources = fcc["voted"], fcc["level"], fcc["source"]
    reference, usable = fcc["reference"], fcc["reference_usable"]
    lost = 0
    for i in range(S):
        value, source = voted[i], source_of(level[i], usable[i], reference[i])
        if level[i] == 0:
            lost += 1
            value = reference[i]
        sources[i] = source
        if source == Source.VOTED or (source == Source.REFERENCE and i > sig.R):  # after the body rates
            put(i, value, source, param, state)
    return lost


@kernel
def source_of(level, usable, reference):
    """Return where a signal with ``level`` channels comes from."""
    if level != 0:
        return Source.VOTED
    return Source.REFERENCE if usable != 0 and math.isfinite(reference) else Source.DEGRADED


@kernel
def put(i, value, source, param, state):
    """Make ``value`` signal i's measurement, faded when it comes from elsewhere than the last one did."""
    if not math.isfinite(value):
        return
    s, frames, wraps = state[0], param[0]["fade_frames"], _WRAPS[i]
    measured, fade, left = s["measured"], s["fade"], s["fade_left"]
    value = min(max(value, _LOW[i]), _HIGH[i])
    if source != s["source"][i]:
        s["source"][i] = source
        known = math.isfinite(measured[i])
        fade[i] = difference(measured[i], value, wraps) if known else 0.0
        left[i] = frames if known else 0
    if left[i] > 0:
        value = limit(value + fade[i] * left[i] / frames, _LOW[i], _HIGH[i], wraps)
        left[i] -= 1
    measured[i] = value


@kernel
def carry(i, value, source, state):
    """Make ``value`` signal i's measurement without a fade from the last one."""
    if not math.isfinite(value):
        return
    s = state[0]
    s["source"][i], s["fade_left"][i] = source, 0
    s["measured"][i] = limit(value, _LOW[i], _HIGH[i], _WRAPS[i])
