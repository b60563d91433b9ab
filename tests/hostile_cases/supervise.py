"""Cases, some at a time: a fork each of a process that has imported everything and compiled the kernels."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final

from hostile_cases import child
from hostile_cases.case import Case
from hostile_cases.checks import MEMORY, Outcome, failures

LIMIT_S: Final = 20.0
# Imported only: polars and Arrow start their threads when they are first used, which is in a case's own process.
_RECORDED: Final = (
    "rig.log.recordings.align",
    "rig.bench.vote_summary",
    "rig.bench.vote_rows",
    "rig.bench.write_votes",
)
_CAMPAIGN: Final = (
    "rig.studies.campaign.campaign_page",
    "rig.studies.campaign.run_campaign",
    "rig.studies.campaign.estimate",
)
_OTHERS: Final = (
    *("rig.bench.replay.verify", "rig.bench.replay.what_if", "rig.verdict.of_log", "rig.show.terminal.live"),
    "rig.flight.cost",
)
_IMPORTED: Final = (
    *_RECORDED,
    *_CAMPAIGN,
    *_OTHERS,
    "rig.flight.cost",
    "rig.cli.show_campaign",
    "rig.show.viewer.opened",
)
_PAGE: Final = os.sysconf("SC_PAGE_SIZE")


def warm() -> None:
    """Import what commands need and compile the kernels, without starting a thread pool that a fork would break."""
    from rig.studies.campaign.worker import warm as compile_all

    compile_all()
    for module in _IMPORTED:
        import_module(module)
    gc.collect()
    gc.freeze()


@dataclass
class _Running:
    case: Case
    box: Path
    pid: int
    began: float
    most: int = 0
    stopped: str = ""


@dataclass(frozen=True)
class Result:
    """A case and in what it failed."""

    case: Case
    failed: dict[str, str]
    outcome: Outcome


def run(cases: Sequence[Case], root: Path, workers: int = 2, limit_s: float = LIMIT_S) -> Iterator[Result]:
    """Run cases below ``root``; one that took too long is run once more alone, with three times the time."""
    slow: list[Case] = []
    for result in _run(cases, root, workers, limit_s):
        if "hang" in result.failed:
            slow.append(result.case)
        else:
            yield result
    yield from _run(slow, root, 1, 3 * limit_s)


def _run(cases: Sequence[Case], root: Path, workers: int, limit_s: float) -> Iterator[Result]:
    waiting, running = list(reversed(cases)), list[_Running]()
    while waiting or running:
        while waiting and len(running) < workers:
            running.append(_start(waiting.pop(), root))
        for one in list(running):
            outcome = _look(one, limit_s)
            if outcome is not None:
                running.remove(one)
                yield Result(one.case, failures(one.case, one.box, outcome), outcome)
                _remove(one.box)
        time.sleep(0.004)


def _start(case: Case, root: Path) -> _Running:
    box = root / f"{case.kind}{case.number}"
    _remove(box)
    box.mkdir(parents=True)
    sys.stdout.flush()
    sys.stderr.flush()
    began, pid = time.monotonic(), os.fork()
    if pid == 0:
        child.run(case, box)
    return _Running(case, box, pid, began)


def _look(one: _Running, limit_s: float) -> Outcome | None:
    """How a case ended, or None; it is ended when it takes too long or too much."""
    pid, status, usage = os.wait4(one.pid, os.WNOHANG)
    wall = time.monotonic() - one.began
    if pid:
        with suppress(ProcessLookupError):
            os.killpg(one.pid, signal.SIGKILL)  # what it left running
        return Outcome(os.waitstatus_to_exitcode(status), wall, max(one.most, usage.ru_maxrss << 10), one.stopped)
    with suppress(OSError, IndexError):
        one.most = max(one.most, int(Path(f"/proc/{one.pid}/statm").read_text().split()[1]) * _PAGE)
    one.stopped = one.stopped or ("memory" if one.most > MEMORY else "hang" if wall > limit_s * _busy() else "")
    if one.stopped:
        for kill in (os.killpg, os.kill):
            with suppress(ProcessLookupError):
                kill(one.pid, signal.SIGKILL)
    return None


def _busy() -> float:
    """How many times longer things take now, when more processes want to run than there are cores."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def _remove(box: Path) -> None:
    shutil.rmtree(box, ignore_errors=True)
