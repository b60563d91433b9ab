"""Limits of a process that works for an agent (``rig mcp``): the folders that it may read and write; it runs no code.

The environment holds them, so that the processes that it starts have the same.  Any other process has no limits.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rig.core.errors import BadInput

VARIABLE: Final = "RIG_CONFINED"
_PACKAGE: Final = Path(__file__).parents[1]
_OURS: Final = (_PACKAGE, *(_PACKAGE.parent / kind for kind in ("aircraft", "faults")))  # installed, or a checkout
_scratch: set[Path] = set()  # folders of this process that it removes itself


@dataclass(frozen=True, slots=True)
class Limits:
    """Folders without links in their paths, of which a process may read both kinds, and the size of a flight."""

    write: Path
    read: tuple[Path, ...]
    frames: int  # of a flight, at most


def environment(write: Path, read: Iterable[Path], frames: int) -> dict[str, str]:
    """Return the variable that confines a process."""
    folders = {"write": _real(write), "read": [_real(folder) for folder in read]}
    return {VARIABLE: json.dumps({**folders, "frames": frames})}


@cache
def limits() -> Limits | None:
    """Return the limits of this process; None: it has none."""
    text = os.environ.get(VARIABLE)
    if text is None:
        return None
    given = json.loads(text)
    return Limits(Path(given["write"]), tuple(map(Path, given["read"])), given["frames"])


def may_read(path: Path) -> bool:
    """Return True unless a limit excludes ``path``, or what its links lead to."""
    held = limits()
    return held is None or is_below(path, (held.write, *held.read, *_OURS, *_scratch))


def may_write(path: Path) -> bool:
    """Return True unless a limit excludes a file at ``path``; a link there is replaced, not followed."""
    held = limits()
    return held is None or is_below(path.parent, (held.write, *_scratch))


def may_run_code() -> bool:
    """Return False in a process that works for an agent: no manager class and no unit of a user may run there."""
    return limits() is None


def require_short(frames: int) -> None:
    """Raise BadInput if a limit excludes a flight of ``frames``."""
    held = limits()
    if held is not None and frames > held.frames:
        raise BadInput(f"duration_s: {frames} frames; rig mcp flies at most {held.frames} (duration_s times rate_hz)")


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a temporary folder, which this process may read and write; remove it at the end."""
    with TemporaryDirectory() as name:
        folder = Path(_real(Path(name)))
        _scratch.add(folder)
        try:
            yield folder
        finally:
            _scratch.discard(folder)


def is_below(path: Path, folders: Iterable[Path]) -> bool:
    """Return True if ``path``, its links followed, is one of ``folders`` or in one; they have no links."""
    try:
        place = Path(_real(path))
    except (OSError, ValueError):  # a circle of links, or no name of a file
        return False
    return any(place.is_relative_to(folder) for folder in folders)


def _real(path: Path) -> str:
    return os.path.realpath(path)
