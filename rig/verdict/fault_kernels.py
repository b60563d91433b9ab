"""Measure each fault on each of its channels: its onset, its error, and its effects."""

from __future__ import annotations

import math

import numpy as np

from rig.computer.redundancy.compare import is_split
from rig.computer.redundancy.reference_monitor import reference_threshold
from rig.core.frame import S, sig
from rig.core.kernels import kernel
from rig.core.units.angles import difference
from rig.verdict.signal_kernels import NEVER, in_use
from rig.verdict.tally_records import COMPARISON


@kernel
def acts(acting, number):
    """Return whether fault ``number`` acts in a row; acting : its bytes."""
    return (acting[number >> 3] >> (number & 7)) & 1


@kernel
def mark_acting(acting, out):
    """Mark the channels that faults act on in this row."""
    for f in range(len(out.faults)):
        fault = out.faults[f]
        if not acts(acting, fault["number"]):
            continue
        if fault["signal"] >= 0 and fault["changes"] != 0:
            signals = out.discretes if fault["discrete"] != 0 else out.signals
            signals[fault["signal"]]["acting"] |= 1 << fault["channel"]
        if fault["columns"] != 0:
            for s in range(len(out.signals)):
                out.signals[s]["acting"] |= fault["columns"]
            for d in range(len(out.discretes)):
                out.discretes[d]["acting"] |= fault["columns"]


@kernel
def follow_faults(row, clean, references, frame, out):
    """Take in every fault that acts in this row: its onset and its error.

    clean : its CLEAN; references : (S,) without a fault on them
    """
    for f in range(len(out.faults)):
        fault = out.faults[f]
        if not acts(row["acting"], fault["number"]):
            continue
        used, error, sample, beyond = 1, 0.0, math.nan, False
        if fault["signal"] >= 0:
            signal = out.discretes[fault["signal"]] if fault["discrete"] != 0 else out.signals[fault["signal"]]
            used = 1 & ~(signal["failed"] >> fault["channel"])
            error = abs(signal["error"][fault["channel"]]) if fault["changes"] != 0 else 0.0
            beyond = not error <= fault["threshold"]
        else:
            sample, error = at_its_place(row, clean, references, fault, out)
            beyond = references_beyond(row, fault, out)
        if fault["onset"] == NEVER or (used and fault["executed"] == 0):
            begin(row, fault, frame, out)
        fault["executed"] |= used
        fault["acted_at"] = frame
        if error == error and not error <= fault["peak"]:
            fault["peak"] = error
        if fault["executed"] != 0 and beyond:
            exceed(fault, frame)
        if fault["signal"] < 0 and fault["failed_at"] == NEVER:
            fault["sample"] = sample
            if lost_reference(row, fault, frame, out):
                fault["failed_at"], fault["decided_by"] = frame, COMPARISON


@kernel
def at_its_place(row, clean, references, fault, out):
    """Return the value that a fault on no channel leaves, and how far it is from that without it; NaN and 0: none."""
    if fault["inertial"] >= 0:
        i = fault["inertial"]
        return row["inertial"][i], abs(row["inertial"][i] - clean["inertial"][i])
    if fault["reference"] >= 0:
        s = fault["reference"]
        return row["reference"][s], abs(difference(row["reference"][s], references[s], out.params[s]["wraps"]))
    if fault["surface"] >= 0:
        i = fault["surface"]
        return row["surface_command"][i], abs(row["surface_command"][i] - row["surface"][i])
    return math.nan, 0.0


@kernel
def references_beyond(row, fault, out):
    """Return whether any reference that a fault can change is beyond its threshold from the truth."""
    for s in range(S):
        if (fault["references"] >> s) & 1:
            p, reference = out.params[s], row["reference"][s]
            if not abs(difference(reference, row["truth"][s], p["wraps"])) <= reference_threshold(reference, p):
                return True
    return False


@kernel
def lost_reference(row, fault, frame, out):
    """Return whether a reference that a fault can change is no more usable from this row on."""
    for s in range(S if frame > 0 else 0):
        if (fault["references"] >> s) & 1 and out.signals[s]["usable"] != 0 and row["reference_usable"][s] == 0:
            return True
    return False


@kernel
def begin(row, fault, frame, out):
    """Set a fault to its onset; one that acts on a channel that is out begins again when the channel is in use."""
    flight = out.flight[0]
    flight["onsets"] = 1
    fault["onset"], fault["peak"] = frame, np.nan
    fault["in_split"] = fault["worst"] = 0
    fault["load_factor"] = flight["load_factor"] if frame > 0 else row["truth"][sig.N_Z]
    fault["load_factor_change"] = np.nan
    s, c = fault["signal"], fault["channel"]
    if s < 0 or fault["discrete"] != 0:
        return
    fault["sample"] = row["channels"][s, c]
    signal = out.signals[s]
    if out.spans[signal["span"]]["begin"] != frame or signal["span"] < len(out.signals):
        n = flight["spans"]
        flight["spans"] += 1
        signal["span"] = n
        span, before = out.spans[n], np.int64(signal["failed"])
        span["signal"], span["begin"] = s, frame
        span["good"] = in_use(signal, before, ~np.int64(signal["acted"]))
        span["latent"] = in_use(signal, before, np.int64(signal["acted"]))
    fault["span"] = signal["span"]


@kernel
def exceed(fault, frame):
    """Count a frame in which the error of a fault was above its threshold."""
    if fault["exceeded_at"] == NEVER:
        fault["exceeded_at"] = frame
    fault["run"] = fault["run"] + 1 if fault["beyond_at"] == frame - 1 else 1
    fault["beyond_at"] = frame
    fault["longest_run"] = max(fault["longest_run"], fault["run"])


@kernel
def watch_faults(row, frame, out):
    """Follow what comes after each onset: the load factor, and the patterns of the signal."""
    load_factor, window = row["truth"][sig.N_Z], out.flight[0]["window"]
    for f in range(len(out.faults)):
        fault = out.faults[f]
        if fault["onset"] == NEVER:
            continue
        change = abs(load_factor - fault["load_factor"])
        if frame - fault["onset"] <= window and change == change and not change <= fault["load_factor_change"]:
            fault["load_factor_change"] = change
        if fault["signal"] >= 0 and fault["discrete"] == 0:
            pattern = row["pattern"][fault["signal"]]
            fault["worst"] = max(fault["worst"], pattern)
            if fault["in_split"] == 0 and is_split(pattern):
                fault["in_split"] = pattern
