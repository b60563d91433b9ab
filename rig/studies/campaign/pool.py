"""The workers that fly batches: processes of this computer, or the workers of a Dask cluster.

Both are a ``concurrent.futures.Executor``.  A task whose worker stopped before its end raises one of ``lost``; the
campaign then flies its runs alone.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import wait
from typing import Any, Final, TypeVar

from rig.core.errors import BadInput, RigError
from rig.core.interrupt import Stop, interruptible

ANSWER_S: Final = 5.0  # how long a scheduler may take to answer
RETURN_S: Final = 60.0  # how long one that stopped, and then a worker of it, may take to come back
_METHOD: Final = "forkserver" if sys.platform == "linux" else "spawn"
_SETTINGS: Final = {
    # One flight uses one core: further threads of libraries would only compete.
    **{f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "NUMBA", "POLARS")},
    # glibc gives a flight's memory back after each and fetches it again for the next: 4 % of a short flight's time.
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 30),
    "PYTHONSAFEPATH": "1",  # no module of the present folder
}
_AHEAD: Final = 4  # parts for each worker that are handed out in advance
_LOOK_S: Final = 0.2  # between two looks whether the process is to end
Item = TypeVar("Item")
Result = TypeVar("Result")


def get_ready() -> None:
    """Start the process that workers are forked from, if the system forks; a second call has no effect.

    The process imports and compiles everything for a flight while its caller continues, so a new worker costs little.
    """
    if _METHOD != "forkserver":
        return
    forkserver.set_forkserver_preload(["rig.studies.campaign.warmed"])
    # The tracker cleans up after a kill -9, and would print a warning.
    with _environment({**_SETTINGS, "PYTHONWARNINGS": "ignore:resource_tracker"}):
        resource_tracker.ensure_running()  # the server would start it, and that lifts any block of SIGINT
    theirs = {signal.SIGINT, signal.SIGHUP}  # the parent's to handle; a mask is inherited
    before = signal.pthread_sigmask(signal.SIG_BLOCK, theirs)
    try:
        with _environment(_SETTINGS):
            forkserver.ensure_running()
    except OSError as error:  # its socket is in the folder of temporary files, and a socket's path is short
        raise RigError(f"TMPDIR {tempfile.gettempdir()}: no workers can be started: {error}") from None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Local:
    """Processes of this computer: ``size`` tasks at a time; if one worker stops, all tasks are lost."""

    lost: tuple[type[BaseException], ...] = (BrokenExecutor,)
    breaks = True

    def __init__(self, workers: int) -> None:
        self.size = workers
        self._executor = self._new()

    def _new(self) -> ProcessPoolExecutor:
        get_ready()
        try:
            return ProcessPoolExecutor(self.size, mp_context=multiprocessing.get_context(_METHOD), initializer=_begin)
        except (OSError, ImportError, NotImplementedError) as error:  # a system without semaphores, or none left
            raise RigError(f"no workers can be started: {error}") from None

    def submit(self, function: Any, *arguments: Any) -> Future[Any]:
        """Hand out one task; a task that is no longer accepted fails as lost."""
        try:
            with _environment(_SETTINGS):
                return self._executor.submit(function, *arguments)
        except BrokenExecutor as error:
            lost: Future[Any] = Future()
            lost.set_exception(error)
            return lost

    def everywhere(self, function: Callable[..., object], *arguments: Any) -> None:
        """Do nothing: a worker of this machine has what this process has."""

    def renew(self, stop: Stop) -> None:
        """Replace the executor after a worker stopped."""
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._executor = self._new()

    def close(self, kill: bool = False) -> None:
        """End the workers; ``kill`` does not wait for running tasks."""
        if kill:
            for process in list((self._executor._processes or {}).values()):  # it has no public way
                process.kill()
        self._executor.shutdown(wait=True, cancel_futures=True)


class Cluster:
    """The workers of a Dask cluster. Dask itself gives a lost worker's tasks to another, a few times.

    A scheduler that stops has lost all tasks; they are handed out again when it is back.
    """

    breaks = False

    def __init__(self, address: str) -> None:
        """Raise BadInput if the scheduler does not reply or has no worker."""
        if not address.strip():
            raise BadInput("--scheduler: must be the address of a scheduler, got an empty text")
        try:
            from distributed import Client
            from distributed.scheduler import KilledWorker
        except ImportError:
            raise BadInput("--scheduler: needs dask.distributed: pip install 'jsbsim-rig[cluster]'") from None
        self._address, self._silence = address, ExitStack()
        self._silence.enter_context(_quiet())  # Dask's own threads tell of a lost scheduler, too
        try:
            self._client = Client(address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, ValueError, RuntimeError) as error:
            self._silence.close()
            raise BadInput(f"--scheduler {address}: no reply: {str(error).strip() or type(error).__name__}") from None
        self.size = self._threads()
        if self.size == 0:
            self._client.close()
            self._silence.close()
            raise BadInput(f"--scheduler {address}: has no worker")
        self._executor: Executor = self._client.get_executor(pure=False)
        # A scheduler that stops cancels what it was given.
        self.lost: tuple[type[BaseException], ...] = (KilledWorker, CancelledError)

    def _threads(self) -> int:
        """Return how many tasks the workers run at once."""
        threads: Any = self._client.nthreads()
        return sum(threads.values())

    def submit(self, function: Any, *arguments: Any) -> Future[Any]:
        """Hand out one task."""
        return self._executor.submit(function, *arguments)

    def everywhere(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function on every worker before there is work for it.  RigError: it raises an error, or is missing."""
        try:
            self._client.run(function, *arguments)
        except RigError:
            raise
        except Exception as error:
            text = " ".join(str(error).split())
            raise RigError(f"a worker failed: {type(error).__name__}: {text}") from error

    def renew(self, stop: Stop) -> None:
        """Wait for the scheduler, if it stopped, and for a worker, or for ``stop``; the cluster replaces those itself.

        RigError: they are not back within RETURN_S.
        """
        from distributed import Client

        until = time.monotonic() + RETURN_S
        while time.monotonic() < until:
            if stop.requested:
                return
            with suppress(OSError, ValueError, RuntimeError):  # no reply yet
                if self._client.status == "closed":
                    self._client = Client(self._address, timeout=ANSWER_S, set_as_default=False)
                    self._executor = self._client.get_executor(pure=False)
                if self._threads() > 0:
                    return
            time.sleep(_LOOK_S)
        raise RigError(f"--scheduler {self._address}: it or its workers stopped, and are not back after {RETURN_S:g} s")

    def close(self, kill: bool = False) -> None:
        """Leave the cluster unchanged."""
        if self._client.status == "running":
            self._executor.shutdown(wait=not kill)
        self._client.close()
        self._silence.close()


