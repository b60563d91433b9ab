"""One process compiles a kernel that several need: each kernel's lock is a byte of one file in the cache.

A lock ends with its process, and the system refuses a lock by which processes would wait in a circle.
If files cannot be locked, and on systems without such locks, a kernel may be compiled twice.
"""

from __future__ import annotations

import hashlib
import os
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Final

_FCNTL: Final[Any] = import_module("fcntl") if os.name == "posix" else None  # no such locks on Windows
_held: dict[str, tuple[int, int]] = {}  # by name: the file and the byte in it


def take(folder: Path, name: str, *, wait: bool = True) -> bool:
    """Lock ``name`` among the processes that use ``folder``; return True, or without ``wait`` False if another has it.

    Return False also if it cannot be locked.  A process may take its lock again; its threads do not exclude each other.
    """
    if _FCNTL is None:
        return False
    try:
        # A byte below 2^56, which every file system takes.
        file, byte = _file(folder, os.getpid()), int.from_bytes(hashlib.sha256(name.encode()).digest()[:7])
        _FCNTL.lockf(file, _FCNTL.LOCK_EX if wait else _FCNTL.LOCK_EX | _FCNTL.LOCK_NB, 1, byte)
    except OSError:  # another has it, no right to write, no locks on this file system, or a circle of waiting
        return False
    _held[name] = file, byte
    return True


def give_back(name: str) -> None:
    """Unlock ``name``; do nothing if this process does not have it."""
    held = _held.pop(name, None)
    if held is not None:
        _FCNTL.lockf(held[0], _FCNTL.LOCK_UN, 1, held[1])


def give_all_back() -> None:
    """Release all locks of this process: a kernel that fails to compile is never saved."""
    for name in list(_held):
        give_back(name)


@cache
def _file(folder: Path, process: int) -> int:
    """Open the file of locks, once in each process: to close any other of its descriptors would end all locks."""
    folder.mkdir(parents=True, exist_ok=True)
    return os.open(folder / "locks", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
