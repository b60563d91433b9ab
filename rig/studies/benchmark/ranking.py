"""The verdict of a benchmark in words: which manager keeps the budget, and where ours loses and wins."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

from scipy.stats import poisson

from rig.studies.benchmark.benchmark_trials import STATES
from rig.studies.benchmark.entrants import BIASED, OURS, SHIPPED, SLOW_FAULTS, UNBOUNDED
from rig.studies.benchmark.outcome_table import ALL
from rig.studies.thresholds.holdout import OVER
from rig.verdict.words import PRIOR

Row = dict[str, Any]
_OURS: Final = (OURS, BIASED, SLOW_FAULTS, SHIPPED)


def verdict(result: Mapping[str, Any]) -> list[str]:
    """Return the sentences on ``result``, as of run_benchmark.py: the losses of ours first, then the manager that
    takes too long.

    A loss or a lead is one whose 95 % interval leaves out zero.
    """
    table, differences, silent = result["table"], result["differences"], result["silent"]
    baselines = [
        row for row in differences if row["entrant"] not in (*silent, *_OURS) and UNBOUNDED not in row["entrant"]
    ]
    lines: list[str] = []
    for ours in (OURS, BIASED, SLOW_FAULTS):
        lines += _losses([row for row in baselines if row["ours"] == ours], ours)
    lines += [*_transients(result["transients"]), *_over_budget(result["second"])]
    plain = [row for row in differences if row["kind"] == ALL and row["reference"] == STATES[0]]
    lines += _leads([row for row in plain if row in baselines])
    lines += _among([row for row in plain if row["entrant"] in _OURS and row["ours"] == OURS])
    lines += [*_wrong(table, silent), *_before(table, silent), *_votes(plain, silent)]
    return [*lines, *_lost(result["lost_differences"])]


def _where(row: Row) -> str:
    count = f"{row['faults']} fault{'s' if row['faults'] > 1 else ''}"
    kind = "all kinds" if row["kind"] == ALL else row["kind"]
    return f"{row['signal']}, {kind}, {count}, reference {row['reference']}"


def _alike(rows: Sequence[Row], figures: Callable[[Row], tuple[float, ...]]) -> list[Row]:
    """Return the rows with one for all states of the reference in which the ``figures`` are the same."""
    merged: dict[tuple[Any, ...], Row] = {}
    for row in rows:
        key = tuple(row.get(name) for name in ("ours", "entrant", "signal", "kind", "faults")) + figures(row)
        before = merged.get(key)
        reference = row["reference"] if before is None else f"{before['reference']}, {row['reference']}"
        merged[key] = {**row, "reference": reference}
    return list(merged.values())


def _points(row: Row) -> str:
    return f"{100 * row['value']:+.1f} points ({100 * row['low']:.1f} to {100 * row['high']:.1f})"


def _losses(rows: Sequence[Row], ours: str) -> Iterator[str]:
    """Yield each group in which a baseline manager isolates more, the worst first."""
    lost = _alike([row for row in rows if row["low"] > 0.0], lambda row: (row["value"], row["low"], row["high"]))
    for row in sorted(lost, key=lambda row: -row["value"]):
        yield f"{ours} LOSES to {row['entrant']}: {_where(row)}: it isolates {_points(row)}"
    if rows and not lost:
        yield f"{ours} loses in no group: no baseline manager isolates significantly more"


def _leads(rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        if row["high"] < 0.0:
            yield f"{row['ours']} is ahead of {row['entrant']}: {_where(row)}: that one isolates {_points(row)}"


def _among(rows: Sequence[Row]) -> Iterator[str]:
    """Yield how ours as shipped, with equalisation and with all slow-fault rules differ from ours as designed."""
    for row in rows:
        if row["ours"] == OURS:
            yield f"{row['entrant']} against {OURS}: {_where(row)}: it isolates {_points(row)}"


def _wrong(table: Sequence[Row], silent: Sequence[str]) -> Iterator[str]:
    wrong = [row for row in table if row["kind"] == ALL and row["wrong channel"] and row["entrant"] not in silent]
    for row in _alike(wrong, lambda row: (row["wrong channel"], row["trials"])):
        share = 100 * row["wrong channel"] / row["trials"]
        yield f"{row['entrant']} fails a healthy channel for the fault in {share:.2g} % of {_where(row)}"


def _before(table: Sequence[Row], silent: Sequence[str]) -> Iterator[str]:
    """Yield who fails a healthy channel because a reference jumps."""
    for row in table:
        if (row["kind"], row["reference"]) == (ALL, "jumping") and row[PRIOR] and row["entrant"] not in silent:
            share = 100 * row[PRIOR] / row["trials"]
            yield f"{row['entrant']} fails a channel before the fault in {share:.2g} % of {_where(row)}"


def _votes(rows: Sequence[Row], silent: Sequence[str]) -> Iterator[str]:
    """Yield how those that fail nobody vote, against ours as designed."""
    for row in rows:
        if row["entrant"] in silent and row["ours"] == OURS:
            smaller, larger = (100 * row[name] / row["trials"] for name in ("peak_smaller", "peak_larger"))
            yield (
                f"{row['entrant']} fails nobody: its largest vote error is smaller than that of {OURS} in "
                f"{smaller:.0f} %, larger in {larger:.0f} % of {_where(row)}"
            )


def _transients(rows: Sequence[Row]) -> Iterator[str]:
    """Yield whom bursts shorter than the persistence make fail somebody."""
    for row in rows:
        if row["failed"]:
            bursts = (
                f"{row['failed']} of {row['bursts']} bursts of {row['frames']} frame{'s' if row['frames'] > 1 else ''}"
            )
            yield (
                f"{row['entrant']} FAILS A CHANNEL FOR A TRANSIENT: {row['signal']}: {bursts} and "
                f"{row['thresholds']:g} thresholds"
            )


def _lost(rows: Sequence[Row]) -> Iterator[str]:
    """Yield who loses aircraft more or less often than ours, in closed loop."""
    for row in rows:
        if row["kind"] == ALL and (row["low"] > 0.0 or row["high"] < 0.0):
            yield f"{row['entrant']} against {row['ours']}: {_where(row)}: it loses {_points(row)} of the aircraft"


def _over_budget(second: Sequence[Row]) -> Iterator[str]:
    for row in second:
        if row["counted"] and poisson.sf(row["counted"] - 1, row["expected"]) < OVER:
            yield (
                f"{row['entrant']} DOES NOT KEEP THE BUDGET: {row['signal']}: {row['counted']} false isolations "
                f"in the second campaign, {row['expected']:.2g} are allowed"
            )
