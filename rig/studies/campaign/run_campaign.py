"""Fly a campaign: hand out the missing runs, write each batch when it returns.

A worker that stops costs only time: its runs are flown again, alone (worker.py).  Ctrl-C, SIGTERM and SIGHUP wait for
the running batches; a second Ctrl-C abandons them.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core.errors import BadInput, RigError
from rig.core.interrupt import FLIES_AGAIN, GOES_ON, Stop, interruptible
from rig.flight.fly import Flight, fly
from rig.studies.campaign import tables as table
from rig.studies.campaign.campaign_file import is_logs
from rig.studies.campaign.folder import NOT_FLOWN, Folder, not_flown
from rig.studies.campaign.plan import SOURCES, Plan, Run, rig_identity
from rig.studies.campaign.pool import Cluster, Local, Pool
from rig.studies.campaign.tables import Rows
from rig.studies.campaign.until import Until, keep, stand
from rig.studies.campaign.worker import Orders, check_rig, fly_alone, fly_batch
from rig.unit.unit_file import Unit
from rig.verdict.of_log import FlightConclusion

AHEAD: Final = 2  # batches handed out for each worker: one it flies, one that waits
PATIENCE: Final = 10  # workers that may stop in a row without a single finished batch

Batch = Callable[[Sequence[Run], Orders], Rows]
Task = tuple[Batch, list[int]]


@dataclass
class Progress:
    """The progress of a campaign."""

    runs: int
    done: int
    flown: int = 0  # in this call
    not_flown: int = 0  # in this call: they could not be
    outcomes: Counter[str] = field(default_factory=Counter)  # of this call's runs, and of them the lost aircraft
    began: float = field(default_factory=time.perf_counter)

    @property
    def flights_per_s(self) -> float:
        """Return the rate of this call."""
        return self.flown / max(time.perf_counter() - self.began, 1e-9)

    @property
    def told_per_s(self) -> float:
        """Return the rate of this call, including runs that could not be flown."""
        return (self.flown + self.not_flown) / max(time.perf_counter() - self.began, 1e-9)

    def count(self, runs: list[dict[str, Any]]) -> None:
        """Count the runs of a batch."""
        flown = sum(run["outcome"] == "flown" for run in runs)
        self.done += flown
        self.flown += flown
        self.not_flown += len(runs) - flown
        self.outcomes.update(run["outcome"] for run in runs)
        self.outcomes["lost"] += sum(run.get("survived") is False for run in runs)


Report = Callable[[Progress], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """The end of a call that flies many runs."""

    interrupted: bool = False
    signal: int = 0  # the signal that interrupted it
    not_flown: int = 0  # of all runs in the tables, and why the first was not
    first_reason: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Result(Ending):
    """The outcome of a call of ``run``."""

    out: Path
    runs: int
    done: int  # of these runs: those that were flown, now or before
    flown: int
    outcomes: dict[str, int]  # of all runs in the tables
    table_sha256: str
    flights_per_s: float
    wall_s: float
    until: dict[str, Any] | None = None  # the proportion that stops it, and where it stands

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, as ``rig campaign run --json`` prints it."""
        return {
            "out": str(self.out),
            **{name: getattr(self, name) for name in ("runs", "done")},
            "not_flown": self.not_flown,
            **{name.replace(" ", "_"): self.outcomes.get(name, 0) for name in NOT_FLOWN},
            "first_reason": self.first_reason,
            "table_sha256": self.table_sha256,
            "flown_now": self.flown,
            **{name: getattr(self, name) for name in ("flights_per_s", "wall_s", "interrupted")},
            **({} if self.until is None else {"until": self.until}),
        }


