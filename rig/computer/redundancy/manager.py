"""The redundancy manager: cross-channel comparison, median vote, latched isolation.

One pass per signal and frame: rank the samples, name the pattern, vote, count, latch.  Only the channels
and the references of the row are read, never the truth.
Source: Zhang 2023, whose sections are named at each rule; rules beyond it are marked as added.
"""

from __future__ import annotations

import numpy as np

from rig.computer.redundancy import median_vote as vote
from rig.computer.redundancy import reference_monitor, slow_faults
from rig.computer.redundancy.box import accused, begin_counts, fail_boxes
from rig.computer.redundancy.compare import classify, comparable, is_split, rank, threshold
from rig.computer.redundancy.lowpass import begins_at, follow, smooth_channels
from rig.computer.redundancy.opinions import update_trend
from rig.computer.redundancy.persistence import count_miscompares, readmit, settle, watch_failed
from rig.computer.redundancy.resolve import Compared, keep_basis, resolve
from rig.computer.redundancy.slow_tests import forget_tests, is_cut, isolate_slow
from rig.core.frame import CHANNELS, DecidedBy, Pattern, State
from rig.core.kernels import kernel
from rig.core.units.angles import difference, limit


@kernel
def manage(bus, fcc, data):
    """Write voted, state, level, pattern, decided_by, trend bytes, reference_usable and common_mode of a row.

    bus, fcc : the row's BUS and FCC records; data : ManagerData
    """
    params, state = data.params, data.state
    accusing, lanes, against = 0, 0, reference_monitor.disputed(params, state)
    for c in range(CHANNELS):
        lanes |= np.int64(data.lanes[c] != 0) << c
    for s in range(len(params)):
        p, st = params[s], state[s]
        st["lanes"], st["in_dispute"] = lanes, against & p["sources"] != 0
        readmit_afresh(bus["reset"][s], p, st)
        samples, valid, ilm, reference = bus["channels"][s], bus["valid"][s], bus["ilm"][s], fcc["reference"][s]
        fcc["decided_by"][s] = manage_signal(samples, valid, ilm, reference, fcc["second_reference"][s], p, st)
        fcc["trend_high"][s], fcc["trend_low"][s] = st["trend_high"], st["trend_low"]
        fcc["common_mode"][s] = st["common_mode"]
        fcc["reference_usable"][s] = st["reference_usable"] if np.isfinite(reference) else 0
        report(fcc, s, p, st)
        accusing += st["accused"] != 0
    box = data.boxes[0]
    if accusing >= box["least"] > 0:
        fail_boxes(fcc, params, state, box)
    elif box["counting"]:
        begin_counts(box)


@kernel
def readmit_afresh(commanded, p, st):
    """Readmit ``commanded`` channels, bits, that have agreed long enough; what is learned of them is forgotten."""
    if commanded == 0:
        return
    out = 0
    for c in range(p["fitted"]):
        out |= np.int64(st["failed"][c]) << c
    readmit(commanded, p, st)
    for c in range(p["fitted"]):
        if (out >> c) & 1 and not st["failed"][c]:
            forget_tests(st)
            st["after_extremes"] = st["cut_frames"] = 0


