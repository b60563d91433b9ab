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
_MOST: Final = 0.2  # of the samples; one that stays longer is no end of a manoeuvre


def leave_out_range_ends(group: Group, x: Floats, rows: int, found: Findings) -> Flags:
    """Return (n,) True where two instances or more are at the end of their range; tell an instance that is alone.

    x : (axes, C, n), corrected; rows : of half a second
    """
    left_out = np.zeros(x.shape[-1], np.bool_)
    for a, signal in enumerate(group.signals):
        hit = np.array([_at_ends(group, samples) for samples in group.own[a]])
        together = widened(hit, rows).sum(axis=0) > 1
        left_out |= together & widened(np.asarray(hit.any(axis=0)), rows)
        for c, instance in enumerate(group.instances):
            alone = hit[c] & ~together
            others = np.median(np.delete(x[a], c, axis=0), axis=0)
            apart = x[a, c] - others
            beyond = alone & (np.abs(apart) > group.settings[signal].threshold)
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


def _at_ends(group: Group, samples: Samples) -> Flags:
    """Return (n,) True on the common rows beside samples that repeat the largest or smallest value of the log."""
    values = samples.values
    hit = np.zeros(len(values), np.bool_)
    good = values[np.isfinite(values)]
    if len(good) < _ROWS:
        return np.zeros(len(group.time_s), np.bool_)
    usual, width = float(np.median(good)), spread(good)
    for end in (float(good.max()), float(good.min())):
        if abs(end - usual) <= max(_BEYOND * width, group.floor):
            continue
        there: Flags = np.abs(values - end) <= 1e-9 * max(abs(end), 1e-9)
        stays = [run for run in runs(there) if run[1] - run[0] < _MOST * len(values)]
        if sum(after - first for first, after in stays) >= _ROWS and any(after - first > 1 for first, after in stays):
            for first, after in stays:
                hit[first:after] = True
    at = np.clip(np.searchsorted(samples.time_s, group.time_s), 0, len(values) - 1)
    return hit[at] | hit[np.maximum(at - 1, 0)]
