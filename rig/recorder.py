"""One block is recorded while the next is flown: the disk and the compressor never hold a frame up.

The recording runs in order, on one thread; at most one block is under way, so that a killed flight loses
no more than that block and the one being filled.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

from numpy.typing import NDArray

from rig.frame import Block

Record = Callable[[Block, NDArray[Any]], None]
# The recording spends most of its time outside the interpreter's lock (hash, checksum, compression,
# write); it must get the lock back quickly in between, or the frames would wait for it in the end.
SWITCH_S = 2e-4


class Recorder:
    """Hands blocks to ``record`` on a thread; what that raises is raised by the next ``put`` or by ``close``."""

    def __init__(self, record: Record) -> None:
        self._record = record
        self._pool = ThreadPoolExecutor(1, "recorder")
        self._pending: Future[None] | None = None
        self._switch_s = sys.getswitchinterval()

    def put(self, rows: Block, timing: NDArray[Any]) -> None:
        """Record ``rows``; returns as soon as the block before them is done.

        The arrays must stay as they are until the next call has returned.
        """
        self._wait()
        self._pending = self._pool.submit(self._record, rows, timing)

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def __enter__(self) -> Self:
        sys.setswitchinterval(SWITCH_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        sys.setswitchinterval(self._switch_s)
        try:
            if kind is None:
                self._wait()
        finally:
            self._pool.shutdown()
