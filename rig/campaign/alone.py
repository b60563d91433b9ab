"""Suspects: runs of a batch whose worker died, flown in a process of their own.

The process reports the result after every flight.  When it dies, the run that it was at is the suspect: it
is flown once more, alone, and when the process dies again the run is recorded as crashed, or as timed out.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import IO, Any

from rig.campaign.flying import Orders, check_rig, fly_run, joined, not_flown
from rig.campaign.plan import Run
from rig.campaign.rows import Rows
from rig.errors import RigError

READY = "ready"


def fly_alone(runs: Sequence[Run], orders: Orders) -> Rows:
    """Fly runs in a child process, whatever becomes of it: their rows by table."""
    check_rig(orders)
    waiting, flown = list(runs), []
    while waiting:
        some, _ = _child(waiting, orders)
        flown += some
        waiting = waiting[len(some) :]
        if waiting:
            suspect = waiting.pop(0)
            again, code = _child([suspect], orders)
            flown += again or [not_flown(suspect, *_died(code, orders))]
    return joined(flown)


def _died(code: int, orders: Orders) -> tuple[str, str]:
    """Outcome and reason of a run that ended its process."""
    if code < 0 and code == -getattr(signal, "SIGALRM", 0):
        return "timed out", f"longer than {orders.timeout_s:g} s"
    if code < 0:
        return "crashed", f"killed by signal {-code} ({signal.Signals(-code).name})"
    return "crashed", f"the process ended with exit code {code}"


def _child(runs: Sequence[Run], orders: Orders) -> tuple[list[Rows], int]:
    """What a fresh process flew of ``runs`` before it ended, and its exit code."""
    command = [sys.executable, "-P", "-m", "rig.campaign.alone"]  # -P: no module of the present folder
    quiet: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    with subprocess.Popen(command, env=environment, **quiet) as process:
        assert process.stdin is not None and process.stdout is not None
        # One that has ended already was never ready, which says so below.
        with suppress(BrokenPipeError), process.stdin as pipe:
            pickle.dump((list(runs), orders), pipe)
        said = list(_messages(process.stdout))
    if not said:
        raise RigError(f"a process for single flights could not be started: exit code {process.returncode}")
    flown = said[1:]
    if flown and isinstance(flown[-1], BaseException):
        raise flown[-1]
    return flown, process.returncode


def _messages(pipe: IO[bytes]) -> Iterator[Any]:
    while True:
        try:
            yield pickle.load(pipe)  # our own child
        except (EOFError, pickle.UnpicklingError):
            return


def main() -> None:
    """The child: runs and orders from standard input, rows to standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's, and so is the terminal that is closed
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a flight prints is no row
    runs, orders = pickle.load(sys.stdin.buffer)  # our own parent
    _say(out, READY)
    try:
        for run in runs:
            _say(out, fly_run(run, orders))
    except Exception as error:  # noqa: BLE001 # handed to the parent, which raises it
        _say(out, error)


def _say(out: IO[bytes], message: Any) -> None:
    pickle.dump(message, out)
    out.flush()


if __name__ == "__main__":
    main()