def run(
    plan: Plan,
    out: Path,
    *,
    runs: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    logs: str | None = None,
    report: Report | None = None,
    unit: Unit | None = None,
    until: Until | None = None,
) -> Result:
    """Fly the runs of ``plan`` (the first ``runs`` of them) that ``out`` does not hold yet.

    workers, logs : instead of the campaign file's; scheduler : the address of a Dask scheduler
    unit : under test; each worker has its own
    until : stop when the proportion is known
    Runs that could not be flown before are flown again.
    BadInput before anything is written; RigError: the disk is full, or workers keep stopping.
    """
    count = plan.count(runs)
    if logs is not None and not is_logs(logs):
        raise BadInput(f"--logs: must be all, failures, none or sample:N, got {logs!r}")
    pool = pool_of(plan, workers, scheduler, unit)  # first: workers get ready during the checks
    kill = True
    try:
        plan.check()
        folder = Folder.of(out, plan, unit)
        orders = orders_of(folder, logs)
        pool.everywhere(check_rig, orders)
        with folder.held(), interruptible(again=True) as stop:
            done = folder.take_out(count)
            keep(until, folder)
            progress = Progress(count, sum(number in done for number in range(count)))
            try:
                state = Flying(plan, pool, folder, orders, progress).fly_until(until, done, stop, report)
            except BadInput as error:
                raise BadInput(f"{error}; {progress.done} of {count} runs done") from None
            except RigError as error:
                raise RigError(f"{error}; {progress.done} of {count} runs done, {GOES_ON}") from None
            kill = stop.insisted
            return _result(folder, count, progress, done, stop, state)
    finally:
        pool.close(kill)


def pool_of(plan: Plan, workers: int | None, scheduler: str | None, unit: Unit | None = None) -> Pool:
    """Return the pool that flies batches; ``workers`` instead of the campaign file's.  BadInput as ``run``."""
    if scheduler is not None:
        return Cluster(scheduler)
    return Local(workers_of(unit, workers) or plan.campaign.run.workers)


def orders_of(folder: Folder, logs: str | None = None) -> Orders:
    """Return how the flights of a folder are flown; ``logs`` instead of the campaign file's."""
    plan, unit, how = folder.plan, folder.unit, folder.plan.campaign.run
    return Orders(
        logs=logs or how.logs,
        runs=len(plan),
        folder=str(folder.logs.absolute()),
        timeout_s=how.timeout_s,
        baseline=plan.campaign.baseline,
        rig=rig_identity(),
        unit=unit,
        unit_build="" if unit is None else unit.build(),
        requirements=plan.requirements,
        sources=plan.identity().get(SOURCES, {}),
    )


def workers_of(unit: Unit | None, workers: int | None) -> int | None:
    """Return how many workers may fly: only one with a unit at an address.

    BadInput: more are asked for, or the unit is a class, which a campaign does not allow.
    """
    if unit is None:
        return workers
    if unit.is_manager:
        raise BadInput(f"{unit.source}: a campaign needs a class as --set redundancy.manager={unit.manager}")
    if unit.address is None:
        return workers
    if workers is not None and workers > 1:
        raise BadInput(f"--workers {workers}: must be 1; the unit at {unit.address} flies one flight at a time")
    return 1


def again(folder: Folder, number: int, out: Path, unit: Unit | None = None) -> tuple[Flight, str | None]:
    """Fly a run again, alone, with its full log in ``out``; return its digest from the table, if there is one."""
    if number >= len(folder.plan):
        raise BadInput(f"--run {number}: must be from 0 to {len(folder.plan) - 1}")
    folder.require(unit)
    row = folder.tables["runs"].filter(pl.col("run") == number)
    flight = fly(folder.plan[number].scenario(), out=out, unit=unit, outcome=FlightConclusion())
    return flight, row["digest"][0] if len(row) else None


