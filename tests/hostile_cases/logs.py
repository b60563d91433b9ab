"""Kind ``log``: a damaged or dishonest MCAP log through every command that reads one."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random
from typing import Final

from hostile_cases.case import Case, Draw
from hostile_cases.store import Store
from hostile_cases.values import TEXTS, short

COMMANDS: Final[tuple[tuple[str, ...], ...]] = (
    ("info", "l.mcap"),
    ("info", "l.mcap", "--json"),
    ("score", "l.mcap", "--no-baseline"),
    ("score", "l.mcap"),
    ("replay", "l.mcap"),
    ("replay", "l.mcap", "--fly"),
    ("replay", "l.mcap", "--set", "redundancy.manager=median"),
    ("diff", "l.mcap", "log.mcap"),
    ("diff", "log.mcap", "l.mcap", "--json"),
    ("export", "l.mcap", "--to", "csv"),
    ("export", "l.mcap", "--to", "parquet", "--for-vote"),
    ("recover", "l.mcap"),
    ("view", "l.mcap", "--save", "v.rrd"),
    ("watch", "l.mcap", "--speed", "1000"),
    ("vote", "l.mcap", "--config", "vote.toml", "--out", "o.csv"),
)
_MAGIC: Final = b"\x89MCAP0\r\n"


def log(draw: Draw, store: Store) -> Case:
    """One damage, one command."""
    argv, name = draw.turn(COMMANDS), draw.rng.choice(sorted(_DAMAGES))
    text, seed = draw.rng.choice(TEXTS), draw.rng.random()

    def make(folder: Path) -> None:
        for needed in ("log.mcap", "vote.toml"):
            store.copy(needed, folder)
        (folder / "l.mcap").write_bytes(_DAMAGES[name]((folder / "log.mcap").read_bytes(), Random(seed)))

    def lies(folder: Path) -> None:
        make(folder)
        key = Random(seed).choice(["title", "id", "aircraft", "flight_point"])
        from hostile_cases.remade import retold

        retold(store.folder / "log.mcap", folder / "l.mcap", key, text)

    if draw.rng.random() < 0.25:
        return draw.case(argv, f"a log whose metadata says {short(text)}", lies)
    return draw.case(argv, f"a log: {name}", make)


def records(data: bytes) -> list[tuple[int, int]]:
    """Offset and opcode of every record of an MCAP file."""
    found, at = [], len(_MAGIC)
    while at + 9 <= len(data) - len(_MAGIC):
        found.append((at, data[at]))
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return found


def _flip(data: bytes, rng: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice([1, 3, 50])):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _cut(data: bytes, rng: Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _cut_between(data: bytes, rng: Random) -> bytes:
    return data[: rng.choice(records(data))[0]]


def _length(data: bytes, rng: Random) -> bytes:
    at = rng.choice(records(data))[0] + 1
    return data[:at] + struct.pack("<Q", rng.choice([0, 1, 2**31, 2**63, 2**64 - 1, 10])) + data[at + 8 :]


def _opcode(data: bytes, rng: Random) -> bytes:
    at = rng.choice(records(data))[0]
    return data[:at] + bytes([rng.choice([0, 1, 2, 3, 4, 5, 6, 8, 15, 0x80, 255])]) + data[at + 1 :]


def _left_out(data: bytes, rng: Random) -> bytes:
    at = rng.choice(records(data))[0]
    end = at + 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return data[:at] + data[end:]


def _twice(data: bytes, rng: Random) -> bytes:
    at = rng.choice(records(data))[0]
    end = at + 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return data[:end] + data[at:end] + data[end:]


def _within(data: bytes, rng: Random) -> bytes:
    """Numbers inside a record set to the largest."""
    at = rng.choice(records(data))[0] + 9 + 4 * rng.randrange(12)
    return data[:at] + rng.choice([b"\xff" * 8, b"\x00" * 8, b"\xff\xff\xff\x7f"]) + data[at + 8 :]


_DAMAGES: Final = {
    "bits flipped": _flip,
    "cut anywhere": _cut,
    "cut between records": _cut_between,
    "a length changed": _length,
    "an opcode changed": _opcode,
    "a record left out": _left_out,
    "a record twice": _twice,
    "numbers of a record changed": _within,
    "empty": lambda data, rng: b"",
    "the magic alone": lambda data, rng: _MAGIC,
    "magic twice": lambda data, rng: _MAGIC * 2,
    "bytes after the end": lambda data, rng: data + b"x" * 1000,
    "two logs in one": lambda data, rng: data + data,
    "text": lambda data, rng: b"time_s,x.1\n0,1\n",
}
