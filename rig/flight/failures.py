"""Isolations of channels, found in the rows: channel, frame, and the rule that decided; and the seconds to look at.

Events, headline of the viewer, score, report and votes of recordings all read them here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import DISCRETES, SIGNALS, Block, DecidedBy, State

COMPARISON: Final = "comparison"
BEFORE_S, AFTER_S, WITHOUT_S = 0.5, 1.0, 2.0  # of decisive_s


class Failure(NamedTuple):
    """A channel that was isolated."""

    frame: int
    place: str  # signal or discrete
    channel: int  # from 1
    decided_by: str


def became_failed(state: NDArray[np.uint8], before: NDArray[np.uint8] | None = None) -> NDArray[np.intp]:
    """Return (m, 3) row, item and channel of every change to failed in ``state`` (n, items, 4), in order of time.

    before : (items, 4) states in the row before the first; None: no channel was out then
    """
    rows, items, channels = state.shape
    width = items * channels
    failed = np.ascontiguousarray(state).reshape(rows, width) == State.FAILED
    new = failed.copy()
    new[1:] &= ~failed[:-1]
    if before is not None and rows:
        new[0] &= before.reshape(-1) != State.FAILED
    places = np.flatnonzero(new.ravel())  # of one axis: much faster than of two
    return np.column_stack([places // width, places % width // channels, places % channels])


def who_failed(row: Any, s: int, c: int) -> str:
    """Return what isolated channel ``c`` of signal ``s`` in ``row``: the rule, if it decided, otherwise the comparison.

    No rule isolates a channel that cannot be compared.
    """
    return decider(row["decided_by"][s], bool(row["valid"][s, c] != 0 and np.isfinite(row["channels"][s, c])))


def decider(code: int, comparable: bool) -> str:
    """Return the name of the DecidedBy ``code`` of a row if it decided on a ``comparable`` channel, or comparison."""
    decided_by = DecidedBy(code)
    undecided = not comparable or decided_by in (DecidedBy.NONE, DecidedBy.UNRESOLVED)
    return COMPARISON if undecided else decided_by.name.lower()


def failures(rows: Block, before: Block | None = None) -> list[Failure]:
    """Return the failures in ``rows`` (n,) of signals and discretes, in order of time; ``before`` (1,) the row before.

    Without a row before, a channel that is out in the first row was isolated in it.
    """
    frames, last = rows["frame"], None if before is None else before[0]
    signals = became_failed(rows["state"], None if last is None else last["state"])
    discretes = became_failed(rows["discrete_state"], None if last is None else last["discrete_state"])
    listed = [Failure(int(frames[k]), SIGNALS[s].name, int(c) + 1, who_failed(rows[k], s, c)) for k, s, c in signals]
    listed += [Failure(int(frames[k]), DISCRETES[d].name, int(c) + 1, COMPARISON) for k, d, c in discretes]
    return sorted(listed, key=lambda failure: failure.frame)


def failed_channels(row: Any) -> dict[str, list[int]]:
    """Return the channels that are out in ``row``, numbered from 1, by signal or discrete."""
    items = [*zip(SIGNALS, row["state"], strict=True), *zip(DISCRETES, row["discrete_state"], strict=True)]
    lists = {item.name: (np.flatnonzero(state == State.FAILED) + 1).tolist() for item, state in items}
    return {name: channels for name, channels in lists.items() if channels}


def failed_text(failed: Mapping[str, Sequence[int]]) -> str:
    """Return isolated channels as people read them: ``pitch_rate 3; heading 1, 2``."""
    texts = (f"{name} {', '.join(map(str, channels))}" for name, channels in failed.items())
    return "; ".join(texts) or "no channel"


def decisive_s(first_s: float, isolated_s: float | None, end_s: float) -> tuple[float, float]:
    """Return the seconds of a flight that show a decision: from before the fault until after the isolation, in s.

    first_s : when the fault begins or is first seen; isolated_s : None if no channel was; end_s : of the flight
    """
    last_s = first_s + WITHOUT_S if isolated_s is None else isolated_s + AFTER_S
    return max(first_s - BEFORE_S, 0.0), min(last_s, end_s)
