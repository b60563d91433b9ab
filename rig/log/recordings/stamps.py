"""Time stamps of a recorder: accepted, refused in one line, or repaired on request; and the rate that they show.

A repair drops the fewest rows without which time rises (time_order.py).  The first of rows with equal stamps is kept.
Strays at the ends go too: a lone stamp far from all others, and rows before the clock was set.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.units.conversion import conversion
from rig.log.publishers import last_decimal
from rig.log.recordings.bursts import GAP, bursts
from rig.log.recordings.time_order import UNIX_S, long_run, out_of_order, strays

Floats = NDArray[np.float64]
TIME: Final = "time_s"
LATEST_S: Final = 9e9  # a log's time stamps are nanoseconds in 64 bits
SHORTEST_S: Final = 1e-9
NAMED: Final = 5  # rows that a message names
OPTION: Final = "--repair-time"
LONG_AGO_S: Final = 1e5  # at the first row: the recorder counts from a date, not from its start
_FEW_S: Final = 1e3
_UNITS_S: Final = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
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


def clock(source: str, time_s: Floats, repair: bool = False, unit: bool = True) -> Clock:
    """Accept the stamps ``time_s`` of ``source``; with ``repair`` without rows whose time is out of order.

    unit : CONFIG may give another unit of time
    BadInput: no rows, a stamp that is no time in seconds, time that does not rise, more rows to drop than to keep, a
    clock that was set back.
    """
    _check_numbers(source, time_s, unit)
    wrong = out_of_order(time_s)
    if len(wrong) and not repair:
        raise BadInput(_refusal(source, time_s, wrong, unit))
    kept = np.delete(np.arange(len(time_s)), wrong)
    ends = strays(time_s[kept]) if repair else None
    if ends is not None:
        wrong = np.union1d(wrong, kept[ends.rows])
        kept = np.delete(kept, ends.rows)
    if len(wrong) == 0:
        _check_interval(source, time_s, unit)
        return Clock(time_s, source=source)
    if why := _no_repair(time_s, wrong, unit):
        raise BadInput(f"{source}: {why}")
    _check_interval(source, time_s[kept], unit)
    repaired = Repair(source, len(time_s), len(wrong), [int(k) + 1 for k in wrong[:NAMED]])
    return Clock(time_s[kept], kept, repaired, source)


def digits(time_s: float) -> str:
    """Return a time in seconds with its milliseconds, however long ago the clock began."""
    return f"{time_s:.6g}" if abs(time_s) < _FEW_S else f"{time_s:.3f}".rstrip("0").rstrip(".")


def utc(time_s: float) -> str:
    """Return date and time of seconds since 1970, to the hundredth of a second: 2023-11-14 22:13:34.16 UTC."""
    hundredths = round(time_s * 100.0)
    at = datetime.fromtimestamp(hundredths // 100, UTC)
    return f"{at:%Y-%m-%d %H:%M:%S}.{hundredths % 100:02d} UTC"


def of_rows(time_s: float, first_s: float) -> str:
    """Return a time of a recording; of one whose clock began long ago also since its first row, at ``first_s``.

    +14.160 s, 2023-11-14 22:13:34.16 UTC where it counts from 1970.
    """
    if first_s >= UNIX_S:
        return f"{time_s - first_s:+.3f} s, {utc(time_s)}"
    since = f" ({time_s - first_s:+.3f} s)" if abs(first_s) >= LONG_AGO_S else ""
    return f"{digits(time_s)} s{since}"


def span(first_s: float, last_s: float) -> str:
    """Return from when to when, with the dates where they count from 1970."""
    seconds = f"{digits(first_s)} to {digits(last_s)} s"
    return f"{seconds} ({utc(first_s)} to {utc(last_s)})" if first_s >= UNIX_S else seconds


def gaps(source: str, time_s: Floats) -> list[str]:
    """Return a line on the pauses of more than GAP periods in the rising ``time_s``; none: an empty list.

    A recorder that writes in bursts has a line on these instead.
    """
    if (of := bursts(time_s)) is not None:
        return [f"{source}: times in bursts of {of.rows:g} rows every {of.every_s:.3g} s, as of messages that waited"]
    steps = np.diff(time_s)
    long = np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else np.empty(0, np.int64)
    if len(long) == 0:
        return []
    largest = long[np.argmax(steps[long])]
    longest = f"gap of {steps[largest]:.6g} s at {of_rows(float(time_s[largest]), float(time_s[0]))}"
    gap = longest if len(long) == 1 else f"{len(long)} gaps of more than {GAP:g} rows, the largest a {longest}"
    return [f"{source}: {gap}: the rows before and after count as consecutive{_stray(time_s)}"]


def _stray(time_s: Floats) -> str:
    """Return a hint at rows at an end whose stamps may be wrong."""
    ends = strays(time_s)
    if ends is None:
        return ""
    many = "1 row" if len(ends.rows) == 1 else f"{len(ends.rows)} rows"
    place = "first" if ends.rows[0] == 0 else "last"
    why = "before the clock was set" if ends.before_clock else "if its time is wrong"
    return f"; {why}: {OPTION} drops the {place} {many}"


def strange_rate(source: str, time_s: Floats, unit: bool = True) -> list[str]:
    """Return a line on a rate that no recorder of flight data has, with the unit that time may be in.

    unit : CONFIG may give another unit of time
    """
    if len(time_s) < 2 or bursts(time_s) is not None:
        return []
    rate_hz = 1.0 / float(np.median(np.diff(time_s)))
    if _LOWEST_HZ < rate_hz <= _HIGHEST_HZ:
        return []
    line = f"{source}: {rate_hz:.4g} rows a second"
    if not unit:
        return [line]
    likely = next((name for name, s in _UNITS_S.items() if _LOWEST_HZ < rate_hz / s <= _HIGHEST_HZ), "h")
    allowed = _fits(time_s, conversion(likely, "s").factor)
    other = f'time_unit = "{likely}" or another in CONFIG' if allowed else "time_unit in CONFIG"
    return [f"{line}: if time is not in seconds, {other}"]


def _fits(time_s: Floats, factor: float) -> bool:
    return bool(np.abs(time_s).max() * factor <= LATEST_S)


def late_rows(time_s: Floats) -> NDArray[np.int64]:
    """Rows (from 0) whose time does not exceed that of every row before them."""
    return np.flatnonzero(time_s[1:] <= np.maximum.accumulate(time_s)[:-1]) + 1


def _check_numbers(source: str, time_s: Floats, unit: bool) -> None:
    if len(time_s) == 0:
        raise BadInput(f"{source}: no rows")
    wrong = np.flatnonzero(~np.isfinite(time_s))
    if len(wrong):
        raise BadInput(f"{source}: row {wrong[0] + 1}: {TIME} is not a number")
    wrong = np.flatnonzero(np.abs(time_s) > LATEST_S)
    if len(wrong):
        got = time_s[wrong[0]]
        fit = next((name for name, s in _UNITS_S.items() if _fits(time_s, s)), "")
        hint = f'; time_unit = "{fit}" or another in CONFIG' if unit and fit else ""
        raise BadInput(f"{source}: row {wrong[0] + 1}: {TIME} is in seconds, up to {LATEST_S:g}, got {got:.15g}{hint}")


def _check_interval(source: str, time_s: Floats, unit: bool) -> None:
    if len(time_s) > 1 and (interval := float(np.median(np.diff(time_s)))) < SHORTEST_S:
        hint = "; time_unit in CONFIG?" if unit else ""
        raise BadInput(f"{source}: {TIME} rises by {interval:g} s a row; at least {SHORTEST_S:g}{hint}")


def _refusal(source: str, time_s: Floats, wrong: NDArray[np.int64], unit: bool) -> str:
    """Return why stamps of which the rows ``wrong`` are out of order are refused, and what can be done."""
    late = late_rows(time_s)
    row = int(late[0])
    before, got = time_s[:row].max(), time_s[row]
    rows = ", ".join(str(k + 1) for k in wrong[:NAMED]) + (", ..." if len(wrong) > NAMED else "")
    one, which = len(wrong) == 1, "it" if len(wrong) == 1 else "them"
    if np.array_equal(wrong, late):
        count = f"{'1 row repeats or steps' if one else f'{len(wrong)} rows repeat or step'} back ({rows})"
    else:
        count = f"{'1 row is' if one else f'{len(wrong)} rows are'} out of order ({rows})"
    way_out = _no_repair(time_s, wrong, unit) or f"{OPTION} drops {which}"
    return f"{source}: row {row + 1}: {TIME} must rise, got {got:.15g} after {before:.15g}; {count}; {way_out}"


def _no_repair(time_s: Floats, wrong: NDArray[np.int64], unit: bool) -> str:
    """Return why the rows ``wrong`` cannot be dropped; "": they can."""
    if len(np.unique(time_s)) == 1 and len(time_s) > 2:
        field = "" if unit else "; time in CONFIG names a field of the messages that has it"
        return f"all rows have one time: {TIME} cannot be repaired{field}"
    if 2 * len(wrong) > len(time_s):
        return (
            f"{OPTION} would drop {len(wrong)} of {len(time_s)} rows, from row {wrong[0] + 1} on: "
            f"{TIME} cannot be repaired"
        )
    if (run := long_run(wrong, time_s)) is not None:
        first, last = run
        return (
            f"rows {first + 1} to {last + 1} have other times, {digits(time_s[first])} to "
            f"{digits(time_s[last])} s: a clock that was set, not wrong stamps; split the recording there"
        )
    return ""


def rows_a_second(time_s: Floats) -> float:
    """Return the rows a second by stamps (n,) that rise; 1 of one row.

    The whole number of them whose instants, rounded to the decimals of the stamps, all stamps are: at 300 a second
    milliseconds rise by 3 and by 4.  Else by the median interval.
    """
    if len(time_s) < 2:
        return 1.0
    if (of := bursts(time_s)) is not None:
        return float(f"{of.rows / of.every_s:.4g}")
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
    unit_s = last_decimal(time_s)
    span_s = float(time_s[-1] - time_s[0])
    if unit_s * rate_hz >= _VAGUE * min(1.0, span_s):
        return False
    periods = (time_s - time_s[0]) * rate_hz
    return bool((np.abs(periods - np.rint(periods)) <= (unit_s + 4.0 * noise_s) * rate_hz).all())
