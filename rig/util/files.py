"""Bundled files, and output files: whole or not there, and never two writers in one.

A file that the user names is written beside and renamed: of two commands with one output the later wins, and the
file is whole.  A file that is named here takes the next free number.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from rig.errors import BadInput, RigError

_KEPT = 40  # characters of a file's name that its draft has too; a name may not have more than 255 bytes
DRAFT = ".part"
NOT_WHOLE = "a file of the rig, which is not installed as a whole, cannot be read"


def bundled(kind: str) -> Path:
    """Return the bundled ``aircraft`` or ``faults`` folder: inside the installed package, else in the checkout.

    RigError: neither is there.
    """
    package = Path(__file__).parents[1]
    installed, checkout = package / "bundled" / kind, package.parent / kind
    for folder in (installed, checkout):
        if folder.is_dir():
            return folder
    raise RigError(f"{installed}: {NOT_WHOLE}: no such folder")


def is_file(path: Path) -> bool:
    """Return True if a regular file is there; False for a name that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 # Path.is_file raises for a name that is too long


def is_pipe(path: Path) -> bool:
    """Return True if opening ``path`` would wait for a writer; False for a name that no file can have."""
    try:
        return path.is_fifo()
    except OSError:
        return False


@contextmanager
def reported(where: Path | str, kind: type[RigError] = RigError, what: str = "cannot be written") -> Iterator[None]:
    """Raise what the system refuses in the block as one line of ``kind``: ``where``, ``what`` and the reason."""
    try:
        yield
    except (OSError, ValueError) as error:  # a name that no file can have is a ValueError
        raise kind(f"{where}: {what}: {getattr(error, 'strerror', None) or error}") from None


def read_bytes(path: Path, most: int) -> bytes:
    """Return a file's bytes; BadInput: missing, a pipe, unreadable, or more than ``most`` bytes."""
    with reported(path, BadInput, "cannot be read"):
        try:
            if path.is_fifo():  # opening one waits for a writer
                raise BadInput(f"{path}: is a pipe, no file")
            with path.open("rb") as file:
                data = file.read(most + 1)  # a device may never end
        except FileNotFoundError:
            raise BadInput(f"{path}: no such file") from None
    if len(data) > most:
        raise BadInput(f"{path}: larger than {most >> 20} MiB")
    return data


@contextmanager
def new_folder(path: Path) -> Iterator[None]:
    """Make the folder ``path`` and those above it where they are missing; they go again when the block raises."""
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # somebody else has put something there
            for folder in made:
                folder.rmdir()
        raise


@contextmanager
def draft(path: Path) -> Iterator[Path]:
    """Yield a new empty file beside ``path``, under a name of its own; it is removed at the end.

    BadInput: ``path`` is a folder or a device, cannot be a file's name, or its folder is not there or not writable.
    """
    _check(path)
    made = path.with_name(f".{path.name[:_KEPT]}.{secrets.token_hex(4)}{DRAFT}")
    with reported(path, BadInput):
        made.touch(exist_ok=False)
    try:
        yield made
    finally:
        made.unlink(missing_ok=True)


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield a draft, which becomes ``path`` when the block ends well; after an error ``path`` is as before.

    A link at ``path`` is replaced, not followed.  BadInput as of ``draft``; RigError when it cannot be renamed.
    """
    with draft(path) as made:
        yield made
        with reported(path):
            made.replace(path)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 with Unix line ends, all of it or nothing. BadInput as of ``draft``, RigError: the disk."""
    with replaced(path) as made, reported(path):
        made.write_text(text, encoding="utf-8", newline="\n")


def numbered(folder: Path, stem: str, ending: str, beside: str = "") -> Iterator[Path]:
    """Yield the free names of stem.ending, stem_2.ending, stem_3.ending; another process may take one first.

    beside : the ending of a file that may be written with it, whose name must be free too
    """
    for number in count(1):
        name = stem if number == 1 else f"{stem}_{number}"
        if not any(os.path.lexists(folder / f"{name}{each}") for each in (ending, beside or ending)):
            yield folder / f"{name}{ending}"  # of a name that is no link to nowhere either


def publish(made: Path, paths: Iterable[Path]) -> Path:
    """Rename a draft to the first of ``paths`` that is free, and say which. RigError when it cannot be renamed."""
    for path in paths:
        with reported(path):
            try:
                path.touch(exist_ok=False)  # ours from here on, whoever else looks for a name
            except FileExistsError:
                continue
            try:
                return made.replace(path)
            except OSError:
                path.unlink(missing_ok=True)
                raise
    raise RigError(f"{made.parent}: no free name")


def _check(path: Path) -> None:
    """Raise BadInput unless a regular file is at ``path``, or none."""
    with reported(path, BadInput):
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
