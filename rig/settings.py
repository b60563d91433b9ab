"""Settings: strict models read from TOML, every fault of them one clear line.

Unknown keys, wrong types, NaN and infinity are refused; a whole number is accepted where a
real one is asked for.  Each stage owns its own ``Config`` derived from ``Settings``.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from rig.errors import BadInput

M = TypeVar("M", bound="Settings")


class Settings(BaseModel):
    """Base of every settings model: strict, frozen, no unknown keys, finite numbers only."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, validate_default=True)


def read_toml(path: Path) -> dict[str, Any]:
    """The TOML document at ``path``; BadInput when it is missing or does not parse."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path}: not valid TOML: {error}") from None


def build(model: type[M], data: dict[str, Any], source: str) -> M:
    """``data`` as a ``model``; BadInput names ``source`` and the first offending key."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise BadInput(f"{source}: {_first_line(error, data)}") from None


def _first_line(error: ValidationError, data: dict[str, Any]) -> str:
    detail = error.errors(include_url=False)[0]
    key = ".".join(_keys(detail["loc"], data, detail["type"] == "missing"))
    if detail["type"] == "extra_forbidden":
        return f"{key}: unknown key"
    message = detail["msg"].removeprefix("Value error, ").replace("\n", " ")
    given = detail.get("input")
    shown = f", got {given!r}" if isinstance(given, (str, int, float, bool)) else ""
    where = f"{key}: " if key else ""
    return f"{where}{message[0].lower()}{message[1:]}{shown}"


def _keys(location: tuple[int | str, ...], data: Any, missing: bool) -> list[str]:
    """The keys of ``data`` in an error's location: without the names of the models that a union chose from."""
    keys, node = [], data
    for i, part in enumerate(location):
        if isinstance(node, dict) and part not in node and not (missing and i == len(location) - 1):
            continue
        keys.append(str(part))
        if isinstance(node, dict):
            node = node.get(part)
        elif isinstance(node, list) and isinstance(part, int) and part < len(node):
            node = node[part]
        else:
            node = None
    return keys
