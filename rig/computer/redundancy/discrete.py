"""Discrete signals: majority, the fail-safe value when there is none, isolation by persistence.

Source: Zhang 2023, section 4, item 1 (majority, the fail-safe value without one, who differs from the vote fails).
Added: the persistence before that, what is not comparable.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.persistence import readmit
from rig.core.frame import CHANNELS, Ilm, State
from rig.core.kernels import kernel

STATE: Final = np.dtype(
    [
        ("count", "i8", (CHANNELS,)),  # miscomparing frames in a row
        ("agreed", "i8", (CHANNELS,)),  # frames in a row that a failed channel agreed with the vote
        ("failed", "u1", (CHANNELS,)),
    ],
    align=True,
)


class DiscreteData(NamedTuple):
    """Data of the voter of the discretes besides the row."""

    params: NDArray[Any]  # one discrete_config.DISCRETE_PARAMS record for each discrete
    state: NDArray[Any]  # one STATE record for each, in place


class DiscreteVoter:
    """Votes the discretes of every row; ``state`` is plain data and can be copied.

    params : one discrete_config.DISCRETE_PARAMS record for each discrete
    """

    def __init__(self, params: NDArray[np.void]) -> None:
        self.params = params
        self.state = np.zeros(len(params), STATE)

    @property
    def data(self) -> DiscreteData:
        """Data of ``vote_discretes`` besides the row."""
        return DiscreteData(self.params, self.state)


@kernel
def vote_discretes(bus, fcc, data):
    """Vote and monitor the discretes of a row: write discrete_voted, discrete_state, discrete_level.

    bus, fcc : the row's BUS and FCC records; data : DiscreteData
    """
    params, state, reset = data.params, data.state, bus["discrete_reset"]
    samples, valid, ilm = bus["discrete_channels"], bus["discrete_valid"], bus["discrete_ilm"]
    voted, levels, states = fcc["discrete_voted"], fcc["discrete_level"], fcc["discrete_state"]
    for d in range(len(params)):
        readmit(reset[d], params[d], state[d])
        voted[d] = majority(samples[d], valid[d], ilm[d], params[d], state[d])
        levels[d] = isolate(samples[d], valid[d], ilm[d], voted[d], params[d], state[d], states[d])


@kernel
def majority(samples, valid, ilm, p, st):
    """Return the value of most channels in use that can be compared; a tie, or none, gives the fail-safe value."""
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

    A channel that cannot be compared or differs from ``voted`` for ``persistence`` frames in a row fails.
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
