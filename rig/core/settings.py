"""Settings: strict models read from TOML; every error is one clear line.

The models refuse unknown keys, wrong types, NaN and infinity; they accept a whole number for a real one.  Times and
counts always have an upper limit, so that they fit into frames.  Each stage has a ``Config`` derived from ``Settings``;
``record`` turns it into the record that the stage's kernels read.
"""

from __future__ import annotations

import math
import pickle
import re
import tomllib
from collections.abc import Iterator
from datetime import date, time
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Final, Self, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from rig.core.errors import BadInput, RigError
from rig.core.files import read_bytes
from rig.core.frame import to_frame
from rig.core.renamed import KEYS, VALUES, is_gone, now_called
from rig.core.text import LONGEST_LIST, choices, must_be, nearest, quoted, shorten

M = TypeVar("M", bound="Settings")
LONGEST_S: Final = 1e6  # eleven days
MOST: Final = 10**9  # of any count
LARGEST_TOML: Final = 16 << 20  # bytes
_KEPT: Final = 1 << 18  # characters of a text that is kept as it was read
DEEPEST: Final = 100  # tables and lists within each other
_TIME: Final = re.compile(r"(?:^|.*_)(?!rad_s|m_s|pa_s|per_s|1_s|sqrt_s|integral_s)[a-z0-9]+_s")


class Settings(BaseModel):
    """Base of every settings model: strict, frozen, no unknown keys, finite numbers only."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        validate_default=True,
        defer_build=True,  # no command needs all models
    )
    keys_are_in: ClassVar[str] = ""  # the command or page that lists all keys, for the error of an unknown one
    _limits: ClassVar[dict[str, float]] = {}  # of fields that name no upper limit themselves

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        cls._limits = dict(_limits(cls))

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        """Return the settings themselves, which are frozen: readers share the defaults."""
        return self

    @model_validator(mode="after")
    def _within_limits(self) -> Settings:
        for name, most in self._limits.items():
            value = getattr(self, name)
            for number in value if isinstance(value, list) else (value,):
                if isinstance(number, int | float) and number > most:
                    raise ValueError(f"{name}: must be at most {most:g}, got {quoted(number)}")
        return self


def _limits(model: type[BaseModel]) -> Iterator[tuple[str, float]]:
    """Yield upper limits of the times (``..._s``) and whole numbers of a model whose fields name none."""
    for name, field in model.model_fields.items():
        if any(hasattr(bound, "le") or hasattr(bound, "lt") for bound in field.metadata):
            continue
        kinds = _leaves(field.annotation)
        if float in kinds and _TIME.fullmatch(name):
            yield name, LONGEST_S
        elif int in kinds and bool not in kinds:
            yield name, MOST


def _leaves(annotation: Any) -> set[Any]:
    """Return the plain types that an annotation is made of."""
    inside = get_args(annotation)
    return {leaf for part in inside for leaf in _leaves(part)} if inside else {annotation}


class NotToml(BadInput):
    """A text that is not TOML."""


def read_toml(path: Path) -> dict[str, Any]:
    """Return the TOML document at ``path``.  BadInput: it is missing or not valid."""
    return parse_toml(toml_text(path), str(path))


def toml_text(path: Path) -> str:
    """Return the text of the TOML document at ``path``.  BadInput: it is missing, too large or not UTF-8."""
    try:
        return read_bytes(path, LARGEST_TOML).decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadInput(f"{path}: not valid TOML: {error}") from None


def read_own(path: Path) -> dict[str, Any]:
    """Return the TOML document of a bundled file at ``path``.  RigError: it cannot be read, as it is not input."""
    try:
        return read_toml(path)
    except BadInput as error:
        raise RigError(f"{error}: the installation of the rig is incomplete") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the tables of a TOML text.  BadInput names ``source``: it is not valid, or nested too deep."""
    try:
        tables: dict[str, Any] = pickle.loads(_parsed(text)) if len(text) <= _KEPT else tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NotToml(f"{source}: not valid TOML: {error}") from None
    except RecursionError:
        raise BadInput(f"{source}: nested more than {DEEPEST} deep") from None
    except ValueError:
        raise BadInput(f"{source}: not valid TOML: a number has too many digits") from None
    _refuse_deep(tables, source)
    return tables


