"""Every channel that was failed: for a fault of its own, for another's, or for nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.record import Isolation
from rig.frame import CHANNELS, Block, Resolver, State

COMPARISON = "comparison"


class Failure(NamedTuple):
    """A channel that became failed; ``signal`` and ``channel`` are columns of the frame."""

    frame: int
    signal: int
    channel: int
    resolver: str
    own: bool  # its sample was wrong or a fault acted on it, now or within the last ``linger`` frames
    any: bool  # that of some channel of the signal was


class Failures:
    """All failures of the channels of some signals of a flight, in order of time.

    names : of the m signals; state, error, acted : (n, m, 4) states, injected errors (NaN for a lost sample), and
    whether a fault that changes samples acted; linger : (m,) frames in which a fault that has ceased can still be the
    cause; by : who failed channel c of signal s in row k
    """

    def __init__(
        self,
        names: Sequence[str],
        state: NDArray[np.uint8],
        error: NDArray[np.float64],
        acted: NDArray[np.bool_],
        linger: NDArray[np.int64],
        by: Callable[[int, int, int], str],
    ) -> None:
        self._names, self._linger = names, linger
        self.all: list[Failure] = []
        for k, s, c in changes(state).tolist():
            since = slice(max(0, k - int(linger[s])), k + 1)
            wrong = (error[since, s] != 0.0).any(axis=0)  # NaN is not 0
            own = bool(wrong[c] or acted[since, s, c].any())
            self.all.append(Failure(k, s, c, by(k, s, c), own, bool(wrong.any())))

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
        return [self._isolation(failure) for failure in self.all if not failure.own and not failure.any]

    @property
    def wrong_isolations(self) -> list[Isolation]:
        """Healthy channels failed while another channel of the signal was faulty."""
        return [self._isolation(failure) for failure in self.all if not failure.own and failure.any]

    def _isolation(self, failure: Failure) -> Isolation:
        return Isolation(self._names[failure.signal], failure.channel + 1, failure.frame, failure.resolver)


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
