"""Print the design of slow-fault tests: factors with their reserve, and the delay of each size of fault."""

from __future__ import annotations

from typing import Any, Final

from rig.cli.printing import line, table
from rig.core.column import Column

_NAMES: Final = {"factor": "means", "squares_factor": "squares", "halves_factor": "halves"}


def show_slow_tests(signals: dict[str, Any]) -> None:
    """Print the designs of slow-fault tests of the signals that have one; nothing if none has."""
    rows = [
        {"signal": name, "unit": of["unit"], **tests} for name, of in signals.items() if (tests := of["slow_tests"])
    ]
    if not rows:
        return
    line()
    line("slow-fault tests: factor on each limit (largest share in the data x reserve); error of the reference at rest")
    line("and its rise in motion, frames; held-out flights that exceed the factors of the others")
    table(rows, _FACTORS)
    line()
    drift = rows[0]["delay_s"]["drift_per_s"]
    line("one channel at rest: smallest isolated offset, thresholds; delay to isolation, s, of offsets in thresholds,")
    line(f"and of a drift by {drift:g} thresholds per second")
    table(rows, _delays(rows[0], Column("noise", "noise", ".3g")))
    if moving := [{**row, **row["in_motion"]} for row in rows if row["allowance"] > 0.0]:
        line()
        line("the same with the mean allowance for motion in the data")
        table(moving, _delays(rows[0], Column("allowance", "allowance", ".3g")))


def _factor(key: str) -> Column:
    """Return the column of one factor."""

    def told(row: dict[str, Any]) -> str:
        reserve = row["reserve"][key]
        by = "" if reserve is None else f" x {reserve:.2f}"
        return f"{row['keys'][key]:.3g} ({row['largest'][key]:.2f}{by})"

    return Column(_NAMES[key], told)


def _error(row: dict[str, Any]) -> str:
    """Return the healthy error of the reference at rest."""
    error = row["keys"].get("reference_error")
    return "" if error is None else f"{error:.3g} {row['unit'] or ''}".rstrip()


def _beyond(row: dict[str, Any]) -> str:
    beyond = row["held_out_beyond"]
    return "-" if beyond is None else f"{beyond} of {row['flights']}"


def _delays(row: dict[str, Any], amount: Column) -> tuple[Column, ...]:
    """Return the columns of the delays, of the sizes that ``row`` has, after an amount in the unit of the signal."""
    sizes = (
        Column(size, lambda row, size=size: row["delay_s"]["offset"][size], ".2f", empty="none")
        for size in row["delay_s"]["offset"]
    )
    return (
        *(Column("signal"), amount, Column("", "unit")),
        *(Column("smallest", "smallest_offset", ".3f", empty="none"), *sizes),
        Column("drift", lambda row: row["delay_s"]["drift"], ".2f", empty="none"),
    )


_FACTORS: Final = (
    *(Column("signal"), *(_factor(key) for key in _NAMES)),
    *(Column("error", _error), Column("in motion", lambda row: row["keys"].get("reference_frames"), ".3g")),
    Column("held out", _beyond),
)
