"""One league in a folder: calibrate, run the trials on several processes, make the table; it goes on where it stopped.

    league.json                  what decides the result: campaign, managers, budget, healthy flights, trials, seed
    levels.json                  the calibration, and the counts of the second campaign
    units/000000-000000.parquet  trials of a combination, a chunk
    result.json                  levels, table, differences and verdict

Each file is written beside and renamed.  None depends on the number of processes, their order or the time it took.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import polars as pl

from rig.campaign.config import from_what
from rig.campaign.folder import difference, locked, write_whole
from rig.campaign.plan import Plan, rig_identity
from rig.campaign.pool import context, each, leave_interrupts_to_parent
from rig.campaign.statistics import poisson
from rig.errors import BadInput
from rig.league.calibration import Calibrated, calibrate, isolations, require_time
from rig.league.entrants import Entrant, OfSignal, fails_nobody, manager
from rig.league.healthy import Flight, Healthy, read
from rig.league.outcomes import differences, table
from rig.league.trials import Runner, Told, joined, of_signals, shared_out
from rig.league.verdict import verdict
from rig.reliability.trials import Batch
from rig.thresholds.monitored import failures
from rig.util.files import DRAFT, is_file, reported
from rig.util.outputs import LEAGUE
from rig.util.progress import tell

FORMAT: Final = 1
_TIMES: Final = 3  # that a cost is measured, of which the least counts


@dataclass(frozen=True, slots=True)
class Asked:
    """What a league is asked for."""

    entrants: list[Entrant]
    budget_per_h: float
    healthy: Path
    second: Path | None = None
    trials: int = 500  # of each combination
    seed: int = 0


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
    begun = _begun(out, about)
    calibrated = _read(out / "levels.json") if begun else _calibration(asked, signals, healthy, second, workers)
    with locked(out, "rig league is writing"):
        _sweep(out)
        write_whole(out / LEAGUE, _json(about))
        write_whole(out / "levels.json", _json(calibrated))
        rows = _trials(plan, asked, _told(asked, calibrated), out, workers)
        result = _result(asked, signals, calibrated, rows)
        write_whole(out / "result.json", _json(result))
    return {**result, "microseconds": _costs(asked, signals, _told(asked, calibrated), healthy)}


def _about(plan: Plan, asked: Asked, healthy: Healthy, second: Healthy | None) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "rig": rig_identity(),
        **plan.identity(),
        "managers": [entrant.name for entrant in asked.entrants],
        "budget_per_h": asked.budget_per_h,
        "healthy": {"hours": healthy.hours, "sha256": healthy.sha256},
        "second": None if second is None else {"hours": second.hours, "sha256": second.sha256},
        "trials": asked.trials,
        "seed": asked.seed,
    }


def _require_ours(out: Path) -> None:
    """Raise BadInput unless ``out`` is new, empty, or a league's."""
    with reported(f"--out {out}", BadInput, "cannot be read"):
        others = [] if not out.is_dir() else [path for path in out.iterdir() if path.name != "lock"]
        if (out.exists() and not out.is_dir()) or (others and not is_file(out / LEAGUE)):
            raise BadInput(f"--out {out}: is no league's folder, and not empty")


def _begun(out: Path, about: dict[str, Any]) -> bool:
    """Return whether the folder holds the levels of the same league.  BadInput: it holds another."""
    if not is_file(out / LEAGUE):
        return False
    differs = difference(_read(out / LEAGUE), json.loads(_json(about)))
    if differs:
        raise BadInput(f"--out {out}: holds another league: {differs[0]}")
    return is_file(out / "levels.json")


def _sweep(out: Path) -> None:
    for path in (*out.glob(f".*{DRAFT}"), *(out / "units").glob(f".*{DRAFT}")):
        path.unlink()


def _read(path: Path) -> dict[str, Any]:
    with reported(path, BadInput, "cannot be read"):
        return dict(json.loads(path.read_text(encoding="utf-8")))


def _json(data: Any) -> bytes:
    return json.dumps(data, indent=1, allow_nan=False).encode()


def _calibration(
    asked: Asked, signals: Sequence[OfSignal], healthy: Healthy, second: Healthy | None, workers: int
) -> dict[str, Any]:
    """Return what ``levels.json`` holds."""
    pairs = [(entrant, signal) for signal in signals for entrant in asked.entrants]
    with ThreadPoolExecutor(workers) as pool:
        work = [pool.submit(calibrate, *pair, healthy, asked.budget_per_h) for pair in pairs]
        found: list[Calibrated] = []
        for (entrant, signal), future in zip(pairs, work, strict=True):
            try:
                found.append(future.result())
            except BadInput:
                pool.shutdown(cancel_futures=True)
                raise
            tell(f"calibrated {entrant.name}, {signal.name}", len(found) - 1, len(pairs))
    counts: list[dict[str, Any]] = []
    if second is not None:
        told = {(each.entrant, each.signal): each for each in found}
        counts = [_count(*pair, told, second, asked.budget_per_h) for pair in pairs if not fails_nobody(*pair)]
    return {"hours": healthy.hours, "levels": [asdict(each) for each in found], "second": counts}


