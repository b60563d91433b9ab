"""One run of a campaign, flown in memory and scored: what a worker does.

A row does not depend on who flies it: all that decides it is in the run's scenario, and nothing but the
tables of an aircraft and compiled kernels is kept from one flight to the next.
"""

from __future__ import annotations

import faulthandler
import gc
import math
import os
import signal
import threading
import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig import aircraft, loop
from rig.assess import Score, fly_twin, score
from rig.campaign.identity import rig_identity
from rig.campaign.plan import Run
from rig.campaign.rows import TABLES, Rows, alarm_rows, episode_rows, fault_rows, run_row, signal_rows
from rig.campaign.units import check as check_unit
from rig.campaign.units import flown_with
from rig.errors import RigError, UnitDead, UnitRefused
from rig.flight.recorder import Findings, end_reason
from rig.flight.unit_loop import unit_computer
from rig.frame import TIMING, Block, new_block
from rig.log import LogWriter
from rig.log.of_flight import metadata
from rig.record.events import Event
from rig.record.flight_summary import Verdict
from rig.scenario import Scenario, load
from rig.unit.settings import Unit
from rig.unit.unit import UnitUnderTest
from rig.util.files import replaced
from rig.util.interrupt import Stop

Timing = NDArray[Any]
_tables = cache(aircraft.tables)  # of an aircraft, read once by each worker


