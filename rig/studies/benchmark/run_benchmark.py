"""One league in a folder: calibrate, run the trials on several processes, make the table; it goes on where it stopped.

    league.json                  what decides the result: campaign, managers, budget, healthy flights, trials, seed
    levels.json                  the calibration, transients, and the counts of the second campaign
    units/000000-000000.parquet  trials of a combination, a chunk
    flights/...                  flights of a combination in closed loop
    result.json                  levels, tables, differences and verdict

Each file is written beside and renamed; those that are read again have a checksum.  None depends on the number of
processes, their order or the time it took.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final, Literal

import polars as pl

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import is_file, is_unused, read_bytes, sweep
from rig.core.outputs import LEAGUE
from rig.core.progress import tell
from rig.studies.benchmark import flights
from rig.studies.benchmark.benchmark_trials import STATES, Runner, Told, joined, of_signals, shared_out
from rig.studies.benchmark.calibration import require_time
from rig.studies.benchmark.calibration_data import Healthy, read
from rig.studies.benchmark.entrants import OfSignal, fails_nobody
from rig.studies.benchmark.outcome_table import LOST, by_size, curve, differences, table
from rig.studies.benchmark.prepared import Asked, costs, prepare, told
from rig.studies.benchmark.ranking import verdict
from rig.studies.campaign.campaign_file import from_what
from rig.studies.campaign.folder import difference, locked, write_whole
from rig.studies.campaign.manager_source import sources
from rig.studies.campaign.plan import SOURCES, Plan, rig_identity
from rig.studies.campaign.pool import context, each
from rig.studies.reliability.cell_trials import Batch

FORMAT: Final = 3
UNITS, FLIGHTS = "units", "flights"  # folders
LEVELS: Final = "levels.json"
Where = Literal["units", "flights"]
Work = Callable[[Batch], pl.DataFrame]


def run(plan: Plan, asked: Asked, out: Path, workers: int = 1) -> dict[str, Any]:
    """Run a league into the folder ``out``, or go on with it; return what ``result.json`` holds, and the costs.

    BadInput, nothing written: ``out`` is something else's, or what ``calibrate`` and ``of_signals`` refuse.
    """
    if not (isfinite(asked.budget_per_h) and asked.budget_per_h > 0.0):
        raise BadInput(f"--budget: false isolations an hour and signal, above 0, got {asked.budget_per_h:g}")
    _require_ours(out)
    aircraft, signals = of_signals(plan)
    tell("reading the healthy flights")
    healthy = read(asked.healthy, aircraft, signals)
    require_time(asked.budget_per_h, healthy.hours)
    second = None if asked.second is None else read(asked.second, aircraft, signals, "--second")
    about = _about(plan, asked, healthy, second)
    of = sealed.identity(_json(about))
    begun = _begun(out, about)
    prepared = _levels(out, of) if begun else prepare(asked, signals, healthy, second, workers)
    # What is flown is what the file says: a number that is written and read is the same.
    prepared, units = json.loads(_json(prepared)), shared_out(plan, asked.trials, asked.seed)
    with locked(out, "rig league is writing"):
        _sweep(out)
        write_whole(out / LEAGUE, _json(about))
        write_whole(out / LEVELS, sealed.to_json(prepared, of))
        orders, of = told(asked, prepared), sealed.identity(_json(about), _json(prepared))
        rows = _all(plan, orders, out, UNITS, units, workers, of)
        flown = _all(plan, orders, out, FLIGHTS, flights.shared_out(units, asked.flights), workers, of)
        result = _result(asked, signals, prepared, rows, flown)
        write_whole(out / "result.json", _json(result))
    return {**result, "microseconds": costs(asked, signals, orders, healthy)}


def _about(plan: Plan, asked: Asked, healthy: Healthy, second: Healthy | None) -> dict[str, Any]:
    own = plan.sources | sources(entrant.manager for entrant in asked.entrants)
    return {
        "format": FORMAT,
        "rig": rig_identity(),
        **plan.identity(),
        **({SOURCES: own} if own else {}),
        "managers": [entrant.name for entrant in asked.entrants],
        "budget_per_h": asked.budget_per_h,
        "healthy": {"hours": healthy.hours, "sha256": healthy.sha256},
        "second": None if second is None else {"hours": second.hours, "sha256": second.sha256},
        "trials": asked.trials,
        "flights": asked.flights,
        "seed": asked.seed,
    }


def _require_ours(out: Path) -> None:
    """Raise BadInput unless ``out`` is new, empty, or a league's."""
    if not is_file(out / LEAGUE) and not is_unused(out):
        raise BadInput(f"--out {out}: not a league's folder, and not empty")


