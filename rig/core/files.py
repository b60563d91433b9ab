"""Bundled files, and output files, which are complete or absent, and never have two writers.

The rig writes a file that the user names beside its place and renames it.  If two commands have one output, the later
one wins, and the file is complete.  A file that this module names takes the next free number.
"""

from __future__ import annotations

import os
import re
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from itertools import count
from pathlib import Path
from typing import Final

from rig.core.confined import may_read, may_write
from rig.core.errors import BadInput, RigError

_KEPT = 40  # characters of a file's name that its draft has too; a name may not have more than 255 bytes
DRAFT = ".part"
_AT_ONCE: Final = getattr(os, "O_NONBLOCK", 0)  # a pipe that has come meanwhile is not waited for
_KINDS: Final = {stat.S_IFIFO: "a pipe", stat.S_IFDIR: "a folder", stat.S_IFSOCK: "a socket"}  # others: a device
NOT_WHOLE = "cannot be read: the installation of the rig is incomplete"
LOCK: Final = "lock"  # an empty file in a folder, locked by the command that writes into the folder
_DRAFT_NAME: Final = re.compile(rf"\..{{1,{_KEPT}}}\.[0-9a-f]{{8}}\{DRAFT}", re.DOTALL)
_DEVICES: Final = ("/dev", "/proc", "/sys")
_SHARED_MEMORY: Final = "/dev/shm"  # a folder of files among the devices
_MOST_LINKS: Final = 40  # in a row, as of the system


def bundled(kind: str) -> Path:
    """Return the bundled ``aircraft`` or ``faults`` folder, of the installed package or of the checkout.

    RigError: neither exists.
    """
    package = Path(__file__).parents[1]
    installed, checkout = package / "bundled" / kind, package.parent / kind
    for folder in (installed, checkout):
        if folder.is_dir():
            return folder
    raise RigError(f"{installed}: {NOT_WHOLE}: no such folder")


def is_file(path: Path) -> bool:
    """Return True if a regular file exists; False for a name that no file can have, or where no file may be read."""
    return may_read(path) and os.path.isfile(path)  # noqa: PTH113 # Path.is_file raises for a name that is too long


def is_installed(path: Path) -> bool:
    """Return True if a file exists in an installation, or among the files that the rig keeps, for any limits."""
    return os.path.isfile(path)  # noqa: PTH113 # as is_file


def is_folder(path: Path) -> bool:
    """Return True if a folder exists; False for a name that no folder can have, or without permission to look."""
    return may_read(path) and os.path.isdir(path)  # noqa: PTH112 # Path.is_dir raises for those


@contextmanager
def reported(where: Path | str, kind: type[RigError] = RigError, what: str = "cannot be written") -> Iterator[None]:
    """Raise an error of the system in the block as one line of ``kind``: ``where``, ``what`` and the reason."""
    try:
        yield
    except (OSError, ValueError) as error:  # a name that no file can have is a ValueError
        raise kind(f"{where}: {what}: {getattr(error, 'strerror', None) or error}") from None


def open_regular(
    path: Path, most: int | None = None, kind: type[BadInput] = BadInput, where: str = ""
) -> BufferedReader:
    """Open a file that the user names for reading; ``most``: the largest allowed number of bytes.

    ``kind``, which names ``where`` or the path: missing, no regular file, unreadable, larger than ``most``.  A pipe
    waits for a writer, a device may never end: neither is opened.
    """
    where = where or str(path)
    if not may_read(path):
        raise kind(f"{where}: is outside the folders that rig mcp may read")
    with reported(where, kind, "cannot be read"):
        try:
            status = path.stat()
            if not stat.S_ISREG(status.st_mode):
                raise kind(f"{where}: is {_KINDS.get(stat.S_IFMT(status.st_mode), 'a device')}, not a file")
            if most is not None and status.st_size > most:
                raise kind(f"{where}: {_larger(most)}")
            return open(path, "rb", opener=_opened)
        except FileNotFoundError:
            raise kind(f"{where}: no such file") from None


def _opened(name: str, flags: int) -> int:
    return os.open(name, flags | _AT_ONCE)


def read_bytes(path: Path, most: int, where: str = "") -> bytes:
    """Return a file's bytes, at most ``most``; BadInput as of ``open_regular``."""
    with open_regular(path, most, where=where) as file, reported(where or path, BadInput, "cannot be read"):
        data = file.read(most + 1)  # of a file whose size is not told, as those of /proc
    if len(data) > most:
        raise BadInput(f"{where or path}: {_larger(most)}")
    return data


def _larger(most: int) -> str:
    return f"larger than {most >> 20} MiB"


def is_unused(folder: Path, is_left: Callable[[Path], bool] = lambda path: False) -> bool:
    """Return True if there is no folder, or one that is empty except for the rig's lock and drafts.

    A command that was killed in its first moment leaves such a folder; the same command resumes there.
    is_left : returns True for another file that the command may have left
    BadInput: the folder, which ``--out`` named, cannot be read.
    """
    with reported(f"--out {folder}", BadInput, "cannot be read"):
        if not os.path.isdir(folder):  # noqa: PTH112 # Path.is_dir raises for a name that is too long
            return not os.path.lexists(folder)
        with os.scandir(folder) as entries:
            return all(_is_ours(entry) or is_left(Path(entry.path)) for entry in entries)


