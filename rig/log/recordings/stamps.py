"""Time stamps of a recorder: accepted, refused in one line, or repaired on request; and the rate that they show.

A row is kept if its time exceeds that of every row before it, in the order of the input.  So the first of
rows with equal stamps is kept, and after a step back rows are dropped until time exceeds the largest so far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput

Floats = NDArray[np.float64]
TIME: Final = "time_s"
LATEST_S: Final = 9e9  # a log's time stamps are nanoseconds in 64 bits
SHORTEST_S: Final = 1e-9
NAMED: Final = 5  # rows that a message names
OPTION: Final = "--repair-time"
LONG_AGO_S: Final = 1e5  # at the first row: the recorder counts from a date, not from its start
_FEW_S: Final = 1e3
GAP: Final = 5.0  # periods from which a pause is told
_UNITS_S: Final = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_DECIMALS: Final = 9  # of a stamp, at most: nanoseconds
_REFINED: Final = 3  # times that a rate is
_VAGUE: Final = 0.5  # of a row, or of a row a second: what the decimals leave open must be less
_LOWEST_HZ, _HIGHEST_HZ = 1.0, 10_000.0  # rates that a recorder has


@dataclass(frozen=True, slots=True)
class Repair:
    """The rows that were dropped from one input, counted from 1."""

    source: str
    rows: int  # of the input
    dropped: int
    first: list[int]  # the first few of those dropped


@dataclass(frozen=True, slots=True)
class Clock:
    """Time (n,) that rises from row to row, s, and the rows of the input that have it."""

    time_s: Floats
    kept: NDArray[np.int64] | None = None  # (n,) counted from 0; None: all rows
    repair: Repair | None = None
    source: str = ""

    def of(self, column: NDArray[Any]) -> NDArray[Any]:
        """Return the rows of a column that are kept."""
        return column if self.kept is None else column[self.kept]


def clock(source: str, time_s: Floats, repair: bool = False) -> Clock:
    """Accept the stamps ``time_s`` of ``source``; with ``repair`` without rows that repeat or step back.

    BadInput: no rows, a stamp that is no time in seconds, time that does not rise, more rows to drop than to keep.
    """
    _check_numbers(source, time_s)
    late = late_rows(time_s)
    if len(late) == 0:
        _check_interval(source, time_s)
        return Clock(time_s, source=source)
    if not repair:
        raise BadInput(_refusal(source, time_s, late))
    if 2 * len(late) > len(time_s):
        raise BadInput(
            f"{source}: {OPTION} would drop {len(late)} of {len(time_s)} rows, from row {late[0] + 1} on: "
            f"{TIME} cannot be repaired"
        )
    kept = np.delete(np.arange(len(time_s)), late)
    _check_interval(source, time_s[kept])
    repaired = Repair(source, len(time_s), len(late), [int(k) + 1 for k in late[:NAMED]])
    return Clock(time_s[kept], kept, repaired, source)


def digits(time_s: float) -> str:
    """Return a time in seconds with its milliseconds, however long ago the clock began."""
    return f"{time_s:.6g}" if abs(time_s) < _FEW_S else f"{time_s:.3f}".rstrip("0").rstrip(".")


def of_rows(time_s: float, first_s: float) -> str:
    """Return a time of a recording; of one whose clock began long ago also since its first row, at ``first_s``."""
    since = f" ({time_s - first_s:+.3f} s)" if abs(first_s) >= LONG_AGO_S else ""
    return f"{digits(time_s)} s{since}"


def gaps(source: str, time_s: Floats) -> list[str]:
    """Return a line on the pauses of more than GAP periods in the rising ``time_s``; none: an empty list."""
    steps = np.diff(time_s)
    long = np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else np.empty(0, np.int64)
    if len(long) == 0:
        return []
    largest = long[np.argmax(steps[long])]
    longest = f"gap of {steps[largest]:.6g} s at {of_rows(float(time_s[largest]), float(time_s[0]))}"
    gap = longest if len(long) == 1 else f"{len(long)} gaps of more than {GAP:g} rows, the largest a {longest}"
    return [f"{source}: {gap}: the rows before and after count as consecutive"]


def strange_rate(source: str, time_s: Floats) -> list[str]:
    """Return a line on a rate that no recorder of flight data has, with the unit that time may be in."""
    if len(time_s) < 2:
        return []
    rate_hz = 1.0 / float(np.median(np.diff(time_s)))
    if _LOWEST_HZ < rate_hz <= _HIGHEST_HZ:
        return []
    likely = next((unit for unit, s in _UNITS_S.items() if _LOWEST_HZ < rate_hz / s <= _HIGHEST_HZ), "h")
    other = f'if time is not in seconds, time_unit = "{likely}" or another in CONFIG'
    return [f"{source}: {rate_hz:.4g} rows a second: {other}"]


def late_rows(time_s: Floats) -> NDArray[np.int64]:
    """Rows (from 0) whose time does not exceed that of every row before them."""
    return np.flatnonzero(time_s[1:] <= np.maximum.accumulate(time_s)[:-1]) + 1


def _check_numbers(source: str, time_s: Floats) -> None:
    if len(time_s) == 0:
        raise BadInput(f"{source}: no rows")
    wrong = np.flatnonzero(~np.isfinite(time_s))
    if len(wrong):
        raise BadInput(f"{source}: row {wrong[0] + 1}: {TIME} is not a number")
    wrong = np.flatnonzero(np.abs(time_s) > LATEST_S)
    if len(wrong):
        got = time_s[wrong[0]]
        raise BadInput(
            f"{source}: row {wrong[0] + 1}: {TIME} is in seconds, up to {LATEST_S:g}, got {got:g}; "
            'time_unit = "ms" or another in CONFIG'
        )


def _check_interval(source: str, time_s: Floats) -> None:
    if len(time_s) > 1 and (interval := float(np.median(np.diff(time_s)))) < SHORTEST_S:
        raise BadInput(f"{source}: {TIME} rises by {interval:g} s a row; at least {SHORTEST_S:g}; time_unit in CONFIG?")


def _refusal(source: str, time_s: Floats, late: NDArray[np.int64]) -> str:
    row = int(late[0])
    before, got = time_s[:row].max(), time_s[row]
    rows = ", ".join(str(k + 1) for k in late[:NAMED]) + (", ..." if len(late) > NAMED else "")
    count = "1 row repeats or steps" if len(late) == 1 else f"{len(late)} rows repeat or step"
    which = "it" if len(late) == 1 else "them"
    return (
        f"{source}: row {row + 1}: {TIME} must rise, got {got:.15g} after {before:.15g}; "
        f"{count} back ({rows}); {OPTION} drops {which}"
    )


def rows_a_second(time_s: Floats) -> float:
    """Return the rows a second by stamps (n,) that rise; 1 of one row.

    The whole number of them whose instants, rounded to the decimals of the stamps, all stamps are: at 300 a second
    milliseconds rise by 3 and by 4.  Else by the median interval.
    """
    if len(time_s) < 2:
        return 1.0
    steps = np.diff(time_s)
    median_s = float(np.median(steps))
    usual = steps[steps < GAP * median_s]  # with rows that are missing, without pauses
    rate_hz = 1.0 / median_s
    for _ in range(_REFINED):  # a few rows together are not told by the median of 2 and 3 ms
        rate_hz = float(np.rint(usual * rate_hz).sum() / usual.sum())
    whole = round(rate_hz)
    return float(whole) if whole > 0 and _are_instants(time_s, whole) else 1.0 / median_s


def _are_instants(time_s: Floats, rate_hz: float) -> bool:
    """Return True if all stamps are whole periods after the first as far as their decimals tell, and these tell it."""
    noise_s = float(np.spacing(np.abs(time_s).max()))
    unit_s = _last_decimal(time_s, noise_s)
    span_s = float(time_s[-1] - time_s[0])
    if unit_s * rate_hz >= _VAGUE * min(1.0, span_s):
        return False
    periods = (time_s - time_s[0]) * rate_hz
    return bool((np.abs(periods - np.rint(periods)) <= (unit_s + 4.0 * noise_s) * rate_hz).all())


def _last_decimal(time_s: Floats, noise_s: float) -> float:
    """Return the unit of the last decimal that any stamp has, s; 0: they are not rounded."""
    for decimals in range(_DECIMALS + 1):
        if (np.abs(time_s - np.round(time_s, decimals)) <= noise_s).all():
            return 10.0**-decimals
    return 0.0