def _begun(out: Path, about: dict[str, Any]) -> bool:
    """Return whether the folder holds the levels of the same league.  BadInput: it holds another."""
    path = out / LEAGUE
    if not is_file(path):
        return False
    try:
        was = json.loads(read_bytes(path, sealed.MOST_BYTES).decode())
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: cannot be read: {' '.join(str(error).split())[:120]}") from None
    differs = difference(was if isinstance(was, dict) else {}, json.loads(_json(about)))
    if differs:
        raise BadInput(f"--out {out}: holds another league: {differs[0]}")
    return is_file(out / LEVELS)


def _levels(out: Path, of: str) -> dict[str, Any]:
    path = out / LEVELS
    return sealed.read_json(path, f"remove it, and the same command computes it again: rm {shlex.quote(str(path))}", of)


def _sweep(out: Path) -> None:
    for folder in (out, out / UNITS, out / FLIGHTS):
        sweep(folder)


def _json(data: Any) -> bytes:
    return json.dumps(data, indent=1, allow_nan=False).encode()


def _all(
    plan: Plan, orders: Told, out: Path, where: Where, units: Sequence[Batch], workers: int, of: str
) -> pl.DataFrame:
    """Return the rows of all units, those that are kept read, the others run and kept.

    of : the league's identity, with which its files are marked
    """
    folder = out / where
    if units:
        folder.mkdir(exist_ok=True)
    done = [unit for unit in units if is_file(_path(folder, unit))]
    for unit in done:
        _unit(_path(folder, unit), of)  # one that is damaged is refused before others are run
    todo = [unit for unit in units if unit not in done]
    for unit, rows in zip(todo, _flown(plan, orders, where, todo, workers), strict=True):
        tell("trials" if where == UNITS else where, sum(is_file(_path(folder, of)) for of in units), len(units))
        path = _path(folder, unit)
        write_whole(path, sealed.table(rows, _place(of, path)))
    return joined([_unit(_path(folder, unit), of) for unit in units])


def _path(folder: Path, unit: Batch) -> Path:
    return folder / f"{unit.number:06d}-{unit.chunk:06d}.parquet"


def _place(of: str, path: Path) -> str:
    return f"{of} {path.parent.name}/{path.name}"


def _unit(path: Path, of: str) -> pl.DataFrame:
    remedy = f"remove it, and the same command runs it again: rm {shlex.quote(str(path))}"
    return sealed.read_table(path, _place(of, path), remedy)


def _work(plan: Plan, orders: Told, where: Where) -> Work:
    return Runner(plan, orders) if where == UNITS else flights.Flier(plan, orders)


def _flown(plan: Plan, orders: Told, where: Where, units: Sequence[Batch], workers: int) -> Iterator[pl.DataFrame]:
    """Return the units' rows in their order, by ``workers`` processes or, for one, by this."""
    if workers == 1 or len(units) < 2:
        return map(_work(plan, orders, where), units)
    initargs = (plan.campaign.what(), plan.source, orders, where)
    begin = {"initializer": _begin, "initargs": initargs, "mp_context": context()}
    return each(_fly, units, workers, **begin)


def _begin(what: dict[str, Any], source: str, orders: Told, where: Where) -> None:
    """Begin a worker."""
    global _runner
    _runner = _work(Plan(from_what(what, source), source), orders, where)


_runner: Work | None = None  # of a worker


def _fly(unit: Batch) -> pl.DataFrame:
    assert _runner is not None
    return _runner(unit)


def _result(
    asked: Asked, signals: Sequence[OfSignal], prepared: dict[str, Any], rows: pl.DataFrame, flown: pl.DataFrame
) -> dict[str, Any]:
    silent = [entrant.name for entrant in asked.entrants if all(fails_nobody(entrant, each) for each in signals)]
    as_flown = pl.col("reference") == STATES[0]
    at_budget = rows.filter(pl.col("budget_per_h") == asked.budget_per_h)
    found = {
        "table": table(at_budget),
        "differences": differences(at_budget),
        "by_size": by_size(at_budget.filter(as_flown)),
        "curve": curve(rows.filter(as_flown)),
        "flights": table(flown) if len(flown) else [],
        "flight_differences": differences(flown) if len(flown) else [],
        "lost_differences": differences(flown, LOST) if len(flown) else [],
    }
    told = {"budget_per_h": asked.budget_per_h, **prepared, "silent": silent, **found}
    return {**told, "verdict": verdict(told)}
