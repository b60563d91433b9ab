"""The words for the outcome of a fault, of an isolated channel and of a voted value; and their public names.

    fault     isolated         its channel, or its reference, was isolated for it
              wrong channel    a healthy channel was isolated for it
              missed           its error was above the threshold, and no channel was isolated
              no effect        its error was never above the threshold
              not executed     it never acted on a channel in use
    channel   own fault        isolated for its own fault
              false alarm, wrong isolation, failed with its box, failed by rule: see docs/reference/scores-and-tables.md
    vote      kept             within its threshold at the end, and before but for a monitor's time
              lost and announced   level 0
              bad and silent   neither

Commands and files that are older than these words keep their own: PUBLIC.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

FaultWord = Literal["isolated", "wrong channel", "missed", "no effect", "not executed"]
VoteWord = Literal["kept", "lost and announced", "bad and silent"]
IsolationKind = Literal["false alarm", "wrong isolation", "failed with its box", "failed by rule"]

# The public names of the words, by who prints them.  Words that are not listed are not printed there.
PUBLIC: Final[dict[str, dict[str, str]]] = {
    "score": {
        "isolated": "detected",
        "missed": "missed",
        "no effect": "undetectable",
        "not executed": "not executed",
    },
    "campaign": {
        "isolated": "correct",
        "wrong channel": "wrong",
        "missed": "none",
        "no effect": "none",
        "not executed": "none",
    },
    "injection": {
        "isolated": "correct",
        "wrong channel": "wrong",
        "missed": "missed",
        "no effect": "missed",
        "not executed": "none",
    },
    "reliability": {"kept": "correct", "lost and announced": "annunciated loss", "bad and silent": "undetected error"},
}
PRIOR: Final = "prior"  # of an injected fault: its signal had failed a channel before it began
INJECTED: Final[tuple[FaultWord, ...]] = ("isolated", "wrong channel", "missed")  # that acts, and is to be found


class Cause(IntEnum):
    """Cause of the isolation of a channel, as the kernel writes it."""

    OWN_FAULT = 0
    FALSE_ALARM = 1
    WRONG_ISOLATION = 2
    WITH_ITS_BOX = 3
    BY_RULE = 4

    @property
    def kind(self) -> IsolationKind | None:
        """Return the words for a healthy channel that was isolated; None for one isolated for its own fault."""
        return _KINDS.get(self)

    @property
    def by_design(self) -> bool:
        """Return True if a rule isolated a healthy channel for a fault elsewhere."""
        return self in (Cause.WITH_ITS_BOX, Cause.BY_RULE)


_KINDS: Final[dict[Cause, IsolationKind]] = {
    Cause.FALSE_ALARM: "false alarm",
    Cause.WRONG_ISOLATION: "wrong isolation",
    Cause.WITH_ITS_BOX: "failed with its box",
    Cause.BY_RULE: "failed by rule",
}
BY_DESIGN: Final = tuple(kind for cause, kind in _KINDS.items() if cause.by_design)


def fault_word(executed: bool, failed: bool, exceeded: bool, healthy_failed: bool = False) -> FaultWord:
    """Return the outcome of a fault.

    failed : its channel was isolated for it; exceeded : its error was above the threshold
    healthy_failed : a healthy channel was isolated for it
    """
    if healthy_failed:
        return "wrong channel"
    if not executed:
        return "not executed"
    return "isolated" if failed else "missed" if exceeded else "no effect"


def fault_words(executed: Any, failed: Any, exceeded: Any, healthy_failed: Any) -> NDArray[np.str_]:
    """Return ``fault_word`` of each of several faults: flags are arrays, or one for all of them."""
    return _FAULT_WORDS(executed, failed, exceeded, healthy_failed)


_FAULT_WORDS: Final = np.vectorize(fault_word, otypes=[np.str_])


def vote_flags(lost: Any, off: Any) -> dict[VoteWord, Any]:
    """Return which of the words for a vote are true: columns, arrays or numpy's bool, as they are given.

    lost : the signal was at level 0, its vote kept until then; off : its vote was not kept
    """
    return {"kept": ~lost & ~off, "lost and announced": lost, "bad and silent": ~lost & off}
