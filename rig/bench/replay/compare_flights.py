"""Two flights, number by number: equal, within a tolerance, different.

Equal is equal to the bit, or NaN on both sides.  A tolerance is in the unit of the number; of an angle on the
circle the short way round counts.  NaN on one side is within no tolerance.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import Table
from rig.core.units.angles import short_way
from rig.log.columns import COLUMNS, Column

Verdict = Literal["equal", "within", "different", "missing in A", "missing in B"]


@dataclass(frozen=True, slots=True)
class Field:
    """One number of the frame over both flights; an equal one has neither frame nor size."""

    name: str
    verdict: Verdict
    frames: int = 0  # that are not equal; of a different one those beyond the tolerance
    first_frame: int | None = None
    largest: float | None = None  # difference; None where it is not a number


@dataclass(frozen=True, slots=True)
class Comparison:
    """All fields of two flights, and other differences, one line each."""

    frames: int  # compared
    fields: list[Field]
    remarks: list[str]  # what forbids an equal verdict although no field differs: lengths, rates
    notes: list[str]  # what is only said: other versions, other seeds

    @property
    def same(self) -> bool:
        """Return True if no field is missing or beyond its tolerance."""
        return not self.remarks and all(field.verdict in ("equal", "within") for field in self.fields)

    @property
    def identical(self) -> bool:
        """Return True if all fields are equal to the bit."""
        return not self.remarks and all(field.verdict == "equal" for field in self.fields)

    def counts(self) -> dict[str, int]:
        """Return the number of fields of each verdict."""
        counts = Counter(field.verdict for field in self.fields)
        return {name: counts.get(name, 0) for name in ("equal", "within", "different", "missing in A", "missing in B")}

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; equal fields are counted, not listed."""
        unequal = [asdict(field) for field in self.fields if field.verdict != "equal"]
        same = {"same": self.same, "identical": self.identical, "frames": self.frames}
        return {**same, "counts": self.counts(), "remarks": self.remarks, "notes": self.notes, "fields": unequal}


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Tolerances of numbers: the last pattern that fits a name applies; without one 0."""

    patterns: tuple[tuple[str, float], ...] = ()

    def of(self, name: str) -> float:
        """Return the tolerance of a field."""
        return next((allowed for pattern, allowed in reversed(self.patterns) if fnmatchcase(name, pattern)), 0.0)


def tolerances(texts: Sequence[str], names: Iterable[str]) -> Tolerances:
    """Read ``1e-6`` for all fields, ``pitch_rate.*=0.01`` for some.  BadInput: a wrong tolerance."""
    names = list(names)
    patterns: list[tuple[str, float]] = []
    for text in texts:
        pattern, equals, number = text.rpartition("=")
        pattern = pattern if equals else "*"
        try:
            allowed = float(number)
        except ValueError:
            allowed = math.nan
        if not allowed >= 0 or math.isinf(allowed):
            raise BadInput(f"--tolerance {text}: must be 0 or more, or FIELD=NUMBER")
        if not any(fnmatchcase(name, pattern) for name in names):
            raise BadInput(f"--tolerance {text}: no field {pattern!r}; a field is named like pitch_rate.ch_1")
        patterns.append((pattern, allowed))
    return Tolerances(tuple(patterns))


def compare(a: Table, b: Table, columns: Sequence[Column] = COLUMNS, allowed: Tolerances | None = None) -> list[Field]:
    """Compare the ``columns`` of the rows, or of the rows of servo actuators, that both flights have."""
    n = min(len(a), len(b))
    a, b, allowed = a[:n], b[:n], allowed or Tolerances()
    return [
        of_column(column.path, column.of(a), column.of(b), a["frame"], allowed.of(column.path), column.wraps)
        for column in columns
    ]


def joined(first: Field, then: Field) -> Field:
    """Return one number over frames and those that follow them."""
    if "equal" in (first.verdict, then.verdict):
        return then if first.verdict == "equal" else first
    sizes = [difference.largest for difference in (first, then) if difference.largest is not None]
    worse = then if then.verdict == "different" != first.verdict else first
    frames = first.frames + then.frames if first.verdict == then.verdict else worse.frames
    return replace(worse, frames=frames, largest=max(sizes, default=None))


def of_column(
    name: str,
    a: NDArray[Any],
    b: NDArray[Any],
    frames: NDArray[np.int64],
    tolerance: float = 0.0,
    wraps: bool = False,
) -> Field:
    """Compare one number (n,) of two flights."""
    unequal = np.flatnonzero(~_equal(a, b))
    if not len(unequal):
        return Field(name, "equal")
    with np.errstate(invalid="ignore", over="ignore"):  # infinities
        off = np.abs(a[unequal].astype(float) - b[unequal].astype(float))
        off = np.abs(short_way(off)) if wraps else off
    beyond = ~(off <= tolerance)  # NaN is beyond
    sizes = off[np.isfinite(off)]
    largest = float(sizes.max()) if len(sizes) else None
    if not beyond.any():
        return Field(name, "within", len(unequal), int(frames[unequal[0]]), largest)
    return Field(name, "different", int(beyond.sum()), int(frames[unequal[beyond][0]]), largest)


def _equal(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    if a.dtype.kind != "f" or b.dtype.kind != "f":
        return a == b
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    bits = f"u{a.itemsize}"
    return (a.view(bits) == b.view(bits)) | (np.isnan(a) & np.isnan(b))
