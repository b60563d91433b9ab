"""What can go wrong outside a frame (inside a frame nothing raises, a status says it).

RigError                  a failure of ours or of the machine: exit code 1
├── ManagerFailed         a manager class of the user's own raised in a frame
│   └── UnitDead          a unit under test does not answer any more
└── BadInput              what the user gave cannot be used: one line, exit code 2
    ├── PointFault        a flight point at which an aircraft cannot be designed
    ├── UnitRefused       a unit under test that will not fly, or must not
    └── BadLog            a file that is no log, or a damaged one
"""

from __future__ import annotations

from typing import Any

from rig.core.text import one_line


class RigError(Exception):
    """A flight, log or design that could not be completed.

    The message becomes one plain line (text.one_line), whatever was put into it.
    """

    def __init__(self, message: str = "", *rest: Any) -> None:
        super().__init__(one_line(message), *rest)


class ManagerFailed(RigError):
    """A manager class of the user's own that raised: ``row`` of its block, ``frame`` of the flight."""

    def __init__(self, message: str, row: int = 0, frame: int = 0) -> None:
        super().__init__(message, row, frame)
        self.row, self.frame = row, frame

    def __str__(self) -> str:
        return str(self.args[0])


class BadInput(RigError):
    """Input that is refused before anything is written.

    The message is one line: file, key, what is wrong, what is allowed.
    """


class PointFault(BadInput):
    """A flight point at which an aircraft cannot be designed or flown: ``point`` is its name."""

    def __init__(self, message: str = "", point: str = "") -> None:
        super().__init__(message)
        self.point = point


class UnitDead(ManagerFailed):
    """A unit under test that does not answer any more, and why."""


class UnitRefused(BadInput):
    """A unit under test that cannot be begun."""


class BadLog(BadInput):
    """A log file that cannot be read: missing, foreign, truncated or damaged."""
