"""Discrete signals: majority, the fail-safe value when there is none, isolation by persistence.

Source: Zhang 2023, section 4, item 1; the rule of a frame stands in docs/redundancy.md.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.config import RESETS
from rig.frame import CHANNELS, Block, Ilm, State
from rig.kernels import kernel

STATE: Final = np.dtype(
    [
        ("count", "i8", (CHANNELS,)),  # miscomparing frames in a row
        ("agreed", "i8", (CHANNELS,)),  # frames in a row that a failed channel agreed with the vote
        ("failed", "u1", (CHANNELS,)),
    ],
    align=True,
)
NO_RESETS: Final = np.zeros(0, RESETS)


class DiscreteData(NamedTuple):
    """What the voter of the discretes needs besides the row."""

    params: NDArray[Any]  # one discrete_config.DISCRETE_PARAMS record for each discrete
    state: NDArray[Any]  # one STATE record for each, in place
    resets: NDArray[Any]  # config.RESETS records, whose ``signal`` is the place of a discrete


class DiscreteVoter:
    """Votes the discretes of every row; ``state`` is plain data and can be copied.

    params : one discrete_config.DISCRETE_PARAMS record for each discrete; resets : config.RESETS, whose ``signal``
    is the place of a discrete among them
    """

    def __init__(self, params: NDArray[np.void], resets: NDArray[np.void] = NO_RESETS) -> None:
        self.params = params
        self.resets = resets
        self.state = np.zeros(len(params), STATE)

    @property
    def data(self) -> DiscreteData:
        """What ``vote_discretes`` needs besides the row."""
        return DiscreteData(self.params, self.state, self.resets)

    def step(self, block: Block, k: int) -> None:
        """Write discrete_voted, discrete_state and discrete_level of row k."""
        vote_discretes(block, k, self.data)


@kernel
def vote_discretes(block, k, data):
    """Vote and monitor the discretes of row k: write discrete_voted, discrete_state, discrete_level.

    block : FRAME records, reads discrete_channels, discrete_valid, discrete_ilm
    data : DiscreteData
    """
    row, params, state, resets = block[k], data.params, data.state, data.resets
    samples, valid, ilm = row["discrete_channels"], row["discrete_valid"], row["discrete_ilm"]
    voted, levels, states = row["discrete_voted"], row["discrete_level"], row["discrete_state"]
    for i in range(len(resets)):
        if resets[i]["frame"] == row["frame"]:
            d = resets[i]["signal"]
            readmit(resets[i]["channel"], params[d], state[d])
    for d in range(len(params)):
        voted[d] = majority(samples[d], valid[d], ilm[d], params[d], state[d])
        levels[d] = isolate(samples[d], valid[d], ilm[d], voted[d], params[d], state[d], states[d])


@kernel
def readmit(commanded, p, st):
    """Clear the failures of the commanded channels that have agreed with the vote for ``readmit_frames``."""
    for c in range(p["fitted"]):
        if commanded[c] and st["failed"][c] and st["agreed"][c] >= p["readmit_frames"]:
            st["failed"][c] = st["count"][c] = st["agreed"][c] = 0


@kernel
def majority(samples, valid, ilm, p, st):
    """The value of most channels that are not failed and can be compared; a tie, or none, gives the fail-safe value."""
    balance = 0
    for c in range(p["fitted"]):
        if st["failed"][c] == 0 and valid[c] != 0 and ilm[c] != Ilm.BAD:
            balance += 1 if samples[c] != 0 else -1
    if balance == 0:
        return p["fail_safe"]
    return 1 if balance > 0 else 0


@kernel
def isolate(samples, valid, ilm, voted, p, st, states):
    """Count, latch and report the channels of one discrete; returns how many are left.

    A channel that cannot be compared or differs from ``voted`` for ``persistence`` frames in a row is failed.
    """
    level = 0
    for c in range(CHANNELS):
        if c >= p["fitted"]:
            states[c] = State.ABSENT
            continue
        agrees = valid[c] != 0 and ilm[c] != Ilm.BAD and (samples[c] != 0) == (voted != 0)
        st["agreed"][c] = st["agreed"][c] + 1 if agrees and st["failed"][c] else 0
        st["count"][c] = 0 if agrees else st["count"][c] + 1
        if st["count"][c] >= p["persistence"]:
            st["failed"][c] = 1
        if st["failed"][c]:
            states[c] = State.FAILED
            continue
        level += 1
        states[c] = State.OK if agrees else State.SUSPECT
    return level
