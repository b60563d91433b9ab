"""Instances at the end of their range: one alone is a fault or a smaller range, several at once are a manoeuvre."""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.bench.diagnose.findings import Fault, Findings
from rig.bench.diagnose.sensor_groups import Group, Samples
from rig.bench.diagnose.smoothing import Flags, runs, spread, widened
from rig.log.recordings.stamps import Floats

_ROWS: Final = 5
_BEYOND: Final = 3.0  # spreads from the usual value
_HEAPED: Final = 4.0  # times as often as the values next to it: an end within large motion
_NEXT: Final = 3  # values next to an end
_PART: Final = 0.2  # of the largest part of an axis that was turned
_SAME_END: Final = 0.06  # of an end that two instances share
_NEAR: Final = 0.6  # of it
_MOST: Final = 0.2  # of the samples; one that stays longer is no end of a manoeuvre


def leave_out_range_ends(group: Group, x: Floats, rows: int, found: Findings) -> Flags:
    """Return (n,) True where two instances or more are at the end of their range; tell an instance that is alone.

    x : (axes, C, n), corrected; rows : of half a second
    """
    left_out = np.zeros(x.shape[-1], np.bool_)
    hits = _hits(group, found)
    for a, signal in enumerate(group.signals):
        hit = hits[a]
        together = widened(hit, rows).sum(axis=0) > 1
        left_out |= together & widened(np.asarray(hit.any(axis=0)), rows)
        for c, instance in enumerate(group.instances):
            alone = hit[c] & ~together
            if not alone.any():
                continue
            others = np.median(np.delete(x[a], c, axis=0), axis=0)
            apart = x[a, c] - others
            shared, near = _shared(x[a], c, alone, rows)
            left_out |= widened(alone & near, rows)
            beyond = alone & ~shared & (np.abs(apart) > group.settings[signal].threshold)
            if beyond.sum() < 2:
                continue
            k = int(np.flatnonzero(beyond)[0])
            largest = apart[beyond][int(np.argmax(np.abs(apart[beyond])))]
            text = f"stays at the end of its range, {group.shown(float(x[a, c, k]))}, the others do not"
            time_s = float(group.time_s[k])
            found.faults.append(Fault(signal, "end of range", instance.channel, time_s, float(largest), text))
    if left_out.any():
        first = float(group.time_s[int(np.flatnonzero(left_out)[0])] - group.time_s[0])
        found.remarks.append(
            f"two or more are at the end of their range at once, first {first:.2f} s after the first row: "
            "not compared there"
        )
    return widened(left_out, rows)


def _hits(group: Group, found: Findings) -> Flags:
    """Return (axes, C, n) True at the ends of ranges; an axis that was turned is at the end if one of its parts is."""
    hits = np.array([[_at_ends(group, samples) for samples in axis] for axis in group.own])
    for convention in found.conventions:
        c = group.instances.index(convention.instance)
        if convention.kind == "delay" and isinstance(convention.value, float):
            hits[:, c] = np.roll(hits[:, c], -round(convention.value * group.rate_hz), axis=-1)
        if convention.matrix is not None:
            matrix = np.abs(np.asarray(convention.matrix))
            parts = matrix > _PART * matrix.max()
            hits[:, c] = [hits[part, c].any(axis=0) for part in parts]
    return hits


def _shared(x: Floats, c: int, alone: Flags, rows: int) -> tuple[Flags, Flags]:
    """Return (n,) True where instance c of x (C, n) is at an end that another has too, and where one is near it then.

    Instances of one range do not reach its end in the same row, as each vibrates by itself.
    """
    shared, near = np.zeros(x.shape[-1], np.bool_), np.zeros(x.shape[-1], np.bool_)
    usual = np.median(x, axis=1, keepdims=True)
    for sign in (1.0, -1.0):
        off = sign * (x - usual)
        here = alone & (off[c] > 0)
        ends = sign * (sign * x).max(axis=1)
        if (np.abs(np.delete(ends, c) - ends[c]) <= _SAME_END * max(abs(ends[c]), float(off[c].max()))).any():
            shared |= here
            reached = np.delete(off, c, axis=0) > _NEAR * off[c].max()
            near |= here & widened(np.asarray(reached.any(axis=0)), rows)
    return shared, near


def _at_ends(group: Group, samples: Samples) -> Flags:
    """Return (n,) True on the common rows beside samples that repeat the largest or smallest value of the log."""
    values = samples.values
    hit = np.zeros(len(values), np.bool_)
    good = values[np.isfinite(values)]
    if len(good) < _ROWS:
        return np.zeros(len(group.time_s), np.bool_)
    usual, width = float(np.median(good)), spread(good)
    for end in (float(good.max()), float(good.min())):
        away = abs(end - usual)
        if away <= group.floor or (away <= _BEYOND * width and not _heaped(good, end)):
            continue
        there: Flags = np.abs(values - end) <= 1e-9 * max(abs(end), 1e-9)
        stays = [run for run in runs(there) if run[1] - run[0] < _MOST * len(values)]
        if sum(after - first for first, after in stays) >= _ROWS and any(after - first > 1 for first, after in stays):
            for first, after in stays:
                hit[first:after] = True
    at = np.clip(np.searchsorted(samples.time_s, group.time_s), 0, len(values) - 1)
    return hit[at] | hit[np.maximum(at - 1, 0)]


def _heaped(good: Floats, end: float) -> bool:
    """Return True if the samples repeat their largest or smallest value more often than the values next to it."""
    depth = np.sort(np.abs(good - end))
    limit = 1e-9 * max(abs(end), 1e-9)
    count = int(np.searchsorted(depth, limit, side="right"))
    _, counts = np.unique(depth[count : count + _NEXT * max(count, 1)], return_counts=True)
    return count >= _ROWS and len(counts) > 0 and count > _HEAPED * float(counts[:_NEXT].max())
