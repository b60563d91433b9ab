"""A recording's file, written here from a pipe: Rerun's own writer waits for ever once a disk is full."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Final

DESCRIPTORS: Final = Path("/dev/fd")  # where a pipe has a name; not on Windows
_CHUNK: Final = 1 << 20  # bytes


class PipedFile:
    """A file that gets what is written to ``pipe``; after an error the rest is read and dropped.

    ``writing`` is the descriptor of the pipe's other end: close it once the writer has opened ``pipe``.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, and begin to read.  OSError: it cannot be opened."""
        self._path, self._file = path, path.open("wb", buffering=0)
        self._error: OSError | None = None
        self._reading, self.writing = os.pipe()
        self.pipe = DESCRIPTORS / str(self.writing)
        self._thread = threading.Thread(target=self._copy, name="recording", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raise the OSError of a file that could not be written."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Wait until the writer has closed its end; OSError as ``check``: the file is removed."""
        self._thread.join()
        if self._error is not None:
            self._path.unlink(missing_ok=True)
        self.check()

    def _copy(self) -> None:
        with self._file, open(self._reading, "rb", buffering=0) as pipe:  # noqa: PTH123 # a descriptor, no path
            while data := pipe.read(_CHUNK):
                try:
                    while self._error is None and data:
                        data = data[self._file.write(data) :]
                except OSError as error:
                    self._error = error
