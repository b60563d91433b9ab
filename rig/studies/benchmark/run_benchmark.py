"""One benchmark in a folder: calibrate, run the trials on several processes, make the table; resume where it stopped.

    benchmark.json               all that decides the result: campaign, managers, rate, healthy flights, trials, seed
    levels.json                  the calibration, the transients, and the counts of the second campaign
    units/000000-000000.parquet  trials of a combination, a chunk
    flights/...                  flights of a combination in closed loop
    result.json                  levels, tables, differences and verdict

Each file is written under another name and renamed.  Files that are read again have a checksum.  No file depends on the
number of processes, their order or the time they took.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import is_file, read_bytes, sweep
from rig.core.outputs import BENCHMARK
from rig.core.progress import tell
from rig.studies.benchmark import flights
from rig.studies.benchmark.benchmark_trials import STATES, Runner, joined, of_signals, shared_out
from rig.studies.benchmark.calibration import require_time
from rig.studies.benchmark.calibration_data import Healthy, read
from rig.studies.benchmark.entrants import OfSignal, isolates_no_channel
from rig.studies.benchmark.outcome_table import LOST, by_size, curve, differences, table
from rig.studies.benchmark.prepared import Asked, costs, prepare, told
from rig.studies.benchmark.ranking import losses, verdict
from rig.studies.campaign.manager_source import sources
from rig.studies.campaign.plan import SOURCES, Plan, rig_identity
from rig.studies.campaign.pool import by_workers
from rig.studies.campaign.study_folder import Study, write_whole
from rig.studies.reliability.cell_trials import Batch

FORMAT: Final = 4
UNITS, FLIGHTS = "units", "flights"  # folders
LEVELS: Final = "levels.json"
_AGAIN: Final = "remove it, and the same command"


class _BenchmarkFolder(Study):
    """Its mark has no checksum: all of it is compared."""

    def read(self, out: Path, name: str = "") -> dict[str, Any]:
        """Return the options that a folder was made with.  BadInput: they cannot be read."""
        path = out / self.mark
        try:
            was = json.loads(read_bytes(path, sealed.MOST_BYTES).decode())
        except (ValueError, RecursionError) as error:
            raise BadInput(f"{path}: cannot be read: {' '.join(str(error).split())[:120]}") from None
        return was if isinstance(was, dict) else {}

    def written(self, about: dict[str, Any]) -> bytes:
        """Return the content of ``benchmark.json``."""
        return _json(about)


STUDY: Final = _BenchmarkFolder(BENCHMARK, "a benchmark's folder", "another benchmark", "rig benchmark is writing")


def run(plan: Plan, asked: Asked, out: Path, workers: int = 1) -> dict[str, Any]:
    """Run a benchmark into the folder ``out``, or resume it; return the content of ``result.json`` and the costs.

    BadInput, nothing written: ``out`` is not of this benchmark, or ``calibrate`` or ``of_signals`` refuses.
    """
    if not (isfinite(asked.budget_per_h) and asked.budget_per_h > 0.0):
        raise BadInput(f"--budget: {asked.budget_per_h:g} false isolations an hour; must be a number above 0")
    STUDY.require(out)
    aircraft, signals = of_signals(plan)
    tell("reading the healthy flights")
    healthy = read(asked.healthy, aircraft, signals)
    require_time(asked.budget_per_h, healthy.hours)
    second = None if asked.second is None else read(asked.second, aircraft, signals, "--second")
    if second is not None and second.sha256 == healthy.sha256:
        raise BadInput(f"--second: {asked.second}: the flights of --healthy; give others, of another seed")
    about = json.loads(_json(_about(plan, asked, healthy, second)))
    STUDY.require(out, about)
    of, levels = sealed.identity(_json(about)), out / LEVELS
    if STUDY.is_begun(out) and is_file(levels):
        prepared = sealed.read_json(levels, f"{_AGAIN} computes it again: {_remove(levels)}", of)
    else:
        prepared = prepare(asked, signals, healthy, second, workers)
    # What is flown is what the file says: a number that is written and read is the same.
    prepared, units = json.loads(_json(prepared)), shared_out(plan, asked.trials, asked.seed)
    orders = told(asked, prepared)
    with STUDY.held(out, about):
        for folder in (out / UNITS, out / FLIGHTS):
            sweep(folder)
        write_whole(levels, sealed.to_json(prepared, of))
        of = sealed.identity(_json(about), _json(prepared))
        rows = _all("trials", units, out / UNITS, of, Runner, (plan, orders), workers)
        flying = flights.shared_out(units, asked.flights)
        flown = _all(FLIGHTS, flying, out / FLIGHTS, of, flights.Flier, (plan, orders), workers)
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


def _json(data: Any) -> bytes:
    return json.dumps(data, indent=1, allow_nan=False).encode()


def _all(
    what: str,
    units: Sequence[Batch],
    folder: Path,
    of: str,
    worker: Callable[..., Callable[[Batch], pl.DataFrame]],
    about: tuple[Any, ...],
    workers: int,
) -> pl.DataFrame:
    """Return the rows of all units: those in ``folder`` are read, the others are run and kept there.

    of : the benchmark's identity, which marks its files;  worker, about : as for ``pool.by_workers``
    """
    if units:
        folder.mkdir(exist_ok=True)
    paths = {unit: folder / f"{unit.number:06d}-{unit.chunk:06d}.parquet" for unit in units}

    def kept(unit: Batch) -> pl.DataFrame:
        path = paths[unit]
        return sealed.read_table(path, place(path), f"{_AGAIN} runs it again: {_remove(path)}")

    def place(path: Path) -> str:
        return f"{of} {folder.name}/{path.name}"

    done = [unit for unit in units if is_file(paths[unit])]
    for unit in done:
        kept(unit)  # one that is damaged is refused before others are run
    todo = [unit for unit in units if unit not in done]
    for i, rows in enumerate(by_workers(worker, about, todo, workers)):
        tell(what, len(done) + i, len(units))
        write_whole(paths[todo[i]], sealed.table(rows, place(paths[todo[i]])))
    return joined([kept(unit) for unit in units])


def _remove(path: Path) -> str:
    return f"rm {shlex.quote(str(path))}"


def _result(
    asked: Asked, signals: Sequence[OfSignal], prepared: dict[str, Any], rows: pl.DataFrame, flown: pl.DataFrame
) -> dict[str, Any]:
    silent = [entrant.name for entrant in asked.entrants if all(isolates_no_channel(entrant, each) for each in signals)]
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
    return {**told, "losses": losses(told), "verdict": verdict(told)}
