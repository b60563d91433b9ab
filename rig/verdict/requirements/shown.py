"""Margins as they are shown: one that has no number is shown as none."""

from __future__ import annotations

from math import isfinite
from typing import Final

from rig.verdict.requirements.margins import MOST

_TINY: Final = 1e-6  # below which a margin under 0 is that of a strict comparison of equals


def number_of(margin: float) -> float | None:
    """Return a margin, None where it has no number: decided by a state alone, beyond the bound, not applicable."""
    return margin if isfinite(margin) and abs(margin) < MOST else None


def margin_text(margin: float) -> str:
    """Return a margin for a table: ``0.42``, ``<0`` of a strict comparison of equals, "" where it has no number."""
    number = number_of(margin)
    if number is None:
        return ""
    return "<0" if -_TINY < number < 0.0 else f"{number:.3g}"
