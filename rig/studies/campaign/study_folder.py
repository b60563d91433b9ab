"""The folder of a study of any kind: its identity, its lock, and files that are complete or absent.

One file, the mark, holds the options and the version of rig.  A command resumes in a folder with the same mark, and
refuses a folder with another.  Every file is written under another name and renamed.  Files that are read again have a
checksum of their bytes (core/sealed.py) and, except the mark, carry the identity of their study.
One command writes into a folder at a time, on every system: it holds the file ``lock``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rig.core import sealed
from rig.core.difference import difference
from rig.core.errors import BadInput, RigError
from rig.core.files import LOCK, is_file, is_unused, replaced, reported, require_writable, sweep

UNSEALED: Final = 1  # the format of an earlier version, whose files have no checksum
FORMAT: Final = 2
_FLAGS: Final = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)  # no child process inherits what os.open gives


@dataclass(frozen=True)
class Study:
    """A kind of study, with the words of its error messages."""

    mark: str  # the file that holds the options
    folder: str  # the folder is not this
    other: str  # the folder contains this instead
    busy: str  # another command does this
    remedy: str = ""  # where a file is damaged
    beside: tuple[str, ...] = ()  # files whose drafts are swept out of a begun folder too; none: of all

    def is_begun(self, out: Path) -> bool:
        """Return True if a folder holds a study of this kind."""
        return is_file(out / self.mark)

    def read(self, out: Path, name: str = "") -> dict[str, Any]:
        """Return the options of a folder, or its file ``name``.  BadInput: it is damaged, or of another version."""
        return sealed.read_json(out / (name or self.mark), self.remedy, formats=(FORMAT, UNSEALED))

    def written(self, about: dict[str, Any]) -> bytes:
        """Return the mark for the options ``about``."""
        return sealed.to_json(about)

    def differences(self, was: dict[str, Any], now: dict[str, Any]) -> list[str]:
        """Return the differences of two sets of options, a line each."""
        return difference(was, now)

    def require(self, out: Path, about: dict[str, Any] | None = None) -> None:
        """Raise BadInput unless a folder is new, empty, or of this kind and, if given, of the options ``about``.

        Writes nothing.
        """
        if self.is_begun(out):
            if about is not None and (differs := self.differences(self.read(out), about)):
                raise BadInput(f"--out {out}: contains {self.other}: {differs[0]}; choose another folder or delete it")
        elif not is_unused(out):
            raise BadInput(f"--out {out}: is not empty and not {self.folder}")

    @contextmanager
    def held(self, out: Path, about: dict[str, Any]) -> Iterator[None]:
        """Make the folder if there is none, hold it alone, sweep it, and mark it.  BadInput as ``require``."""
        self.require(out, about)
        with locked(out, self.busy):
            self.require(out, about)  # another command may have been faster
            begun = self.is_begun(out)
            sweep(out, *((self.mark, *self.beside) if begun and self.beside else ()))
            if not begun:
                write_whole(out / self.mark, self.written(about))
            yield


def write_whole(path: Path, data: bytes) -> None:
    """Write to the disk under another name, then rename: the file is complete or absent.  RigError: the disk."""
    try:
        with reported(path):
            path.parent.mkdir(exist_ok=True)
            with replaced(path) as draft, draft.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
    except BadInput as error:
        raise RigError(str(error)) from None


@contextmanager
def locked(folder: Path, busy: str) -> Iterator[None]:
    """Make the folder and hold its file ``lock``, which is not written to, and not followed when it is a link.

    busy : what another command that holds the lock is doing
    The system releases the lock of a process that ends for any reason.
    BadInput: another process holds the lock, it is a link, or the folder is not writable.
    """
    file = _opened(folder, folder / LOCK)
    try:
        try:
            _lock(file, hold=True)
            ours = os.path.samestat((folder / LOCK).lstat(), os.fstat(file))
        except OSError:  # held by another, or removed since
            ours = False
        if not ours:  # or another has removed it, and a third has made a new one
            raise BadInput(f"--out {folder}: another {busy} into it")
        try:
            yield
        finally:
            _lock(file, hold=False)
    finally:
        os.close(file)


def _opened(folder: Path, path: Path) -> int:
    """Return a descriptor of the lock file; BadInput as ``locked``."""
    require_writable(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.is_symlink():  # made a link since: O_NOFOLLOW, where the system has it
            return os.open(path, _FLAGS, 0o666)
    except OSError as error:
        raise BadInput(f"--out {folder}: cannot be written: {error.strerror}") from None
    raise BadInput(f"{path}: is a link and is not followed; remove it")


def _lock(file: int, hold: bool) -> None:
    """Lock the file for this descriptor, at once or not at all, or unlock it. OSError: another process holds it.

    Closing the descriptor also unlocks the file, but on Windows only some time later.
    """
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK if hold else msvcrt.LK_UNLCK, 1)  # the first byte, which need not be there
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB if hold else fcntl.LOCK_UN)
