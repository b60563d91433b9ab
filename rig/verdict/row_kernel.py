"""The one kernel that decides the outcomes of the faults in rows, of a flight or of a recording, in bounded memory.

docs/reference/scores-and-tables.md defines every number.  flight_tally.py, which adds the rows, empties the lists.
"""

from __future__ import annotations

import math

import numpy as np

from rig.computer.redundancy.compare import is_split
from rig.core.frame import CHANNELS, DecidedBy, Ilm, State, UnitStatus, sig
from rig.core.kernels import kernel, long_kernel
from rig.core.units.angles import difference
from rig.verdict.fault_kernels import follow_faults, mark_acting, watch_faults
from rig.verdict.signal_kernels import (
    LEVELS,
    NEVER,
    channel_bits,
    count_healthy,
    count_vote,
    in_use,
    known_level,
    mark_failed,
    mark_wrong,
)
from rig.verdict.tally_records import COMPARISON, EXTREMES, PATTERNS, TIE_BREAKS
from rig.verdict.unfaulted import injected, middle, same
from rig.verdict.words import Cause


@long_kernel
def add_rows(rows, clean, references, first, out):
    """Add ``rows`` (n,) FLAT from ``first`` on; return the first that was not added, n when all were.

    clean : (n,) faults.CLEAN; references : (n, S) without a fault on them, NO_REFERENCES: no fault sits on one
    out : Outcomes
    It stops when a list is full, or at a wrong sample though no fault has acted: ``unexplained``.
    """
    flight, most = out.flight[0], CHANNELS * (len(out.signals) + len(out.discretes))
    for k in range(first, len(rows)):
        if max(flight["failures"], flight["episodes"]) + most > len(out.failures):
            return k
        row = rows[k]
        acting = 0
        for i in range(len(row["acting"])):
            acting |= row["acting"][i]
        frame = flight["frames"]
        if acting != 0 and flight["acted_from"] == NEVER:
            flight["acted_from"] = frame
        if not add_errors(row, clean[k], out):
            return k
        add_discrete_errors(row, out)
        if acting != 0:
            mark_acting(row["acting"], out)
        for s in range(len(out.signals)):
            add_wrong(frame, out.signals[s])
        for d in range(len(out.discretes)):
            add_wrong(frame, out.discretes[d])
        if acting != 0:
            follow_faults(row, clean[k], references[min(k, len(references) - 1)], frame, out)
        for s in range(len(out.signals)):
            add_signal(row, clean[k], s, frame, out)
        for d in range(len(out.discretes)):
            add_discrete(row, d, frame, out)
        if flight["onsets"] != 0:
            watch_faults(row, frame, out)
        add_flight(row, flight)
    return len(rows)


@kernel
def add_errors(row, clean, out):
    """Write the errors of all samples; return False where one was wrong though no fault has acted."""
    flight = out.flight[0]
    corrupted = not same(row["channels"], clean["channels"]) or not same(row["valid"], clean["valid"])
    if not corrupted and flight["corrupted"] == 0:
        return True
    for s in range(len(out.signals)):
        signal = out.signals[s]
        for c in range(signal["fitted"]):
            error = injected(row, clean, s, c, out.params[s]["wraps"]) if corrupted else 0.0
            signal["error"][c] = error
            if error != 0.0 and flight["acted_from"] == NEVER:
                flight["unexplained"] = s * CHANNELS + c
                return False
    flight["corrupted"] = corrupted
    return True


@kernel
def add_discrete_errors(row, out):
    """Write the errors of the discretes, 0 or 1; a sample is lost if it is flagged, or by its in-line monitor."""
    for d in range(len(out.discretes)):
        for c in range(CHANNELS):
            error = 1.0 if row["discrete_channels"][d, c] != row["discrete_truth"][d] else 0.0
            if row["discrete_valid"][d, c] == 0 or row["discrete_ilm"][d, c] == Ilm.BAD:
                error = np.nan
            out.discretes[d]["error"][c] = 0.0 if row["discrete_state"][d, c] == State.ABSENT else error


@kernel
def add_wrong(frame, signal):
    """Take in which channels of a signal are wrong in this row."""
    error = signal["error"]
    if signal["acting"] == 0 and error[0] == 0.0 and error[1] == 0.0 and error[2] == 0.0 and error[3] == 0.0:
        return
    wrong = np.int64(signal["acting"])
    for c in range(CHANNELS):
        if error[c] != 0.0:  # NaN is not 0
            wrong |= 1 << c
            signal["error_at"][c] = frame
    mark_wrong(wrong, frame, signal)


