"""A worker of a campaign: it flies runs one after the other, and suspects in a separate process.

A row does not depend on the worker: the run's scenario decides it, and a worker keeps only the tables of an aircraft,
compiled kernels and a unit under test from one flight to the next.

A suspect is a run of a batch whose worker stopped.  A child process flies the batch again and reports after every
flight.  If it stops, its present run is flown once more, alone.  If the process stops again, the run is recorded as
crashed, or as timed out.
"""

from __future__ import annotations

import faulthandler
import gc
import io
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path
from typing import IO, Any, Final

from rig.core.errors import BadInput, RigError, UnitDead, UnitRefused
from rig.core.interrupt import Terminated, signal_name
from rig.scenario import aircraft
from rig.scenario.scenario import load
from rig.studies.campaign.flying import fly, write_log
from rig.studies.campaign.manager_source import first_sources
from rig.studies.campaign.plan import Run, rig_identity
from rig.studies.campaign.pool import leave_interrupts_to_parent
from rig.studies.campaign.tables import TABLES, Rows, rows
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_facts import voted_by
from rig.unit.unit_file import Unit
from rig.verdict.requirements.measure import check_rows
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.scoring import score
from rig.verdict.transients import fly_baseline

READY: Final = "ready"
_CHILD: Final = "from rig.studies.campaign.worker import fly_for_parent; fly_for_parent()"
_tables = cache(aircraft.tables)  # of an aircraft, read once by each worker
_running: dict[str, UnitUnderTest] = {}  # units of this process
_ends: list[Finalize] = []  # what ends them with it
_one_at_a_time = threading.Lock()  # a cluster's worker may have several threads; JSBSim and the timer are the process's


@dataclass(frozen=True, slots=True)
class Orders:
    """The orders of every worker: the logs to keep, their folder, and the time limit of a flight."""

    logs: str  # all, failures, none, or sample:N
    runs: int  # of the campaign, for the sample
    folder: str  # of the logs
    timeout_s: float
    baseline: bool
    rig: str  # sources and packages that fly; a worker with others refuses
    unit: Unit | None = None  # under test, and its build
    unit_build: str = ""
    requirements: tuple[Requirement, ...] = ()
    sources: Mapping[str, dict[str, str]] = field(default_factory=dict)  # of managers of the user's own, by file

    def voter(self, manager: str) -> str:
        """Return the voter of flights with this manager: the manager, or the unit under test and its build."""
        return voted_by(manager, None if self.unit is None else {**self.unit.settings(), "sha256": self.unit_build})


def fly_batch(runs: Sequence[Run], orders: Orders) -> Rows:
    """Fly runs one after the other; return their rows by table.

    RigError: this is another version of rig.  BadInput: a file of the unit has changed; the rows may be of both.
    """
    check_rig(orders)
    with _one_at_a_time:
        flown = _joined([fly_run(run, orders) for run in runs])
    _check_unit(orders)
    return flown


def _joined(parts: Sequence[Rows]) -> Rows:
    return {table: [row for rows in parts for row in rows[table]] for table in TABLES}


def check_rig(orders: Orders) -> None:
    """Raise RigError if this worker has another rig or manager of the user than the campaign; BadInput: a unit."""
    if rig_identity() != orders.rig:
        raise RigError("a worker has another version of rig than this command; install the same version everywhere")
    _check_unit(orders)
    for manager, files in orders.sources.items():
        try:
            here = first_sources(manager)
        except BadInput as error:
            raise RigError(f"a worker cannot fly it: {error}; start the workers in a folder with the manager") from None
        for name in sorted(name for name in {*files, *here} if files.get(name) != here.get(name)):
            what = f"another {name} of {manager!r} than this command"
            raise RigError(f"a worker has {what}; install the same everywhere, and start the workers again")


def _check_unit(orders: Orders) -> None:
    """Raise BadInput if a file of the unit is not the one that the command has read."""
    if orders.unit is not None:
        orders.unit.require_unchanged()


def fly_run(run: Run, orders: Orders) -> Rows:
    """Fly, score and perhaps log one run; return its rows by table. An exception in the flight is its outcome."""
    warm()
    began = time.perf_counter()
    try:
        with _limit(orders.timeout_s), flown_with(orders.unit) as tested:
            flight = fly(run.scenario(_tables(run.aircraft)), tested)
            baseline = fly_baseline(flight.scenario, unit=tested) if orders.baseline else None
            lane, by_unit = (None, True) if tested is None else (tested.lane, tested.unit.votes)
            scored = score(flight.scenario, flight.table, baseline, unit_lane=lane, unit_votes=by_unit)
            asked = orders.requirements
            verdicts = check_rows(flight.table.rows, flight.scenario, asked, baseline, tested) if asked else ()
        found = {table: rows(table, run.number, flight.scenario, scored, flight, verdicts) for table in TABLES}
        found["runs"][0]["manager"] = orders.voter(flight.scenario.redundancy.manager)
    except (UnitDead, UnitRefused) as error:
        return not_flown(run, "unit dead" if isinstance(error, UnitDead) else "unit refused", str(error))
    except Terminated:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 # whatever a flight raises is its own failure
        return not_flown(run, "failed", " ".join(f"{type(error).__name__}: {error}".split()))
    row = found["runs"][0]
    if keeps(orders, run.number, _troubled(row)):
        write_log(flight, log_path(Path(orders.folder), run.number))
    row["wall_s"] = time.perf_counter() - began
    return found


