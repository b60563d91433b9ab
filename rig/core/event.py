"""One event of a flight, and the report of the stream that showed the flight live.

This module needs no kernels, so that a log is read and viewed without loading them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened in one frame."""

    frame: int
    level: Severity
    name: str  # what kind of event, e.g. "channel failed"
    text: str


@dataclass(frozen=True, slots=True)
class StreamReport:
    """Result of a stream."""

    where: str  # the .rrd file, or the address of the server
    browser: str  # what to open in a browser; empty unless served
    sent_frames: int
    dropped_frames: int
    error: str  # empty when all went well
