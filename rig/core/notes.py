"""Lines on stderr about what a command could not have, and does without."""

from __future__ import annotations

from functools import cache


@cache
def note(text: str) -> None:
    """Print a line on stderr, once in a process."""
    from rig.core.console import console

    console(stderr=True).print(f"note: {text}", soft_wrap=True)