Pool = Local | Cluster


def each(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int, chunk: int = 1, **begin: Any
) -> Iterator[Result]:
    """Yield ``function`` of every item, in order, from several processes; after an interruption no more begin.

    The interruption takes effect between two checks: inside the executor's queues it could leave a lock held and
    threads waiting.  Workers leave interruptions to this process and end by SIGTERM, as the executor asks them to when
    one of them stopped.
    begin : ``initializer``, ``initargs`` and ``mp_context`` of a worker, as of ProcessPoolExecutor
    """
    begin["initargs"] = (begin.pop("initializer", None), *begin.get("initargs", ()))
    parts = iter([items[i : i + chunk] for i in range(0, len(items), chunk)])
    with interruptible() as stop, ProcessPoolExecutor(workers, initializer=_begin, **begin) as executor:
        out: deque[Future[list[Result]]] = deque()
        try:
            while True:
                begun = islice(parts, _AHEAD * workers - len(out))
                out.extend(executor.submit(_every, function, part) for part in begun)
                if not out:
                    return
                while not wait_for([out[0]], timeout=_LOOK_S).done:
                    stop.heed()
                stop.heed()
                yield from out.popleft().result()
        finally:
            executor.shutdown(cancel_futures=True)


def by_workers(
    worker: Callable[..., Callable[[Item], Result]],
    about: tuple[Any, ...],
    items: Sequence[Item],
    workers: int,
    chunk: int = 1,
) -> Iterator[Result]:
    """Yield the result of ``worker(*about)`` for every item, in order, from several processes, or from this one alone.

    Each process makes its worker once.  No process inherits a lock that a thread of this process holds, as of polars.
    """
    if workers == 1 or len(items) < 2:
        return map(worker(*about), items)
    get_ready()
    context = multiprocessing.get_context(_METHOD)
    return each(_work, items, workers, chunk, initializer=_make, initargs=(worker, about), mp_context=context)


_made: Callable[[Any], Any]  # of this process, by ``_make``


def _make(worker: Callable[..., Callable[[Any], Any]], about: tuple[Any, ...]) -> None:
    global _made
    _made = worker(*about)


def _work(item: Any) -> Any:
    return _made(item)


def _every(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Run in a worker the items that are handed out together."""
    return [function(item) for item in items]


def leave_interrupts_to_parent() -> None:
    """Ignore Ctrl-C and the signal of a terminal that is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)


def _begin(then: Callable[..., None] | None = None, *arguments: Any) -> None:
    """Begin a worker that ends with its parent; ``then`` is the caller's own initializer."""
    leave_interrupts_to_parent()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    if then is not None:
        then(*arguments)


def _end_with(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Set environment variables for the processes started within; variables that are already set do not change."""
    new = {name: value for name, value in values.items() if name not in os.environ}
    os.environ.update(new)
    try:
        yield
    finally:
        for name in new:
            os.environ.pop(name, None)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the log of Dask; one line of rig reports the result."""
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
