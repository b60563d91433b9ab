"""The verdict of a benchmark in sentences: which managers keep the budget, which isolate more, by how much."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

from scipy.stats import binomtest, poisson

from rig.studies.benchmark.benchmark_trials import STATES
from rig.studies.benchmark.entrants import BUILT_IN, DESIGNED, OURS, UNBOUNDED
from rig.studies.benchmark.outcome_table import ALL
from rig.studies.thresholds.holdout import OVER
from rig.verdict.words import PRIOR

Row = dict[str, Any]
_OURS: Final = (*DESIGNED, BUILT_IN)
_CHANCE: Final = 0.05  # of a sign test, two-sided
_MORE, _FEWER, _NEARER = "more", "fewer", "nearer"
_WHAT: Final = {
    _MORE: "in which another manager isolates more",
    _FEWER: "in which another isolates fewer healthy channels",
    _NEARER: "in which another has the smaller vote error",
}


def losses(result: Mapping[str, Any]) -> list[str]:
    """Return where a built-in manager loses, of ``result`` as of run_benchmark.py: counts first, then each group.

    It loses a group where another manager isolates more channels, fails fewer healthy ones, or has the smaller vote
    error, each significantly: intervals of 95 %, and a sign test of the vote errors.
    """
    rows = _others(result["differences"])
    lost = {ours: _lost_by(_rows(rows, ours), result["silent"]) for ours in DESIGNED}
    counts = [line for ours in DESIGNED for line in _counted(ours, _rows(rows, ours), lost[ours])]
    able = [row for row in rows if row["manager"] not in result["silent"]]
    kept = [ours for ours in DESIGNED if _rows(able, ours) and not lost[ours][_MORE]]
    if kept:
        counts.append(f"no baseline manager isolates significantly more than {', '.join(kept)} in any group")
    return [*counts, *(line for what in _WHAT for ours in DESIGNED for line in _sentences(what, ours, lost[ours]))]


def verdict(result: Mapping[str, Any]) -> list[str]:
    """Return the sentences on ``result``: where the built-in manager loses comes first.

    A difference counts if its 95 % interval excludes zero.
    """
    table, differences, silent = result["table"], result["differences"], result["silent"]
    baselines = [row for row in _others(differences) if row["manager"] not in silent]
    lines = [*losses(result), *_no_number(table), *_transients(result["transients"]), *_over_budget(result["second"])]
    plain = [row for row in differences if row["kind"] == ALL and row["reference"] == STATES[0]]
    lines += _leads([row for row in plain if row in baselines])
    lines += _among([row for row in plain if row["manager"] in _OURS and row["built_in"] == OURS])
    lines += [*_wrong(table, silent), *_before(table, silent), *_votes(plain, silent)]
    return [*lines, *_lost(result["lost_differences"])]


def _others(rows: Sequence[Row]) -> list[Row]:
    """Return the differences of all managers but the built-in one, and those that are outside the verdict."""
    return [row for row in rows if row["manager"] not in _OURS and UNBOUNDED not in row["manager"]]


def _rows(rows: Sequence[Row], ours: str) -> list[Row]:
    return [row for row in rows if row["built_in"] == ours]


def _lost_by(rows: Sequence[Row], silent: Sequence[str]) -> dict[str, list[Row]]:
    """Return the differences to one built-in manager that it loses, by what it loses, the largest first."""
    able = [row for row in rows if row["manager"] not in silent]
    return {
        _MORE: sorted((row for row in able if row["low"] > 0.0), key=lambda row: -row["value"]),
        _FEWER: sorted(
            ({**row, **row["harmed"]} for row in able if row["harmed"]["high"] < 0.0), key=lambda row: row["value"]
        ),
        _NEARER: sorted(filter(_is_nearer, rows), key=lambda row: row["peak_larger"] - row["peak_smaller"]),
    }


def _sentences(what: str, ours: str, lost: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    for row in _alike(lost[what], _votes_of if what == _NEARER else _interval, "reference"):
        if what == _MORE:
            yield f"LOSS: {_more(row['manager'], 'isolate', row, ours)}"
        elif what == _FEWER:
            points = _points(row, "fewer").format(" of the trials", ours)
            yield f"LOSS: {row['manager']} isolates a healthy channel in {points}: {_where(row)}"
        else:
            yield _nearer(row, ours)


def _is_nearer(row: Row) -> bool:
    """Return True if a vote error is smaller than the built-in manager's more often than chance makes it."""
    smaller, larger = row["peak_smaller"], row["peak_larger"]
    return smaller > larger and bool(binomtest(smaller, smaller + larger).pvalue < _CHANCE)


def _votes_of(row: Row) -> tuple[float, ...]:
    return row["peak_smaller"], row["peak_larger"], row["peak_median"], row["peak_built_in"]


def _nearer(row: Row, ours: str) -> str:
    smaller, larger = (100 * row[name] / row["trials"] for name in ("peak_smaller", "peak_larger"))
    medians = f"median {row['peak_median']:.2f} instead of {row['peak_built_in']:.2f} thresholds"
    return (
        f"LOSS: {row['manager']} has a smaller vote error than {ours} in {smaller:.0f} % of trials, a larger one in "
        f"{larger:.0f} % ({medians}): {_where(row)}"
    )


