"""The format of a log, by its first bytes, and its reader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from rig.core.errors import BadInput, BadLog
from rig.core.files import is_folder, open_regular, reported
from rig.log.foreign import encodings
from rig.log.recordings.columns_file import TABLES
from rig.log.recordings.formats import ardupilot, bags, mdf, px4, ros2
from rig.log.recordings.formats.ardupilot import ArduPilotLog
from rig.log.recordings.formats.cdr import KINDS
from rig.log.recordings.formats.contents import OpenLog
from rig.log.recordings.formats.mdf import MdfLog
from rig.log.recordings.formats.px4 import Px4Log
from rig.log.recordings.formats.ros2 import Ros2Log

_LONGEST: Final = 32  # bytes by which a format is known
_BLACKBOX: Final = b"H Product:Blackbox"


class Format(NamedTuple):
    """A format of logs: the name, the first bytes of its files, and how one is opened."""

    name: str
    magic: bytes
    open: Callable[[Path], OpenLog]


FORMATS: Final = (
    Format(px4.FORMAT, px4.MAGIC, Px4Log),
    Format(ardupilot.FORMAT, ardupilot.MAGIC, ArduPilotLog),
    Format(ros2.FORMAT, bags.SQLITE, Ros2Log),
    Format(mdf.FORMAT, mdf.MAGIC, MdfLog),
)


def names() -> str:
    """Return the names of all formats."""
    return ", ".join(format.name for format in FORMATS)


def open_log(path: Path) -> OpenLog | None:
    """Return the log at ``path``, opened by its format; None: a table, an MCAP file without CDR, a folder of tables.

    BadInput: the library of its format is not installed, damaged, nothing in it.
    """
    found = format_of(path)
    return None if found is None else found.open(path)


def format_of(path: Path) -> Format | None:
    """Return the format of the log at ``path`` by its content; None as of ``open_log``.  BadInput: Betaflight's."""
    if is_folder(path):
        return Format(ros2.FORMAT, b"", Ros2Log) if bags.is_bag_folder(path) else None
    with open_regular(path) as file, reported(path, BadInput, "cannot be read"):
        start = file.read(_LONGEST)
    if not start and path.suffix not in (*TABLES, ".mcap"):
        raise BadInput(f"{path}: the file is empty")
    if start.startswith(_BLACKBOX):
        raise BadInput(f"{path}: a Betaflight log: it has one gyro, nothing to compare")
    if start.startswith(bags.MCAP):
        return Format(ros2.FORMAT, bags.MCAP, Ros2Log) if _is_bag(path) else None
    return next((format for format in FORMATS if start.startswith(format.magic)), None)


def is_log(path: Path) -> bool:
    """Return True if ``path`` is a log of another system; False too if it cannot be read."""
    try:
        return format_of(path) is not None
    except BadInput:
        return False


def _is_bag(path: Path) -> bool:
    """Return True if an MCAP file has sensors of ROS 2, or only messages of it; its own reader tells of damage."""
    try:
        found = encodings(path)
    except BadLog:
        return False
    cdr = {schema for encoding, schema in found if encoding == "cdr"}
    return bool(cdr) and (len(cdr) == len(found) or not cdr.isdisjoint(KINDS))
