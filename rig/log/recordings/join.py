"""Instances that were not sampled together, on the rows of one of them.

The channels of a signal need common rows.  Those are the rows of its slowest channel; of several signals, those of the
signal whose slowest channel is the fastest.  A channel that is faster than the rows is averaged over their step, and
every channel is then interpolated in a line.  The nearest sample, or the last one held, makes healthy channels differ
two to four times as much.  Where a channel pauses for more than GAP of its steps it has no samples.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.log.foreign import Source
from rig.log.recordings.stamps import GAP, Clock, Floats, span

_MOST_OF: Final = 0.9


def joined(
    path: str, sources: Mapping[str, Source], clocks: Mapping[str, Clock], signals: Mapping[str, Collection[str]]
) -> tuple[Clock, Callable[[str, str], Floats]]:
    """Return the common rows within the span of all, and a function from source and field to a column on them.

    clocks : the accepted stamps of each source; signals : the sources of the channels of each signal
    BadInput: spans that have less than two rows in common.
    """
    slowest = [max((clocks[source] for source in own), key=_step_s) for own in signals.values()]
    rows = min(slowest, key=_step_s)
    first_s = max(float(own.time_s[0]) for own in clocks.values())
    last_s = min(float(own.time_s[-1]) for own in clocks.values())
    inside = (rows.time_s >= first_s) & (rows.time_s <= last_s)
    if inside.sum() < 2:
        spans = ", ".join(f"{name} {_span(own.time_s)}" for name, own in clocks.items())
        raise BadInput(f"{path}: the sources have no time in common: {spans}")
    time_s = rows.time_s[inside]
    kept = np.flatnonzero(inside) if rows.kept is None else rows.kept[inside]

    def column(source: str, field: str) -> Floats:
        own = clocks[source]
        values = own.of(sources[source].fields[field])
        if own is rows:
            return values[inside]
        own_s = _step_s(own)
        averaged = running_mean(values, round(_step_s(rows) / own_s))
        return in_lines(time_s, own.time_s, averaged, GAP * own_s)

    return Clock(time_s, kept, rows.repair, rows.source), column


def whole(name: str, source: Source) -> Source:
    """Return a source without the rows at its ends that have no sample of a field, as of a receiver without a fix.

    BadInput: no row has samples of all fields.
    """
    if not source.fields or len(source.time_s) == 0:
        return source
    there = np.flatnonzero(np.all([np.isfinite(values) for values in source.fields.values()], axis=0))
    if len(there) == 0:
        raise BadInput(f"{name}: no row has a sample of {', '.join(sorted(source.fields))}")
    kept = slice(int(there[0]), int(there[-1]) + 1)
    return Source(source.time_s[kept], {name: values[kept] for name, values in source.fields.items()})


def shortened(path: str, rows: Clock, clocks: Mapping[str, Clock]) -> list[str]:
    """Return a line if the common rows are much shorter than the longest source; none: an empty list."""
    spans = {name: float(own.time_s[-1] - own.time_s[0]) for name, own in clocks.items()}
    longest, common_s = max(spans, key=spans.__getitem__), float(rows.time_s[-1] - rows.time_s[0])
    if common_s >= _MOST_OF * spans[longest]:
        return []
    return [
        f"{path}: all sources have only {_span(rows.time_s)} in common; {longest} has {_span(clocks[longest].time_s)}: "
        "a CONFIG with fewer sources votes more"
    ]


def running_mean(values: Floats, rows: int) -> Floats:
    """Return the mean of an odd number of rows about each, ``rows`` or one more; values (n,) with their ends repeated.

    NaN where one of the rows is NaN.
    """
    if rows < 2 or len(values) == 0:
        return values
    rows |= 1
    padded = np.pad(values, rows // 2, mode="edge")
    missing = ~np.isfinite(padded)
    total = np.cumsum(np.concatenate([[0.0], np.where(missing, 0.0, padded)]))
    lost = np.cumsum(np.concatenate([[0], missing]))
    return np.where(lost[rows:] > lost[:-rows], np.nan, (total[rows:] - total[:-rows]) / rows)


def in_lines(time_s: Floats, own_s: Floats, values: Floats, longest_s: float) -> Floats:
    """Return ``values`` (n,) of the rising times ``own_s`` at ``time_s``; NaN in pauses of more than ``longest_s``."""
    made = np.interp(time_s, own_s, values)
    after = np.clip(np.searchsorted(own_s, time_s), 1, max(len(own_s) - 1, 1))
    pause = own_s[np.minimum(after, len(own_s) - 1)] - own_s[after - 1] > longest_s
    return np.where(pause & ~np.isin(time_s, own_s), np.nan, made)


def _step_s(clock: Clock) -> float:
    """Return the usual step of a clock, s; 1 of one row."""
    return float(np.median(np.diff(clock.time_s))) if len(clock.time_s) > 1 else 1.0


def _span(time_s: Floats) -> str:
    return span(float(time_s[0]), float(time_s[-1]))
