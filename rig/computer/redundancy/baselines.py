"""Managers to compare with: mean, median, cross-voter monitor, selection of one channel.

Same records, same parameters and state, same interface as manager.manage.  Mean and median fail nobody, and
a selection takes back what it distrusted by itself, so resets concern the cross-voter monitor alone.
Sources: Zhang 2023, section 1 (why mean and cross-voter are not good enough); the selector of the PX4
autopilot for several inertial units (integrated deviation from their mean, 7 deg/s and 15 deg).
"""

from __future__ import annotations

from rig.computer.redundancy.compare import rank, threshold
from rig.computer.redundancy.manager import anchor, publish, report
from rig.computer.redundancy.monitor import readmit, watch_failed
from rig.computer.redundancy.persistence import latch
from rig.computer.redundancy.vote import median
from rig.frame import CHANNELS, Pattern
from rig.kernels import kernel


@kernel
def average(bus, fcc, data):
    """A row: the arithmetic mean of all comparable samples of each signal; nobody is ever failed."""
    params, state = data.params, data.state
    for s in range(len(params)):
        p, st = params[s], state[s]
        n = ranked(bus, s, p, st)
        finish(bus, fcc, s, mean_of(st, n), n, p, st)


@kernel
def mean_of(st, n):
    """The mean of the ``n`` ranked samples, within their range even if the sum overflows; the last vote for none."""
    if n == 0:
        return st["vote"]
    x, order, total = st["x"], st["order"], 0.0
    for i in range(n):
        total += x[order[i]]
    return min(max(total / n, x[order[0]]), x[order[n - 1]])


@kernel
def plain_median(bus, fcc, data):
    """A row: the median of all comparable samples of each signal; nobody is ever failed."""
    params, state = data.params, data.state
    for s in range(len(params)):
        p, st = params[s], state[s]
        n = ranked(bus, s, p, st)
        voted = median(st["x"], st["order"], n, st["alone"], 0.5) if n else st["vote"]
        finish(bus, fcc, s, voted, n, p, st)


@kernel
def select(bus, fcc, data):
    """A row: one channel is the vote, the first by number until it is distrusted; then the next that is not.

    excess += max(|x - mean of all| - deviation, -excess) each frame; a channel whose excess is above
    ``deviation_frames`` is distrusted (reported failed) until it has come down again.  A sample that is not
    comparable is distrusted at once.  With two channels left the mean is as far from both: nobody is.
    """
    params, state = data.params, data.state
    for s in range(len(params)):
        p, st = params[s], state[s]
        for c in range(CHANNELS):
            st["failed"][c] = False
        n = ranked(bus, s, p, st)
        center = mean_of(st, n)
        for i in range(n):
            c = st["order"][i]
            off = abs(st["x"][c] - center) - p["deviation"] if n > 2 else 0.0
            st["excess"][c] = max(st["excess"][c] + off, 0.0)
        choose(n, p, st)
        voted = st["x"][st["selected"]]
        finish(bus, fcc, s, voted, n, p, st)


@kernel
def choose(n, p, st):
    """Mark the distrusted channels in ``failed`` and move the selection off them.

    When none is trusted it stays where it is, or, if its channel has no comparable sample, goes to the one with
    the least excess that has; when nobody has, the last sample stands.
    """
    here, best, least = 0, -1, -1
    for i in range(n):
        here |= 1 << st["order"][i]
    for c in range(p["fitted"] - 1, -1, -1):
        speaks = (here >> c) & 1 == 1
        if speaks and (least < 0 or st["excess"][c] <= st["excess"][least]):
            least = c
        if not speaks or st["excess"][c] > p["deviation_frames"]:
            st["failed"][c] = True
        else:
            best = c
    if best >= 0 and st["failed"][st["selected"]]:
        st["selected"] = best
    elif least >= 0 and (here >> st["selected"]) & 1 == 0:
        st["selected"] = least


@kernel
def cross_voter(bus, fcc, data):
    """A row: the median of the channels in use; each is then compared with it instead of with each other."""
    params, state, reset = data.params, data.state, bus["reset"]
    for s in range(len(params)):
        p, st = params[s], state[s]
        readmit(reset[s], p, st)
        n = ranked(bus, s, p, st)
        x, order, alone, count = st["x"], st["order"], st["alone"], st["count"]
        voted = median(x, order, n, alone, 0.5) if n else st["vote"]
        for c in range(p["fitted"]):
            alone[c] = not st["failed"][c]
        for i in range(n):
            alone[order[i]] = not abs(x[order[i]] - voted) <= threshold(n, p)
        for c in range(p["fitted"]):
            count[c] = count[c] + 1 if alone[c] else 0
        finish(bus, fcc, s, voted, n, p, st)


@kernel
def ranked(bus, s, p, st):
    """Rank the samples of signal s into its state; nobody is alone yet.  Returns their number."""
    samples, valid, failed = bus["channels"][s], bus["valid"][s], st["failed"]
    for c in range(CHANNELS):
        st["alone"][c] = False
    base = anchor(samples, valid, p, st)
    return rank(samples, valid, failed, p["fitted"], p["low"], p["high"], p["wraps"], base, st["x"], st["order"])


@kernel
def finish(bus, fcc, s, voted, n, p, st):
    """Latch, publish and report signal s of a row."""
    st["pattern"] = Pattern.NORMAL if n else Pattern.LOST
    watch_failed(bus["channels"][s], bus["valid"][s], voted, p, st)
    latch(p, st)
    publish(voted, p, st)
    fcc["voted"][s] = st["output"]
    fcc["level"][s], fcc["pattern"][s] = st["level"], st["pattern"]
    report(p, st, fcc["state"][s])
