"""Lines on stderr about a missing optional resource of a command."""

from __future__ import annotations

from functools import cache


@cache
def note(text: str) -> None:
    """Print a line on stderr, once per process."""
    from rig.core.console import console

    console(stderr=True).print(f"note: {text}", soft_wrap=True)
