"""What the monitor made of each fault that was injected.

    right   the faulty channel was failed, and no healthy one of the signal from the onset to this row
    wrong   a healthy channel of the signal was failed before it, or with it
    missed  neither, to the end of the recording
    prior   before the onset a channel of the signal had been failed without a fault, or this one by an earlier fault
    none    the fault never began (a random trigger that did not fire)

A channel counts as healthy until the first row in which any injected fault acts on it.  Delay is from the onset to the
row in which the channel was failed: of the faulty one if right, of the first healthy one if wrong.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import floor
from typing import Any, Final

from rig.assess.words import PRIOR, PUBLIC, fault_word
from rig.bench.vote import Result, Voted, VotedDiscrete
from rig.recordings.align import Corrections
from rig.recordings.injection_file import Injected
from rig.recordings.recording import Recording

OUTCOMES: Final = ("right", "wrong", "missed", PRIOR, "none")


@dataclass(frozen=True, slots=True)
class Scored:
    """One channel under a fault, and whom the monitor failed."""

    fault: str
    kind: str
    signal: str
    channel: int
    onset_s: float | None  # in the recording as voted: of an aligned channel, with its delay taken off
    outcome: str  # one of OUTCOMES
    failed_channel: int | None  # that the outcome is about, of right and wrong
    failed_at_s: float | None
    delay_s: float | None
    by: str | None  # comparison, or a resolver


def score(
    injected: Sequence[Injected], recording: Recording, voted: Result, corrections: Corrections | None = None
) -> list[Scored]:
    """Return the outcome of each fault on each of its channels; ``recording`` as voted upon, perhaps aligned."""
    onsets = [_onset_s(fault, recording, corrections) for fault in injected]
    return [_score(i, injected, onsets, {**voted.signals, **voted.discretes}) for i in range(len(injected))]


def summary(scored: Sequence[Scored], file: str, seed: int) -> dict[str, Any]:
    """Return the same for ``--json``: the file, the seed, how many of each outcome, each fault."""
    counts = Counter(row.outcome for row in scored)
    outcomes = {outcome: counts[outcome] for outcome in OUTCOMES}
    return {"file": file, "seed": seed, "outcomes": outcomes, "faults": [asdict(row) for row in scored]}


def _onset_s(fault: Injected, recording: Recording, corrections: Corrections | None) -> float | None:
    """Return when a fault reaches the rows voted upon: a delay d that was taken off shows row r in row r - d."""
    if fault.first is None:
        return None
    by_channel = (corrections or {}).get(fault.signal)
    delay = by_channel[fault.channel - 1].delay_frames if by_channel else 0.0
    row = floor(fault.first - delay) - recording.first_row
    return float(recording.time_s[min(max(row, 0), len(recording.time_s) - 1)])


def _score(
    i: int, injected: Sequence[Injected], onsets: Sequence[float | None], voted: dict[str, Voted | VotedDiscrete]
) -> Scored:
    fault, onset = injected[i], onsets[i]
    injection = (fault.label, fault.kind, fault.signal, fault.channel, onset)
    begun = _begun(fault.signal, injected, onsets)
    failures = voted[fault.signal].failures if onset is not None else []
    false = [failure for failure in failures if failure.time_s < begun.get(failure.channel, float("inf"))]
    own = [failure for failure in failures if failure.channel == fault.channel and failure not in false]
    if onset is None or any(f.time_s < onset for f in (*false, *own)):
        word = PUBLIC["injection"]["not executed"] if onset is None else PRIOR
        return Scored(*injection, word, None, None, None, None)
    healthy_failed = bool(false) and not (own and own[0].time_s < false[0].time_s)
    word = fault_word(True, bool(own), exceeded=True, healthy_failed=healthy_failed)
    decisive = false[0] if healthy_failed else own[0] if own else None
    if decisive is None:
        return Scored(*injection, PUBLIC["injection"][word], None, None, None, None)
    failed = (decisive.channel, decisive.time_s, decisive.time_s - onset, decisive.why)
    return Scored(*injection, PUBLIC["injection"][word], *failed)


def _begun(signal: str, injected: Sequence[Injected], onsets: Sequence[float | None]) -> dict[int, float]:
    """Return when the first fault of each channel of a signal begins."""
    begun: dict[int, float] = {}
    for fault, onset in zip(injected, onsets, strict=True):
        if fault.signal == signal and onset is not None:
            begun[fault.channel] = min(onset, begun.get(fault.channel, onset))
    return begun
