"""READY and REFUSED of a unit, and the check of a message that should be one of them."""

from __future__ import annotations

import zlib
from typing import Any, Final, NamedTuple

import numpy as np

from rig.unit.host import HEAD
from rig.unit.unit_records import (
    FROM_UNIT,
    INTERFACE,
    INTERFACES,
    LAYOUT,
    READY,
    TO_UNIT,
    VERSION,
    Interface,
    Kind,
    place,
)

REBUILD: Final = "write the header again ('rig unit header') and rebuild"
_TEXT_AT: Final = place(READY, "text")[1]
_BODY: Final = place(READY, "length")[1]


class UnitStopped(Exception):
    """A unit that stops answering, and the reason."""


class Ready(NamedTuple):
    """A READY or REFUSED; ``wrong`` is the reason why a message is neither, the other fields are then undefined."""

    kind: int
    session: int
    text: str
    wrong: str = ""
    interface: Interface = INTERFACE  # that the unit was built for


def read_ready(message: bytes | memoryview) -> Ready:
    """Return the READY or REFUSED of a unit.  UnitStopped: it was built for other records."""
    wrong = _wrong(bytes(message))
    if wrong:
        return Ready(0, 0, "", wrong)
    _, version, kind, layout, session, _, _ = HEAD.unpack_from(message)
    text = bytes(message[_TEXT_AT:_BODY]).split(b"\0")[0].decode(errors="replace")
    return Ready(kind, session, text, interface=INTERFACES[version, layout])


def _wrong(message: bytes) -> str:
    """Return the fault of a READY or REFUSED, "" if none."""
    if not message:
        return "an empty message"
    magic = int.from_bytes(message[:4], "little")
    if message[:4] == FROM_UNIT.to_bytes(4, "big"):
        return "a message in big-endian byte order, must be little-endian"
    if magic == TO_UNIT:
        return "a message with the magic RIGI of the rig, must be RIGO"
    if magic != FROM_UNIT:
        return f"{len(message)} bytes without the magic RIGO of a unit"
    if len(message) < HEAD.size:
        return f"{len(message)} bytes, fewer than the head of a record"
    _, version, kind, layout, *_ = HEAD.unpack_from(message)
    if (version, layout) not in INTERFACES:
        built = f"layout {layout:016x}, version {version}"
        raise UnitStopped(f"was built for {built}, this rig has {LAYOUT:016x}, version {VERSION}: {REBUILD}")
    if kind not in (Kind.READY, Kind.REFUSED):
        named = Kind(kind).name if kind in set(Kind) else f"a message of kind {kind}"
        return f"{named}, which is neither READY nor REFUSED"
    return _wrong_size(message, Kind(kind).name)


def _wrong_size(message: bytes, name: str) -> str:
    """Return the fault of length and checksum, "" if none."""
    if len(message) != READY.itemsize:
        return f"{name} of {len(message)} bytes, must be {READY.itemsize}"
    length, crc = (int.from_bytes(message[at : at + 4], "little") for at in (_BODY, _BODY + 4))
    if length != _BODY:
        return f"{name} with length {length} before its checksum, must be {_BODY}"
    if crc not in (0, zlib.crc32(message[:_BODY])):
        return f"{name} with checksum {crc:08x}, must be {zlib.crc32(message[:_BODY]):08x}"
    return ""


def sealed(record: np.ndarray[Any, Any]) -> memoryview:
    """Write the checksum of a record (1,) into it; return its bytes."""
    return summed(record.view(np.uint8).data)


def summed(message: memoryview) -> memoryview:
    """Write the checksum of a message into its last bytes; return it."""
    message[-4:] = zlib.crc32(message[:-8]).to_bytes(4, "little")
    return message
