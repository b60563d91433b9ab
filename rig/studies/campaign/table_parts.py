"""The parts of a campaign's tables, read and checked: every run exactly once, in all tables.

A part is five files of one name: runs/000010-000019.parquet, and the same name in the folders of the other tables.
Runs are flown again if their part in ``runs`` is removed, so every damage of a part has a remedy.
"""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Sequence
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from rig.core import renamed, sealed
from rig.core.errors import BadInput
from rig.core.files import is_file, is_folder
from rig.core.frame import SIGNALS
from rig.flight.time_histogram import BINS
from rig.studies.campaign import tables as table
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.tables import OF, OUTCOMES, TABLES
from rig.verdict.score_records import ISOLATIONS

_PART: Final = "\0part"  # a column while the parts are checked; no key has such a name
_NO_COVERAGE: Final = "a coverage cannot be of a flight"
# Columns of ``runs`` that together say how many rows of another table a run has.
_COUNTS = {
    "faults": tuple(OUTCOMES.values()),
    "alarms": tuple(ISOLATIONS.values()),
}


def names(folder: Path) -> list[str]:
    """Return the names of the parts in ``runs``, sorted."""
    return sorted(path.stem for path in (folder / "runs").glob("*.parquet"))


def name_of(numbers: list[int]) -> str:
    """Return the name of the part that holds the runs of ``numbers``."""
    return f"{min(numbers):06d}-{max(numbers):06d}"


def read(folder: Path, plan: Plan, identity: str | None) -> dict[str, pl.DataFrame]:
    """Read all tables of a folder, in the order of the runs.

    identity : of the campaign, which marks its parts; None for parts without a checksum
    BadInput names a file that is damaged, missing, of another campaign or a copy, and the remedy.
    """
    parts = names(folder)
    rows = {name: _rows(folder, name, parts, plan, identity) for name in TABLES}
    _check_runs(folder, parts, rows["runs"], plan)
    for name in TABLES[1:]:
        if not _agree(name, rows["runs"].table, rows[name].table):
            _name_the_part(folder, name, parts, rows["runs"], rows[name])
    return {name: table.joined(name, [held.table.drop(_PART)] if parts else []) for name, held in rows.items()}


class _Rows(NamedTuple):
    """The rows of all parts of one table, part after part."""

    table: pl.DataFrame  # with the number of the part beside each row
    ends: list[int]  # of each part

    @classmethod
    def of(cls, table: pl.DataFrame, counts: Sequence[int]) -> _Rows:
        """Return rows with the number of their part; counts : rows of each part."""
        part = pl.Series(_PART, np.repeat(np.arange(len(counts)), counts), pl.Int64)
        return cls(table.with_columns(part), list(accumulate(counts)))

    def part(self, i: int) -> pl.DataFrame:
        """Return the rows of one part."""
        start = self.ends[i - 1] if i else 0
        return self.table[start : self.ends[i]]


def _rows(folder: Path, name: str, parts: list[str], plan: Plan, identity: str | None) -> _Rows:
    """Read the files of one table and check their columns, all at once if possible, in a quarter of the time."""
    held = [_bytes(folder, name, part, identity) for part in parts]
    expected, counts = table.schema(plan, name), [count for _, count in held]
    if parts and identity is not None:
        with suppress(OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException):
            rows = pl.read_parquet([data for data, _ in held], hive_partitioning=False, glob=False, parallel="none")
            if rows.schema == expected and len(rows) == sum(counts) and all(map(_is_finite, rows)):
                return _Rows.of(_with_words_of_now(rows.rechunk()), counts)
    read = [_table(folder, name, part, plan, data) for part, (data, _) in zip(parts, held, strict=True)]
    return _Rows.of(pl.concat(read) if read else pl.DataFrame(schema=expected), list(map(len, read)))