def _count(
    entrant: Entrant,
    signal: OfSignal,
    told: dict[tuple[str, str], Calibrated],
    second: Healthy,
    budget_per_h: float,
) -> dict[str, Any]:
    """Return the false isolations in the second campaign beside what the budget allows, with an interval an hour."""
    values = told[entrant.name, signal.name].values
    counted = isolations(entrant, signal, values, second.flights[signal.name])
    rate = poisson(counted, second.hours)
    return {
        "entrant": entrant.name,
        "signal": signal.name,
        "counted": counted,
        "hours": second.hours,
        "expected": budget_per_h * second.hours,
        "low_per_h": rate.low,
        "high_per_h": rate.high,
    }


def _told(asked: Asked, calibrated: dict[str, Any]) -> Told:
    found = (Calibrated(**each) for each in calibrated["levels"])
    return Told(asked.entrants, {(each.entrant, each.signal): each for each in found})


def _trials(plan: Plan, asked: Asked, told: Told, out: Path, workers: int) -> pl.DataFrame:
    """Run the units that are not there yet; return the rows of all."""
    units = shared_out(plan, asked.trials, asked.seed)
    todo = [unit for unit in units if not is_file(_path(out, unit))]
    for unit, rows in zip(todo, _flown(plan, told, todo, workers), strict=True):
        tell("trials", sum(is_file(_path(out, each)) for each in units), len(units))
        memory = io.BytesIO()
        rows.write_parquet(memory)
        write_whole(_path(out, unit), memory.getvalue())
    return joined([_unit(_path(out, unit)) for unit in units])


def _path(out: Path, unit: Batch) -> Path:
    return out / "units" / f"{unit.number:06d}-{unit.chunk:06d}.parquet"


def _unit(path: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(path.read_bytes())
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = " ".join(str(error).split())[:120]
        raise BadInput(f"{path}: cannot be read ({reason}): remove it, and the same command runs it again") from None


def _flown(plan: Plan, told: Told, units: Sequence[Batch], workers: int) -> Iterator[pl.DataFrame]:
    """Return the units' rows in their order, by ``workers`` processes or, for one, by this."""
    if workers == 1 or len(units) < 2:
        return map(Runner(plan, told), units)
    begin = {"initializer": _begin, "initargs": (plan.campaign.what(), plan.source, told), "mp_context": context()}
    return each(_fly, units, workers, **begin)


def _begin(what: dict[str, Any], source: str, told: Told) -> None:
    """Begin a worker; Ctrl-C is its parent's."""
    global _runner
    leave_interrupts_to_parent()
    _runner = Runner(Plan(from_what(what, source), source), told)


_runner: Callable[[Batch], pl.DataFrame] | None = None  # of a worker


def _fly(unit: Batch) -> pl.DataFrame:
    assert _runner is not None
    return _runner(unit)


def _result(
    asked: Asked, signals: Sequence[OfSignal], calibrated: dict[str, Any], rows: pl.DataFrame
) -> dict[str, Any]:
    silent = [entrant.name for entrant in asked.entrants if all(fails_nobody(entrant, each) for each in signals)]
    found, apart = table(rows), differences(rows)
    return {
        "budget_per_h": asked.budget_per_h,
        **calibrated,
        "silent": silent,
        "table": found,
        "differences": apart,
        "verdict": verdict(found, apart, calibrated["second"], silent),
    }


def _costs(asked: Asked, signals: Sequence[OfSignal], told: Told, healthy: Healthy) -> dict[str, float]:
    """Return microseconds a signal and frame of each entrant, here; no part of the folder."""
    signal = signals[0]
    flight = healthy.flights[signal.name][0]
    return {
        entrant.name: _cost(flight, entrant, signal, told.calibrated[entrant.name, signal.name].values)
        for entrant in asked.entrants
    }


def _cost(flight: Flight, entrant: Entrant, signal: OfSignal, values: dict[str, float]) -> float:
    seconds: list[float] = []
    for _ in range(_TIMES + 1):  # the first warms up
        began = perf_counter()
        failures(flight.samples, flight.references, manager(entrant, signal, values))
        seconds.append(perf_counter() - began)
    return 1e6 * min(seconds[1:]) / len(flight.samples)
