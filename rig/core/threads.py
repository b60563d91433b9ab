"""Work on several threads, in order, which ends soon after an error or an interruption."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
_HERE: Final = threading.local()  # ``ended``, the event of the work that this thread is part of


class Ended(Exception):  # no error: no caller waits for the result any more
    """The work of this thread has ended."""


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def on_threads(items: Sequence[Item], work: Callable[[Item], Result], threads: int) -> Generator[Result, None, None]:
    """Yield the result of ``work`` for each item, in order; results do not depend on the number of threads.

    If one raises, or the caller is interrupted or closes it (``contextlib.closing``), no further item is started, and
    running work ends at its next call of ``heed``.
    """
    ended = threading.Event()

    def begun(item: Item) -> Result:
        _HERE.ended = ended
        return work(item)

    with ThreadPoolExecutor(max(1, min(threads, len(items)))) as pool:
        futures = [pool.submit(begun, item) for item in items]
        try:
            for future in futures:
                yield future.result()
        finally:
            try:
                pool.shutdown(wait=False, cancel_futures=True)  # first: a thread that has ended its item takes the next
            finally:
                ended.set()


def heed() -> None:
    """Raise Ended on a thread of ``on_threads`` whose work has ended; do nothing elsewhere."""
    ended: threading.Event | None = getattr(_HERE, "ended", None)
    if ended is not None and ended.is_set():
        raise Ended
