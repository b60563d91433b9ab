"""The lock of a campaign's folder: one command flies into it at a time, on every system."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rig.errors import BadInput

_FLAGS: Final = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)  # no child process inherits what os.open gives


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Make the folder and hold its file ``lock``, which is not written to, and not followed when it is a link.

    The system releases the lock of a process that ends, whatever ends it.
    BadInput: another process holds the lock, it is a link, or the folder is not writable.
    """
    file = _opened(folder, folder / "lock")
    try:
        try:
            _take(file)
        except OSError:
            raise BadInput(f"--out {folder}: another rig campaign run is flying into it") from None
        try:
            yield
        finally:
            _release(file)
    finally:
        os.close(file)


def _opened(folder: Path, path: Path) -> int:
    """Return a descriptor of the lock file; BadInput as ``locked``."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.is_symlink():  # made a link since: O_NOFOLLOW, where the system has it
            return os.open(path, _FLAGS, 0o666)
    except OSError as error:
        raise BadInput(f"--out {folder}: cannot be written: {error.strerror}") from None
    raise BadInput(f"{path}: is a link, and is not followed: remove it")


def _take(file: int) -> None:
    """Lock the file for this descriptor, at once or not at all. OSError: somebody holds it."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # the first byte, which need not be there
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _release(file: int) -> None:
    """Unlock; closing the descriptor does it too, but on Windows only some time later."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_UNLCK, 1)