@lru_cache(maxsize=64)
def _parsed(text: str) -> bytes:
    """Return the tables of a text as a pickle: a copy for each reader, in a tenth of the time of reading it again.

    A flight reads the same defaults and gains several times, and a suite or a search the same again for each flight.
    """
    return pickle.dumps(tomllib.loads(text), pickle.HIGHEST_PROTOCOL)


def _refuse_deep(data: dict[str, Any], source: str) -> None:
    level: list[Any] = [data]
    for _ in range(DEEPEST):
        level = [
            inside
            for node in level
            for inside in (node.values() if isinstance(node, dict) else node)
            if isinstance(inside, dict | list)
        ]
        if not level:
            return
    raise BadInput(f"{source}: nested more than {DEEPEST} deep")


def refuse_what_is_no_setting(data: Any, source: str, key: str = "") -> None:
    """Refuse plain data with an infinite number, NaN or a date; BadInput names ``source`` and the key."""
    if isinstance(data, float) and not math.isfinite(data):
        raise BadInput(f"{source}: {key}: must be a finite number, got {data}")
    if isinstance(data, date | time):  # TOML has them, JSON and our settings do not
        raise BadInput(f"{source}: {key}: must be a number, a text, a list or a table, got the date or time {data}")
    for name, value in data.items() if isinstance(data, dict) else enumerate(data if isinstance(data, list) else ()):
        refuse_what_is_no_setting(value, source, f"{key}.{name}" if key else str(name))


def build(model: type[M], data: dict[str, Any], source: str, context: object = None) -> M:
    """Return ``data`` as a ``model``; BadInput names ``source`` and the first offending key.

    context : additional input of the validators
    """
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        raise BadInput(f"{source}: {_first_line(model, error, data)}") from None


def _first_line(model: type[Settings], error: ValidationError, data: dict[str, Any]) -> str:
    details = error.errors(include_url=False)
    for detail in details:  # an old name first: what else is wrong may follow from it
        if renamed := _renamed(model, detail):
            return f"{shorten('.'.join(_keys(detail['loc'], data, False)))}{renamed}"
    detail = details[0]
    key = shorten(".".join(_keys(detail["loc"], data, detail["type"] == "missing")))
    if detail["type"] == "extra_forbidden":
        return f"{key}: unknown key{_instead(model, detail['loc'])}"
    if detail["type"] == "union_tag_invalid":
        context = detail.get("ctx", {})
        tag, name = str(context["tag"]), context["discriminator"].strip("'")
        allowed = re.findall(r"'([^']*)'", context["expected_tags"])
        return f"{key}.{name}: unknown {name} {quoted(tag)}, {choices(tag, allowed, model.keys_are_in)}"
    given = detail.get("input")
    shown = f", got {quoted(given)}" if isinstance(given, (str, int, float, bool)) else ""
    where = f"{key}: " if key else ""
    return f"{where}{must_be(detail['msg'])}{shown}"


def unknown_key(key: str, model: type[BaseModel], keys_are_in: str) -> str:
    """Return the end of an error: ``key`` of a table that may have the keys of ``model`` is old, or unknown."""
    if (new := KEYS.get(key)) in model.model_fields:
        return f"{shorten(key)}: is now called {new}"
    if gone := is_gone(key):
        return f"{shorten(key)}: {gone}"
    return f"{shorten(key)}: unknown key; nearest: {nearest(key, model.model_fields)[0]}; all keys: {keys_are_in}"


def _renamed(model: type[Settings], detail: Any) -> str:
    """Return the present name of an old key or value, to follow its place; "" for another error."""
    *above, key = detail["loc"] or [""]
    if detail["type"] == "extra_forbidden":
        new = KEYS.get(str(key))
        if new in _fields(model, tuple(above)):
            return f": is now called {new}"
        return f": {gone}" if (gone := is_gone(str(key))) else ""
    given, behind = detail.get("input"), ""
    if detail["type"] == "union_tag_invalid":
        key, given = detail["ctx"]["discriminator"].strip("'"), detail["ctx"]["tag"]
        behind = f".{key}"
    new = VALUES.get(str(key), {}).get(given) if isinstance(given, str) else None
    return "" if new is None else f"{behind}: {now_called(quoted(given), quoted(new))}"


