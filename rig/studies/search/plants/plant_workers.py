"""The processes that run a plant, each within its time limit; or a Python function in this process."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final, Protocol

from rig.core.confined import may_run_code
from rig.core.errors import BadInput
from rig.core.files import open_regular
from rig.core.interrupt import Stop, signal_name
from rig.core.text import one_line
from rig.studies.search.plants.plant_call import Call, Function, Outcome, Takes, Wrong, limited, simulate, took_longer
from rig.studies.search.plants.plant_call import takes as arguments_of

_SERVE: Final = "from rig.studies.search.plants.plant_call import serve; serve()"
_LOOK_S: Final = 0.2  # between two looks whether the process is to end
_ENDING_S: Final = 2.0
_IMPORT_S: Final = 60.0  # for the file of the user


class Runner(Protocol):
    """A way to run the simulations of a plant."""

    called: str  # the plant, for messages

    def takes(self) -> Takes:
        """Return the arguments of the plant."""
        ...

    def run(self, calls: Sequence[Call], stop: Stop) -> list[Outcome]:
        """Return the outcomes in the order of ``calls``; fewer if the process is to end."""
        ...


class Here:
    """A function of this process: one simulation after the other."""

    def __init__(self, function: Function, timeout_s: float) -> None:
        self._function, self._timeout_s = function, timeout_s
        self.called = getattr(function, "__qualname__", type(function).__name__)

    def takes(self) -> Takes:
        """Return the arguments of the function."""
        return arguments_of(self._function)

    def run(self, calls: Sequence[Call], stop: Stop) -> list[Outcome]:
        """Return the outcomes in the order of ``calls``; fewer if the process is to end."""
        done: list[Outcome] = []
        for call in calls:
            if stop.requested:
                break
            try:
                with limited(self._timeout_s):
                    done.append(simulate(self._function, call))
            except Wrong as error:  # between two statements of the rig
                done.append(Outcome(None, str(error)))
        return done


class Processes:
    """Processes that import FILE.py and run its function; one that ends, or takes too long, is replaced."""

    def __init__(self, path: Path, name: str, timeout_s: float, count: int) -> None:
        self._command = [sys.executable, "-P", "-c", _SERVE, str(path), name]
        self.called, self._timeout_s = f"{path}:{name}", timeout_s
        self._free: SimpleQueue[_Process | None] = SimpleQueue()
        self._all: set[_Process] = set()
        for _ in range(count):
            self._free.put(None)
        self._threads = ThreadPoolExecutor(count)
        self._closed = False

    @cache  # noqa: B019 # as long as the processes
    def takes(self) -> Takes:
        """Return the arguments of the function, which one process imports."""
        process = self._begin()
        self._free.get()
        self._free.put(None if process.told.wrong else process)
        return process.told

    def _begin(self) -> _Process:
        process = _Process(self._command)
        self._all.add(process)
        process.told = process.ask(None, _IMPORT_S) or Takes((), (), False, "its import ended a process")
        return process

    def run(self, calls: Sequence[Call], stop: Stop) -> list[Outcome]:
        """Return the outcomes in the order of ``calls``; fewer if the process is to end."""
        out: list[Future[Outcome]] = [self._threads.submit(self._one, call) for call in calls]
        while not stop.requested and wait(out, timeout=_LOOK_S).not_done:
            pass
        if stop.requested:
            running = [each for each in out if not each.cancel()]
            while not stop.insisted and wait(running, timeout=_LOOK_S).not_done:
                pass
            if stop.insisted:
                self.close()
                return []  # simulations that were ended have not failed
        done = [each.result() for each in out if not each.cancelled()]
        return done if len(done) == len(calls) else []

    def _one(self, call: Call) -> Outcome:
        if self._closed:
            return Outcome(None, "ended")
        process = self._free.get()
        try:
            process = process or self._begin()
            if process.told.wrong:
                return Outcome(None, process.told.wrong)
            found: Outcome | None = process.ask((call, self._timeout_s), self._timeout_s)
            if found is None:
                reason, process = process.ended(self._timeout_s), None
                return Outcome(None, reason)
            return found
        finally:
            self._free.put(process)

    def close(self) -> None:
        """End all processes."""
        self._closed = True
        for each in self._all:
            each.end()
        self._threads.shutdown(wait=True, cancel_futures=True)


class _Process:
    """One process: what it imported, and the pipes to it."""

    told: Takes

    def __init__(self, command: list[str]) -> None:
        path = os.pathsep.join([str(Path(__file__).parents[4]), *(each for each in sys.path if each)])
        alone = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}  # one core for each process
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self._process: Any = subprocess.Popen(command, env={**os.environ, **alone, "PYTHONPATH": path}, **pipes)
        self._late = False

    def ask(self, what: Any, within_s: float) -> Any:
        """Send a request, if there is one, and return the answer; None: the process ended, or took longer."""
        timer = threading.Timer(within_s, self._end_late)
        timer.daemon = True
        timer.start()
        try:
            if what is not None:
                pickle.dump(what, self._process.stdin, pickle.HIGHEST_PROTOCOL)
                self._process.stdin.flush()
            return pickle.load(self._process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError, ValueError):
            return None
        finally:
            timer.cancel()

    def _end_late(self) -> None:
        self._late = True
        self._process.kill()

    def ended(self, timeout_s: float) -> str:
        """Return why the process is no more."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_ENDING_S)  # its pipe may close first
        self.end()
        code = self._process.returncode
        if self._late:
            return took_longer(timeout_s)
        killed = f"was killed by signal {signal_name(-code)}" if code < 0 else f"ended with exit code {code}"
        return f"its process {killed}"

    def end(self) -> None:
        """End the process and close its pipes."""
        if self._process.poll() is None:
            self._process.kill()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()
        self._process.wait()


@contextmanager
def processes(reference: str, timeout_s: float, count: int) -> Iterator[Processes]:
    """Run the plant FILE.py:function in ``count`` processes.  BadInput: no such file, or not of this form."""
    path, name = split_reference(reference)
    if not may_run_code():
        raise BadInput(f"--plant {one_line(reference)}: is code, and rig mcp runs no code")
    with open_regular(path, 16 << 20):
        pass
    made = Processes(path, name, timeout_s, count)
    try:
        yield made
    finally:
        made.close()


def split_reference(reference: str) -> tuple[Path, str]:
    """Return file and function of FILE.py:function.  BadInput: it is not of this form."""
    where, _, name = reference.rpartition(":")
    if not where.endswith(".py") or not name.isidentifier():
        raise BadInput(f"--plant {one_line(reference)}: must be FILE.py:function")
    return Path(where), name