def _bytes(folder: Path, name: str, part: str, identity: str | None) -> tuple[bytes, int]:
    """Return the bytes of a file as written, and the number of its rows; 0 without a checksum."""
    path = folder / name / f"{part}.parquet"
    if not is_file(path):
        raise _again(folder, path, part, "is not a file" if os.path.lexists(path) else "is missing")
    try:
        data = path.read_bytes()
        if identity is None:
            return data, 0
        fault, count = sealed.fault_of_table(data, f"{identity} {name}/{part}.parquet")
    except (OSError, KeyError, ValueError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise _unreadable(folder, path, part, error) from None
    if fault == sealed.ELSEWHERE and name == "runs":
        raise BadInput(f"{path}: {fault}? To remove it: {_remove(path)}")
    if fault:
        raise _again(folder, path, part, fault)
    return data, count


def _with_words_of_now(frame: pl.DataFrame) -> pl.DataFrame:
    """Return a table, possibly of an earlier version, with the present words for outcomes."""
    there = {name: words for name, words in renamed.CELLS.items() if frame.schema.get(name) == pl.String}
    return frame.with_columns(pl.col(name).replace(words) for name, words in there.items())


def with_names_of_now(frame: pl.DataFrame) -> pl.DataFrame:
    """Return a table, possibly of an earlier version, with the present names."""
    named = _with_words_of_now(frame.rename(lambda column: renamed.COLUMNS.get(column, renamed.key_now(column))))
    if named.columns == frame.columns or "requirements" not in named.columns:
        return named
    verdicts = pl.col("requirements").str.replace_many(renamed.VERDICT)
    return named.with_columns(verdicts)


def _table(folder: Path, name: str, part: str, plan: Plan, data: bytes) -> pl.DataFrame:
    """Read one file and check its columns."""
    path = folder / name / f"{part}.parquet"
    try:
        frame = pl.read_parquet(data, hive_partitioning=False, parallel="none")  # small: threads cost more
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise _unreadable(folder, path, part, error) from None
    frame = with_names_of_now(frame)
    expected, columns = table.schema(plan, name), frame.columns
    lacking = [n for n, column in OF[name].columns.items() if column.added and n not in columns]
    if lacking:
        frame = frame.with_columns(pl.lit(None, expected[column]).alias(column) for column in lacking)
    schema = frame.schema
    for column in {**expected, **schema}:
        if schema.get(column) != expected.get(column):
            raise _again(folder, path, part, f"column {column[:60]!r} is not that of this campaign's tables")
    if not all(map(_is_finite, frame)):
        raise _again(folder, path, part, "a number is not finite")
    return frame if frame.columns == list(expected) else frame.select(list(expected))


def _unreadable(folder: Path, path: Path, part: str, error: Exception) -> BadInput:
    return _again(folder, path, part, f"cannot be read ({' '.join(str(error).split())[:120]})")


def _is_finite(column: pl.Series) -> bool:
    """Return True if all numbers of a column are finite; missing ones do not count."""
    return not column.dtype.is_float() or int((~np.isfinite(column.to_numpy())).sum()) == column.null_count()


def _check_runs(folder: Path, parts: list[str], rows: _Rows, plan: Plan) -> None:
    """Raise BadInput unless the runs of each part match its name and the plan, and are in no earlier part."""
    all_numbers, seen = rows.table["run"].to_list(), dict[int, str]()
    sound, start = _is_sound(rows.table), 0
    for i, (part, end) in enumerate(zip(parts, rows.ends, strict=True)):
        path, numbers, start = folder / "runs" / f"{part}.parquet", all_numbers[start:end], end
        if not numbers or None in numbers or part != name_of(numbers):
            raise BadInput(f"{path}: the name does not match its runs; if it is a copy, remove it: {_remove(path)}")
        if not sound and not _is_sound(of_part := rows.part(i)):
            what = "reply times have other bins than this version" if _is_covered(of_part) else _NO_COVERAGE
            raise _again(folder, path, part, what)
        if len(set(numbers)) < len(numbers) or not 0 <= min(numbers) <= max(numbers) < len(plan):
            raise _again(folder, path, part, f"a run is twice there, or not one of the campaign's {len(plan)}")
        for number in numbers:
            if number in seen:
                raise _again(folder, path, part, f"run {number} is also in runs/{seen[number]}.parquet")
            seen[number] = part


def _is_sound(runs: pl.DataFrame) -> bool:
    """Return True if runs have a coverage of flights, and reply times in the bins of this version."""
    replies = map(list, runs["replies"].drop_nulls())
    return _is_covered(runs) and all(len(bins) == BINS and min(bins) >= 0 for bins in replies)


def _is_covered(runs: pl.DataFrame) -> bool:
    return all(map(_is_coverage, runs["coverage"].drop_nulls().unique()))


def _is_coverage(text: str) -> bool:
    """Return True if a text is the ``coverage`` of a run: voter states by signal, counted."""
    try:
        covered = json.loads(text)
    except (ValueError, RecursionError):
        return False
    signals = covered.values() if isinstance(covered, dict) else [None]
    return all(isinstance(s, dict) and all(isinstance(v, list | int) for v in s.values()) for s in signals)


def _agree(name: str, runs: pl.DataFrame, rows: pl.DataFrame) -> bool:
    """Return True if a table has as many rows of every run as ``runs`` counts, in the same part."""
    if name == "episodes":
        unresolved = rows.filter(pl.col("decided_by") == "unresolved").group_by(_PART).len("unresolved")
        counted = runs.group_by(_PART).agg(pl.col("unresolved").sum()).filter(pl.col("unresolved") != 0)
        known = rows.join(runs, on=[_PART, "run"], how="anti").is_empty()
        return known and counted.sort(_PART).rows() == unresolved.sort(_PART).rows()
    if name == "signals":
        of_run = pl.when(pl.col("outcome") == "flown").then(len(SIGNALS)).otherwise(0)
    else:
        of_run = pl.sum_horizontal(_COUNTS[name])
    counted = runs.select(_PART, "run", count=of_run.cast(pl.Int64)).filter(pl.col("count") != 0)
    return counted.sort(_PART, "run").rows() == rows.group_by(_PART, "run").len("count").sort(_PART, "run").rows()


def _name_the_part(folder: Path, name: str, parts: list[str], runs: _Rows, rows: _Rows) -> None:
    """Raise BadInput for the first part whose rows of a table do not match its runs."""
    for i, part in enumerate(parts):
        if not _agree(name, runs.part(i), rows.part(i)):
            path = folder / name / f"{part}.parquet"
            raise _again(folder, path, part, f"the rows do not match the counts of runs/{part}.parquet")


def _again(folder: Path, path: Path, part: str, what: str) -> BadInput:
    """Return the error for a part whose runs must be flown again."""
    runs = folder / "runs" / f"{part}.parquet"
    remove = _remove(runs, *([path] if is_folder(path) and path != runs else []))
    out = shlex.quote(str(folder))
    return BadInput(f"{path}: {what}; to fly its runs again: {remove} && rig campaign run FILE --out {out}")


def _remove(*paths: Path) -> str:
    """Return the command that removes files, or folders in their place."""
    option = "-r " if any(map(is_folder, paths)) else ""
    return f"rm {option}{shlex.join(map(str, paths))}"
