"""The diagnosis of one quantity: its steps in order, and the verdict of each of its signals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from rig.bench.diagnose.departures import Compared, find_departures
from rig.bench.diagnose.findings import Convention, Fault, Findings, InFlight, Instance, SignalDiagnosis, Verdict
from rig.bench.diagnose.frozen import LASTS_S, frozen, stopped
from rig.bench.diagnose.in_flight import fly
from rig.bench.diagnose.lateness import take_off_delays
from rig.bench.diagnose.mounted_axes import take_off_axes
from rig.bench.diagnose.range_ends import leave_out_range_ends
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.diagnose.smoothing import runs, smoothed, widened
from rig.bench.diagnose.unit_factors import take_off_units
from rig.bench.diagnose.usual_levels import Levels, take_off_offsets
from rig.log.recordings.delays import bridged
from rig.log.recordings.stamps import Floats

MEANS_S: Final = 0.5
LEAST_ROWS: Final = 20
LEAST_S: Final = 3.0
SLOW_HZ: Final = 5.0  # below it vibration and short faults are not detected
_LEAST_SHARE: Final = 0.2  # of the rows, before an instance freezes; with fewer it is left out instead
_FASTER: Final = {  # PX4-Autopilot, src/modules/logger/params.c
    "px4": "; PX4 logs gyros, accelerometers and barometers faster with bit 6 (sensor comparison) of SDLOG_PROFILE"
}


class Shown(NamedTuple):
    """The data that a page draws of one quantity.

    x : (axes, C, n) as joined, converted, at time_s (n,); voted (axes, n) in flight; both SI, ``scale`` SI of one unit
    apart : (axes, c, m) differences of means from their middle, in thresholds, of the channels ``compared``, from 1
    """

    time_s: Floats
    x: Floats
    scale: float
    voted: list[Floats] | None = None
    compared_s: Floats | None = None
    compared: tuple[int, ...] = ()
    apart: Floats | None = None


@dataclass(frozen=True, slots=True)
class QuantityDiagnosis:
    """The verdicts of the signals of one quantity."""

    name: str
    instances: tuple[Instance, ...]
    rate_hz: float
    rows: int
    first_s: float
    last_s: float
    signals: dict[str, SignalDiagnosis]
    conventions: tuple[Convention, ...] = ()
    remarks: tuple[str, ...] = ()
    shown: Shown | None = None


def diagnose_group(
    group: Group, threshold_of: str, zero_s: float | None = None, flown: bool = True
) -> QuantityDiagnosis:
    """Return the diagnosis of one quantity.

    zero_s : time from which seconds are counted; the first common row if None
    flown : False skips the vote of the rows as joined
    """
    zero_s = float(group.time_s[0]) if zero_s is None else zero_s
    if reason := _too_short(group):
        return _unknown(group, zero_s, reason)
    found = Findings(faults=[*frozen(group), *stopped(group)], remarks=list(group.remarks))
    kept, channels = _comparable(group, found)
    x, part, lost = _without_gaps(group, kept, channels, found)
    rows = max(1, round(MEANS_S * group.rate_hz))
    compared, levels, apart = dict[str, Compared](), None, None
    corrected, of_rows = group.x, list[Convention]()
    if len(channels) > 1 and x.shape[-1] >= LEAST_ROWS:
        before = len(found.conventions)
        take_off_units(part, x, rows, found)
        left_deg = take_off_axes(part, x, found) if len(x) == 3 else 0.0
        of_rows = [one for one in found.conventions[before:] if one.matrix is not None]
        corrected = _converted(group, of_rows)
        timed = take_off_delays(part, x, found)
        left_out = leave_out_range_ends(part, x, rows, found) | lost
        levels = take_off_offsets(part, x, rows, left_deg, timed, found)
        compared = find_departures(part, x, levels, rows, left_out, found)
        apart = _apart(x, levels, rows)
    elif len(channels) < 2:
        found.remarks.append("one channel is left: nothing to compare")
    firsts = _first_faults(found.faults)
    flights, voted = dict[str, InFlight](), None
    if flown and group.votes is not None:
        turned = {one.instance.channel - 1 for one in of_rows}
        flights, voted = fly(group, group.votes, corrected, turned, threshold_of, firsts, zero_s)
    _tell_rate(group, found, threshold_of)
    signals = {
        name: _verdict(group, a, firsts.get(name), compared.get(name), levels, flights.get(name), zero_s)
        for a, name in enumerate(group.signals)
    }
    numbers = tuple(instance.channel for instance in part.instances)
    shown = Shown(group.time_s, corrected, group.first.scale, voted, part.time_s, numbers, apart)
    return _made(group, signals, found, shown)


def _apart(x: Floats, levels: Levels, rows: int) -> Floats:
    """Return (axes, C, n) the differences of the means from their middle, in thresholds."""
    means = smoothed(x, rows)
    return (means - np.median(means, axis=1, keepdims=True)) / levels.thresholds[:, None, None]


def _too_short(group: Group) -> str:
    """Return why nothing can be compared; "" if it can."""
    n = len(group.time_s)
    if n < LEAST_ROWS:
        return f"{n} common rows: too few to compare, {LEAST_ROWS} are needed"
    span_s = float(group.time_s[-1] - group.time_s[0])
    return f"{span_s:.3g} s in common: too short to compare, {LEAST_S:g} s are needed" if span_s < LEAST_S else ""


def _comparable(group: Group, found: Findings) -> tuple[slice, list[int]]:
    """Return the rows before an instance freezes, and the channels to compare, from 0.

    An instance that freezes early, or has next to no samples, is left out instead.
    """
    n = len(group.time_s)
    have = np.isfinite(group.x).all(axis=0).mean(axis=1)
    channels = [c for c in range(len(group.instances)) if have[c] > 0.5]
    end = n
    for fault in found.faults:
        if fault.kind == "frozen" and fault.channel:
            row = int(np.searchsorted(group.time_s, fault.time_s))
            if row >= max(_LEAST_SHARE * n, 2 * LEAST_ROWS):
                end = min(end, row)
            elif fault.channel - 1 in channels:
                channels.remove(fault.channel - 1)
    return slice(0, end), channels


def _without_gaps(group: Group, kept: slice, channels: list[int], found: Findings) -> tuple[Floats, Group, np.ndarray]:
    """Return the samples (axes, C, n) bridged across gaps, their group, and (n,) True in long gaps."""
    x = group.x[:, channels, kept].copy()
    missing = ~np.isfinite(x)
    lost = np.zeros(x.shape[-1], np.bool_)
    if missing.any():
        rows = max(1, round(MEANS_S * group.rate_hz))
        lost = widened(np.asarray(missing.any(axis=(0, 1))), rows)
        for c, k in enumerate(channels):
            _tell_gaps(group, k, np.asarray(missing[:, c].any(axis=0)), found)
        x = np.array([[bridged(column) for column in axis] for axis in x])
        x = np.nan_to_num(x, nan=0.0)
    own = [[axis[c] for c in channels] for axis in group.own]
    instances = tuple(group.instances[c] for c in channels)
    part = Group(group.name, group.settings, instances, group.time_s[kept], x, own)
    return x, part, lost


def _tell_gaps(group: Group, c: int, missing: np.ndarray, found: Findings) -> None:
    long = [(a, b) for a, b in runs(missing) if group.time_s[min(b, len(missing) - 1)] - group.time_s[a] >= LASTS_S]
    if long:
        first_s = float(group.time_s[long[0][0]] - group.time_s[0])
        found.remarks.append(
            f"{group.instances[c].who} has no usable samples in {len(long)} gap{'s' * (len(long) > 1)} of more than "
            f"{LASTS_S:g} s, the first {first_s:.2f} s after the first row"
        )


def _converted(group: Group, conventions: list[Convention]) -> Floats:
    """Return the samples as joined, with units and axes as in the comparison."""
    x = group.x.copy()
    for convention in conventions:
        if convention.matrix is not None:
            c = convention.instance.channel - 1
            x[:, c] = np.einsum("ab,bn->an", np.asarray(convention.matrix), x[:, c])
    return x


def _first_faults(faults: list[Fault]) -> dict[str, Fault]:
    """Return the fault of each signal that began first; one of a named channel before one of two."""
    firsts: dict[str, Fault] = {}
    for fault in sorted(faults, key=lambda f: (f.kind == "no samples", not f.channel, f.time_s)):
        firsts.setdefault(fault.signal, fault)
    return firsts


def _tell_rate(group: Group, found: Findings, threshold_of: str) -> None:
    if group.rate_hz < SLOW_HZ:
        faster = next((how for system, how in _FASTER.items() if threshold_of.endswith(system)), "")
        found.remarks.append(
            f"{group.rate_hz:.2g} rows a second: faults shorter than {3.0 / group.rate_hz:.1f} s, and vibration, "
            f"are not detected{faster}"
        )


def _verdict(
    group: Group,
    a: int,
    fault: Fault | None,
    compared: Compared | None,
    levels: Levels | None,
    flight: InFlight | None,
    zero_s: float,
) -> SignalDiagnosis:
    own = list(group.settings.values())[a]

    def shown(value: float) -> float:
        return float(f"{own.shown(value):.6g}")

    threshold = None if levels is None else shown(float(levels.thresholds[a]))
    smallest = None if levels is None else shown(float(levels.smallest[a]))
    common = {"threshold": threshold, "smallest_told": smallest, "in_flight": flight}
    if fault is None:
        verdict: Verdict = "unknown" if compared is None else "none"
        largest = None if compared is None else shown(compared.largest)
        ratio = None if compared is None else round(compared.in_thresholds, 3)
        return SignalDiagnosis(group.name, verdict, own.unit or "", difference=largest, in_thresholds=ratio, **common)
    named = group.instances[fault.channel - 1] if fault.channel else None
    verdict = "channel" if named else "one_of" if fault.channel is None else "unknown"
    ratio = None if levels is None else round(abs(fault.difference) / float(levels.thresholds[a]), 3)
    return SignalDiagnosis(
        group.name,
        verdict,
        own.unit or "",
        channel=named.channel if named else None,
        instance=named.name if named else None,
        device=(named.device or None) if named else None,
        kind=fault.kind,
        since_s=round(fault.time_s - zero_s, 6),
        time_s=fault.time_s,
        difference=shown(fault.difference),
        in_thresholds=ratio,
        text=fault.text,
        **common,
    )


def _unknown(group: Group, zero_s: float, reason: str) -> QuantityDiagnosis:
    signals = {
        name: SignalDiagnosis(group.name, "unknown", own.unit or "", remarks=(reason,))
        for name, own in group.settings.items()
    }
    return _made(group, signals, Findings(remarks=[*group.remarks, reason]), None)


def _made(group: Group, signals: dict[str, SignalDiagnosis], found: Findings, shown: Shown | None) -> QuantityDiagnosis:
    return QuantityDiagnosis(
        group.name,
        group.instances,
        group.rate_hz,
        len(group.time_s),
        float(group.time_s[0]),
        float(group.time_s[-1]),
        signals,
        tuple(found.conventions),
        tuple(dict.fromkeys(found.remarks)),
        shown,
    )
