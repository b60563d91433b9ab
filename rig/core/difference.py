"""The differences of two tables of plain data, such as the identities of two studies."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

_NOTHING: Final = object()


def difference(was: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return the differences of two identities, a line each, sorted by key."""
    before, after = dict(_flat(was)), dict(_flat(now))
    return [
        f"{key} was {_shown(before, key)}, is {_shown(after, key)}"
        for key in sorted({*before, *after})
        if before.get(key, _NOTHING) != after.get(key, _NOTHING)
    ]


def _shown(flat: dict[str, Any], key: str) -> str:
    return json.dumps(flat[key]) if key in flat else "not there"


def _flat(data: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every leaf of plain data with its dotted key."""
    if isinstance(data, dict | list):
        items = data.items() if isinstance(data, dict) else enumerate(data)
        for key, value in items:
            yield from _flat(value, f"{above}.{key}" if above else str(key))
    else:
        yield above, data
