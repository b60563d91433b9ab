"""Discrete signals: majority, the fail-safe value when there is none, isolation by persistence.

Source: Zhang 2023, section 4, item 1; redundancy.md, section 3.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rig.frame import CHANNELS, DISCRETES, Block, D, State
from rig.kernels import kernel

STATE: Final = np.dtype([("count", "i8", (CHANNELS,)), ("failed", "u1", (CHANNELS,))], align=True)
_OK, _SUSPECT, _FAILED = int(State.OK), int(State.SUSPECT), int(State.FAILED)


class DiscreteVoter:
    """Votes the discretes of every row."""

    def __init__(self, persistence: int) -> None:
        self.fail_safe = np.array([discrete.fail_safe for discrete in DISCRETES], np.int64)
        self.state = np.zeros(D, STATE)
        self._persistence = persistence

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``vote_discretes`` needs besides the row."""
        return self.fail_safe, self.state, self._persistence

    def step(self, block: Block, k: int) -> None:
        """Write discrete_voted, discrete_state and discrete_level of row k."""
        vote_discretes(block, k, *self.arguments)


@kernel
def vote_discretes(block, k, fail_safe, state, persistence):
    """Majority of the channels in use; a tie, or nobody left, gives the fail-safe value.

    A channel that differs from the vote for ``persistence`` frames in a row is failed, latched.
    block : FRAME records; fail_safe : (D,) 0 or 1; state : (D,) STATE records
    """
    row = block[k]
    for d in range(len(state)):
        samples, st = row["discrete_channels"][d], state[d]
        balance = 0
        for c in range(CHANNELS):
            if not st["failed"][c]:
                balance += 1 if samples[c] else -1
        voted = fail_safe[d]
        if balance != 0:
            voted = 1 if balance > 0 else 0
        row["discrete_voted"][d] = voted
        row["discrete_level"][d] = isolate(samples, voted, st, persistence, row["discrete_state"][d])


@kernel
def isolate(samples, voted, st, persistence, states):
    """Count, latch and report the channels of one discrete; returns how many are left."""
    level = 0
    for c in range(CHANNELS):
        differs = (samples[c] != 0) != (voted != 0)
        st["count"][c] = st["count"][c] + 1 if differs else 0
        if st["count"][c] >= persistence:
            st["failed"][c] = True
        if st["failed"][c]:
            states[c] = _FAILED
            continue
        level += 1
        states[c] = _SUSPECT if differs else _OK
    return level
