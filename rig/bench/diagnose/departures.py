"""Which channel departs from the others: the manager of the rig on means of half a second.

Three channels or more: "cross-channel" with a persistence of one second and without a tie-break.  Two: the two part,
and one is named only if it alone jumps.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from rig.bench.diagnose.findings import Fault, Findings, Instance
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.diagnose.smoothing import Flags, held, runs, smoothed
from rig.bench.diagnose.usual_levels import Levels
from rig.bench.vote_rows import vote
from rig.core.frame import Pattern
from rig.log.recordings.recording import Bytes, Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedSignal

PERSISTENCE_S: Final = 1.0
_LEAST_ROWS: Final = 3
_VOTED_HZ: Final = 100.0
_VIBRATES: Final = 1.2  # times the vibration, which an accelerometer must part by
_RISES: Final = 2.0  # times its calm level
_FEW_ROWS: Final = 5  # of half a second: with fewer a mean is no mean of vibration
_SWING_S: Final = 4.0
_SWING_ROWS: Final = 16
_SWINGS: Final = 1.7  # times the deviation from the mean of a window
_JUMPS: Final = 2.0  # times its usual largest step, and the other's jump
_STAYS_S: Final = 5.0
_SHARE: Final = 0.3  # of a jump that may be missing from the difference, or be in the other
_LARGEST: Final = 1e12  # of samples, in the signals of this vote


class Compared(NamedTuple):
    """The largest difference that lasted for the persistence, in relation to what counts then."""

    largest: float  # SI
    in_thresholds: float


def find_departures(
    group: Group, x: Floats, levels: Levels, rows: int, left_out: Flags, found: Findings
) -> dict[str, Compared]:
    """Tell which channels of ``x`` (axes, C, n) depart, and return what each signal differs by.

    rows : of half a second; left_out : (n,) True where nothing is compared
    """
    lasts = max(_LEAST_ROWS, round(PERSISTENCE_S * group.rate_hz))
    compared: dict[str, Compared] = {}
    for a, signal in enumerate(group.signals):
        axis = _Axis(group, signal, x[a], smoothed(x[a], rows), float(levels.thresholds[a]), rows, lasts)
        apart = _beyond_motion(axis.means, levels.allowed)
        apart[:, left_out] = 0.0
        compared[signal] = _compared(axis, levels.allowed, left_out)
        fault = _of_two(axis, apart, found) if len(apart) == 2 else _of_several(axis, apart, found)
        if fault is not None:
            found.faults.append(fault)
    return compared


class _Axis(NamedTuple):
    """One signal as it is compared: values and means (C, n)."""

    group: Group
    signal: str
    x: Floats
    means: Floats
    threshold: float
    rows: int
    lasts: int


def _beyond_motion(means: Floats, allowed: Floats) -> Floats:
    """Return (C, n) the distances from the middle without ``allowed`` (n,); of two, half the difference each."""
    middle = np.median(means, axis=0) if len(means) > 2 else means.mean(axis=0)
    share = 1.0 if len(means) > 2 else 0.5
    off = means - middle
    return np.sign(off) * np.maximum(np.abs(off) - share * allowed, 0.0)


def _compared(axis: _Axis, allowed: Floats, left_out: Flags) -> Compared:
    """Return the largest distance of a channel from its nearest, relative to the threshold and what motion allows."""
    means, count = axis.means, len(axis.means)
    best = Compared(0.0, 0.0)
    for c in range(count):
        apart = np.abs(np.delete(means, c, axis=0) - means[c]).min(axis=0)
        relative = np.where(left_out, 0.0, apart / (axis.threshold + allowed))
        lasting = held(relative, axis.lasts)
        k = int(np.argmax(lasting))
        if lasting[k] > best.in_thresholds:
            lowest = apart[max(k - axis.lasts + 1, 0) : k + 1].min()
            best = Compared(float(lowest), float(lasting[k]))
    return best


def _of_several(axis: _Axis, apart: Floats, found: Findings) -> Fault | None:
    """Return the first departure that the manager isolates and vibration does not explain."""
    step = max(1, round(axis.group.rate_hz / _VOTED_HZ))
    time_s = axis.group.time_s[::step]
    persistence = max(_LEAST_ROWS, axis.lasts // step)
    settings = RecordedSignal(
        threshold=axis.threshold,
        persistence=persistence,
        split_persistence=persistence,
        tie_break=["ilm"],
        range=[-_LARGEST, _LARGEST],
    )
    recording = Recording(time_s, {axis.signal: Samples([np.ascontiguousarray(own[::step]) for own in apart])})
    voted = vote(recording, {axis.signal: settings}, [])[axis.signal]
    for failure in voted.failures:
        k = min(int(np.searchsorted(axis.group.time_s, failure.time_s)), apart.shape[1] - 1)
        c = failure.channel - 1
        instance = axis.group.instances[c]
        off = axis.means[c] - np.median(np.delete(axis.means, c, axis=0), axis=0)
        if _vibrates(axis, k, float(off[k]), found) or _swings(axis, k, off, found):
            continue
        time = _onset(off, axis, k)
        text = f"departs from the others by {axis.group.shown(float(off[k]))}"
        unsure = _why_unsure(axis, time, instance, found)
        return Fault(axis.signal, "departs", 0 if unsure else instance.channel, time, float(off[k]), unsure or text)
    return _split(axis, voted.pattern, time_s, persistence, apart, found)


def _why_unsure(axis: _Axis, time_s: float, instance: Instance, found: Findings) -> str:
    """Return why the channel that departs cannot be named; "" if it can."""
    if time_s <= float(axis.group.time_s[0]):
        return f"{instance.who} differs from the first row on, and not later"
    turned = any(c.kind == "mounting" and c.corrected and c.angle and c.instance == instance for c in found.conventions)
    return f"{instance.who} departs after its mounting was estimated" if turned else ""


def _split(axis: _Axis, pattern: Bytes, time_s: Floats, lasts: int, apart: Floats, found: Findings) -> Fault | None:
    """Tell rows without a majority that last."""
    splits = np.isin(pattern, [int(each) for each in Pattern if each.is_split])
    for first, after in runs(splits):
        if after - first >= lasts:
            since = float(time_s[first] - time_s[0])
            k = min(int(np.searchsorted(axis.group.time_s, time_s[first])), apart.shape[1] - 1)
            if not _vibrates(axis, k, float(np.ptp(axis.means[:, k])), found):
                text = f"on {axis.signal} there is no majority from {since:.2f} s on"
                text += f" for {time_s[after - 1] - time_s[first]:.1f} s"
                found.remarks.append(text)
                size = float(np.ptp(axis.means[:, k]))
                return Fault(axis.signal, "departs", 0, float(time_s[first]), size, "the channels disagree")
            return None
    return None


def _onset(off: Floats, axis: _Axis, k: int) -> float:
    """Return the time from which ``off`` (n,) stays above half of its size at row k, or half of the threshold."""
    size = float(off[k])
    below = np.flatnonzero(off[: k + 1] * np.sign(size) <= max(axis.threshold, abs(size)) / 2)
    row = 0 if len(below) == 0 else min(int(below[-1]) + 1, k)
    return float(axis.group.time_s[row])


def _vibrates(axis: _Axis, k: int, size: float, found: Findings) -> bool:
    """Return True if an accelerometer parts while its vibration rises, which shifts its mean."""
    if axis.group.kind != "accel" or axis.rows < _FEW_ROWS:
        return False
    level = np.sqrt(np.maximum(smoothed((axis.x - axis.means) ** 2, 8 * axis.rows), 0.0)).max(axis=0)
    if abs(size) > _VIBRATES * level[k] or level[k] < _RISES * np.quantile(level, 0.25):
        return False
    since = float(axis.group.time_s[k] - axis.group.time_s[0])
    found.remarks.append(
        f"on {axis.signal} the channels diverge by {axis.group.shown(size)} {since:.2f} s after the first row while "
        f"the vibration rises to {axis.group.shown(float(level[k]))}: no sign of a fault"
    )
    return True


def _swings(axis: _Axis, k: int, off: Floats, found: Findings) -> bool:
    """Return True if ``off`` (n,) swings to both sides at row k of a slow log, more than before: vibration is aliased.

    A step has at most half of its size as deviation from the mean of a window, a sine 0.7.
    """
    if axis.rows >= _FEW_ROWS:
        return False
    window = max(_SWING_ROWS, round(_SWING_S * axis.group.rate_hz))
    level = np.sqrt(np.maximum(smoothed((off - smoothed(off, window)) ** 2, window), 0.0))
    if abs(off[k]) > _SWINGS * level[k] or level[k] < _RISES * np.quantile(level, 0.25):
        return False
    since = float(axis.group.time_s[k] - axis.group.time_s[0])
    found.remarks.append(
        f"on {axis.signal} a difference swings by {axis.group.shown(float(level[k]))} {since:.2f} s after the first "
        "row: vibration that the log is too slow to show, no sign of a fault"
    )
    return True


def _of_two(axis: _Axis, apart: Floats, found: Findings) -> Fault | None:
    """Return when two part; the one that alone jumps is named."""
    difference = apart[0] - apart[1]
    bad = np.flatnonzero(held(np.abs(difference), axis.lasts) > axis.threshold)
    real = axis.means[0] - axis.means[1]
    if len(bad) == 0 or _vibrates(axis, int(bad[0]), float(real[bad[0]]), found):
        return None
    k = int(bad[0])
    if _swings(axis, k, real, found):
        return None
    time = _onset(real, axis, k)
    named = _alone_jumps(axis, difference, int(np.searchsorted(axis.group.time_s, time)))
    if time <= float(axis.group.time_s[0]):
        text = "the two differ from the first row on, and not later"
        return Fault(axis.signal, "departs", 0, time, float(real[k]), text)
    size = axis.group.shown(float(abs(real[k])))
    text = f"departs from the other by {size}, and it alone jumps" if named is not None else f"the two differ by {size}"
    signed = float(real[k]) if named in (None, 0) else -float(real[k])
    channel = None if named is None else axis.group.instances[named].channel
    return Fault(axis.signal, "departs", channel, time, signed, text)


def _alone_jumps(axis: _Axis, difference: Floats, k: int) -> int | None:
    """Return the channel, from 0, that jumps at row k, stays there, and makes the whole difference; None: neither."""
    lag = max(1, axis.rows // 2)
    n, stays = len(difference), round(_STAYS_S * axis.group.rate_hz)
    if axis.rows <= 4 or k < 2 * axis.rows or k + stays > n:
        return None
    steps = np.abs(axis.x[:, 2 * lag :] - axis.x[:, : -2 * lag])
    near = slice(max(k - axis.rows - 2 * lag, 0), k + axis.rows + 1)
    jumps = steps[:, near].max(axis=1) / (np.quantile(steps, 0.98, axis=1) + 1e-12)
    c = int(np.argmax(jumps))
    before, after = slice(k - 2 * axis.rows, k - axis.rows // 2), slice(k + axis.rows, k + 3 * axis.rows)
    moved = axis.means[:, after].mean(axis=1) - axis.means[:, before].mean(axis=1)
    change = abs(moved[0] - moved[1])
    alone = (
        abs(moved[1 - c]) < _SHARE * change and (np.abs(difference[k : k + stays]) > axis.threshold / 2).mean() > 0.9
    )
    return c if alone and jumps[c] > _JUMPS * max(1.0, jumps[1 - c]) else None
