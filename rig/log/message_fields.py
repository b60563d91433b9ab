"""A field of a message by its name, in messages that were decoded: JSON values and protobuf messages.

    angular_velocity.x     nested; data.3 is an element of a list
    gyro.x                 also the one key "gyro.x": the longest name that the message has counts
    "gyro.x"."y"           names in quotes are taken as they are

A message that leaves a field out has its default by the schema: zero in protobuf, ``default`` in a JSON schema.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from google.protobuf.message import Message
from mcap.records import Schema

_PART: Final = re.compile(r'"([^"]+)"(?:\.|$)|([^."]+)(?:\.|$)')
_HOPS: Final = 16  # references within a schema that are followed
_MISSING: Final = object()


class _Name(NamedTuple):
    """A part of a name between dots; ``exact``: it was quoted, and is not joined to another."""

    text: str
    exact: bool


class FieldPath:
    """The name of a field, and where the messages have it."""

    def __init__(self, text: str) -> None:
        """Take a name as a mapping writes it."""
        self._names = _parts(text)
        self._steps: list[str] | None = None  # of the messages so far

    def value(self, message: Any) -> Any:
        """Return what a message has in the field.  LookupError: it has none."""
        if self._steps is not None:
            found = _along(message, self._steps)
            if found is not _MISSING:
                return found
        steps = _steps(message, self._names)
        if steps is None:
            raise LookupError
        self._steps = steps
        return _along(message, steps)

    def default(self, schema: Schema | None) -> float | None:
        """Return the default that a JSON schema gives the field; None: it gives none."""
        if schema is None or schema.encoding != "jsonschema":
            return None
        try:
            root = json.loads(schema.data)
        except (ValueError, RecursionError):
            return None
        for value in _defaults(root, root, self._names):
            if isinstance(value, (int, float)):
                return float(value)
        return None


def names_in(message: Any) -> list[str]:
    """Return the names of the fields on the first level of a message."""
    if isinstance(message, Message):
        return list(message.DESCRIPTOR.fields_by_name)
    return [str(name) for name in message] if isinstance(message, Mapping) else []


def _parts(text: str) -> list[_Name]:
    """Return the names between dots; quotes that do not enclose a name are letters of it."""
    names, at = [], 0
    while at < len(text):
        found = _PART.match(text, at)
        if found is None:
            return [_Name(part, False) for part in text.split(".")]
        names.append(_Name(found[1] or found[2], found[1] is not None))
        at = found.end()
    return names if not text.endswith(".") else [_Name(part, False) for part in text.split(".")]


def _heads(names: Sequence[_Name]) -> Iterator[tuple[str, Sequence[_Name]]]:
    """Yield each name that the first parts can be together, the longest first, and the parts behind it."""
    longest = 1
    while not names[0].exact and longest < len(names) and not names[longest].exact:
        longest += 1
    for count in range(longest, 0, -1):
        yield ".".join(name.text for name in names[:count]), names[count:]


def _steps(value: Any, names: Sequence[_Name]) -> list[str] | None:
    """Return the names of ``value`` and what it holds that lead to the field; None: it is not there."""
    if not names:
        return []
    for name, rest in _heads(names):
        inner = _step(value, name)
        if inner is not _MISSING and (behind := _steps(inner, rest)) is not None:
            return [name, *behind]
    return None


def _along(value: Any, steps: Sequence[str]) -> Any:
    for name in steps:
        value = _step(value, name)
        if value is _MISSING:
            break
    return value


def _step(value: Any, name: str) -> Any:
    """Return what ``value`` has under a name, or in a place; _MISSING: nothing."""
    if type(value) is dict:  # first, because it is the quickest
        return value.get(name, _MISSING)
    if isinstance(value, Message):
        return getattr(value, name) if name in value.DESCRIPTOR.fields_by_name else _MISSING
    try:
        if isinstance(value, Mapping):
            return value.get(name, _MISSING)
        return value[int(name)] if name.isdecimal() and not isinstance(value, (str, bytes)) else _MISSING
    except (LookupError, TypeError, ValueError):
        return _MISSING


def _defaults(root: Any, node: Any, names: Sequence[_Name], hops: int = 0) -> Iterator[Any]:
    """Yield the defaults of a field that are in a schema, its own before those of what holds it."""
    if not isinstance(node, dict) or hops > _HOPS:
        return
    reference = node.get("$ref")
    if isinstance(reference, str) and reference.startswith("#/"):
        yield from _defaults(root, _along(root, reference[2:].split("/")), names, hops + 1)
    for group in ("allOf", "anyOf", "oneOf"):
        for other in node.get(group) or ():
            yield from _defaults(root, other, names, hops + 1)
    for name, rest in _heads(names) if names else ():
        inner = _step(node.get("properties"), name)
        if inner is _MISSING and name.isdecimal():
            inner = node.get("items")
        yield from _defaults(root, inner, rest, hops + 1)
    if "default" in node:
        own = node["default"]
        steps = _steps(own, names)
        if steps is not None:
            yield _along(own, steps)
