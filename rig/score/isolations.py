"""Every channel that was failed: for a fault of its own, for another's, or for nothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.frame import CHANNELS, DISCRETES, SIGNALS, Block, Resolver, State
from rig.score.record import Isolation

COMPARISON = "comparison"


class Failure(NamedTuple):
    """A channel that became failed; ``signal`` and ``channel`` are columns of the frame."""

    frame: int
    signal: int
    channel: int
    resolver: str
    own: bool  # its sample was spoiled, now or within the last ``linger`` frames
    any: bool  # that of some channel of the signal was


class Failures:
    """All failures of the continuous signals of a flight.

    linger : (S,) frames in which a fault that has ceased can still be the cause: the longer persistence
    """

    def __init__(
        self, rows: Block, error: NDArray[np.float64], spoiled: NDArray[np.bool_], params: NDArray[np.void]
    ) -> None:
        self._linger = np.maximum(params["persistence"], params["singular_persistence"])
        self.all = [self._judge(rows, error, spoiled, *map(int, at)) for at in changes(rows["state"])]

    def _judge(
        self, rows: Block, error: NDArray[np.float64], spoiled: NDArray[np.bool_], k: int, s: int, c: int
    ) -> Failure:
        since = slice(max(0, k - int(self._linger[s])), k + 1)
        wrong = (error[since, s] != 0.0).any(axis=0)  # NaN is not 0
        own = bool(wrong[c] or spoiled[since, s, c].any())
        return Failure(k, s, c, decided_by(rows, k, s, c), own, bool(wrong.any()))

    def of(self, s: int, c: int, acted: NDArray[np.intp]) -> tuple[int | None, str | None]:
        """The first failure of a channel while a fault acted, or up to ``linger`` frames after; and by whom.

        acted : frames in which the fault acted, rising
        """
        for failure in self.all:
            if (failure.signal, failure.channel) == (s, c):
                last = int(np.searchsorted(acted, failure.frame, "right")) - 1
                if last >= 0 and failure.frame - int(acted[last]) <= self._linger[s]:
                    return failure.frame, failure.resolver
        return None, None

    @property
    def false_alarms(self) -> list[Isolation]:
        """Healthy channels failed while every other channel of the signal was healthy too."""
        return [_isolation(failure) for failure in self.all if not failure.own and not failure.any]

    @property
    def wrong_isolations(self) -> list[Isolation]:
        """Healthy channels failed while another channel of the signal was faulty."""
        return [_isolation(failure) for failure in self.all if not failure.own and failure.any]


def _isolation(failure: Failure) -> Isolation:
    return Isolation(SIGNALS[failure.signal].name, failure.channel + 1, failure.frame, failure.resolver)


def discrete_alarms(rows: Block) -> list[Isolation]:
    """Failed channels of discretes, which no fault can spoil."""
    wrong = rows["discrete_channels"] != rows["discrete_truth"][:, :, None]
    return [
        Isolation(DISCRETES[d].name, int(c) + 1, int(k), COMPARISON)
        for k, d, c in changes(rows["discrete_state"])
        if not wrong[: k + 1, d, c].any()
    ]


def changes(state: NDArray[np.uint8]) -> NDArray[np.intp]:
    """(m, 3) row, signal and channel of every change to failed, in order of time; none before the first row."""
    failed = np.ascontiguousarray(state).reshape(len(state), -1) == State.FAILED
    moved = failed.copy()
    moved[1:] &= ~failed[:-1]
    at = np.flatnonzero(moved.ravel())
    width = failed.shape[1]
    return np.column_stack([at // width, at % width // CHANNELS, at % CHANNELS])


def decided_by(rows: Block, k: int, s: int, c: int) -> str:
    """Who failed a channel that can be compared: the resolver of its frame, if one decided, else the comparison."""
    row = rows[k]
    sample = row["channels"][s, c]
    comparable = row["valid"][s, c] != 0 and np.isfinite(sample)
    resolver = row["resolver"][s]
    if comparable and resolver not in (Resolver.NONE, Resolver.UNRESOLVED):
        return Resolver(resolver).name.lower()
    return COMPARISON
