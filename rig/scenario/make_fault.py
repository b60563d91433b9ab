"""``rig.fault``: one fault of a scenario, made and checked in Python."""

from __future__ import annotations

from typing import Any

from rig.core.errors import BadInput
from rig.core.settings import build
from rig.core.text import choices, quoted
from rig.scenario.overrides import plain_data
from rig.world.faults import KINDS, Fault


def fault(kind: str, **keys: Any) -> Fault:
    """Make one fault: ``rig.fault("offset", signal="pitch_rate", channels=[3], offset=0.1, start_s=2.0)``.

    kind : kind of fault, as in ``rig faults list``
    keys : keys of the kind, as in ``rig faults show KIND``
    BadInput: a key is unknown, missing or out of its range.
    """
    if kind not in KINDS:
        raise BadInput(f"fault: unknown kind {quoted(kind)}, {choices(str(kind), KINDS, 'rig faults list')}")
    data = {name: plain_data(value, f"fault {kind}: {name}") for name, value in keys.items() if value is not None}
    return build(KINDS[kind], {"kind": kind, **data}, f"fault {kind}")  # pyright: ignore[reportReturnType]
