"""Hostile things in the place of a file or a folder that a command reads."""

from __future__ import annotations

import os
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from hostile_cases.readers import Reader

Thing = Callable[[Path, Path, str, Random], object]  # where, the sound file or folder, the folder's own file, choices
NAME: Final = "a name that is not UTF-8"
SPARSE_BYTES: Final = 20 << 30  # of ``sparse`` in the store
_ABSURD: Final = ("1e999", "-1e308", "nan", "9" * 400, "-0.0", "1e-320", "18446744073709551616")


def _pipe(path: Path, sound: Path, mark: str, rng: Random) -> None:
    os.mkfifo(path)


def _linked_pipe(path: Path, sound: Path, mark: str, rng: Random) -> None:
    os.mkfifo(path.with_name("pipe"))
    path.symlink_to("pipe")


def _socket(path: Path, sound: Path, mark: str, rng: Random) -> None:
    here = Path.cwd()
    os.chdir(path.parent)  # its name may have 108 characters
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)
    os.chdir(here)


def _sparse(path: Path, sound: Path, mark: str, rng: Random) -> None:
    path.symlink_to(sound.parent / "sparse")


def _of_bytes(change: Callable[[bytes, Random], bytes]) -> Thing:
    """The sound file changed; of a folder, the file by which it is known."""

    def make(path: Path, sound: Path, mark: str, rng: Random) -> None:
        if mark:
            shutil.copytree(sound, path)
            path /= mark
        path.write_bytes(change((sound / mark if mark else sound).read_bytes(), rng))

    return make


def _flipped(data: bytes, rng: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice([1, 5, 100])):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _absurd(data: bytes, rng: Random) -> bytes:
    """A number of the text exchanged; of other files, eight bytes set."""
    text = data.decode("utf-8", "replace")
    places = [at for at, letter in enumerate(text) if letter.isdigit() and not text[at - 1].isalnum()]
    if b"\0" in data or not places:
        at = rng.randrange(max(len(data) - 8, 1))
        return data[:at] + b"\xff" * 8 + data[at + 8 :]
    at = rng.choice(places)
    end = next((i for i in range(at, len(text)) if text[i] not in "0123456789.e+-"), len(text))
    return (text[:at] + rng.choice(_ABSURD) + text[end:]).encode()


def _deep(data: bytes, rng: Random) -> bytes:
    return b"[" * 100_000 if data[:1] in (b"{", b"[") and b"\n" not in data[:2] else b"x = " + b"[" * 20_000


def _renamed(path: Path, sound: Path, mark: str, rng: Random) -> None:
    (shutil.copytree if mark else shutil.copyfile)(sound, path)


def _alone(name: str) -> Thing:
    """A folder with nothing in it but what a kill in its first moment leaves."""

    def make(path: Path, sound: Path, mark: str, rng: Random) -> None:
        path.mkdir()
        (path / name.format(mark)).write_text("{")

    return make


_ANYWHERE: Final[dict[str, Thing]] = {
    "a FIFO": _pipe,
    "a link to a FIFO": _linked_pipe,
    "endless": lambda path, *_: path.symlink_to("/dev/zero"),
    "20 GB, sparse": _sparse,
    "a socket": _socket,
    NAME: _renamed,
    "cut": _of_bytes(lambda data, rng: data[: rng.randrange(len(data))]),
    "bits flipped": _of_bytes(_flipped),
    "not UTF-8": _of_bytes(lambda data, rng: b'title = "\xff\xfe"\n' + data),
    "nested deep": _of_bytes(_deep),
    "absurd numbers": _of_bytes(_absurd),
}
THINGS: Final[dict[str, Thing]] = {
    **_ANYWHERE,
    "empty": lambda path, *_: path.touch(),
    "a folder": lambda path, *_: path.mkdir(),
}
FOLDER_THINGS: Final[dict[str, Thing]] = {
    **_ANYWHERE,
    "empty": lambda path, *_: path.mkdir(),
    "a file": lambda path, *_: path.write_text("x"),
    "a lock alone": _alone("lock"),
    "drafts alone": _alone(".{}.0a1b2c3d.part"),
}
REFUSED: Final = {"a FIFO", "a link to a FIFO", "endless", "20 GB, sparse", "a socket"}  # whatever reads it


def not_for(reader: Reader, thing: str) -> str:
    """Why a thing is not tried with a reader; empty when it is."""
    if thing == NAME and reader.beside:
        return "the name stands in TOML, which is UTF-8"
    if reader.long and thing not in REFUSED and not (reader.mark and thing in ("empty", "a file")):
        return "what may be sound input keeps the command busy for minutes"
    if reader.mark and reader.argv.find("--out X") >= 0 and thing in ("empty", NAME, "a lock alone", "drafts alone"):
        return "a folder to begin in: tests/test_campaign_run.py and its like"
    if thing in ("not UTF-8", "nested deep") and reader.ending in (".parquet", ".mcap"):
        return "no text"
    return ""