def _is_ours(entry: os.DirEntry[str]) -> bool:
    """Return True for a lock, which is empty, and for a draft."""
    if not entry.is_file(follow_symlinks=False):
        return False
    return _DRAFT_NAME.fullmatch(entry.name) is not None or (entry.name == LOCK and not entry.stat().st_size)


def sweep(folder: Path, *names: str) -> None:
    """Remove the drafts that killed commands left in ``folder``: drafts of the files ``names``, or all drafts."""
    begin = tuple(f".{name[:_KEPT]}." for name in names)
    for path in folder.glob(f".*{DRAFT}"):
        if _DRAFT_NAME.fullmatch(path.name) and (not names or path.name.startswith(begin)) and not path.is_dir():
            path.unlink(missing_ok=True)


@contextmanager
def new_folder(path: Path) -> Iterator[None]:
    """Make the folder ``path`` and missing ones above it; remove them again if the block raises."""
    require_writable(path / LOCK)
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        with suppress(OSError):  # somebody else has put something there
            for folder in made:
                folder.rmdir()
        raise


def require_writable(path: Path) -> None:
    """Raise BadInput if a limit of this process excludes a file at ``path``."""
    if not may_write(path):
        raise BadInput(f"{path}: is outside the folder that rig mcp may write")


def require_place(path: Path) -> None:
    """Raise BadInput unless a file can be written to ``path``: a regular file or nothing is there.

    A link among the devices is refused.
    """
    require_writable(path)
    with reported(path, BadInput):
        _require_no_device(path)
        try:
            mode = path.stat().st_mode
        except FileNotFoundError:
            if not path.parent.is_dir():
                raise BadInput(f"{path}: no such folder: {path.parent}") from None
            return
    if stat.S_ISDIR(mode):
        raise BadInput(f"{path}: is a folder")
    if not stat.S_ISREG(mode):
        raise BadInput(f"{path}: not a regular file")


@contextmanager
def draft(path: Path) -> Iterator[Path]:
    """Yield a new empty file beside ``path``, under a separate name; remove it at the end.

    BadInput: ``path`` is a folder or a device, cannot be a file's name, or its folder is not there or not writable.
    """
    require_place(path)
    made = path.with_name(f".{path.name[:_KEPT]}.{secrets.token_hex(4)}{DRAFT}")
    with reported(path, BadInput):
        made.touch(exist_ok=False)
    try:
        yield made
    finally:
        made.unlink(missing_ok=True)


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield a draft that becomes ``path`` when the block succeeds; after an error ``path`` is unchanged.

    A link at ``path`` is replaced, not followed: its target stays unchanged.
    BadInput as of ``draft``; RigError when it cannot be renamed.
    """
    with draft(path) as made:
        yield made
        with reported(path):
            made.replace(path)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 with Unix line ends, all of it or nothing. BadInput as of ``draft``, RigError: the disk."""
    with replaced(path) as made, reported(path):
        made.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")  # names that are not UTF-8


def numbered(folder: Path, stem: str, ending: str, beside: str = "") -> Iterator[Path]:
    """Yield the free names among stem.ending, stem_2.ending, stem_3.ending; another process may take one first.

    beside : ending of a second file, whose name must be free too
    """
    for number in count(1):
        name = stem if number == 1 else f"{stem}_{number}"
        if not any(os.path.lexists(folder / f"{name}{each}") for each in (ending, beside or ending)):
            yield folder / f"{name}{ending}"  # of a name that is no link to nowhere either


def publish(made: Path, paths: Iterable[Path]) -> Path:
    """Rename a draft to the first free one of ``paths``, and return that. RigError: it cannot be renamed."""
    for path in paths:
        with reported(path):
            try:
                path.touch(exist_ok=False)  # ours from here on, of all processes that look for a name
            except FileExistsError:
                continue
            try:
                return made.replace(path)
            except OSError:
                path.unlink(missing_ok=True)
                raise
    raise RigError(f"{made.parent}: no free name")


def _require_no_device(path: Path) -> None:
    """Raise BadInput if ``path`` is a link, or a chain of links, to a name among the devices.

    The system may report such a name as a regular file: /dev/stdout of a command whose output goes to a file.
    """
    at, seen = path, 0
    while seen < _MOST_LINKS:
        place, is_link = os.path.join(os.path.realpath(at.parent), at.name), at.is_symlink()  # noqa: PTH118 # normal
        among = place.startswith(tuple(f"{each}/" for each in _DEVICES)) and not place.startswith(f"{_SHARED_MEMORY}/")
        if among and (is_link or seen):
            raise BadInput(f"{path}: is a link among the devices ({place}), not a regular file")
        if not is_link:
            return
        at, seen = Path(place).parent / at.readlink(), seen + 1
