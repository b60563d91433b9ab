"""Entries of ``[mapping]``: each names a source, which is a topic or a file in a folder, and a field of it.

/imu1:angular_velocity.x    source and field
imu:gyro:x                  both may hold colons: the longest name that is a source counts
"imu:gyro":x                a source in quotes is taken as it is
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from rig.core.errors import BadInput


class Place(NamedTuple):
    """A field of a source."""

    source: str
    field: str


def places(mapping: Mapping[str, str], is_source: Callable[[str], bool]) -> dict[str, Place]:
    """Return the place of each column of a mapping.  BadInput: an entry that names no source and field."""
    return {column: _place(column, text, is_source) for column, text in mapping.items()}


def fields_of(named: Mapping[str, Place]) -> dict[str, set[str]]:
    """Return the fields of each source, in the order of the mapping: the source of the rows is the first."""
    wanted: dict[str, set[str]] = {}
    for place in named.values():
        wanted.setdefault(place.source, set()).add(place.field)
    return wanted


def _place(column: str, text: str, is_source: Callable[[str], bool]) -> Place:
    colons = [at for at, letter in enumerate(text) if letter == ":" and 0 < at < len(text) - 1]
    at = next((at for at in reversed(colons) if is_source(text[:at])), None)
    if at is None and text.startswith('"'):
        source, quote, field = text[1:].partition('":')
        if quote and source and field:
            return Place(source, field)
    if not colons:
        raise BadInput(f"[mapping] {column}: must be '<source>:<field>', got {text!r}")
    at = colons[-1] if at is None else at
    return Place(text[:at], text[at + 1 :])
