"""Instances that repeat one value, bit for bit, while others move; and instances that stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rig.bench.diagnose.findings import Fault
from rig.bench.diagnose.sensor_groups import Group, Samples
from rig.bench.diagnose.smoothing import Flags, runs
from rig.log.recordings.stamps import Floats

LASTS_S: Final = 1.0
_REPEATS: Final = 9
_HELD: Final = 4.0  # usual runs of one value: a slow sensor is logged several times
_STEPS: Final = 4.0  # smallest steps of the instance that another must move by
_NEAR_END: Final = 0.5  # of the largest magnitude
_STOPS_STEPS: Final = 5.0


def frozen(group: Group) -> list[Fault]:
    """Return a fault for each signal of each instance that freezes: the whole vector, or single axes."""
    found: list[Fault] = []
    for c, instance in enumerate(group.instances):
        axes = range(len(group.signals))
        together = _onset(group, c, axes) if len(axes) > 1 else None
        for a, signal in enumerate(group.signals):
            onset = together if together is not None else _onset(group, c, [a])
            if onset is not None:
                what = "repeats the same value while others move: frozen"
                found.append(Fault(signal, "frozen", instance.channel, onset, _apart(group, a, c, onset), what))
    return found


def _onset(group: Group, c: int, axes: Sequence[int]) -> float | None:
    """Return the time from which ``axes`` of instance c repeat while another moves; None: they do not."""
    mine = [group.own[a][c] for a in axes]
    n = min(len(samples.values) for samples in mine)
    if n < 2 or any(not np.array_equal(s.time_s[:n], mine[0].time_s[:n]) for s in mine[1:]):
        return None
    time_s = mine[0].time_s[:n]
    same: Flags = np.all([np.diff(samples.values[:n]) == 0 for samples in mine], axis=0)
    found = list(runs(same))
    longest = [run for run in found if run[1] - run[0] >= _REPEATS and time_s[run[1]] - time_s[run[0]] >= LASTS_S]
    if not longest:
        return None
    usual = _usual_run(same)
    for start, end in longest:
        if end - start < _HELD * usual or any(_at_an_end(group, c, a, start, end) for a in axes):
            continue
        if _others_move(group, c, float(time_s[start]), float(time_s[end]), _smallest_step(mine)):
            return float(time_s[start])
    return None


def _usual_run(same: Flags) -> float:
    """Return how many rows a value usually stays: n rows by the number of values."""
    lengths = np.diff(np.concatenate([[-1], np.flatnonzero(~same), [len(same)]]))
    return float(np.median(lengths)) if len(lengths) > 2 else 1.0


def _at_an_end(group: Group, c: int, a: int, start: int, end: int) -> bool:
    """Return True if a run is at the largest magnitude of axis a, and most others are near it: the end of a range."""
    mine = group.own[a][c]
    value, largest = float(mine.values[start]), float(np.nanmax(np.abs(mine.values)))
    if largest == 0.0 or abs(value) < largest * (1 - 1e-9):
        return False
    others = [
        float(np.median(part))
        for j, other in enumerate(group.own[a])
        if j != c and len(part := _within(other, float(mine.time_s[start]), float(mine.time_s[end])))
    ]
    return bool(others) and float(np.median(others)) * np.sign(value) > _NEAR_END * largest


def _within(samples: Samples, start_s: float, end_s: float) -> Floats:
    """Return the samples between two times that are numbers."""
    values = samples.values[(samples.time_s >= start_s) & (samples.time_s <= end_s)]
    return values[np.isfinite(values)]


def _smallest_step(mine: list[Samples]) -> float:
    steps = np.abs(np.concatenate([np.diff(samples.values) for samples in mine]))
    steps = steps[steps > 0]
    return float(steps.min()) if len(steps) else 0.0


def _others_move(group: Group, c: int, start_s: float, end_s: float, step: float) -> bool:
    """Return True if another instance moves by more than the floor while instance c repeats."""
    needed = max(group.floor, _STEPS * step)
    for axis in group.own:
        for j, other in enumerate(axis):
            values = _within(other, start_s, end_s)
            if j != c and len(values) and np.ptp(values) > needed:
                return True
    return False


def _apart(group: Group, a: int, c: int, onset_s: float) -> float:
    """Return the largest distance of a frozen channel from the others' middle, since its onset."""
    since = group.time_s >= onset_s
    others = np.delete(group.x[a], c, axis=0)[:, since]
    if others.shape[1] == 0:
        return 0.0
    distance = group.x[a, c, since] - np.median(others, axis=0)
    distance = distance[np.isfinite(distance)]
    return float(distance[np.argmax(np.abs(distance))]) if len(distance) else 0.0


def stopped(group: Group) -> list[Fault]:
    """Return a fault for each instance whose samples end before those of the others."""
    found: list[Fault] = []
    ends = [_last(group, c) for c in range(len(group.instances))]
    for c, instance in enumerate(group.instances):
        times = group.own[0][c].time_s
        step_s = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
        last = max(end for j, end in enumerate(ends) if j != c)
        if last - ends[c] > max(LASTS_S, _STOPS_STEPS * step_s):
            text = "has no samples from then on, and the others have"
            found += [Fault(signal, "no samples", instance.channel, ends[c], 0.0, text) for signal in group.signals]
    return found


def _last(group: Group, c: int) -> float:
    """Return the time of the last sample of instance c that is a number."""
    ends = []
    for axis in group.own:
        good = np.flatnonzero(np.isfinite(axis[c].values))
        ends.append(float(axis[c].time_s[good[-1]]) if len(good) else float(axis[c].time_s[0]))
    return min(ends)
