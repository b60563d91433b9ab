"""One event of a flight, and the report of the stream that showed the flight live.

This module needs no kernels, so that a log is read and viewed without loading them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Event:
    """One event in one frame."""

    frame: int  # from 0
    level: Severity  # "info", "warning" or "error"
    name: str  # kind of event, such as "channel failed"
    text: str  # description


@dataclass(frozen=True, slots=True)
class StreamReport:
    """The result of a live stream."""

    where: str  # the .rrd file, or the address of the server
    browser: str  # address for a browser; empty: not served
    sent_frames: int  # frames sent
    dropped_frames: int  # frames not sent, because the viewer was too slow
    error: str  # empty: no error