@kernel
def add_signal(row, clean, s, frame, out):
    """Add one signal: isolations and their causes, healthy channels, its voted value, its pattern."""
    signal, p = out.signals[s], out.params[s]
    level, before = known_level(row["level"][s], row["state"][s]), np.int64(signal["failed"])
    became = mark_failed(channel_bits(row["state"][s]), frame, signal)
    excused = add_failures(row, s, became, before, frame, signal, out) if became != 0 else 0
    if frame - signal["disturbed"] > signal["linger"]:
        healthy_frames, false_isolations = signal["healthy_frames"], signal["false_isolations"]
        count_healthy(became & ~excused, before, signal["level"], signal, healthy_frames, false_isolations)
    signal["reported"] |= level < LEVELS
    signal["acted"] |= signal["acting"]
    signal["acting"] = 0
    add_vote(row, clean, s, level, signal, p, out)
    add_pattern(row, s, level, before, signal, frame, out)
    signal["unresolved"] += row["decided_by"][s] == DecidedBy.UNRESOLVED
    signal["lost"] += level == 0
    signal["level"], signal["usable"] = level, row["reference_usable"][s]


@kernel
def add_discrete(row, d, frame, out):
    """Add one discrete: isolations and their causes, and errors of its voted value."""
    signal = out.discretes[d]
    before = np.int64(signal["failed"])
    became = mark_failed(channel_bits(row["discrete_state"][d]), frame, signal)
    for c in range(CHANNELS):
        if (became >> c) & 1:
            add_failure(row, d, c, True, COMPARISON, before, frame, out)
    signal["acting"] = 0
    signal["wrong_votes"] += row["discrete_voted"][d] != row["discrete_truth"][d]


@kernel
def add_failures(row, s, became, before, frame, signal, out):
    """List the channels that ``became`` failed; return those that were by design; before : failed then; all bits."""
    excused = 0
    for c in range(CHANNELS):
        if (became >> c) & 1:
            decided_by = np.int64(row["decided_by"][s])
            comparable = row["valid"][s, c] != 0 and math.isfinite(row["channels"][s, c])
            if not comparable or decided_by == DecidedBy.UNRESOLVED or decided_by >= TIE_BREAKS:
                decided_by = COMPARISON
            cause = add_failure(row, s, c, False, decided_by, before, frame, out)
            excused |= (cause == Cause.WITH_ITS_BOX or cause == Cause.BY_RULE) << c
    return excused


@kernel
def add_failure(row, s, c, discrete, decided_by, before, frame, out):
    """List one channel that was isolated, note it for the faults that caused it, and return its Cause."""
    signal = out.discretes[s] if discrete else out.signals[s]
    cause = cause_of(signal, s, c, decided_by, before, frame, discrete, out)
    flight = out.flight[0]
    failure = out.failures[flight["failures"]]
    flight["failures"] += 1
    failure["frame"], failure["signal"], failure["channel"], failure["discrete"] = frame, s, c, discrete
    failure["decided_by"], failure["cause"] = decided_by, cause
    failure["erring"] = erring_since(signal, frame - signal["linger"])
    for f in range(len(out.faults)):
        fault = out.faults[f]
        here = fault["signal"] == s and fault["channel"] == c and (fault["discrete"] != 0) == discrete
        recent = frame - fault["acted_at"] <= signal["linger"]
        if here and recent and fault["changes"] != 0 and fault["executed"] != 0 and fault["failed_at"] == NEVER:
            fault["failed_at"], fault["decided_by"] = frame, decided_by
            if not discrete:
                fault["sample"] = row["channels"][s, c]
                fault["pattern"] = signal["pattern"] if frame > fault["onset"] else row["pattern"][s]
    return cause


