"""One entry for each kind of fault: cause, places, parameters with units, an example that flies."""

from __future__ import annotations

import inspect
from dataclasses import asdict, dataclass
from types import UnionType
from typing import Any, Final, Literal, Union, get_args, get_origin

import tomli_w
from pydantic.fields import FieldInfo

from rig.core.errors import BadInput
from rig.core.files import bundled
from rig.core.settings import read_toml
from rig.core.text import choices, shorten
from rig.world.faults.fault_settings import Placed, Triggered
from rig.world.faults.scenario_faults import KINDS

EXAMPLES: Final = {kind: model.example for kind, model in KINDS.items()}  # the bundled scenario that shows each kind
_UNITS: Final = {
    "signal": "unit of the signal",
    "signal/s": "unit of the signal per s",
    "signal/source": "unit of the signal per unit of the source",
}
_ALLOWED: Final = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One key of a fault."""

    name: str
    unit: str
    default: Any  # None: none, see ``required``
    required: bool
    allowed: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Entry:
    """One kind of fault; ``parameters`` are the keys of this kind, ``common()`` returns the keys of every kind."""

    kind: str
    what: str  # the effect and the physical cause
    sites: list[str]
    parameters: list[Parameter]
    scenario: str
    example: str  # TOML

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, as ``rig faults list --json`` prints it."""
        return asdict(self)


def entries() -> list[Entry]:
    """Return the whole catalogue."""
    return [entry(kind) for kind in KINDS]


def entry(kind: str) -> Entry:
    """Return the entry of a kind; raise BadInput if there is none."""
    if kind not in KINDS:
        raise BadInput(f"{shorten(kind)}: unknown kind of fault, {choices(kind, KINDS, 'rig faults list')}")
    model = KINDS[kind]
    own = {name: info for name, info in model.model_fields.items() if name not in (*Triggered.model_fields, "kind")}
    sites: list[str] = [*model.sites] if issubclass(model, Placed) else ["channel"]
    parameters = [_parameter(name, info) for name, info in own.items()]
    flown = read_toml(bundled("faults") / f"{EXAMPLES[kind]}.toml")["faults"]
    example = tomli_w.dumps({"faults": [next(fault for fault in flown if fault["kind"] == kind)]})
    return Entry(kind, inspect.getdoc(model) or "", sites, parameters, EXAMPLES[kind], example)


def common() -> list[Parameter]:
    """Return the keys of every kind: name, trigger, duration, repetition."""
    return [_parameter(name, info) for name, info in Triggered.model_fields.items()]


def _parameter(name: str, info: FieldInfo) -> Parameter:
    extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
    unit = str(extra.get("unit", ""))
    default = None if info.is_required() else info.get_default()
    return Parameter(
        name, _UNITS.get(unit, unit), default, info.is_required(), _allowed(info), str(info.description or "")
    )


def _allowed(info: FieldInfo) -> str:
    """Return the choices or the bounds of a setting, in words."""
    choices = _choices(info.annotation)
    bounds = [f"{sign} {getattr(m, key):g}" for m in info.metadata for key, sign in _ALLOWED.items() if hasattr(m, key)]
    return ", ".join(choices or bounds)


def _choices(annotation: Any) -> list[str]:
    if get_origin(annotation) is Literal:
        return list(map(str, get_args(annotation)))
    inside = get_args(annotation) if get_origin(annotation) in (list, Union, UnionType) else ()
    return [choice for part in inside for choice in _choices(part)]