@dataclass(frozen=True, slots=True)
class Orders:
    """What every worker is told: which logs to keep and where, how long a flight may take."""

    logs: str  # all, failures, none, or sample:N
    runs: int  # of the campaign, for the sample
    folder: str  # of the logs
    timeout_s: float
    twin: bool
    rig: str  # sources and packages that fly; a worker with others refuses
    unit: Unit | None = None  # under test, and the hash of its build
    unit_sha256: str = ""


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight in memory."""

    scenario: Scenario
    rows: Block
    timing: Timing
    events: list[Event]
    clean: NDArray[np.void]  # what the sensors said before any fault
    verdict: Verdict
    ended: list[Event]  # what is known only at the end: faults that did nothing
    unit: dict[str, str] = field(default_factory=dict)  # what its log says of the unit under test

    @property
    def end_reason(self) -> str:
        """Why the flight ended."""
        return end_reason(self.verdict, Stop(), self.scenario)


def fly(scenario: Scenario, tested: UnitUnderTest | None = None) -> Flown:
    """Fly a scenario with the digest and events of ``rig fly``, its rows kept in memory.

    UnitDead, UnitRefused: the unit under test.
    """
    rig = loop.Rig(scenario, None if tested is None else unit_computer(tested), keep_clean=scenario.frames)
    findings, (rows, timing) = Findings(scenario), loop.new_memory(scenario)
    loop.fly(rig, [findings], memory=(rows, timing))
    flown = slice(findings.verdict.frames)
    about = findings.verdict, findings.end(), ended_unit(tested)
    return Flown(scenario, rows[flown], timing[flown], findings.events, rig.faults.clean[flown], *about)


def ended_unit(tested: UnitUnderTest | None) -> dict[str, str]:
    """End the session of a unit; what a log says of it.  UnitDead when another flew on in its place."""
    if tested is None:
        return {}
    tested.end()
    if tested.dead:
        raise UnitDead(f"{tested.unit.source}: dead from frame {tested.replies.counts.dead_frame} on")
    return tested.metadata()


def fly_run(run: Run, orders: Orders) -> Rows:
    """Fly, score and perhaps log one run: its rows by table. An exception of its flight is its outcome."""
    warm()
    began = time.perf_counter()
    try:
        with _limit(orders.timeout_s), flown_with(orders.unit) as tested:
            flown = fly(run.scenario(_tables(run.aircraft)), tested)
            twin = fly_twin(flown.scenario, unit=tested) if orders.twin else None
            scored = score(flown.scenario, flown.rows, twin, clean=flown.clean)
        rows = _rows(run.number, flown, scored)
    except (UnitDead, UnitRefused) as error:
        return not_flown(run, "unit dead" if isinstance(error, UnitDead) else "unit refused", str(error))
    except (Exception, SystemExit) as error:  # noqa: BLE001 # whatever a flight raises is its own failure
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return not_flown(run, "failed", said)
    row = rows["runs"][0]
    if keeps(orders, run.number, troubled(row)):
        write_log(flown, log_path(Path(orders.folder), run.number))
    row["wall_s"] = time.perf_counter() - began
    return rows


def _rows(number: int, flown: Flown, scored: Score) -> Rows:
    return {
        "runs": [run_row(number, flown, scored)],
        "faults": fault_rows(number, flown.scenario, scored),
        "alarms": alarm_rows(number, flown.scenario, scored),
        "episodes": episode_rows(number, flown.scenario, scored),
        "signals": signal_rows(number, scored),
    }


def not_flown(run: Run, outcome: str, reason: str) -> Rows:
    """The rows of a run that has no flight to show."""
    row = {"run": run.number, "seed": run.data["seed"], "outcome": outcome, "reason": reason}
    return {**{table: [] for table in TABLES}, "runs": [row]}


def troubled(row: dict[str, Any]) -> bool:
    """Whether an engineer would want to see the flight: lost, a fault missed, a healthy channel failed."""
    return not row["survived"] or any(row[name] for name in ("missed", "false_alarms", "wrong_isolations"))


def keeps(orders: Orders, number: int, in_trouble: bool) -> bool:
    """Whether the log of a run is kept; a sample is spread evenly over the campaign."""
    if orders.logs.startswith("sample:"):
        return number % math.ceil(orders.runs / int(orders.logs.partition(":")[2])) == 0
    return orders.logs == "all" or (orders.logs == "failures" and in_trouble)


def log_path(folder: Path, number: int) -> Path:
    """The log of a run: the same name whoever flies it, so that a second try replaces the first."""
    return folder / f"run_{number:06d}.mcap"


def write_log(flown: Flown, path: Path) -> None:
    """The flight as ``rig fly`` logs it, in larger chunks. RigError when the disk does not take it."""
    verdict, scenario, at = flown.verdict, flown.scenario, [event.frame for event in flown.events]
    path.parent.mkdir(parents=True, exist_ok=True)
    about = {**metadata(scenario), **flown.unit}, [("scenario.toml", b"")]
    with (
        replaced(path) as part,
        LogWriter(part, scenario.rate_hz, *about, chunk_frames=scenario.frames, draft_of=path) as writer,
    ):
        for first in range(0, verdict.frames, writer.chunk_frames):
            part = slice(first, first + writer.chunk_frames)
            events = flown.events[bisect_left(at, part.start) : bisect_left(at, part.stop)]
            writer.write(flown.rows[part], flown.timing[part], events)
        writer.write(new_block(0), np.zeros(0, TIMING), flown.ended)
        ended = {"digest": verdict.digest, "end_reason": flown.end_reason, "survived": str(verdict.survived)}
        writer.close(ended)


@cache
def warm() -> None:
    """Compile the kernels, or load them, before the first clock runs."""
    short = load(None, ["duration_s=0.01", "faults=[]"])
    flown = fly(short)
    score(short, flown.rows, clean=flown.clean)
    gc.collect()
    gc.freeze()  # what stays is not searched for rubbish again and again: tens of milliseconds each time


@contextmanager
def _limit(timeout_s: float) -> Iterator[None]:
    """Let the system end this process when the block takes longer, even inside compiled code.

    Who supervises it sees a worker die and flies the suspects alone.  Without such a timer (Windows) a thread of the
    interpreter's own ends the process with exit code 1, and the run counts as crashed.
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


_one_at_a_time = threading.Lock()  # a cluster's worker may have several threads; JSBSim and the timer are the process's


def fly_batch(runs: Sequence[Run], orders: Orders) -> Rows:
    """Fly runs one after the other: their rows by table. RigError when this is another version of the rig."""
    check_rig(orders)
    with _one_at_a_time:
        flown = [fly_run(run, orders) for run in runs]
    return joined(flown)


def joined(flown: Sequence[Rows]) -> Rows:
    """The rows of several runs, by table."""
    return {table: [row for rows in flown for row in rows[table]] for table in TABLES}


def check_rig(orders: Orders) -> None:
    """RigError when what flies here is not what the campaign is flown with."""
    if rig_identity() != orders.rig:
        raise RigError("a worker flies another version of the rig than this one; install the same everywhere")
    check_unit(orders.unit, orders.unit_sha256)
