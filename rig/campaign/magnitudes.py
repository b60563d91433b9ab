"""Magnitudes of faults as a reader sees them: in the unit of their signal, angles in degrees."""

from __future__ import annotations

from typing import Final

from rig.faults.fault import KINDS
from rig.frame import INDEX, SIGNALS
from rig.units.quantities import number, unit_shown

_RATE: Final = "signal/s"  # units of settings, as the catalogue has them
_SIGNAL: Final = ("signal", _RATE)


def magnitude_unit(signal: str, kind: str) -> str:
    """Return the unit that magnitudes of a kind on a signal are shown in: ``deg/s``; "" where they have none."""
    unit = _setting(kind)
    if unit not in _SIGNAL:
        return unit_shown(unit)
    shown = unit_shown(_of_signal(signal))
    return f"{shown or '1'}/s" if unit == _RATE else shown


def magnitude_shown(value: float | None, signal: str, kind: str) -> str:
    """Return a magnitude, SI, in ``magnitude_unit``; "" for None."""
    return number(value, _of_signal(signal) if _setting(kind) in _SIGNAL else "")


def _of_signal(signal: str) -> str:
    return SIGNALS[INDEX[signal]].unit if signal in INDEX else ""


def _setting(kind: str) -> str:
    """The unit of the setting that says how large a fault of the kind is."""
    model = KINDS.get(kind)
    extra = model.model_fields[model.sizes[0]].json_schema_extra if model is not None and model.sizes else None
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""
