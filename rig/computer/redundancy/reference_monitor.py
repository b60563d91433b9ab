"""References: their threshold, their own monitor, the last channel, two of them against all channels.

Source: Zhang 2023, section 7 (a reference is no channel, and is compared to know whether it is usable).
Ours: the threshold by airspeed, 'The last channel' and 'Two references against all channels' of docs/redundancy.md.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.computer.redundancy.compare import is_singular
from rig.frame import Ilm, Pattern, Resolver
from rig.kernels import kernel
from rig.units.angles import difference
from rig.units.constants import DENSITY_PRINTED

# With 1.0 reference thresholds healthy last channels were failed in 11 of 384 flights, with 1.5 in none.
REFERENCE_MARGIN: Final = 1.5


@kernel
def reference_threshold(reference, p):
    """Return how far a sample may be from its reference [unit of the signal] (ours); p : a PARAMS record.

    A constant for each signal.  A reference of the dynamic pressure that knows the speed over ground only has a second
    bound, and the less of the two counts: wind is its error, and the same wind is more pascals the faster the aircraft
    flies.  With w the equivalent airspeed of the wind, d(q_bar) = d(rho0 v^2 / 2) = rho0 v w = sqrt(2 rho0 q_bar) w.
    Source: docs/references.md, 'Measured errors'.  NaN has the constant.
    """
    if p["reference_airspeed_m_s"] > 0.0 and reference > 0.0:
        of_wind = p["reference_airspeed_m_s"] * math.sqrt(2.0 * DENSITY_PRINTED * reference)
        return min(of_wind, p["reference_threshold"])
    return p["reference_threshold"]


@kernel
def monitor_reference(vote, reference, n, p, st):
    """Set aside a reference that left a healthy vote for ``persistence`` frames until it agreed as long (section 7)."""
    if n < 2 or is_singular(st["pattern"]) or np.isnan(reference):
        return
    off = abs(difference(vote, reference, p["wraps"]))
    agrees = 1 if off <= st["reference_threshold"] else 0
    st["reference_run"] = st["reference_run"] + 1 if agrees != st["reference_usable"] else 0
    if st["reference_run"] >= p["persistence"]:
        st["reference_usable"], st["reference_run"] = agrees, 0


@kernel
def check_last(ilm, reference, p, st):
    """Check the last channel by its own monitor and its reference, as nobody is left to compare it with (ours).

    While either speaks against it the reference votes if it is usable, else the last vote holds.  Returns resolver and
    vote.
    """
    c = st["order"][0]
    sample = st["x"][c]
    usable = st["reference_usable"] and not np.isnan(reference)
    off = usable and abs(difference(sample, reference, p["wraps"])) > REFERENCE_MARGIN * st["reference_threshold"]
    if ilm[c] != Ilm.BAD and not off:
        return Resolver.NONE.value, sample
    st["miscomparing"][c] = True
    instead = reference if usable else (st["vote"] if st["started"] else sample)
    return (Resolver.ILM.value if ilm[c] == Ilm.BAD else Resolver.REFERENCE.value), instead


@kernel
def contradicted(n, vote, reference, second, p, st):
    """Return True if both references speak against a vote on which all channels in use agree (ours).

    n : comparable samples; vote : before the fade; reference, second : NaN where there is none
    """
    if n < 2 or n != st["level"] or st["pattern"] != Pattern.NORMAL:
        return False
    wraps, first_threshold, second_threshold = p["wraps"], st["reference_threshold"], p["second_threshold"]
    # Neither comparison nor majority can see what all channels have in common: one design, one supply, one wrong scale.
    # A comparison with NaN is false; nearly always the first is, and differences of angles take longest here.
    if not abs(difference(vote, reference, wraps)) > max(REFERENCE_MARGIN * first_threshold, st["threshold"]):
        return False
    if not abs(difference(vote, second, wraps)) > max(REFERENCE_MARGIN * second_threshold, st["threshold"]):
        return False
    return abs(difference(reference, second, wraps)) <= first_threshold + second_threshold


@kernel
def watch_common(resolver, n, vote, reference, second, p, st):
    """Count the frames of a contradiction and, at ``common_persistence``, report it; return the resolver (ours).

    By choice every channel in use is failed then: the signal is lost, and its reference, which its own monitor may
    have set aside because the channels outvoted it, is usable.
    """
    st["common_run"] = st["common_run"] + 1 if contradicted(n, vote, reference, second, p, st) else 0
    st["common_mode"] = st["common_run"] >= p["common_persistence"]
    if not st["common_mode"] or p["common_fails"] == 0:
        return resolver
    for c in range(p["fitted"]):
        st["failed"][c] = True
    st["reference_usable"], st["reference_run"] = 1, 0
    return Resolver.COMMON.value
