"""References: their threshold, their own monitor, the last channel, two of them against all channels.

Source: Zhang 2023, section 7 (a reference is no channel, and is compared to know whether it is usable).
Added: the threshold by airspeed, the last channel, and two references against all channels
(docs/explanation/decisions.md).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.computer.redundancy.compare import is_split
from rig.core.frame import DecidedBy, Ilm, Pattern
from rig.core.kernels import kernel
from rig.core.units.angles import difference
from rig.core.units.constants import DENSITY_PRINTED

# With 1.0 reference thresholds healthy last channels were failed in 11 of 384 flights, with 1.5 in none.
REFERENCE_MARGIN: Final = 1.5


@kernel
def reference_threshold(reference, p):
    """Return how far a sample may be from its reference [unit of the signal] (added); p : a PARAMS record.

    A constant for each signal.  A reference of the dynamic pressure that knows the speed over ground only has a second
    bound, and the less of the two counts: wind is its error, and the same wind is more pascals the faster the aircraft
    flies.  With w the equivalent airspeed of the wind, d(q_bar) = d(rho0 v^2 / 2) = rho0 v w = sqrt(2 rho0 q_bar) w.
    Source: docs/explanation/decisions.md, 'References'.  NaN has the constant.
    """
    if p["reference_airspeed_m_s"] > 0.0 and reference > 0.0:
        of_wind = p["reference_airspeed_m_s"] * math.sqrt(2.0 * DENSITY_PRINTED * reference)
        return min(of_wind, p["reference_threshold"])
    return p["reference_threshold"]


@kernel
def monitor_reference(reference, n, p, st):
    """Set aside a reference that left both voting ranks for ``persistence`` frames until it agreed as long (section 7).

    The paper compares it with max- and min+.  While one of two channels drifts, or two of four alike, their mean moves
    by half of that, and the reference that will be asked is near the good rank.  The pair that extremes have left is
    itself under suspicion, and so are channels that all stand still: no reference is compared with them.
    """
    if n < 2 or is_split(st["pattern"]) or np.isnan(reference) or st["after_extremes"] or st["standing"]:
        return
    off = off_ranks(reference, n, p, st)
    agrees = 1 if off <= st["reference_threshold"] else 0
    st["reference_run"] = st["reference_run"] + 1 if agrees != st["reference_usable"] else 0
    if st["reference_run"] >= p["persistence"]:
        st["reference_usable"], st["reference_run"] = agrees, 0


@kernel
def off_ranks(reference, n, p, st):
    """Return how far a reference is from the nearer of the two voting ranks of ``n`` samples, n >= 1."""
    x, order, wraps = st["x"], st["order"], p["wraps"]
    high, low = x[order[n // 2]], x[order[(n - 1) // 2]]
    return min(abs(difference(high, reference, wraps)), abs(difference(low, reference, wraps)))


@kernel
def cut_pair(decided_by, n, reference, p, st):
    """Fail the two channels that extremes have left, if a usable reference is off both for ``persistence`` frames.

    Section 8, item 1: where all four were wrong, the comparison of the two that are left finds them wrong too.
    Returns the rule.
    """
    if not st["after_extremes"]:
        return decided_by
    agree = n == 2 and st["pattern"] == Pattern.NORMAL and st["reference_usable"] and not np.isnan(reference)
    far = agree and off_ranks(reference, n, p, st) > max(REFERENCE_MARGIN * st["reference_threshold"], st["threshold"])
    st["cut_frames"] = st["cut_frames"] + 1 if far else 0
    if st["cut_frames"] < p["persistence"]:
        return decided_by
    st["failed"][: p["fitted"]] = True
    return DecidedBy.REFERENCE.value


@kernel
def check_last(ilm, reference, p, st):
    """Check the last channel by its own monitor and its reference, as no other channel is left to compare with (added).

    While either is against it the reference votes if it is usable, otherwise the last vote holds.  Returns rule and
    vote.
    """
    c = st["order"][0]
    sample = st["x"][c]
    usable = st["reference_usable"] and not np.isnan(reference)
    off = usable and abs(difference(sample, reference, p["wraps"])) > REFERENCE_MARGIN * st["reference_threshold"]
    if ilm[c] != Ilm.BAD and not off:
        return DecidedBy.NONE.value, sample
    st["miscomparing"][c] = True
    instead = reference if usable else (st["vote"] if st["started"] else sample)
    return (DecidedBy.ILM.value if ilm[c] == Ilm.BAD else DecidedBy.REFERENCE.value), instead


@kernel
def contradicted(n, vote, reference, second, p, st):
    """Return True if both references disagree with a vote on which all channels in use agree (added).

    Two references count as two while what they read is in order: neither starts to disagree if a signal that both may
    know from one source, a rate or a load factor and the inertial unit's of the same, was disputed before.
    n : comparable samples; vote : before the fade; reference, second : NaN where there is none
    """
    if n < 2 or n != st["level"] or st["pattern"] != Pattern.NORMAL or (st["in_dispute"] and st["common_run"] == 0):
        return False
    if st["failed"][st["order"][0]]:  # the frame has cut the pair
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
def watch_common(decided_by, n, vote, reference, second, p, st):
    """Count the frames of a contradiction and, at ``common_persistence``, report it; return the rule (added).

    By choice every channel in use is isolated then: the signal is lost, and its reference, which its own monitor may
    have set aside because the channels outvoted it, is usable.
    """
    watch_second(n, vote, second, p, st)
    st["common_run"] = st["common_run"] + 1 if contradicted(n, vote, reference, second, p, st) else 0
    st["common_mode"] = st["common_run"] >= p["common_persistence"]
    if not st["common_mode"] or p["common_fails"] == 0:
        return decided_by
    st["failed"][: p["fitted"]] = True
    st["reference_usable"], st["reference_run"] = 1, 0
    return DecidedBy.COMMON.value


@kernel
def watch_second(n, vote, second, p, st):
    """Count the frames in a row in which the second reference of a signal that others are told by is off its vote."""
    if p["tells"] == 0:
        return
    far = n >= 2 and abs(difference(vote, second, p["wraps"])) > max(
        REFERENCE_MARGIN * p["second_threshold"], st["threshold"]
    )
    st["second_run"] = st["second_run"] + 1 if far else 0


@kernel
def disputed(params, state):
    """Return a bit for each signal that others are told by, and that one of its references disputes."""
    bits = 0
    for s in range(len(params)):
        p, st = params[s], state[s]
        if p["tells"] != 0 and (st["reference_usable"] == 0 or st["second_run"] >= p["persistence"]):
            bits |= p["tells"]
    return bits
