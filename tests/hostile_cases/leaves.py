"""The leaves of a TOML document, and the document with one of them replaced by any text."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

import tomli_w

Path = tuple[str | int, ...]
_HERE = "@@HOSTILE@@"


def leaves(data: Any, above: Path = ()) -> list[Path]:
    """The paths of all values that are no table and no list of tables, and of every table and list itself."""
    found = [above] if above else []
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        if not (isinstance(data, list) and not isinstance(value, dict | list) and key):  # of numbers, the first
            found += leaves(value, (*above, key))
    return found


def alike(paths: Iterable[Path]) -> list[list[Path]]:
    """The paths in groups: of one top table and one last key, wherever between them (each signal, each point)."""
    groups: dict[tuple[str, str], list[Path]] = {}
    for path in paths:
        last = next((str(key) for key in reversed(path) if isinstance(key, str)), "")
        groups.setdefault((str(path[0]), last), []).append(path)
    return list(groups.values())


def at(data: Any, path: Path) -> Any:
    """The value at a path."""
    for key in path:
        data = data[key]
    return data


def replaced(data: Any, path: Path, text: str) -> str:
    """The document as TOML with ``text``, written as it is, in place of the value at ``path``."""
    return _with(data, path, _HERE).replace(f'"{_HERE}"', text)


def removed(data: Any, path: Path) -> str:
    """The document as TOML without the value at ``path``."""
    changed = copy.deepcopy(data)
    del at(changed, path[:-1])[path[-1]]
    return tomli_w.dumps(changed)


def renamed(data: Any, path: Path, key: str) -> str:
    """The document as TOML with one more key, written as it is, beside the value at ``path``."""
    changed = copy.deepcopy(data)
    beside = at(changed, path[:-1])
    if not isinstance(beside, dict):
        return replaced(data, path, f"{{{key} = 1}}")
    beside[_HERE] = 1
    return tomli_w.dumps(changed).replace(f'"{_HERE}"', key)


def _with(data: Any, path: Path, value: Any) -> str:
    changed = copy.deepcopy(data)
    at(changed, path[:-1])[path[-1]] = value
    return tomli_w.dumps(changed)


def dotted(path: Path) -> str:
    """The path as ``--set`` takes it."""
    return ".".join(map(str, path))
