"""Common mode: all channels agree, and two references of different physics agree with each other and not with them.

Neither comparison nor majority can see what all channels have in common: one design, one supply, one wrong scale.
Source: docs/redundancy.md, 'Two references against all channels' (Zhang 2023, section 7, has one reference).
"""

from __future__ import annotations

from rig.computer.redundancy.last_channel import REFERENCE_MARGIN
from rig.frame import Pattern, Resolver
from rig.kernels import kernel
from rig.units.angles import difference


@kernel
def contradicted(n, raw, reference, second, p, st):
    """Whether both references speak against a vote on which all channels in use agree.

    n : comparable samples; raw : the vote; reference, second : NaN where there is none
    """
    if n < 2 or n != st["level"] or st["pattern"] != Pattern.NORMAL:
        return False
    wraps, first_threshold, second_threshold = p["wraps"], st["reference_threshold"], p["second_threshold"]
    off, second_off = abs(difference(raw, reference, wraps)), abs(difference(raw, second, wraps))
    apart = abs(difference(reference, second, wraps))
    # A comparison with NaN is false.
    return (
        off > max(REFERENCE_MARGIN * first_threshold, st["threshold"])
        and second_off > max(REFERENCE_MARGIN * second_threshold, st["threshold"])
        and apart <= first_threshold + second_threshold
    )


@kernel
def watch_common(resolver, n, raw, reference, second, p, st):
    """Count the frames of a contradiction and, at ``common_persistence``, report it; returns the resolver.

    By choice every channel in use is failed then: the signal is lost, and its reference, which its own monitor may
    have set aside because the channels outvoted it, is usable.
    """
    st["common_run"] = st["common_run"] + 1 if contradicted(n, raw, reference, second, p, st) else 0
    st["common_mode"] = st["common_run"] >= p["common_persistence"]
    if not st["common_mode"] or p["common_fails"] == 0:
        return resolver
    for c in range(p["fitted"]):
        st["failed"][c] = True
    st["reference_usable"], st["reference_run"] = 1, 0
    return Resolver.COMMON.value
