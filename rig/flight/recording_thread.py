"""Who records a block: the frame loop itself, or a thread while the next block is flown.

A paced flight records on a thread, so that neither the disk nor the compressor holds a frame up.  One
that flies as fast as it can has nothing to gain from that (both would share the interpreter) and records
in line.  Either way in order, and at most one block is under way.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Self

from numpy.typing import NDArray

from rig.flight.realtime import beside
from rig.frame import Block

Record = Callable[[Block, NDArray[Any]], None]
# The recording spends most of its time outside the interpreter's lock (hash, checksum, compression,
# write); it must get the lock back quickly in between, or the frames would wait for it in the end.
SWITCH_S = 2e-4


class Recorder:
    """Hands blocks to ``record``; what that raises on the thread is raised by the next ``put`` or at the end."""

    def __init__(self, record: Record, threaded: bool) -> None:
        self._record = record
        self._pool = ThreadPoolExecutor(1, "recorder", beside) if threaded else None
        self._pending: Future[None] | None = None
        self._switch_s = sys.getswitchinterval()

    def put(self, rows: Block, timing: NDArray[Any]) -> None:
        """Record ``rows``; on a thread, returns as soon as the block before them is done.

        The arrays must stay as they are until the next call has returned.
        """
        if self._pool is None:
            self._record(rows, timing)
            return
        self._wait()
        self._pending = self._pool.submit(self._record, rows, timing)

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def __enter__(self) -> Self:
        if self._pool is not None:
            sys.setswitchinterval(SWITCH_S)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._pool is None:
            return
        sys.setswitchinterval(self._switch_s)
        try:
            if kind is None:
                self._wait()
        finally:
            self._pool.shutdown()
