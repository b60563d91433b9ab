"""The parts of a summary beside the vote: channels that do not vote, and deviations from the first row on."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final

import numpy as np

from rig.bench.vote_rows import Voted
from rig.core.frame import State
from rig.core.units.angles import differences
from rig.log.recordings.recording import Bytes, Samples

FIRST_ROWS: Final = 8  # rows in which a channel is not ok from the first one on


def shown_beside(samples: Samples, signal: Voted) -> dict[str, Any]:
    """Return the recorded number of each channel of the vote, and the channels that do not vote; {}: as recorded.

    Differences are from the vote, in the unit of the signal.
    """
    if not samples.numbers and not samples.others:
        return {}
    settings = signal.settings
    low, high = settings.limits
    others: list[dict[str, Any]] = []
    for number, column in samples.others.items():
        usable = (column >= low) & (column <= high)
        off = np.abs(differences(column, signal.voted, settings.wraps))[usable]
        others.append(
            {
                "recorded": number,
                "invalid_samples": int((~usable).sum()),
                "median_difference": float(settings.shown(np.median(off))) if len(off) else None,
                "largest_difference": float(settings.shown(off.max())) if len(off) else None,
                "beyond_threshold_share": float((off > settings.threshold).mean()) if len(off) else None,
            }
        )
    return {"recorded": [samples.number(c) for c in range(len(samples.channels))], "not_voted": others}


def from_first_row(states: Bytes, bad_from_start: Collection[int], c: int) -> bool:
    """Return True if channel ``c``, counted from 0, is suspect or isolated from the first row on for FIRST_ROWS rows.

    states : (n,) of the channel; bad_from_start : channels that CONFIG isolates
    """
    return c + 1 not in bad_from_start and bool((states[:FIRST_ROWS] != State.OK).all()) and len(states) >= FIRST_ROWS


def first_row_lines(name: str, signal: dict[str, Any]) -> list[str]:
    """Return a line on the channels of a signal's summary that deviate from the first row on; none: an empty list."""
    found = [f"{name}.{channel['channel']}" for channel in signal["channels"] if channel["from_first_row"]]
    if not found:
        return []
    who = f"{', '.join(found[:-1])} and {found[-1]}" if len(found) > 1 else found[0]
    deviates = "deviates" if len(found) == 1 else "deviate"
    return [
        f"{who} {deviates} from the first row on: a fault from before the recording, or another offset, sign or unit"
    ]
