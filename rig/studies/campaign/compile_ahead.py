"""Compile the kernels of a flight in separate processes, in two if two cores are free.

The parts of a frame before, at and after the decision (loop.py) cost about a third each, and one process alone compiles
each kernel (kernel_locks.py).  One process takes the kernels in the order of a frame, the other begins with the last.
It compiles the outcome and the log last, while LLVM optimises the whole frame in the first.
The calling process loads the results.  While it waits it reacts to a signal at once; during a compilation by LLVM it
could not.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final

from rig.computer.lanes.lanes_stage import think_all
from rig.computer.lanes.think import ComputerData, follow_votes
from rig.computer.redundancy.baselines import select_unit
from rig.computer.redundancy.managers import KINDS
from rig.computer.redundancy.state import ManagerData
from rig.core.compile_shortcuts import take_shortcuts
from rig.core.errors import RigError
from rig.core.files import reported
from rig.core.frame import Table
from rig.core.interrupt import at_once
from rig.core.kernel_cache import reached
from rig.core.kernel_locks import give_back, take
from rig.core.kernels import compile_inner, kernel_folder
from rig.core.threads import cores
from rig.flight import loop
from rig.log.writer import LogWriter
from rig.scenario.scenario import load
from rig.verdict.of_log import FlightConclusion
from rig.verdict.row_kernel import add_rows
from rig.world.plant.truth import write_row

Show = Callable[[int, int], None]  # kernels that are compiled, of how many
_CHILD: Final = "from rig.studies.campaign.compile_ahead import run_child; run_child()"
_LOCK: Final = "compile ahead"  # one pair of processes for all that share a cache


class Ahead:
    """Compile all kernels of a flight when the first is missing; the caller compiles any that are still missing.

    ``compile_missing`` is for ``kernel_cache.before_compiling``.
    """

    def __init__(self, show: Show) -> None:
        self._show, self._tried = show, False

    def compile_missing(self, function: Callable[..., object], path: Path) -> None:
        """Compile ``function`` to ``path``, with all others if it belongs to a flight; once."""
        if self._tried or _name(function) not in _of_flight():
            return
        self._tried, kernels = True, kernel_folder()
        with at_once():
            self._show(0, len(_of_flight()))
            if not take(kernels, _LOCK):
                return  # nothing can be locked there
            try:
                if not path.exists():  # made by another pair, for which this process has waited
                    _compile(self._show)
            finally:
                give_back(_LOCK)


@cache
def _of_flight() -> dict[str, Callable[..., object]]:
    """Return the kernels that the frames, the plant and the outcome of a flight use, by name."""
    roots: tuple[Any, ...] = (loop.compute_held, write_row, add_rows)
    return {_name(function): function for root in roots for function in reached(root.py_func)}


def _name(function: Callable[..., object]) -> str:
    return f"{function.__module__}:{function.__qualname__}"


def _compile(show: Show) -> None:
    """Start the processes and show their progress until they end."""
    wanted, done = _of_flight(), set[str]()
    parts = PARTS if cores() > 1 else PARTS[:1]
    with ExitStack() as stack:
        reading, writing = os.pipe()
        lines = stack.enter_context(open(reading))  # noqa: PTH123 # a descriptor, no path
        try:
            for part in parts:
                stack.enter_context(_child(part, writing))
        finally:
            os.close(writing)  # the children have it: without them the pipe is at its end
        for line in lines:
            if (function := wanted.get(line.strip())) is not None:
                done.update(map(_name, reached(function)))
                show(len(done), len(wanted))


@contextmanager
def _child(part: str, writing: int) -> Iterator[None]:
    """Run a process that compiles a part; it prints nothing and ends with this process, or when the block ends."""
    with reported(sys.executable, RigError, "cannot be started"):
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _CHILD, part, str(writing)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[writing],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        )
    try:
        yield
    finally:
        process.kill()
        process.communicate()


def run_child() -> None:
    """Compile the part named on the command line; report each compiled kernel."""
    from numba.core import event

    part, writing = sys.argv[1], int(sys.argv[2])

    class Teller(event.Listener):
        def on_start(self, event: Any) -> None:
            """Do nothing: a kernel is reported when it is compiled."""

        def on_end(self, event: Any) -> None:
            os.write(writing, f"{_name(event.data['dispatcher'].py_func)}\n".encode())

    take_shortcuts()
    gc.set_threshold(500_000, 10, 10)  # what numba keeps of each kernel stays: a twentieth of the time went in search
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with event.install_listener("numba:compile", Teller()):
        _PART[part]()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()  # nothing ever comes: it ends with the parent, in whatever way that ends
    os._exit(1)


def _in_order() -> None:
    """Compile all kernels of a flight and its score, in the order of a flight."""
    from rig.studies.campaign.worker import warm

    warm()
    LogWriter(os.devnull, 1.0, {})


def _from_the_end() -> None:
    """Compile the end of a frame, the managers, the outcome, the log, then all that the other process may have left."""
    scenario = load(None, ["duration_s=0.01", "faults=[]"])
    rig, rows = loop.Rig(scenario, lambda rig: lambda rows, k, data: None, keep_clean=1), loop.new_block(1)
    rig.prepare(rows)
    row, data = loop.nested(rows)[0], rig.data
    compile_inner(follow_votes, row["bus"], row["fcc"], ComputerData(data.redundancy, data.control, data.faults))
    compile_inner(loop.after, loop.nested(rows), 0, data)
    _managers_from_the_last(row, data.redundancy.manager)
    outcome = FlightConclusion()
    outcome.begin(scenario)
    outcome.add(Table(rows, clean=rig.faults.clean_of(rows)))
    LogWriter(os.devnull, 1.0, {})
    compile_inner(think_all, row, 0, ComputerData(data.redundancy, data.control, data.faults), data.lanes)


def _managers_from_the_last(row: Any, data: ManagerData) -> None:
    """Compile the managers while the other process is at the first one; a flight may use any of them."""
    compile_inner(select_unit, row["bus"], row["fcc"], 0, len(data.params), data)
    for kind in reversed(KINDS):
        if kind.settings is None:
            compile_inner(kind.kernel, row["bus"], row["fcc"], data)


_PART: Final = {"in order": _in_order, "from the end": _from_the_end}
PARTS: Final = tuple(_PART)
