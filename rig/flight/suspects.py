"""Count suspect channels: no persistence isolates an intermittent fault, which only these counts show.

A channel is suspect in a row in which its monitor doubts it, or in which it is in use and has no comparable sample.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, DISCRETES, SIGNALS, D, S, State, new_block
from rig.core.kernels import kernel

LEAST_ROWS: Final = 10  # of a channel that is told in a sentence, and
LEAST_SHARE: Final = 0.01  # of all rows; every count is in the tables
COUNT: Final = np.dtype([("rows", "i8"), ("failed", "u1"), ("fitted", "u1")], align=True)  # of a channel


class Suspect(NamedTuple):
    """The frames in which a channel was suspect."""

    signal: str  # signal or discrete
    channel: int  # from 1
    rows: int  # frames in which it was suspect
    of: int  # frames in all
    failed: bool  # True: it was isolated in one of them

    @property
    def share(self) -> float:
        """Share of all frames, 0 to 1."""
        return self.rows / max(self.of, 1)

    @property
    def slow_faults(self) -> bool:
        """True: suspect in at least ten frames and 1 % of all, and never isolated."""
        return not self.failed and is_many(self.rows, self.of)

    def as_dict(self) -> dict[str, str | int | float | bool]:
        """Return it as plain data, for --json."""
        return {**self._asdict(), "share": self.share}

    def text(self, rows: str = "frames") -> str:
        """Return how often, as people read it: ``in 1750 of 2000 frames (87.5 %), never isolated``."""
        never = "" if self.failed else ", never isolated"
        return f"{share_text(self.rows, self.of, rows)}{never}"


def is_many(rows: int, of: int) -> bool:
    """Return whether ``rows`` of ``of`` are enough for a sentence."""
    return rows >= max(LEAST_ROWS, LEAST_SHARE * of)


def share_text(rows: int, of: int, unit: str = "rows") -> str:
    """Return a count and its share as people read it: ``in 1750 of 2000 frames (87.5 %)``."""
    return f"in {rows} of {of} {unit} ({100 * rows / max(of, 1):.3g} %)"


def slow_faults_text(suspects: Iterable[Suspect]) -> str:
    """Return those of ``suspects`` behind what failed: ``; pitch_rate 3 suspect in ..``; "" without any."""
    return "".join(f"; {one.signal} {one.channel} suspect {one.text()}" for one in suspects if one.slow_faults)


def doubted(state: NDArray[np.uint8], usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where channels are suspect: by ``state``, or in use without a ``usable`` sample; both of one shape."""
    return (state == State.SUSPECT) | ((state == State.OK) & ~usable)


@kernel
def count_suspects(rows, counts):
    """Add (n,) FLAT ``rows`` to ``counts`` (signals and discretes, 4) of COUNT."""
    for k in range(len(rows)):
        row = rows[k]
        state, valid, samples = row["state"], row["valid"], row["channels"]
        for s in range(S):
            for c in range(CHANNELS):
                count_state(state[s, c], valid[s, c] != 0 and math.isfinite(samples[s, c]), counts[s, c])
        state, valid = row["discrete_state"], row["discrete_valid"]
        for d in range(D):
            for c in range(CHANNELS):
                count_state(state[d, c], valid[d, c] != 0, counts[S + d, c])


@kernel
def count_state(state, usable, count):
    """Add one channel of one row to its COUNT, by the rule of ``doubted``."""
    if state == State.OK:
        count["rows"] += not usable
        count["fitted"] = 1
    elif state != State.ABSENT:
        count["rows"] += state == State.SUSPECT
        count["failed"] |= state == State.FAILED
        count["fitted"] = 1


def new_counts() -> NDArray[np.void]:
    """Return (signals and discretes, 4) COUNT of no rows; the kernel is compiled before the first frame."""
    counts: NDArray[np.void] = np.zeros((S + D, CHANNELS), COUNT)
    count_suspects(new_block(0), counts)
    return counts


def suspects(counts: NDArray[np.void], frames: int) -> list[Suspect]:
    """Return every channel that had a state, ever suspect or not; ``counts`` the number of frames."""
    return [
        Suspect(item.name, c + 1, int(counts["rows"][i, c]), frames, bool(counts["failed"][i, c]))
        for i, item in enumerate((*SIGNALS, *DISCRETES))
        for c in np.flatnonzero(counts["fitted"][i]).tolist()
    ]