@kernel
def cause_of(signal, s, c, decided_by, before, frame, discrete, out):
    """Return the Cause of the isolation of channel c; a fault within the linger can be it.

    before : channels that were out in the row before, bits
    """
    since = frame - signal["linger"]
    if signal["wrong_at"][c] >= since:
        return Cause.OWN_FAULT.value
    if not discrete and decided_by == DecidedBy.BOX:
        faulty = 0
        for other in range(len(out.signals)):
            mate = out.signals[other]
            faulty += mate["box"] == signal["box"] and mate["wrong_at"][c] >= frame - mate["linger"]
        if faulty >= max(signal["box_needed"], 1):
            return Cause.WITH_ITS_BOX.value
    erring = erring_since(signal, since)
    # The vote was that of healthy channels where most were: then it was the references that were wrong.
    outvoted = 2 * in_use(signal, before, erring) >= in_use(signal, before, ~0)
    if not discrete and decided_by == DecidedBy.COMMON and outvoted:
        return Cause.BY_RULE.value
    return Cause.WRONG_ISOLATION.value if erring != 0 else Cause.FALSE_ALARM.value


@kernel
def erring_since(signal, since):
    """Return the channels whose samples have been wrong in frame ``since`` or later, bits."""
    erring = 0
    for c in range(CHANNELS):
        erring |= (signal["error_at"][c] >= since) << c
    return erring


@kernel
def add_vote(row, clean, s, level, signal, p, out):
    """Add the vote of one signal: how far it is from the truth, and from that of healthy channels."""
    voted, truth, flight = row["voted"][s], row["truth"][s], out.flight[0]
    counts, frame, after_onset = math.isfinite(truth), flight["frames"], flight["acted_from"] != NEVER
    off = abs(difference(voted, truth, p["wraps"]))
    above = count_vote(out.votes[s, 0], frame, off, counts, p["threshold"], after_onset)
    from_clean = abs(difference(voted, middle(clean["channels"][s], truth, p), p["wraps"]))
    count_vote(out.votes[s, 1], frame, from_clean, counts, p["threshold"], after_onset)
    span = out.spans[signal["span"]]
    span["above"] += above
    if level == 0:
        if span["lost"] == 0:
            span["above_lost"] = span["above"]
        span["lost"] += 1
    span["off"] = above
    if math.isfinite(off) and off > span["error_max"]:
        span["error_max"] = off


@kernel
def add_pattern(row, s, level, before, signal, frame, out):
    """Add the pattern of one signal: coverage, and the stretch without a majority that it may be part of."""
    pattern, flight = row["pattern"][s], out.flight[0]
    last, last_level = (signal["pattern"], signal["level"]) if frame > 0 else (pattern, level)
    if last < PATTERNS and pattern < PATTERNS:
        out.patterns[s, last, pattern] += 1
    if last_level < LEVELS and level < LEVELS:
        out.levels[s, last_level, level] += 1
    signal["pattern"] = pattern
    episode = out.going_on[s]
    if episode["first"] != NEVER and pattern != episode["pattern"]:
        out.episodes[flight["episodes"]] = episode
        flight["episodes"] += 1
        episode["first"] = NEVER
    if is_split(pattern):
        if episode["first"] == NEVER:
            episode["signal"], episode["first"], episode["pattern"], episode["tie_break"] = s, frame, pattern, 0
        keep_last(row, s, before, frame, episode)


@kernel
def keep_last(row, s, before, frame, episode):
    """Keep what the tie-break rules of an episode have to go by in its last row."""
    decided_by = row["decided_by"][s]
    episode["last"], episode["decided_by"], episode["failed"] = frame, decided_by, before
    episode["tie_break"] |= 1 << (decided_by if decided_by < TIE_BREAKS else DecidedBy.NONE.value)
    for c in range(CHANNELS):
        episode["channels"][c], episode["valid"][c] = row["channels"][s, c], row["valid"][s, c]
        episode["ilm"][c] = row["ilm"][s, c]
    episode["trend_high"], episode["trend_low"] = row["trend_high"][s], row["trend_low"][s]
    episode["reference"], episode["reference_usable"] = row["reference"][s], row["reference_usable"][s]


@kernel
def add_flight(row, flight):
    """Add the flight itself: its extremes, its end."""
    truth = row["truth"]
    for i in range(len(EXTREMES)):
        value = truth[EXTREMES[i]]
        if math.isfinite(value):
            flight["low"][i], flight["high"][i] = min(flight["low"][i], value), max(flight["high"][i], value)
    flight["load_factor"] = truth[sig.N_Z]
    flight["unit"] |= row["unit"] != UnitStatus.NONE
    flight["end"] = row["end"]
    flight["frames"] += 1
