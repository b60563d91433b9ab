"""What can go wrong outside a frame (inside a frame nothing raises, a status says it).

RigError                  a failure of ours or of the machine: exit code 1
└── BadInput              what the user gave cannot be used: one line, exit code 2
    └── BadLog            a file that is no log, or a damaged one
"""


class RigError(Exception):
    """A flight, log or design that could not be completed; the message is one line."""


class BadInput(RigError):
    """Input that is refused before anything is written.

    The message is one line: file, key, what is wrong, what is allowed.
    """


class BadLog(BadInput):
    """A log file that cannot be read: missing, foreign, truncated or damaged."""