def _counted(ours: str, rows: Sequence[Row], lost: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Yield in how many groups a built-in manager loses something."""
    said = [f"{len({_where(row) for row in lost[what]})} {words}" for what, words in _WHAT.items() if lost[what]]
    if said:
        yield f"{ours} LOSES, of {_count(len({_where(row) for row in rows}), 'group')}: {'; '.join(said)}"


def _where(row: Row) -> str:
    kind = "all kinds" if row["kind"] == ALL else row["kind"]
    return f"{row['signal']}, {row['place']}, {kind}, reference {row['reference']}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


def _alike(rows: Sequence[Row], figures: Callable[[Row], tuple[float, ...]], *joined: str) -> list[Row]:
    """Return the rows, one for all that have the same ``figures`` and differ in one of the keys ``joined`` alone."""
    for key in joined:
        merged: dict[tuple[Any, ...], Row] = {}
        for row in rows:
            others = (name for name in ("built_in", "manager", "signal", "place", "kind", "reference") if name != key)
            place = (*(row.get(name) for name in others), *figures(row))
            before = merged.get(place)
            merged[place] = {**row, key: row[key] if before is None else f"{before[key]}, {row[key]}"}
        rows = list(merged.values())
    return list(rows)


def _interval(row: Row) -> tuple[float, ...]:
    return row["value"], row["low"], row["high"]


def _points(row: Row, how: str = "more") -> str:
    """Return the size of a significant difference, whichever manager is better, with its interval."""
    low, high = sorted(abs(100 * row[end]) for end in ("low", "high"))
    return f"{100 * abs(row['value']):.1f} points {how}{{}} than {{}} (95 %: {low:.1f} to {high:.1f})"


def _more(name: str, verb: str, row: Row, other: str, what: str = "") -> str:
    """Return the sentence on how many points more ``name`` isolates, or loses, than ``other``, and where."""
    verb = verb if ", " in name else f"{verb}s"
    return f"{name} {verb} {_points(row).format(what, other)}: {_where(row)}"


def _leads(rows: Sequence[Row]) -> Iterator[str]:
    for row in _alike([row for row in rows if row["high"] < 0.0], _interval, "built_in", "manager"):
        yield _more(row["built_in"], "isolate", row, row["manager"])


def _among(rows: Sequence[Row]) -> Iterator[str]:
    """Yield how the manager with its built-in settings, or with tests and sums, differs from the one as designed."""
    for row in _alike([row for row in rows if row["built_in"] == OURS], _interval, "manager"):
        if row["high"] < 0.0:
            yield _more(OURS, "isolate", row, row["manager"])
        elif row["low"] > 0.0:
            yield _more(row["manager"], "isolate", row, OURS)
        else:
            low, value, high = (f"{100 * row[name]:+.1f}" for name in ("low", "value", "high"))
            difference = f"{value} points isolated (95 %: {low} to {high}), not significant"
            yield f"{row['manager']} against {OURS}: {difference}: {_where(row)}"


def _wrong(table: Sequence[Row], silent: Sequence[str]) -> Iterator[str]:
    wrong = [row for row in table if row["kind"] == ALL and row["wrong channel"] and row["manager"] not in silent]
    for row in _alike(wrong, lambda row: (row["wrong channel"], row["trials"]), "reference", "manager"):
        share = 100 * row["wrong channel"] / row["trials"]
        yield f"{row['manager']}: wrong isolation, of a healthy channel, in {share:.2g} % of trials: {_where(row)}"


def _before(table: Sequence[Row], silent: Sequence[str]) -> Iterator[str]:
    """Yield which managers isolate a healthy channel because a reference jumps."""
    for row in table:
        if (row["kind"], row["reference"]) == (ALL, "jumping") and row[PRIOR] and row["manager"] not in silent:
            share = 100 * row[PRIOR] / row["trials"]
            yield f"{row['manager']}: false alarm before the fault in {share:.2g} % of trials: {_where(row)}"


def _votes(rows: Sequence[Row], silent: Sequence[str]) -> Iterator[str]:
    """Yield how managers that isolate no channel vote, against the built-in one as designed."""
    for row in rows:
        if row["manager"] in silent and row["built_in"] == OURS:
            smaller, larger = (100 * row[name] / row["trials"] for name in ("peak_smaller", "peak_larger"))
            yield (
                f"{row['manager']} isolates no channel; its largest vote error is smaller than that of {OURS} in "
                f"{smaller:.0f} % of trials, larger in {larger:.0f} %: {_where(row)}"
            )


def _no_number(table: Sequence[Row]) -> Iterator[str]:
    """Yield which managers vote what is no number."""
    for row in table:
        if row["kind"] == ALL and row["no_number"]:
            yield f"{row['manager']} VOTES NO NUMBER in {row['no_number']} of {row['trials']} trials: {_where(row)}"


def _transients(rows: Sequence[Row]) -> Iterator[str]:
    """Yield which managers isolate a channel for bursts shorter than the persistence."""
    by_manager: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["failed"]:
            by_manager.setdefault((row["manager"], row["signal"]), []).append(
                f"{row['failed']} of {row['bursts']} bursts of {_count(row['frames'], 'frame')} "
                f"and {row['thresholds']:g} thresholds"
            )
    for (entrant, signal), bursts in by_manager.items():
        yield f"{entrant} ISOLATES A CHANNEL FOR A TRANSIENT: {signal}: {'; '.join(bursts)}"


def _lost(rows: Sequence[Row]) -> Iterator[str]:
    """Yield which managers lose more or fewer aircraft than the built-in one in closed loop."""
    for row in rows:
        if row["kind"] == ALL and (row["low"] > 0.0 or row["high"] < 0.0):
            names = (row["manager"], row["built_in"]) if row["low"] > 0.0 else (row["built_in"], row["manager"])
            yield _more(names[0], "lose", row, names[1], " of the aircraft")


def _over_budget(second: Sequence[Row]) -> Iterator[str]:
    for row in second:
        if row["counted"] and poisson.sf(row["counted"] - 1, row["expected"]) < OVER:
            yield (
                f"{row['manager']} EXCEEDS THE FALSE-ISOLATION RATE: {row['signal']}: {row['counted']} false "
                f"isolations in the second campaign, {row['expected']:.2g} expected"
            )
