"""Rounded decimals: 0.0166667 and 0.01667 stand for 1/60 and are read as 1/60."""

from __future__ import annotations

from decimal import Decimal
from math import isfinite
from typing import Final

SURE: Final = 1e-2  # of one: a last digit that counts for more does not tell a whole number from what is beside it


def slack(number: float | str, scale: float) -> float:
    """Return by how much ``number * scale`` may miss a whole number because ``number`` is a rounded decimal.

    It is half a unit of the last digit, as written or in the shortest decimal of a float.  It is 0 for a whole number,
    and if that unit is more than SURE, or than this share of the product: 0.017 is 0.017, not 1/60.
    """
    value = float(number)
    if not isfinite(value) or value == round(value):
        return 0.0
    _, _, exponent = Decimal(number if isinstance(number, str) else repr(value)).as_tuple()
    unit = 10.0 ** int(exponent) * abs(scale)
    return unit / 2 if unit <= SURE * min(1.0, abs(value * scale)) else 0.0


def slack_of_product(a: float, b: float) -> float:
    """Return by how much ``a * b`` may miss a whole number because they are rounded decimals."""
    return slack(a, b) + slack(b, a)
