"""Errors outside a frame (inside a frame a status field reports an error, and nothing raises).

RigError                  a failure of the rig or of the machine: exit code 1
├── ManagerFailed         the user's manager class raised in a frame
│   └── UnitDead          a unit under test no longer answers
└── BadInput              input that cannot be used: one line, exit code 2
    ├── PointFault        a flight point at which an aircraft cannot be designed
    ├── UnitRefused       a unit under test that cannot fly
    └── BadLog            a file that is no log, or a damaged log
"""

from __future__ import annotations

from typing import Any

from rig.core.text import one_line


class RigError(Exception):
    """A flight, log or design that could not be completed.

    The message becomes one plain line (text.one_line).
    """

    def __init__(self, message: str = "", *rest: Any) -> None:
        super().__init__(one_line(message), *rest)


class ManagerFailed(RigError):
    """An exception of the user's manager class: ``row`` of its block, ``frame`` of the flight."""

    def __init__(self, message: str, row: int = 0, frame: int = 0) -> None:
        super().__init__(message, row, frame)
        self.row, self.frame = row, frame

    def __str__(self) -> str:
        return str(self.args[0])


class BadInput(RigError):
    """Input that a command refuses before it writes anything.

    The message is one line: file, key, what is wrong, what is allowed.
    """


class PointFault(BadInput):
    """A flight point at which an aircraft cannot be designed or flown: ``point`` is its name."""

    def __init__(self, message: str = "", point: str = "") -> None:
        super().__init__(message)
        self.point = point


class UnitDead(ManagerFailed):
    """A unit under test that no longer answers, and the reason."""


class UnitRefused(BadInput):
    """A unit under test that cannot be started."""


class BadLog(BadInput):
    """A log file that cannot be read: missing, foreign, truncated or damaged."""