@dataclass
class Flying:
    """The batches in a pool."""

    plan: Plan
    pool: Pool
    folder: Folder
    orders: Orders
    progress: Progress
    out: dict[Future[Rows], list[int]] = field(default_factory=dict)  # handed out
    deaths: int = 0  # of workers, since a batch last came in
    batch: Batch = fly_batch

    def fly(self, missing: Sequence[int], size: int, stop: Stop, report: Report | None) -> None:
        """Hand out and collect batches until none waits; after a stop until none runs, or at once."""
        waiting: deque[Task] = deque(
            (self.batch, list(missing[first : first + size])) for first in range(0, len(missing), size)
        )
        while (self.out or (waiting and not stop.requested)) and not stop.insisted:
            if stop.requested:
                self.out = {future: numbers for future, numbers in self.out.items() if not future.cancel()}
            else:
                self._hand_out(waiting)
            lost = self._take_in()
            if lost:
                self.deaths += 1
                if self.deaths > PATIENCE:
                    raise RigError("workers keep stopping before a batch is finished")
                if not stop.requested:
                    self.pool.renew(stop)
                waiting.extendleft((fly_alone, numbers) for numbers in reversed(lost))
            if report is not None:
                report(self.progress)

    def fly_until(
        self, until: Until | None, done: set[int], stop: Stop, report: Report | None
    ) -> dict[str, Any] | None:
        """Fly the runs that are not ``done``, with ``until`` from look to look; return where it stands at the last."""
        size, total = self.plan.campaign.run.batch, self.progress.runs
        if until is None:
            self.fly([number for number in range(total) if number not in done], size, stop, report)
            return None
        while True:
            tables = self.folder.read()
            state, there = stand(until, self.folder, tables), set(tables["runs"]["run"].to_list())
            if stop.requested or state["finished"]:
                return state
            missing = [number for number in range(state["flights"]) if number not in there]
            self.fly(missing, min(size, ceil(len(missing) / self.pool.size)), stop, report)

    def _hand_out(self, waiting: deque[Task]) -> None:
        while waiting and len(self.out) < AHEAD * self.pool.size:
            function, numbers = waiting.popleft()
            runs = [self.plan[number] for number in numbers]
            self.out[self.pool.submit(function, runs, self.orders)] = numbers

    def _take_in(self) -> list[list[int]]:
        """Write the finished batches; return the runs of the batches that are lost with their worker."""
        came = wait(self.out, timeout=0.5, return_when=FIRST_COMPLETED).done
        if self.pool.breaks and any(isinstance(future.exception(), self.pool.lost) for future in came):
            came = wait(self.out).done  # none of the others will be flown either
        lost = []
        for future in came:
            numbers = self.out.pop(future)
            try:
                rows = future.result()
            except self.pool.lost:
                lost.append(numbers)
            except RigError:
                raise
            except Exception as error:
                text = " ".join(str(error).split())
                raise RigError(f"a worker failed: {type(error).__name__}: {text}") from error
            else:
                self.folder.write(rows)
                self.progress.count(rows["runs"])
                self.deaths = 0
        return lost


def _result(
    folder: Folder, count: int, progress: Progress, before: set[int], stop: Stop, state: dict[str, Any] | None
) -> Result:
    """Return the outcome of the call, from the tables on the disk. RigError: a flown run is no longer in them."""
    try:
        tables = folder.tables
    except BadInput as error:
        raise RigError(str(error)) from None
    runs = tables["runs"]
    told = len(before) + progress.flown + progress.not_flown
    lost = told - len(runs)
    if lost:
        text = f"{lost} of {told} runs that were flown are no longer in the tables"
        raise RigError(f"{folder.path}: {text}; {FLIES_AGAIN}")
    known = state is not None and state["known"]
    return Result(
        out=folder.path,
        runs=count,
        done=progress.done,
        flown=progress.flown,
        outcomes=dict(Counter(runs["outcome"].to_list())),
        **not_flown(runs),
        table_sha256=table.sha256(tables),
        flights_per_s=progress.flights_per_s,
        wall_s=time.perf_counter() - progress.began,
        interrupted=stop.requested and not known and progress.done + progress.not_flown < count,
        signal=stop.signal,
        until=state,
    )
