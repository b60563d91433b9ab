"""The flight's voter of discretes over the rows of a recording, one discrete after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.bench.vote import ROWS, Failure
from rig.computer.redundancy.discrete import DiscreteVoter, vote_discretes
from rig.computer.redundancy.discrete_config import DISCRETE_PARAMS, PERSISTENCE, fill_discrete
from rig.frame import CHANNELS, Ilm, State, nested, new_block
from rig.kernels import kernel
from rig.recordings.recording import Bytes, Recording, Samples
from rig.recordings.settings import RecordedDiscrete, Reset, commands


@dataclass(frozen=True, slots=True)
class VotedDiscrete:
    """What the voter said of one discrete; every array (n,), ``state`` one for each channel."""

    settings: RecordedDiscrete
    voted: Bytes  # 0 or 1
    level: Bytes
    state: list[Bytes]
    invalid: list[int]  # samples of each channel that were empty or flagged
    failures: list[Failure]


def vote_all(
    recording: Recording, settings: dict[str, RecordedDiscrete], resets: list[Reset]
) -> dict[str, VotedDiscrete]:
    """Vote the discretes that have settings, whose fail-safe values are known."""
    return {
        name: _vote(recording, recording.discretes[name], chosen, commands(resets, name, recording.time_s))
        for name, chosen in settings.items()
    }


def _vote(recording: Recording, samples: Samples, settings: RecordedDiscrete, resets: Bytes) -> VotedDiscrete:
    n, fitted = len(recording.time_s), len(samples.channels)
    voter = DiscreteVoter(_params(settings, fitted, recording.rate_hz))
    voted, level, invalid = np.empty(n, np.uint8), np.empty(n, np.uint8), np.zeros(CHANNELS, np.int64)
    state = [np.empty(n, np.uint8) for _ in samples.channels]
    block = new_block(ROWS)
    block["discrete_ilm"] = Ilm.ABSENT
    for start in range(0, n, ROWS):
        part = slice(start, min(start + ROWS, n))
        rows = block[: part.stop - start]
        _put(rows, samples, part)
        rows["discrete_reset"][:, 0] = resets[part]
        vote_rows(nested(rows), voter.data)
        voted[part], level[part] = rows["discrete_voted"][:, 0], rows["discrete_level"][:, 0]
        invalid += (rows["discrete_valid"][:, 0] == 0).sum(axis=0)
        for c, column in enumerate(state):
            column[part] = rows["discrete_state"][:, 0, c]
    counts = [int(count) for count in invalid[:fitted]]
    return VotedDiscrete(settings, voted, level, state, counts, _failures(recording, state))


def _params(settings: RecordedDiscrete, fitted: int, rate_hz: float) -> NDArray[np.void]:
    assert settings.fail_safe is not None  # VoteConfig.discretes sees to it
    params = np.zeros(1, DISCRETE_PARAMS)
    fill_discrete(params[0], settings, settings.fail_safe, fitted, PERSISTENCE, rate_hz)
    return params


def _put(rows: NDArray[Any], samples: Samples, part: slice) -> None:
    """The samples of ``part`` as discrete 0 of frames; an empty one is invalid."""
    rows["frame"] = np.arange(part.start, part.stop)
    for c, column in enumerate(samples.channels):
        rows["discrete_channels"][:, 0, c], rows["discrete_valid"][:, 0, c] = column[part] == 1, ~np.isnan(column[part])
    for c, flags in enumerate(samples.valid or ()):
        rows["discrete_valid"][:, 0, c] &= flags[part] != 0
    for c, flags in enumerate(samples.ilm or ()):
        rows["discrete_ilm"][:, 0, c] = flags[part]


@kernel
def vote_rows(rows, data):
    """All rows through the voter of discretes; see discrete.vote_discretes."""
    for k in range(len(rows)):
        vote_discretes(rows[k]["bus"], rows[k]["fcc"], data)


def _failures(recording: Recording, states: list[Bytes]) -> list[Failure]:
    """Every change to failed."""
    found: list[Failure] = []
    for c, state in enumerate(states, 1):
        failed = state == State.FAILED
        for k in np.flatnonzero(failed & ~np.concatenate([[False], failed[:-1]])):
            found.append(Failure(c, recording.row(int(k)), float(recording.time_s[k]), "comparison"))
    return sorted(found, key=lambda failure: (failure.frame, failure.channel))