def not_flown(run: Run, outcome: str, reason: str) -> Rows:
    """Return the rows of a run without a flight."""
    row = {"run": run.number, "seed": run.data["seed"], "outcome": outcome, "reason": reason}
    return {**{table: [] for table in TABLES}, "runs": [row]}


def _troubled(row: dict[str, Any]) -> bool:
    """Return True for a failure: aircraft lost, fault missed, healthy channel isolated, or requirement violated."""
    return not row["survived"] or any(
        row.get(name) for name in ("missed", "false_alarms", "wrong_isolations", "violated")
    )


def keeps(orders: Orders, number: int, in_trouble: bool) -> bool:
    """Return True if the log of a run is kept; a sample is spread evenly over the campaign."""
    if orders.logs.startswith("sample:"):
        return number % math.ceil(orders.runs / int(orders.logs.partition(":")[2])) == 0
    return orders.logs == "all" or (orders.logs == "failures" and in_trouble)


def log_path(folder: Path, number: int) -> Path:
    """Return the log file of a run, the same for every worker, so that a second try replaces the first."""
    return folder / f"run_{number:06d}.mcap"


@cache
def warm() -> None:
    """Compile the kernels, or load them, before the first time limit starts."""
    short = load(None, ["duration_s=0.01", "faults=[]"])
    flight = fly(short)
    score(short, flight.table)
    gc.collect()
    gc.freeze()  # what stays is not searched for rubbish again and again: tens of milliseconds each time


@contextmanager
def _limit(timeout_s: float) -> Iterator[None]:
    """Let the system end this process if the block takes too long, even inside compiled code.

    The supervising process then flies the suspects alone.  On a system without such a timer (Windows) a thread of the
    interpreter ends the process with exit code 1, and the run counts as crashed.
    """
    if not hasattr(signal, "setitimer"):
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123 # a device, not a path
            faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
            try:
                yield
            finally:
                faulthandler.cancel_dump_traceback_later()
        return
    signal.setitimer(signal.ITIMER_REAL, timeout_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def flown_with(unit: Unit | None) -> Iterator[UnitUnderTest | None]:
    """Give the unit under test to one flight: it starts with the first and is kept from one to the next.

    A unit that stopped, or that must not be used again, is ended with the flight.
    """
    if unit is None:
        yield None
        return
    key = f"{unit.build()} {unit.folder} {unit.model_dump_json()}"
    if not any(end.still_active() for end in _ends):  # one of the parent's is not
        _ends[:] = [Finalize(None, _end_units, exitpriority=1)]  # a worker runs no atexit
    if key not in _running:
        _running[key] = UnitUnderTest(unit, crowded=True)
    tested, fit = _running[key], False
    try:
        yield tested
        fit = unit.reuse and not tested.dead
    finally:
        if not fit:
            del _running[key]
            tested.close()


def _end_units() -> None:
    """End the units of this process, with their folders."""
    while _running:
        _running.popitem()[1].close()


def fly_alone(runs: Sequence[Run], orders: Orders) -> Rows:
    """Fly runs in a child process, even if it stops; return their rows by table."""
    check_rig(orders)
    waiting, flown = list(runs), []
    while waiting:
        parts, _ = _child(waiting, orders)
        flown += parts
        waiting = waiting[len(parts) :]
        if waiting:
            suspect = waiting.pop(0)
            again, code = _child([suspect], orders)
            flown += again or [not_flown(suspect, *_died(code, orders))]
    _check_unit(orders)
    return _joined(flown)


def _died(code: int, orders: Orders) -> tuple[str, str]:
    """Return outcome and reason of a run that ended its process."""
    if code < 0 and code == -getattr(signal, "SIGALRM", 0):
        return "timed out", f"longer than {orders.timeout_s:g} s"
    if code < 0:
        return "crashed", f"killed by signal {signal_name(-code)}"
    return "crashed", f"the process ended with exit code {code}"


def _child(runs: Sequence[Run], orders: Orders) -> tuple[list[Rows], int]:
    """Return the rows of the ``runs`` that a fresh process flew before it ended, and its exit code."""
    ended = subprocess.run(
        [sys.executable, "-P", "-c", _CHILD],  # -P: no module of the present folder
        input=pickle.dumps((list(runs), orders)),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        check=False,
    )
    messages = list(_messages(io.BytesIO(ended.stdout)))
    if not messages:
        raise RigError(f"a process for single flights could not be started: exit code {ended.returncode}")
    if isinstance(messages[-1], BaseException):
        raise messages[-1]
    return messages[1:], ended.returncode


def _messages(file: IO[bytes]) -> Iterator[Any]:
    while True:
        try:
            yield pickle.load(file)  # our own child
        except (EOFError, pickle.UnpicklingError):
            return


def fly_for_parent() -> None:
    """Fly as the child of ``fly_alone``: runs and orders from standard input, rows to standard output."""
    leave_interrupts_to_parent()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the prints of a flight are no rows
    runs, orders = pickle.load(sys.stdin.buffer)  # our own parent
    _send(out, READY)
    try:
        check_rig(orders)
        for run in runs:
            _send(out, fly_run(run, orders))
    except Exception as error:  # noqa: BLE001 # handed to the parent, which raises it
        _send(out, error)


def _send(out: IO[bytes], message: Any) -> None:
    pickle.dump(message, out)
    out.flush()