def _instead(model: type[Settings], location: tuple[int | str, ...]) -> str:
    """Return the allowed keys, or the nearest of many, and the place that lists all of them."""
    allowed = _fields(model, location[:-1])
    where = f"; all keys: {model.keys_are_in}" if model.keys_are_in else ""
    if not allowed:
        return where
    near = nearest(str(location[-1]), allowed)
    if len(", ".join(allowed)) <= LONGEST_LIST:
        return f"; nearest: {near[0]}; allowed: {', '.join(allowed)}{where}"
    return f"; nearest: {', '.join(near)}{where}"


def _fields(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return the keys that a table at ``location`` of a model may have."""
    here = [model]
    for part in location:
        fields = [table.model_fields[str(part)] for table in here if part in table.model_fields]
        inside = [model for field in fields for model in _models(field.annotation)]
        tagged = [table for table in here if _tag(table) == part]
        here = inside or tagged or here
    return list(dict.fromkeys(field.alias or name for table in here for name, field in table.model_fields.items()))


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the settings models that an annotation may be."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]


def _tag(model: type[BaseModel]) -> str | None:
    """Return the ``kind`` (or ``plant``) by which a model is chosen among others."""
    for name in ("kind", "plant"):
        if name in model.model_fields:
            return next(iter(get_args(model.model_fields[name].annotation)), None)
    return None


def _keys(location: tuple[int | str, ...], data: Any, missing: bool) -> list[str]:
    """Return the keys of ``data`` in an error's location, without the models that a union chose from."""
    keys, node = [], data
    for i, part in enumerate(location):
        if isinstance(node, dict) and part not in node and not (missing and i == len(location) - 1):
            continue
        keys.append(str(part))
        if isinstance(node, dict):
            node = node.get(part)
        else:
            node = node[part] if isinstance(node, list) and isinstance(part, int) and part < len(node) else None
    return keys


def record(dtype: np.dtype[Any], *models: BaseModel, **derived: Any) -> NDArray[Any]:
    """Return settings as the record of a kernel, (1,): each field from ``derived`` or from a model.

    TypeError: a field without a value, or a derived value without a field.
    """
    made = np.zeros(1, dtype)
    fill(made[0], *models, **derived)
    return made


def numbers(model: type[BaseModel]) -> list[tuple[str, str]]:
    """Return the fields of a record for all numbers and flags of a settings model, as ``record`` fills them."""
    types = {float: "f8", int: "i8", bool: "i8"}
    return [(name, types[f.annotation]) for name, f in model.model_fields.items() if f.annotation in types]


def fill(row: Any, *models: BaseModel, **derived: Any) -> None:
    """Write settings into one record as ``record`` does."""
    names = row.dtype.names
    if strange := derived.keys() - set(names):
        raise TypeError(f"no field of the record: {', '.join(sorted(strange))}")
    for name, place in zip(names, _places(names, tuple(map(type, models))), strict=True):
        value = derived[name] if name in derived else None if place is None else getattr(models[place], name)
        if value is None:
            raise TypeError(f"nothing fills the record's field {name}")
        row[name] = value


@lru_cache
def _places(names: tuple[str, ...], models: tuple[type[BaseModel], ...]) -> tuple[int | None, ...]:
    """Return for each name the place of the first model with a setting of that name; None where there is none."""
    fields = [model.model_fields.keys() for model in models]
    return tuple(next((i for i, of in enumerate(fields) if name in of), None) for name in names)


def share_in_frame(time_constant_s: float, rate_hz: float) -> float:
    """Return the share of a new sample that passes a first-order lag in one frame; 1 without a lag."""
    return 1.0 - math.exp(-1.0 / (rate_hz * time_constant_s)) if time_constant_s > 0.0 else 1.0


def refuse_both(settings: Settings, *names: str) -> None:
    """Raise ValueError if a setting is given both in frames, ``<name>``, and in seconds, ``<name>_s``."""
    for name in names:
        if getattr(settings, f"{name}_s") is not None and name in settings.model_fields_set:
            raise ValueError(f"{name} and {name}_s are the same setting, give only one")


def in_frames(frames: int, seconds: float | None, rate_hz: float) -> int:
    """Return ``frames``, or for a time given instead the frames that last at least as long, at least one."""
    return frames if seconds is None else max(1, to_frame(seconds, rate_hz))
