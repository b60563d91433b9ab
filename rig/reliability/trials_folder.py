"""A folder of open-loop trials: what they were drawn from, and what they came to.

trials.json               campaign, seed, number, manager, versions; written last: without it there is nothing
cells.parquet             cells.COUNTS
false_isolations.parquet  cells.FALSE_ISOLATIONS
"""

from __future__ import annotations

import hashlib
import io
import json
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.campaign.config import from_what
from rig.campaign.identity import rig_identity
from rig.campaign.plan import Plan
from rig.errors import BadInput, RigError
from rig.reliability.cells import ABOUT, COUNTS, FALSE_ISOLATIONS, Cells
from rig.reliability.trials import Flight, Tally, Unit, added_up, shared_out
from rig.util.files import is_file, replaced

_FORMAT: Final = 1
_TABLES: Final = {"cells": COUNTS, "false_isolations": FALSE_ISOLATIONS}
Report = Callable[[int, int], None]  # trials done, of how many


def fly_trials(
    plan: Plan, out: Path, runs: int, seed: int, workers: int, good: list[int], report: Report | None = None
) -> dict[str, Any]:
    """Run trials and write their folder, whole or not at all; what ``trials.json`` says of them.

    BadInput before the first trial; RigError: the disk.
    """
    _new(out)
    units = shared_out(plan, runs, seed, good)
    manager = plan[units[0].number].scenario().redundancy.manager
    count, done, tallies = sum(unit.trials for unit in units), 0, []
    for unit, tally in zip(units, _tallies(plan, units, workers), strict=True):
        tallies.append(tally)
        done += unit.trials
        if report is not None:
            report(done, count)
    found = added_up(tallies, manager)
    about = {"format": _FORMAT, **_identity(plan, seed), "manager": manager, "trials": count, "good_before": good}
    _write(out, found, about)
    return about


def _tallies(plan: Plan, units: Sequence[Unit], workers: int) -> Iterator[Tally]:
    """Yield the units' tallies in their order, by ``workers`` processes or, for one, by this; Ctrl-C ends it."""
    if workers == 1:
        yield from map(Flight(plan), units)
        return
    given = plan.campaign.what(), plan.source
    with ProcessPoolExecutor(workers, initializer=_begin, initargs=given) as pool:
        try:
            yield from pool.map(_fly, units, chunksize=4)
        finally:
            pool.shutdown(cancel_futures=True)


def _begin(what: dict[str, Any], source: str) -> None:
    """Begin a worker; of Ctrl-C its parent is told."""
    global _flight
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _flight = Flight(Plan(from_what(what, source), source))


_flight: Callable[[Unit], Tally] | None = None  # of a worker


def _fly(unit: Unit) -> Tally:
    assert _flight is not None
    return _flight(unit)


def _identity(plan: Plan, seed: int) -> dict[str, Any]:
    what = json.dumps(plan.identity(), sort_keys=True).encode()
    return {"campaign": plan.campaign.title, "campaign_sha256": hashlib.sha256(what).hexdigest(), "seed": seed,
            "rig": rig_identity()}  # fmt: skip


def _new(out: Path) -> None:
    """Raise BadInput unless a folder can be made at ``out``: nothing there, or an empty folder."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(f"--out {out}: is there already, and not empty")


def _write(out: Path, found: Cells, about: dict[str, Any]) -> None:
    """Write tables first, ``trials.json`` last."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, table in zip(_TABLES, (found.counts, found.false_isolations), strict=True):
            memory = io.BytesIO()
            table.write_parquet(memory)
            with replaced(out / f"{name}.parquet") as draft:
                draft.write_bytes(memory.getvalue())
        with replaced(out / ABOUT) as draft:
            draft.write_text(json.dumps(about, indent=1), encoding="utf-8")
    except OSError as error:
        raise RigError(f"--out {out}: cannot be written: {error.strerror}") from None


def read_trials(folder: Path) -> Cells:
    """Return the cells of a folder of trials.  BadInput names the file that is damaged or missing."""
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise BadInput(f"{folder / ABOUT}: cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(about, dict) or about.get("format") != _FORMAT or not isinstance(about.get("manager"), str):
        raise BadInput(f"{folder / ABOUT}: is damaged, or not of this version of the rig")
    return Cells(about["manager"], *(_table(folder / f"{name}.parquet", columns) for name, columns in _TABLES.items()))


def _table(path: Path, columns: dict[str, Any]) -> pl.DataFrame:
    if not is_file(path):
        raise BadInput(f"{path}: is missing; the trials are run again into another folder")
    try:
        table = pl.read_parquet(path.read_bytes(), hive_partitioning=False)
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise BadInput(f"{path}: cannot be read ({' '.join(str(error).split())[:120]})") from None
    if dict(table.schema) != {name: kind() if isinstance(kind, type) else kind for name, kind in columns.items()}:
        raise BadInput(f"{path}: its columns are not those of trials")
    return table
