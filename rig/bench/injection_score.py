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

from rig.bench.vote import Failure, Result, Voted, VotedDiscrete
from rig.recordings.align import Corrections
from rig.recordings.injection_file import Injected
from rig.recordings.recording import Recording

OUTCOMES: Final = ("right", "wrong", "missed", "prior", "none")


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
    """The outcome of each fault on each of its channels; ``recording`` is the one voted upon, perhaps aligned."""
    onsets = [_onset_s(one, recording, corrections) for one in injected]
    return [_score(i, injected, onsets, {**voted.signals, **voted.discretes}) for i in range(len(injected))]


def summary(scored: Sequence[Scored], file: str, seed: int) -> dict[str, Any]:
    """The same for ``--json``: the file, the seed, how many of each outcome, each fault."""
    counts = Counter(one.outcome for one in scored)
    outcomes = {outcome: counts[outcome] for outcome in OUTCOMES}
    return {"file": file, "seed": seed, "outcomes": outcomes, "faults": [asdict(one) for one in scored]}


def _onset_s(one: Injected, recording: Recording, corrections: Corrections | None) -> float | None:
    """When a fault reaches the rows voted upon: a delay d that was taken off shows row r in row r - d."""
    if one.first is None:
        return None
    found = (corrections or {}).get(one.signal)
    delay = found[one.channel - 1].delay_frames if found else 0.0
    row = floor(one.first - delay) - recording.first_row
    return float(recording.time_s[min(max(row, 0), len(recording.time_s) - 1)])


def _score(
    i: int, injected: Sequence[Injected], onsets: Sequence[float | None], voted: dict[str, Voted | VotedDiscrete]
) -> Scored:
    one, onset = injected[i], onsets[i]
    about = (one.label, one.kind, one.signal, one.channel, onset)
    if onset is None:
        return Scored(*about, "none", None, None, None, None)
    begun = _begun(one.signal, injected, onsets)
    failures = voted[one.signal].failures
    false = [failure for failure in failures if failure.time_s < begun.get(failure.channel, float("inf"))]
    mine = [failure for failure in failures if failure.channel == one.channel and failure not in false]
    if any(f.time_s < onset for f in (*false, *mine)):
        return Scored(*about, "prior", None, None, None, None)
    right, wrong = mine[0] if mine else None, false[0] if false else None
    if right is None and wrong is None:
        return Scored(*about, "missed", None, None, None, None)
    if right is not None and (wrong is None or right.time_s < wrong.time_s):
        return Scored(*about, "right", *_told(right, onset))
    assert wrong is not None  # one of the two is there
    return Scored(*about, "wrong", *_told(wrong, onset))


def _begun(signal: str, injected: Sequence[Injected], onsets: Sequence[float | None]) -> dict[int, float]:
    """When the first fault of each channel of a signal begins."""
    found: dict[int, float] = {}
    for other, at in zip(injected, onsets, strict=True):
        if other.signal == signal and at is not None:
            found[other.channel] = min(at, found.get(other.channel, at))
    return found


def _told(failure: Failure, onset_s: float) -> tuple[int, float, float, str]:
    return failure.channel, failure.time_s, failure.time_s - onset_s, failure.why
