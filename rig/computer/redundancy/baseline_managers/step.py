"""The part of a frame that all baseline managers share: ranks and middle, one failure a signal, latches, the last
channel, the records.

The middle is the median of those in use; of an even number the usable reference, held between the two in the middle,
else their mean (slow_faults.middle).  A sample that cannot be compared, or is stale, counts as with our manager; so do
the last channel, the reference's own monitor, two references against all channels, and resets.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from rig.computer.redundancy.baseline_managers.learned_bias import BIAS_STATE, are_calm, learn, take_off
from rig.computer.redundancy.compare import classify, rank, threshold
from rig.computer.redundancy.manager import anchor, beside, publish, report
from rig.computer.redundancy.persistence import latch, readmit, watch_failed
from rig.computer.redundancy.reference_monitor import check_last, monitor_reference, reference_threshold, watch_common
from rig.computer.redundancy.slow_faults import count_repeats, middle
from rig.core.frame import CHANNELS, DecidedBy
from rig.core.kernels import kernel

NO_CHANNEL: Final = -1
BASELINE_STATE: Final = (
    ("statistic", "f8", (CHANNELS,)),  # of this frame, in the unit of the level that fails a channel
    ("run", "i8"),  # frames in a row above the limit, of the same channel
    ("run_of", "i8"),
    ("alarm", "u1"),  # a channel is, or would be, failed in this frame
    ("held", "u1"),  # an even split keeps the last vote
    *BIAS_STATE,
)
LARGEST: Final = 1e6  # of a residual in its unit: sums of squares stay finite
_ALIKE: Final = 0.5  # of the largest statistic: who leans as far takes part in an even split


class At(NamedTuple):
    """A signal in a frame."""

    n: Any  # samples that are compared
    middle: Any
    center: Any  # the middle of what is compared: of the samples less what is learned of their biases
    reference: Any  # NaN where there is none
    usable: Any  # whether it may be relied on


@kernel
def begin(bus, fcc, s, p, st):
    """Rank the samples of signal s of a row, and find their middle; no channel is suspect yet.

    There is no reference in the first frame: that in a log's first row is made from the first votes.
    """
    samples, valid = bus["channels"][s], bus["valid"][s]
    readmit(bus["reset"][s], p, st)
    base = anchor(samples, valid, p, st)
    reference = beside(fcc["reference"][s], base, p) if st["started"] else np.nan
    count_repeats(samples, valid, reference, reference, p, st)
    n = rank(samples, valid, base, p, st)
    st["threshold"], st["reference_threshold"] = threshold(n, p), reference_threshold(reference, p)
    pattern = classify(st["x"], st["order"], n, st["threshold"], st["miscomparing"])
    st["pattern_frames"] = st["pattern_frames"] + 1 if pattern == st["pattern"] else 1
    st["pattern"], st["held"], st["alarm"] = pattern, False, False
    st["miscomparing"][:] = False
    usable = st["reference_usable"] != 0 and not np.isnan(reference)
    asked = reference if usable else np.nan
    of_samples = middle(st["x"], st["order"], n, asked) if n > 0 else st["vote"]
    return At(n, of_samples, take_off(n, asked, p, st), reference, usable)


@kernel
def residual(c, at, unit, st):
    """Return how far channel c, less its bias, is from the middle in units, within bounds; 0 where it is no number."""
    r = (st["y"][c] - at.center) / unit
    return min(max(r, -LARGEST), LARGEST) if r == r else 0.0


@kernel
def limit_of(n, p):
    """Return the limit while ``n`` samples are compared."""
    return p["limit"][min(max(CHANNELS - n, 0), 2)]


@kernel
def largest_above(n, p, st):
    """Return the channel with the largest statistic above the limit, or ``NO_CHANNEL``."""
    worst, largest = NO_CHANNEL, limit_of(n, p)
    for i in range(n):
        c = st["order"][i]
        if st["statistic"][c] > largest:
            worst, largest = c, st["statistic"][c]
    return worst


@kernel
def slow_faults(worst, p, st):
    """Return ``worst`` if it has been that for the persistence, or at once if nothing is bounded, or ``NO_CHANNEL``."""
    st["run"] = st["run"] + 1 if worst == st["run_of"] and worst != NO_CHANNEL else int(worst != NO_CHANNEL)
    st["run_of"] = worst
    if p["bounded"] and st["run"] < p["persistence"]:
        return NO_CHANNEL
    return worst


@kernel
def isolate(at, worst, p, st):
    """Fail ``worst``, unless it is ``NO_CHANNEL``, or one of an even split that nothing settles."""
    if worst == NO_CHANNEL or at.n < 2:
        return
    st["alarm"] = True
    if p["watches"]:
        return
    if p["holds_ties"] and not at.usable and even_split(at, st["statistic"][worst], st):
        st["held"] = True
        return
    st["failed"][worst] = True


@kernel
def even_split(at, largest, st):
    """Return True if the upper and the lower half of the samples are apart, each sample with a statistic as large.

    largest : the largest statistic; half of it is as large
    """
    order, half = st["order"], at.n // 2
    for i in range(at.n):
        if st["statistic"][order[i]] < _ALIKE * largest:
            return False
    return at.n % 2 == 0 and st["x"][order[half - 1]] < st["x"][order[half]]


@kernel
def end(bus, fcc, s, at, worst, voted, p, st):
    """Learn biases, isolate channel ``worst``, vote and report signal s of a row; return True if its level has changed.

    Then it forgets what all baseline managers keep of a signal: another number of channels has another middle.
    """
    # No bias is learned while a statistic is above half of the limit.
    learn(at.n, at.center, p["bias_bound"] <= 0.0 or are_calm(at.n, limit_of(at.n, p), st), p, st)
    isolate(at, worst, p, st)
    samples, valid, reference, decided_by = bus["channels"][s], bus["valid"][s], at.reference, DecidedBy.NONE.value
    second = beside(fcc["second_reference"][s], at.middle, p) if st["started"] else np.nan
    if at.n == 0:
        voted = st["vote"]
    elif at.n == 1:
        decided_by, voted = check_last(bus["ilm"][s], reference, p, st)
    elif st["held"]:
        decided_by, voted = DecidedBy.UNRESOLVED.value, (st["vote"] if st["started"] else voted)
    monitor_reference(reference, at.n, p, st)
    decided_by = watch_common(decided_by, at.n, voted, reference, second, p, st)
    watch_failed(samples, samples, valid, voted, p, st)
    count(at.n, p, st)
    level = st["level"]
    latch(False, p, st)
    publish(voted, p, st)
    fcc["decided_by"][s], fcc["common_mode"][s] = decided_by, st["common_mode"]
    fcc["reference_usable"][s] = st["reference_usable"] if np.isfinite(fcc["reference"][s]) else 0
    report(fcc, s, p, st)
    if level == st["level"]:
        return False
    st["run"], st["run_of"] = 0, NO_CHANNEL
    st["statistic"][:] = 0.0
    return True


@kernel
def count(n, p, st):
    """Count the frames in a row in which each channel in use had no sample to compare, or one that miscompares."""
    ranked = 0
    for i in range(n):
        ranked |= 1 << st["order"][i]
    for c in range(p["fitted"]):
        if not st["failed"][c]:
            off = (ranked >> c) & 1 == 0 or st["miscomparing"][c]
            st["count"][c] = st["count"][c] + 1 if off else 0
