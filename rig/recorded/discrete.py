"""The flight's voter of discretes over the rows of a recording.

What a recording has and this voter does not yet: samples that are invalid, fewer than four channels.  A channel that
is not fitted is one that failed before the first row; an invalid sample, or one whose in-line monitor says bad, is out
of the vote of its row and counts as off the vote.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import CHANNELS, Ilm, State, new_block
from rig.kernels import kernel
from rig.recorded.config import RecordedDiscrete
from rig.recorded.record import Bytes, Recording, Samples
from rig.recorded.vote import ROWS, Failure
from rig.redundancy.discrete import STATE, vote_discretes

_SUSPECT: Final = int(State.SUSPECT)
_FAILED: Final = int(State.FAILED)


@dataclass(frozen=True, slots=True)
class VotedDiscrete:
    """What the voter said of one discrete; every array (n,), ``state`` one for each channel."""

    settings: RecordedDiscrete
    voted: Bytes  # 0 or 1
    level: Bytes
    state: list[Bytes]
    invalid: list[int]  # samples of each channel that were empty or flagged
    failures: list[Failure]


def vote_all(recording: Recording, settings: dict[str, RecordedDiscrete]) -> dict[str, VotedDiscrete]:
    """Vote the discretes that have settings, whose fail-safe values are known."""
    return {name: _vote(recording, recording.discretes[name], chosen) for name, chosen in settings.items()}


def _vote(recording: Recording, samples: Samples, settings: RecordedDiscrete) -> VotedDiscrete:
    n, fitted = len(recording.time_s), len(samples.channels)
    values, invalid = np.zeros((n, CHANNELS), np.uint8), np.zeros((n, CHANNELS), np.uint8)
    for c, column in enumerate(samples.channels):
        values[:, c], invalid[:, c] = column == 1, np.isnan(column)
        if samples.valid is not None:
            invalid[:, c] |= samples.valid[c] == 0
    unusable = invalid.copy()
    for c, flags in enumerate(samples.ilm or ()):
        unusable[:, c] |= flags == Ilm.BAD
    voted, level, states = _run(values, unusable, fitted, settings)
    state = [states[:, c].copy() for c in range(fitted)]
    counts = [int(count) for count in invalid[:, :fitted].sum(axis=0)]
    return VotedDiscrete(settings, voted, level, state, counts, _failures(recording, state))


def _run(
    values: NDArray[np.uint8], unusable: NDArray[np.uint8], fitted: int, settings: RecordedDiscrete
) -> tuple[Bytes, Bytes, NDArray[np.uint8]]:
    """The vote (n,), the level (n,) and the states (n, CHANNELS)."""
    n = len(values)
    voted, level, states = np.empty(n, np.uint8), np.empty(n, np.uint8), np.empty((n, CHANNELS), np.uint8)
    fail_safe, state = np.array([settings.fail_safe], np.int64), np.zeros(1, STATE)
    state["failed"][0, fitted:] = 1
    block, before = new_block(ROWS), np.empty(CHANNELS, np.int64)
    for start in range(0, n, ROWS):
        part = slice(start, min(start + ROWS, n))
        rows = block[: part.stop - start]
        rows["discrete_channels"][:, 0] = values[part]
        vote_rows(rows, unusable[part], fail_safe, state, settings.persistence, before)
        voted[part], level[part] = rows["discrete_voted"][:, 0], rows["discrete_level"][:, 0]
        states[part] = rows["discrete_state"][:, 0]
    return voted, level, states


@kernel
def vote_rows(rows, unusable, fail_safe, state, persistence, before):
    """All rows through the voter of discretes, each without its unusable samples.

    rows : FRAME records, discrete 0 of which is voted; unusable : (rows, CHANNELS) 0 or 1
    before : (CHANNELS,) room for the counts of the channels that are set aside in a row
    """
    st = state[0]
    for k in range(len(rows)):
        row = rows[k]
        for c in range(CHANNELS):
            before[c] = -1
            if unusable[k, c] and not st["failed"][c]:
                before[c] = st["count"][c]
                st["failed"][c] = 1
        vote_discretes(rows, k, fail_safe, state, persistence)
        for c in range(CHANNELS):
            if before[c] < 0:
                continue
            st["count"][c] = before[c] + 1
            st["failed"][c] = st["count"][c] >= persistence
            if not st["failed"][c]:
                row["discrete_state"][0, c] = _SUSPECT
                row["discrete_level"][0] += 1


def _failures(recording: Recording, states: list[Bytes]) -> list[Failure]:
    """Every change to failed."""
    found: list[Failure] = []
    for c, state in enumerate(states, 1):
        failed = state == _FAILED
        for k in np.flatnonzero(failed & ~np.concatenate([[False], failed[:-1]])):
            found.append(Failure(c, recording.row(int(k)), float(recording.time_s[k]), "comparison"))
    return sorted(found, key=lambda failure: (failure.frame, failure.channel))
