"""Every channel that was failed: for a fault of its own, by a rule that answers faults elsewhere, or wrongly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.record import BY_DESIGN, Isolation, IsolationKind
from rig.frame import CHANNELS, Block, Resolver, State

COMPARISON, BOX, COMMON = "comparison", Resolver.BOX.name.lower(), Resolver.COMMON.name.lower()
Bools = NDArray[np.bool_]


class Failure(NamedTuple):
    """A channel that became failed; ``signal`` and ``channel`` are columns of the frame."""

    frame: int
    signal: int
    channel: int
    resolver: str
    kind: IsolationKind | None  # None: of its own fault

    @property
    def own(self) -> bool:
        """Whether its sample was wrong or a fault acted on it, now or within the last ``linger`` frames."""
        return self.kind is None


class Rules(NamedTuple):
    """What the rules answer that fail healthy channels for faults elsewhere."""

    box_signals: int = 1  # faulty signals of a channel that make its box a faulty one
    on_references: Bools | None = None  # (n, m) whether a fault acted on a reference of the signal


_NO_RULES: Final = Rules()


class Failures:
    """All failures of the channels of some signals of a flight, in order of time.

    names : of the m signals; state, error, acted : (n, m, 4) states, injected errors (NaN for a lost sample), and
    whether a fault that changes samples acted; linger : (m,) frames in which a fault that has ceased can still be the
    cause; by : who failed channel c of signal s in row k
    rules : see Rules
    """

    def __init__(
        self,
        names: Sequence[str],
        state: NDArray[np.uint8],
        error: NDArray[np.float64],
        acted: NDArray[np.bool_],
        linger: NDArray[np.int64],
        by: Callable[[int, int, int], str],
        rules: Rules = _NO_RULES,
    ) -> None:
        self._names, self._linger, self._rules = names, linger, rules
        self._state, self._error, self._acted = state, error, acted
        self.all: list[Failure] = []
        for k, s, c in changes(state).tolist():
            resolver = by(k, s, c)
            self.all.append(Failure(k, s, c, resolver, self._kind(k, s, c, resolver)))

    def _kind(self, k: int, s: int, c: int, resolver: str) -> IsolationKind | None:
        if self._faulty(k, s)[c]:
            return None
        if resolver == BOX and self._faulty_signals(k, c) >= max(self._rules.box_signals, 1):
            return "failed with its box"
        if resolver == COMMON and self._contradicts_faults(k, s):
            return "failed by rule"
        return "wrong isolation" if (self._error[self._since(k, s), s] != 0.0).any() else "false alarm"

    def _since(self, k: int, s: int) -> slice:
        """The frames whose faults can be the cause of a failure in row k."""
        return slice(max(0, k - int(self._linger[s])), k + 1)

    def _faulty(self, k: int, s: int) -> Bools:
        """(4,) whether the sample of each channel was wrong, or a fault acted on it."""
        since = self._since(k, s)
        return ((self._error[since, s] != 0.0) | self._acted[since, s]).any(axis=0)  # NaN is not 0

    def _faulty_signals(self, k: int, c: int) -> int:
        """On how many signals channel c was faulty."""
        return sum(bool(self._faulty(k, s)[c]) for s in range(len(self._names)))

    def _contradicts_faults(self, k: int, s: int) -> bool:
        """Whether vote and references could contradict each other: a fault on a channel in use, or on a reference."""
        since, on_references = self._since(k, s), self._rules.on_references
        wrong = (self._error[since, s] != 0.0) | self._acted[since, s]
        before = self._state[np.maximum(np.arange(since.start, since.stop) - 1, 0), s]
        in_use = (before != State.FAILED) | (np.arange(since.start, since.stop) == 0)[:, None]
        return bool((wrong & in_use).any() or (on_references is not None and on_references[since, s].any()))

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

    def of_kind(self, kind: IsolationKind) -> list[Isolation]:
        """Return the healthy channels that were failed so, in order of time."""
        return [
            Isolation(self._names[failure.signal], failure.channel + 1, failure.frame, failure.resolver)
            for failure in self.all
            if failure.kind == kind
        ]

    def not_by_design(self) -> Bools:
        """Return (n, m, 4) the frames in which each channel was failed, those of BY_DESIGN left out."""
        out = np.zeros(self._state.shape, bool)
        for failure in self.all:
            out[failure.frame, failure.signal, failure.channel] = failure.kind not in BY_DESIGN
        return out


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
