"""Assumptions for a reply without states, levels or both: all fitted channels are in use.

A unit under test or a manager of the user may return its votes alone.  Other values are taken as they are:
level 0 is a lost signal.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.core.frame import CHANNELS, DecidedBy, Pattern, State
from rig.core.kernels import kernel

_UNSAID: Final = 255  # no state and no level
_NO_VOTE: Final = -np.finfo(np.float64).max  # no sample of any sensor


@kernel
def level_of(states):
    """Return how many channels of ``states`` (4,) are in use."""
    level = 0
    for c in range(CHANNELS):
        level += states[c] == State.OK or states[c] == State.SUSPECT
    return level


@kernel
def state_of(c, level, fitted):
    """Return the state of channel c, of ``fitted``, where only the level of its signal is known."""
    if c >= fitted:
        return State.ABSENT.value
    return State.FAILED.value if level == 0 else State.OK.value


@kernel
def begin_answer(fcc, k, signals):
    """Mark votes, levels and states of row k of the first ``signals`` as not written; all else of them is blank."""
    row = fcc[k]
    for s in range(signals):
        row["voted"][s], row["level"][s] = _NO_VOTE, _UNSAID
        row["pattern"][s], row["decided_by"][s] = Pattern.NORMAL, DecidedBy.NONE
        row["reference_usable"][s] = row["common_mode"][s] = 0
        row["trend_high"][s] = row["trend_low"][s] = 0
        for c in range(CHANNELS):
            row["state"][s, c] = _UNSAID


@kernel
def complete_answer(fcc, k, fitted):
    """Write what is assumed where row k still has the marks of ``begin_answer``; return how many votes were written.

    A signal of which nothing was written has no vote, no state and level 0.  fitted : (n,) channels of signals
    """
    row, votes = fcc[k], 0
    for s in range(len(fitted)):
        states, level, written = row["state"][s], row["level"][s], 0
        for c in range(CHANNELS):
            written += states[c] != _UNSAID
        voted = row["voted"][s] != _NO_VOTE
        votes += voted
        silent = not voted and level == _UNSAID and written == 0
        for c in range(CHANNELS):
            if states[c] == _UNSAID:
                states[c] = state_of(c, level if written == 0 else _UNSAID, 0 if silent else fitted[s])
        if level == _UNSAID:
            row["level"][s] = level_of(states)
        if not voted:
            row["voted"][s] = np.nan
    return votes
