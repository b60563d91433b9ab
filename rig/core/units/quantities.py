"""Times, durations and quantities for people: seconds with the frame, milliseconds, degrees.

The rig and its JSON use SI units and rad; this module converts text for people only.
"""

from __future__ import annotations

from math import ceil, degrees, isfinite, log10
from typing import Final

_PLAIN: Final = {"rad": "deg", "rad/s": "deg/s", "1": ""}  # by SI unit; any other stays
_UNITS: Final = {"_rad_s": "rad/s", "_rad": "rad", "_m_s2": "m/s2", "_m_s": "m/s", "_m": "m"}  # by end of a name
_WHOLE: Final = 999.5  # from here on without decimals
_SMALL: Final = 1e-4  # below it with an exponent


def unit_shown(unit: str) -> str:
    """Return the unit in which a quantity of the SI ``unit`` is shown; "" if it has none."""
    return _PLAIN.get(unit, unit)


def scale_shown(unit: str) -> float:
    """Return the factor from the SI ``unit`` to ``unit_shown(unit)``."""
    return degrees(1.0) if unit.startswith("rad") else 1.0


def unit_of_name(name: str) -> str:
    """Return the SI unit at the end of a setting's or field's ``name``; "" if it has none."""
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), "")


def number(value: float | None, unit: str = "", signed: bool = False) -> str:
    """Return ``value``, in the SI ``unit``, as a number in ``unit_shown(unit)``: three digits; "" for None."""
    if value is None:
        return ""
    shown = value * scale_shown(unit)
    if not isfinite(shown):
        return f"{shown}"
    size = abs(shown)
    digits = ".0f" if size >= _WHOLE else ".2e" if 0.0 < size < _SMALL else ".3g"
    return format(shown, f"+{digits}" if signed else digits)


def quantity(value: float, unit: str, signed: bool = False) -> str:
    """Return ``value``, in the SI ``unit``, with the unit in which it is shown: ``0.17 deg/s``."""
    return f"{number(value, unit, signed)} {unit_shown(unit)}".rstrip()


def seconds(frame: int, rate_hz: float) -> str:
    """Return the time of a frame: ``20.07 s``; with the decimals that the rate needs, at least two."""
    return f"{frame / rate_hz:.{max(2, ceil(log10(rate_hz)))}f} s"


def moment(frame: int | None, rate_hz: float) -> str:
    """Return the time of a frame with the frame: ``20.07 s (frame 2007)``; "" for None."""
    return "" if frame is None else f"{seconds(frame, rate_hz)} (frame {frame})"


def duration(frames: int | None, rate_hz: float) -> str:
    """Return the duration of ``frames``: ``70 ms``, from a second on ``4.85 s``; "" for None."""
    if frames is None:
        return ""
    length_s = frames / rate_hz
    return f"{length_s:.2f} s" if abs(length_s) >= 1.0 else f"{round(length_s * 1e3, 1):g} ms"
