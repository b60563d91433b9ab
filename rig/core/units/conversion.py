"""Units that a user names: their factors to SI units, by pint.

pint is imported only for a unit other than the SI unit, because the import takes about a second.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any, Final, NamedTuple

from rig.core.text import quoted

USUAL: Final = {  # SI units by name, each with others that are usual
    "rad/s": ("deg/s", "rpm"),
    "rad": ("deg", "mrad"),
    "g": ("m/s^2", "ft/s^2"),  # the rig's unit of load factors
    "Pa": ("hPa", "kPa", "psf", "psi", "inHg"),
    "1": ("%",),
    "s": ("ms", "us", "ns", "min", "h"),
    "m": ("ft", "km", "nmi"),
    "m/s": ("kt", "ft/s", "km/h"),
    "m/s^2": ("g", "ft/s^2"),
    "rad/s^2": ("deg/s^2",),
    "K": (),
    "kg": ("lb",),
    "N": ("lbf", "kN"),
    "N*m": ("lbf*ft",),
    "V": ("mV",),
    "A": ("mA",),
    "T": ("uT", "gauss"),
}
_MEANT: Final = {  # in aviation, where pint means another or none
    "g": "standard_gravity",
    "G": "standard_gravity",
    "psf": "(force_pound/foot**2)",
    "kts": "knot",
    "gauss": "gauss_of_field",  # pint's is of another system of units
    "mgauss": "milligauss_of_field",
}
_TERM: Final = r"(?:1|[^\W\d]+|[%°])(?:(?:\*\*|\^)-?[1-9])?"
_UNIT: Final = re.compile(rf"(?=.{{1,40}}$){_TERM}(?:[*/]{_TERM})*")  # pint would compute any power


class Conversion(NamedTuple):
    """One ``unit`` is ``factor`` times the SI unit ``si``."""

    factor: float
    si: str


def conversion(unit: str, si: str | None = None) -> Conversion:
    """Return the conversion of ``unit`` to ``si``, or to the SI unit of its dimension if that is None.

    ValueError, with the allowed units: an unknown unit, one of another quantity, one with another zero (degC).
    """
    if unit == si or (si is None and unit in USUAL and unit != "g"):
        return Conversion(1.0, unit)
    known = list(USUAL) if si is None else [si, *USUAL.get(si, ())]
    allowed = f"allowed: {', '.join(known)}{', ...' if si is None else ' and other units of it'}"
    base = _base(unit)
    if base is None:
        raise ValueError(f"unknown unit {quoted(unit)}, or not a multiple of an SI unit; {allowed}")
    if si is None:
        return Conversion(base[0], _name(base[1]))
    own = _base(si)
    if own is None or own[1] != base[1]:
        raise ValueError(f"{quoted(unit)} is not a unit of this quantity; {allowed}")
    return Conversion(base[0] / own[0], si)


def _name(base: Any) -> str:
    """Return the usual name of a unit of base units: ``Pa`` for ``kg/m/s^2``."""
    named = (name for name in USUAL if name != "g" and (_base(name) or (0, None))[1] == base)
    return next(named, f"{base:~}".replace(" ", "").replace("**", "^"))


@cache
def _base(unit: str) -> tuple[float, Any] | None:
    """Return the factor to base units (rad is one of them) and these; None: not a unit, or one with another zero."""
    import pint

    if not _UNIT.fullmatch(unit):
        return None
    meant = re.sub(r"[^\W\d]+", lambda name: _MEANT.get(name[0], name[0]), unit)
    try:
        parsed = _registry().parse_units(meant)
        zero, one, two = (_registry().Quantity(x, parsed).to_base_units() for x in (0.0, 1.0, 2.0))
    except (pint.PintError, ArithmeticError, ValueError, TypeError):
        return None
    factor = float(one.magnitude)
    linear = zero.magnitude == 0.0 and math.isclose(two.magnitude, 2.0 * factor, rel_tol=1e-12)
    return (factor, one.units) if linear and math.isfinite(factor) and factor > 0.0 else None


@cache
def _registry() -> Any:
    import pint

    registry = pint.UnitRegistry()
    registry.define("gauss_of_field = 1e-4 tesla")
    return registry
