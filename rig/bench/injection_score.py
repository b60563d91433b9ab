"""Outcome of each injected fault, by the kernel that scores a flight (verdict/row_kernel.py).

    correct isolated: the manager isolated the faulty channel
    wrong   wrong channel: the manager isolated a healthy channel, up to the next onset on the signal
    missed  neither
    prior   before the onset a healthy channel of the signal was isolated, or the faulty channel was out already
    none    not executed: the fault never began (a random trigger that did not fire)

A recording has no truth: its samples before the injection take its place, and the votes are not scored.
The delay is from the onset to the row of the isolation: of the faulty channel if correct, of a healthy one if wrong.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import ceil
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.channels import usable_samples
from rig.bench.inject import Injection
from rig.bench.rows_of_recording import blocks, put
from rig.bench.vote_rows import Result, discrete_params, params_of, put_votes
from rig.core.frame import Block, D, Ilm, S, State, Table, rows
from rig.core.units.angles import differences
from rig.log.recordings.align import Corrections
from rig.log.recordings.injection_file import Injected
from rig.log.recordings.recording import Recording
from rig.verdict.flight_tally import Outcome
from rig.verdict.monitored_places import Monitored, fault_records
from rig.verdict.scoring import rule_name
from rig.verdict.words import INJECTED, PRIOR, PUBLIC, Cause
from rig.world.faults.fault_records import clean_of

_PUBLIC: Final = PUBLIC["injection"]
OUTCOMES: Final = (*(_PUBLIC[word] for word in INJECTED), PRIOR, _PUBLIC["not executed"])
_BITS: Final = (0.0, 1.0)  # range of a discrete
_UNEXPECTED: Final = (Cause.FALSE_ALARM, Cause.WRONG_ISOLATION)


@dataclass(frozen=True, slots=True)
class Scored:
    """One channel with a fault, and the channel that the monitor isolated."""

    fault: str
    kind: str
    signal: str
    channel: int
    onset_s: float | None  # in the recording as voted: of an aligned channel, with its delay taken off
    outcome: str  # one of OUTCOMES
    failed_channel: int | None  # that the outcome is about, of correct and wrong
    failed_at_s: float | None
    delay_s: float | None
    by: str | None  # comparison, or a rule


def score(
    injection: Injection,
    recording: Recording,
    voted: Result,
    corrections: Corrections | None = None,
) -> list[Scored]:
    """Return the outcome of each fault on each of its channels; ``recording`` as voted upon, perhaps aligned."""
    outcome = added_up(injection, recording, voted, corrections or {})
    pairs = zip(injection.injected, outcome.records.faults, strict=True)
    return [_scored(fault, record, outcome, recording, corrections or {}) for fault, record in pairs]


def summary(scored: Sequence[Scored], file: str, seed: int) -> dict[str, Any]:
    """Return the outcomes for ``--json``: the file, the seed, the count of each outcome, each fault."""
    counts = Counter(row.outcome for row in scored)
    outcomes = {outcome: counts[outcome] for outcome in OUTCOMES}
    return {"file": file, "seed": seed, "outcomes": outcomes, "faults": [asdict(row) for row in scored]}


def _scored(
    fault: Injected, record: np.void, outcome: Outcome, recording: Recording, corrections: Corrections
) -> Scored:
    injection = (fault.label, fault.kind, fault.signal, fault.channel)
    if fault.first is None:
        return Scored(*injection, None, _PUBLIC["not executed"], None, None, None, None)
    last = len(recording.time_s) - 1
    row = min(max(fault.first - _later(fault.signal, fault.channel, recording, corrections), 0), last)
    onset_s, failures = float(recording.time_s[row]), outcome.failures
    here = failures[(failures["signal"] == record["signal"]) & (failures["discrete"] == record["discrete"])]
    word = outcome.word(record)
    if not record["executed"] or np.isin(here["cause"][here["frame"] < row], _UNEXPECTED).any():
        return Scored(*injection, onset_s, PRIOR, None, None, None, None)
    failed = None
    if word == "wrong channel":
        failed = outcome.wrong_isolations(record)[0]
    elif word == "isolated":
        failed = here[(here["frame"] == record["failed_at"]) & (here["channel"] == record["channel"])][0]
    if failed is None:
        return Scored(*injection, onset_s, _PUBLIC[word], None, None, None, None)
    at_s, by = float(recording.time_s[failed["frame"]]), rule_name(failed["decided_by"])
    return Scored(*injection, onset_s, _PUBLIC[word], int(failed["channel"]) + 1, at_s, at_s - onset_s, by)


def _later(name: str, channel: int, recording: Recording, corrections: Corrections) -> int:
    """Return the shift in rows between a channel as recorded and as voted: a removed delay d moves row r to r - d."""
    delay = corrections[name][channel - 1].delay_frames if name in corrections else 0.0
    return recording.first_row + ceil(delay)


def added_up(injection: Injection, recording: Recording, voted: Result, corrections: Corrections) -> Outcome:
    """Return the outcomes of all voted rows."""
    signals = {name: of.settings for name, of in voted.signals.items()}
    params = params_of(recording, signals, voted.rules)
    discretes = discrete_params(recording, {name: of.settings for name, of in voted.discretes.items()})
    monitored = Monitored.of(params, discretes, voted.rules.box_signals)
    outcome = Outcome(monitored, fault_records(injection.faults, monitored, injection.places))
    for block, clean in _rows(injection, recording, voted, corrections):
        outcome.add(Table(block, clean=clean))
    return outcome


def _rows(
    injection: Injection, recording: Recording, voted: Result, corrections: Corrections
) -> Iterator[tuple[Block, NDArray[Any]]]:
    """Yield the rows as voted and the samples before the faults; no truth, and discretes relative to before."""
    n = len(recording.time_s)
    later = [_later(fault.signal, fault.channel, recording, corrections) for fault in injection.injected]
    acting = _acting(injection, n, later)
    errors = [
        _shifted(_error(injection, fault, voted), n, k) for fault, k in zip(injection.injected, later, strict=True)
    ]
    usable = {name: usable_samples(recording.signals[name], of.settings.limits) for name, of in voted.signals.items()}
    kind = rows(max(len(voted.signals), S), max(len(voted.discretes), D))  # the flight's, where there is room
    for part, block in blocks(kind, n):
        block["truth"], block["discrete_truth"], block["acting"] = np.nan, 0, acting[part]
        block["state"] = block["discrete_state"] = State.ABSENT
        block["discrete_channels"], block["discrete_valid"] = 0, 1
        for i, (name, of) in enumerate(voted.signals.items()):
            put(block, i, recording.signals[name], part, second=False)
            put_votes(block, i, of, part)
            for c, good in enumerate(usable[name]):
                block["valid"][:, i, c] = good[part]
        for d, of in enumerate(voted.discretes.values()):
            for c, column in enumerate(of.state):
                block["discrete_state"][:, d, c] = column[part]
        clean = np.zeros(len(block), clean_of(kind.signals))
        clean["channels"], clean["valid"] = block["channels"], block["valid"]
        for fault, error in zip(injection.injected, errors, strict=True):
            _take_off(block, clean, injection, fault, error[part])
        yield block, clean


def _acting(injection: Injection, n: int, later: Sequence[int]) -> NDArray[np.uint8]:
    """Return (n, bytes) the active faults of the voted rows: each from its first channel on."""
    acting = np.zeros((n, injection.acting.shape[1]), np.uint8)
    earliest: dict[int, int] = {}
    for fault, rows_later in zip(injection.injected, later, strict=True):
        earliest[fault.fault] = max(rows_later, earliest.get(fault.fault, rows_later))
    for i, rows_later in earliest.items():
        acting[:, i >> 3] |= _shifted(injection.acting[:, i >> 3], n, rows_later) & np.uint8(1 << (i & 7))
    return acting


def _take_off(block: Block, clean: Any, injection: Injection, fault: Injected, error: NDArray[np.float64]) -> None:
    """Write the value of a channel before its fault; for a discrete, True if it has changed."""
    i, c, lost = injection.places.number(fault.signal), fault.channel - 1, np.isnan(error)
    if injection.places.site(fault.signal) == "discrete":
        block["discrete_channels"][:, i, c], block["discrete_valid"][:, i, c] = error == 1.0, ~lost
        return
    before = block["channels"][:, i, c] - error
    clean["channels"][:, i, c], clean["valid"][:, i, c] = np.where(lost, 0.0, before), block["valid"][:, i, c] | lost


def _shifted(values: NDArray[Any], n: int, later: int) -> NDArray[Any]:
    """Return (n,) the values of the rows ``later``, with the values at the ends beyond them."""
    return values[np.clip(np.arange(n) + later, 0, len(values) - 1)]


def _error(injection: Injection, fault: Injected, voted: Result) -> NDArray[np.float64]:
    """Return (n,) the error of a channel by the injection: the difference, NaN for a usable sample that it removed."""
    name, c, discrete = fault.signal, fault.channel - 1, fault.signal in voted.discretes
    before, after = ((of.discretes if discrete else of.signals)[name] for of in (injection.before, injection.recording))
    limits = _BITS if discrete else voted.signals[name].settings.limits
    was, now = (usable_samples(samples, limits)[c] for samples in (before, after))
    if discrete and before.ilm is not None and after.ilm is not None:
        now &= (after.ilm[c] != Ilm.BAD) | (before.ilm[c] == Ilm.BAD)
    wraps = not discrete and voted.signals[name].settings.wraps
    error = differences(after.channels[c], before.channels[c], wraps)
    return np.where(was, np.where(now, abs(error) if discrete else error, np.nan), 0.0)
