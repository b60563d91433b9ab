"""Overrides of a scenario: dotted keys with values, laid over its tables before they are checked."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.core.errors import BadInput
from rig.core.frame import SIGNALS
from rig.core.settings import DEEPEST, NotToml, Settings, parse_toml
from rig.core.text import quoted, shorten

Overrides = Sequence[str] | Mapping[str, Any]  # ``key=value``, or values by key
OPTION, TABLE = "--set ", "overrides: "  # how a message names an override: of the command line, of a program
EVERY: Final = "*"  # in a key of --set: all items of a list, all signals of a table of signals
_OF_SIGNALS: Final = ("redundancy.signals", "sensors")
_DIGITS: Final = re.compile("[0-9]{1,9}")


def named_manager(sets: Iterable[tuple[str, Any]]) -> str | None:
    """Return the ``redundancy.manager`` that dotted keys with their values name, if any; naming it permits its code."""
    data: dict[str, Any] = {}
    for key, value in sets:
        if key.partition(".")[0] == "redundancy":
            data = set_key(data, key, value, f"--set {key}")
    table = data.get("redundancy")
    name = table.get("manager") if isinstance(table, dict) else None
    return name if isinstance(name, str) else None


def override(data: dict[str, Any], text: str, given: str = OPTION) -> dict[str, Any]:
    """Return ``data`` with one ``dotted.key=value`` set; a number in the key counts into a list from 0.

    given : name of the origin of the override in messages
    """
    key, value = parse_set(text, given)
    return set_key(data, key, value, f"{given}{shorten(text)}")


def parse_set(text: str, given: str = OPTION) -> tuple[str, Any]:
    """Return key and value of ``dotted.key=value``; ``given`` as of ``override``."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise BadInput(f"{given}{shorten(text)}: must be key=value")
    return key.strip(), _parse(value.strip(), f"{given}{shorten(key.strip())}")


def set_key(data: dict[str, Any], key: str, value: Any, source: str) -> dict[str, Any]:
    """Return ``data`` with one dotted key set; BadInput names ``source``.

    A number in the key counts into a list from 0; ``*`` is every item of a list, or every signal of a table of signals.
    """
    keys = key.split(".")
    if len(keys) > DEEPEST:
        raise BadInput(f"{source}: {quoted(key)}: must have at most {DEEPEST} parts")
    return _set(data, keys, value, source)


def _set(node: Any, keys: list[str], value: Any, source: str, within: str = "") -> Any:
    if not keys:
        return value
    key, rest = keys[0], keys[1:]
    if key == EVERY:
        return _set_every(node, rest, value, source, within)
    if isinstance(node, list):
        if not _DIGITS.fullmatch(key) or int(key) >= len(node):
            allowed = f"must be an index from 0 to {len(node) - 1}" if node else "is an index into an empty list"
            raise BadInput(f"{source}: {quoted(key)} {allowed}")
        return [_set(item, rest, value, source) if i == int(key) else item for i, item in enumerate(node)]
    if node is None and _DIGITS.fullmatch(key):
        raise BadInput(f"{source}: {quoted(key)} is an index into an empty list{f', {within}' if within else ''}")
    table = node if isinstance(node, dict) else {}
    return {**table, key: _set(table.get(key), rest, value, source, f"{within}.{key}" if within else key)}


def _set_every(node: Any, rest: list[str], value: Any, source: str, within: str) -> Any:
    """Set ``rest`` in all items of a list, or in the tables of all signals."""
    if isinstance(node, list) and node:
        return [_set(item, rest, value, source) for item in node]
    if within not in _OF_SIGNALS:
        allowed = ", ".join((*(f"{table}.*" for table in _OF_SIGNALS), "lists that are not empty"))
        raise BadInput(f"{source}: {within or 'the file'}: * is allowed only for {allowed}")
    table = node if isinstance(node, dict) else {}
    return {**table, **{signal.name: _set(table.get(signal.name), rest, value, source) for signal in SIGNALS}}


def _parse(value: str, source: str) -> Any:
    """Return a TOML value; other text is a string."""
    try:
        return parse_toml(f"value = {value}", source)["value"]
    except NotToml:
        return value


def override_texts(overrides: Overrides) -> tuple[str, ...]:
    """Return overrides as texts ``key=value``.  BadInput names the key of a value that no file could hold."""
    if not isinstance(overrides, Mapping):
        return tuple(overrides)
    return tuple(f"{key}={_inline(plain_data(value, key))}" for key, value in overrides.items())


def _inline(value: Any) -> str:
    """Return plain data as TOML in one line; an unambiguous text is not quoted."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_quoted(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(_quoted, value))}]"
    bare = isinstance(value, str) and value == value.strip() and _parse(value, "") == value
    return value if bare else json.dumps(value)


def _quoted(value: Any) -> str:
    return json.dumps(value) if isinstance(value, str) else _inline(value)


def plain_data(value: Any, key: str) -> Any:
    """Return a value from Python as a file would hold it, also settings, paths and numbers of numpy."""
    if isinstance(value, Settings):
        return value.model_dump(exclude_none=True)
    if isinstance(value, Mapping):
        return {str(name): plain_data(item, f"{key}.{name}") for name, item in value.items() if item is not None}
    if isinstance(value, np.ndarray | np.generic):
        return plain_data(value.tolist(), key)
    if isinstance(value, list | tuple):
        return [plain_data(item, f"{key}.{i}") for i, item in enumerate(value)]
    if isinstance(value, Path):
        return str(value)
    if not isinstance(value, str | bool | int | float):
        raise BadInput(f"{key}: must be a number, a text, a list or a table, got {quoted(value)}")
    return value
