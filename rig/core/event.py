"""One event of a flight, as it is found, logged, read and shown.

No kernels here: a log is read and viewed before they would be loaded.
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
