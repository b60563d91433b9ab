"""How each signal stood: its level at the end, time lost and unresolved, hours of healthy channels by level.

Healthy channels count while they are in use and nothing disturbs the signal: no channel in use differs from its clean
one, nor has within the linger before.  What is failed in such a frame was failed for nothing, unless a rule
answered a fault elsewhere: with its box, or for references that a fault had changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.monitored import Monitored, lingers
from rig.assess.record import FaultScore, SignalScore
from rig.frame import CHANNELS, INDEX, SIGNALS, Block, Resolver, State
from rig.kernels import kernel

LEVELS: Final = CHANNELS + 1
STANDING: Final = np.dtype(
    [
        ("lost", "i8"),  # frames at level 0
        ("unresolved", "i8"),
        ("disturbed", "i8"),  # last frame in which a channel in use was wrong; before that far below 0
        ("healthy", "i8", (LEVELS,)),  # frames of healthy channels, by the level of the frame before
        ("failed", "i8", (LEVELS,)),  # of them failed
        ("faulty", "u1", (CHANNELS,)),  # once wrong, never healthy again
    ],
    align=True,
)
_NEVER: Final = -(2**62)


def signal_scores(
    rows: Block, signals: Monitored, faults: Sequence[FaultScore], params: NDArray[np.void], rate_hz: float
) -> dict[str, SignalScore]:
    """Of every signal; faults : of the flight; params : (S,) config.PARAMS."""
    found = np.zeros(len(SIGNALS), STANDING)
    found["disturbed"] = _NEVER
    touched = np.zeros(len(SIGNALS), bool)  # nothing else can make a channel wrong
    touched[[INDEX[fault.signal] for fault in faults if fault.signal in INDEX]] = True
    touched[[failure.signal for failure in signals.failures.all]] = True
    failed = signals.failures.not_by_design()
    stand(rows, signals.error, signals.acted, failed, lingers(params), params["fitted"], touched, found)
    hours = found["healthy"][:, :0:-1] / (rate_hz * 3600.0)
    columns = (
        rows["level"][-1],
        found["lost"] / rate_hz,
        found["unresolved"] / rate_hz,
        hours,
        found["failed"][:, :0:-1],
    )
    scores = (
        SignalScore(level, lost_s, unresolved_s, tuple(healthy), tuple(failed))
        for level, lost_s, unresolved_s, healthy, failed in zip(*(column.tolist() for column in columns), strict=True)
    )
    return dict(zip(INDEX, scores, strict=True))


@kernel
def stand(rows, error, acted, failed, linger, fitted, touched, found):
    """Add up ``rows`` (n,) FLAT; error, acted : (n, S, 4), see Monitored; found : (S,) STANDING, in place.

    failed : (n, S, 4) whether each channel was failed in the frame, but by design
    touched : (S,) whether any channel was ever wrong or failed; all the others have nothing to look for
    """
    for k in range(len(rows)):
        row, last = rows[k], rows[max(k - 1, 0)]
        now, before, resolver = row["level"], last["level"], row["resolver"]
        for s in range(len(found)):
            one = found[s]
            level = before[s] if k > 0 else fitted[s]
            one["lost"] += now[s] == 0
            one["unresolved"] += resolver[s] == Resolver.UNRESOLVED
            if touched[s]:
                failures = failed[k, s], last["state"][s]
                undisturbed(k, failures, error[k, s], acted[k, s], level, linger[s], fitted[s], one)
            elif level < LEVELS:
                one["healthy"][level] += fitted[s]


@kernel
def undisturbed(k, failures, error, acted, level, linger, fitted, one):
    """One signal in row k: who is faulty, and what that leaves of the healthy channels in use.

    failures : (4,) whether each channel was failed in this frame, but by design, and (4,) states of the last
    level : of the last; one : STANDING, in place
    """
    failed, before = failures
    for c in range(fitted):
        if acted[c] or error[c] != 0.0:  # NaN is not 0
            one["faulty"][c] = 1
            if k == 0 or before[c] != State.FAILED:
                one["disturbed"] = k
    if k - one["disturbed"] <= linger or level >= LEVELS:
        return
    for c in range(fitted):
        if one["faulty"][c] == 0 and (k == 0 or before[c] != State.FAILED):
            one["healthy"][level] += 1
            one["failed"][level] += failed[c]