@kernel
def manage_signal(samples, valid, ilm, reference, second, p, st):
    """Monitor and vote one signal in one frame; return the rule that decided (Zhang 2023, sections 2 to 8)."""
    x, order = st["x"], st["order"]
    base = anchor(samples, valid, p, st)
    seen = beside(reference, base, p)
    slow_faults.count_repeats(samples, valid, reference, seen, p, st)
    if p["weighted"]:
        keep_before(samples, valid, p, st)
    n = rank(samples, valid, base, p, st)
    reference = seen
    second = beside(second, base, p)
    if is_quiet(n, p, st):
        return vote_quiet(reference, second, n, p, st)
    st["whole"] = all_ranked(n, p, st)
    compared = to_compare(samples, valid, reference, base, n, p, st)
    st["reference_threshold"] = reference_monitor.reference_threshold(reference, p)
    st["threshold"] = threshold(n, p)
    pattern = classify(compared.values, compared.order, n, st["threshold"], st["miscomparing"])
    st["together"] = is_split(pattern) and p["filter_gain"] > 0.0 and come_together(compared.order, n, p, st)
    if pattern != st["pattern"]:
        st["pattern_frames"] = 1
    elif not st["together"]:
        st["pattern_frames"] += 1
    st["pattern"] = pattern
    # Without a sample the ranks are leftovers, and no step reads what comes of them.
    update_trend(st, x[order[n // 2]], x[order[(n - 1) // 2]], n, p)
    decided_by, vote_before_fade = decide(ilm, reference, compared, n, p, st)
    keep_basis(decided_by, st)
    decided_by = reference_monitor.cut_pair(decided_by, n, reference, p, st)
    reference_monitor.monitor_reference(reference, n, p, st)
    decided_by = reference_monitor.watch_common(decided_by, n, vote_before_fade, reference, second, p, st)
    if p["filter_gain"] > 0.0:
        followed = vote_before_fade if np.isfinite(vote_before_fade) else st["vote"]
        if n > 0 or st["started"]:
            st["smooth_vote"] = follow(st["smooth_vote"], followed, base, p)
        watch_failed(st["smooth"], samples, valid, st["smooth_vote"], p, st)
    else:
        watch_failed(samples, samples, valid, vote_before_fade, p, st)
    ranked = 0
    for i in range(n):
        ranked |= 1 << order[i]
        st["agreed"][order[i]] = 0  # of a channel that this frame has failed
    st["accused"] = accused(decided_by, ranked, p, st)
    count_miscompares(n, ranked, vote_before_fade, p, st)
    slow = slow_of(decided_by, reference, n, p, st) if slow_faults.lasts(p) else 0
    decided_by = latch_all(decided_by, slow, p, st)
    publish(vote_before_fade, p, st)
    return decided_by


@kernel
def all_ranked(n, p, st):
    """Return True if all channels in use are among the ``n`` that are compared."""
    in_use = 0
    for c in range(p["fitted"]):
        in_use += not st["failed"][c]
    return n == in_use


@kernel
def to_compare(samples, valid, reference, base, n, p, st):
    """Return what is compared of ``n`` ranked samples, as Compared: behind the low-pass, if on."""
    values, order = st["x"], st["order"]
    if p["filter_gain"] > 0.0:
        start, last = begins_at(n, st), st["smooth_reference"]
        smooth_channels(samples, valid, base, start, n, p, st)
        st["smooth_reference"] = follow(start if np.isnan(last) else last, reference, base, p)
        values, order, reference = st["smooth"], st["smooth_order"], st["smooth_reference"]
    return Compared(values, order, reference)


@kernel
def come_together(order, n, p, st):
    """Return True if a split that the filter still shows has closed: its samples in the middle agree again (added).

    order : (4,) of what is compared.  Such a frame settles nothing: it may be the rest of a burst.
    """
    x, within, wraps = st["x"], st["threshold"], p["wraps"]
    if n == 3:
        one = x[order[1]]
        return abs(difference(x[order[0]], one, wraps)) <= within or abs(difference(x[order[2]], one, wraps)) <= within
    return abs(difference(x[order[n // 2]], x[order[(n - 1) // 2]], wraps)) <= within


@kernel
def latch_all(decided_by, slow, p, st):
    """Latch what has persisted and whom sums and tests fail; return the rule.

    slow : channels that sums or tests of small deviations fail, a bit each
    """
    level = st["level"]
    for c in range(p["fitted"]):
        st["failed"][c] |= (slow >> c) & 1
    decided_by = settle(decided_by, p, st)
    by = st["tests"]["by"]
    if slow != 0 and decided_by != DecidedBy.GIVEN_UP:
        decided_by = by if by != DecidedBy.NONE else DecidedBy.SLOW.value
    if st["level"] != level:
        slow_faults.begin_sums(st)
    return decided_by


@kernel
def slow_of(decided_by, reference, n, p, st):
    """Return the channels that the sums and the tests of small deviations fail, a bit each.

    None where a common mode has failed all channels; what is learned is forgotten when one is readmitted.
    """
    st["tests"]["by"] = DecidedBy.NONE.value
    if decided_by == DecidedBy.COMMON:
        return 0
    summed = slow_faults.NO_CHANNEL
    if p["slow_limit"] > 0.0 and n > 2:
        m = slow_faults.summed_from(n, reference, p, st)
        if not is_cut(m, p):
            summed = slow_faults.watch_sums(m, n, p, st)
    tested = isolate_slow(reference, n, p, st)
    return tested if summed == slow_faults.NO_CHANNEL else tested | 1 << summed


@kernel
def is_quiet(n, p, st):
    """Return True if all fitted channels agree, and nothing of earlier frames is pending; so in nearly every frame.

    Then no channel is suspect, counted or faded.
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


@kernel
def vote_quiet(reference, second, n, p, st):
    """Vote a quiet signal: the rest of ``manage_signal`` without the parts that no channel needs, same bits, sooner."""
    x, order = st["x"], st["order"]
    st["reference_threshold"], st["threshold"] = reference_monitor.reference_threshold(reference, p), threshold(n, p)
    st["pattern_frames"] += 1
    st["whole"] = True
    update_trend(st, x[order[n // 2]], x[order[(n - 1) // 2]], n, p)
    weight = vote.trend_weight(st["rise_high"], st["rise_low"], st["rise_vote"]) if p["weighted"] else 0.5
    voted = vote.median(x, order, n, st["miscomparing"], weight)
    reference_monitor.monitor_reference(reference, n, p, st)
    decided_by = reference_monitor.watch_common(DecidedBy.NONE.value, n, voted, reference, second, p, st)
    st["accused"] = 0
    slow = slow_of(decided_by, reference, n, p, st) if slow_faults.lasts(p) else 0
    if slow != 0 or decided_by != DecidedBy.NONE:
        decided_by = latch_all(decided_by, slow, p, st)
    publish(voted, p, st)
    return decided_by


@kernel
def anchor(samples, valid, p, st):
    """Return the value that an angle is taken near to: the last vote; at first the first comparable sample.

    Unless another sees all of them closer together: where they are around the circle, no two that agree are cut apart.
    """
    if st["started"]:
        return st["vote"]
    base, least = 0.0, np.inf
    for c in range(p["fitted"]):
        if comparable(samples[c], valid[c], p["low"], p["high"]):
            across = seen_across(samples[c], samples, valid, p)
            if least == np.inf or across < least - p["threshold"]:
                base, least = samples[c], across
    return base


@kernel
def seen_across(base, samples, valid, p):
    """Return how far the comparable samples of an angle are apart as seen from ``base``, rad; 0 for other signals."""
    low = high = 0.0
    for c in range(p["fitted"]):
        if p["wraps"] and comparable(samples[c], valid[c], p["low"], p["high"]):
            off = difference(samples[c], base, p["wraps"])
            low, high = min(low, off), max(high, off)
    return high - low


@kernel
def beside(reference, base, p):
    """Return a reference as the sensors could read it; NaN when it is not finite.

    An angle is taken within half a turn of ``base``; anything else is limited to the range: sensors at their stop do
    not contradict what is beyond it.
    """
    if not np.isfinite(reference):
        return np.nan
    if p["wraps"]:
        return base + difference(reference, base, p["wraps"])
    return min(max(reference, p["low"]), p["high"])


@kernel
def keep_before(samples, valid, p, st):
    """Keep the comparable samples of the last frame and of this one, whose changes weigh a mean; NaN for others."""
    before, now = st["before"], st["now"]
    for c in range(p["fitted"]):
        before[c] = now[c]
        there = comparable(samples[c], valid[c], p["low"], p["high"]) and not slow_faults.is_stale(c, st)
        now[c] = samples[c] if there else np.nan


@kernel
def decide(ilm, reference, compared, n, p, st):
    """Return the rule that answered, and this frame's vote before the fade (Zhang 2023, sections 4 to 8).

    Writes ``blamed``: the channels that the answer would fail.  compared : Compared
    """
    x, order, pattern = st["x"], st["order"], st["pattern"]
    st["blamed"][:] = False
    if pattern == Pattern.LOST:
        return DecidedBy.NONE.value, st["vote"]
    if is_split(pattern):
        return resolve(ilm, reference, compared, n, p, st)
    if n == 1:
        return reference_monitor.check_last(ilm, reference, p, st)
    weight = 0.5
    if p["weighted"]:
        weight = vote.trend_weight(st["rise_high"], st["rise_low"], st["rise_vote"])
    return DecidedBy.NONE.value, vote.median(x, order, n, st["miscomparing"], weight)


@kernel
def publish(vote_before_fade, p, st):
    """Store the vote and its faded output; the fade, which is added, starts in the frame after a change of level.

    Until the first frame with a sample there is no vote to hold, and what is stored, 0, is taken for none.
    Differences of samples near the largest number overflow: then the last vote holds, and nothing is faded.
    """
    if not np.isfinite(vote_before_fade):
        vote_before_fade = st["vote"]
    st["rise_vote"] = difference(vote_before_fade, st["vote"], p["wraps"]) if st["started"] else 0.0
    st["vote"] = limit(vote_before_fade, p["low"], p["high"], p["wraps"])
    frames, left = p["fade_frames"], st["fade_left"]
    if left == frames:  # the first vote after the change
        st["fade"] = difference(st["output"], st["vote"], p["wraps"])
    st["output"] = st["vote"]
    if 0 < left <= frames:
        faded = st["vote"] + st["fade"] * left / (frames + 1.0)
        st["output"] = limit(faded, p["low"], p["high"], p["wraps"]) if np.isfinite(faded) else st["vote"]
    st["fade_left"] = max(left - 1, 0)
    st["started"] |= st["pattern"] != Pattern.LOST


@kernel
def report(fcc, s, p, st):
    """Write vote, level, pattern and channel states of signal s of a row.

    Failed; suspect while it miscompares or a rule is against it; otherwise ok.
    """
    fcc["voted"][s], fcc["level"][s], fcc["pattern"][s] = st["output"], st["level"], st["pattern"]
    states = fcc["state"][s]
    for c in range(CHANNELS):
        if c >= p["fitted"]:
            states[c] = State.ABSENT
        elif st["failed"][c]:
            states[c] = State.FAILED
        elif st["miscomparing"][c] or st["blamed"][c] or st["count"][c]:
            states[c] = State.SUSPECT
        else:
            states[c] = State.OK
