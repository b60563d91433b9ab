"""Quantities of rows as columns: all quantities of a family are taken out of a block at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, INDEX, Block, End, State, UnitStatus
from rig.core.kernels import kernel
from rig.core.units.angles import differences
from rig.verdict.requirements.subject import Quantity, Subject

Floats = NDArray[np.float64]
_LATE: Final = (UnitStatus.HELD, UnitStatus.LATE, UnitStatus.DEAD)
_SYMMETRIC: Final = (  # limits on both sides of zero, and the signals that they bound
    ("sideslip_max_rad", ("angle_of_sideslip",)),
    ("pitch_angle_max_rad", ("pitch_angle",)),
    ("roll_angle_max_rad", ("roll_angle",)),
    ("body_rate_max_rad_s", ("roll_rate", "pitch_rate", "yaw_rate")),
)


class Columns:
    """Fills the columns of quantities, block after block in order of time."""

    def __init__(self, quantities: Sequence[Quantity], subject: Subject) -> None:
        self._columns = [_column(quantity, subject) for quantity in quantities]

    def fill(self, rows: Block, out: Floats) -> None:
        """Write the quantities of ``rows`` (n,) to ``out`` (Q, n)."""
        for values, column in zip(out, self._columns, strict=True):
            values[:] = column(rows)


def _column(q: Quantity, subject: Subject) -> Callable[[Block], Any]:
    """Return what gives (n,) of a quantity."""
    discrete, place, c = q.discrete >= 0, max(q.signal, q.discrete), q.parts.channel - 1
    prefix, signals = ("discrete_", subject.discretes) if discrete else ("", subject.signals)
    match family := q.parts.family:
        case "truth" if discrete:
            return lambda rows: rows["discrete_truth"][:, place]
        case "truth" | "voted" | "level" | "reference":
            return lambda rows: rows[f"{prefix}{family}" if family != "truth" else "truth"][:, place]
        case "channel":
            return lambda rows: rows["channels"][:, place, c]
        case "flight" | "surface":
            return lambda rows: rows[family][:, q.element]
        case "error" | "channel error":
            wraps = signals[place].wraps
            at = ("voted", place) if family == "error" else ("channels", place * CHANNELS + c)
            of = lambda rows: rows[at[0]].reshape(len(rows), -1)[:, at[1]]  # noqa: E731
            return lambda rows: differences(of(rows), rows["truth"][:, place], wraps)
        case "threshold":
            return lambda _: signals[place].threshold
        case "failed":
            return lambda rows: rows[f"{prefix}state"][:, place, c] == State.FAILED
        case "count":
            return _Count(f"{prefix}state", place, c, max(signals[place].persistence, 1))
        case "healthy":
            faults = [i for i, on in enumerate(subject.faults) if (signals[place].name, q.parts.channel) in on]
            return lambda rows: ~np.unpackbits(rows["acting"], axis=1, bitorder="little")[:, faults].any(axis=1)
        case "departure":
            return _Departure(subject).of
        case "lost":
            return lambda rows: rows["end"] != End.FLYING
        case "acting":
            return lambda rows: rows["acting"].any(axis=1)
        case "onset":
            return Onsets().of
    return lambda rows: np.isin(rows["unit"], _LATE)  # unit.late


class Onsets:
    """Finds the frames in which a fault of the scenario acts for the first time."""

    def __init__(self) -> None:
        self._acted = np.zeros(64, np.uint8)

    def find(self, rows: Block) -> list[int]:
        """Return the places of such frames in ``rows`` (n,)."""
        if not rows["acting"].any():
            return []
        acts = np.unpackbits(np.bitwise_or.reduce(rows["acting"], axis=0), bitorder="little")
        new = np.flatnonzero(acts & (self._acted == 0)).tolist()
        self._acted |= acts
        return sorted({int(np.argmax(rows["acting"][:, fault // 8] & (1 << fault % 8) != 0)) for fault in new})

    def of(self, rows: Block) -> NDArray[np.bool_]:
        """Return (n,) whether a row is one."""
        out = np.zeros(len(rows), np.bool_)
        out[self.find(rows)] = True
        return out


class _Count:
    """Frames in a row that a channel is suspect, over its persistence; 1 where it is failed."""

    def __init__(self, field: str, place: int, channel: int, persistence: int) -> None:
        self._of, self._persistence, self._before = (field, place, channel), persistence, 0

    def __call__(self, rows: Block) -> Floats:
        """Return (n,)."""
        field, place, channel = self._of
        out = np.empty(len(rows))
        self._before = counts(rows[field][:, place, channel], self._persistence, self._before, out)
        return out


@kernel
def counts(state, persistence, before, out):
    """Fill ``out`` (n,) from the states of a channel; return the frames in a row up to its end, as ``before`` is.

    Below 1 until the channel is isolated: a count may be frozen during a split.
    """
    for k in range(len(state)):
        before = before + 1 if state[k] == State.SUSPECT else 0
        out[k] = 1.0 if state[k] == State.FAILED else min(before, persistence - 1) / persistence
    return before


class _Departure:
    """The least distance to the airframe's limits: 1 in trim, 0 at a limit, minus the share not flown of one lost."""

    def __init__(self, subject: Subject) -> None:
        self._subject, self._trim = subject, None

    def of(self, rows: Block) -> Floats:
        """Return (n,); the first row is the trim."""
        if self._trim is None:
            self._trim: Any = rows["truth"][0].copy()
        truth, trim, limits = rows["truth"], self._trim, self._subject.limits
        assert limits is not None  # of a flight
        alpha, n_z = INDEX["angle_of_attack"], INDEX["normal_load_factor"]
        shares = [
            _share(truth[:, alpha], trim[alpha], limits.angle_of_attack_max_rad),
            _share(-truth[:, alpha], -trim[alpha], -limits.angle_of_attack_min_rad),
            _share(truth[:, n_z], trim[n_z], limits.load_factor_max),
            _share(-truth[:, n_z], -trim[n_z], -limits.load_factor_min),
        ]
        for key, names in _SYMMETRIC:
            bound: float | None = getattr(limits, key)
            if bound is not None:
                places = [INDEX[name] for name in names]
                shares += [_share(np.abs(truth[:, place]), abs(trim[place]), bound) for place in places]
        least = np.min(shares, axis=0)
        not_flown = 1.0 - (rows["frame"] + 1.0) / self._subject.frames
        return np.where(rows["end"] != End.FLYING, np.minimum(least, -not_flown), least)


def _share(values: Floats, trim: float, limit: float) -> Floats:
    """Return how much of the way from the trim to its upper limit is left; of a trim beyond it none."""
    return (limit - values) / max(limit - trim, 1e-9)


class BaselineColumns:
    """Columns of the baseline, whose blocks are of other sizes; NaN after its end."""

    def __init__(self, blocks: Iterator[Block], columns: Columns) -> None:
        self._blocks, self._columns, self._left = blocks, columns, None

    def fill(self, count: int, out: Floats) -> None:
        """Write the next ``count`` frames to ``out`` (Q, count)."""
        done = 0
        while done < count:
            if self._left is None or not len(self._left):
                self._left: Any = next(self._blocks, None)
                if self._left is None:
                    out[:, done:] = np.nan
                    return
            part = self._left[: count - done]
            self._columns.fill(part, out[:, done : done + len(part)])
            self._left = self._left[len(part) :]
            done += len(part)
