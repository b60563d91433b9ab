"""Quantities of rows as columns: all quantities of a family are taken out of a block at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.requirements.margin_kernels import counts_of_channels
from rig.assess.requirements.subject import Quantity, Subject
from rig.frame import CHANNELS, INDEX, Block, End, State, UnitStatus
from rig.units.angles import differences

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
        self._subject, self._quantities = subject, quantities
        self._fillers = [
            (_together(rows), self._filler(family, discrete, [quantities[i] for i in rows]))
            for (family, discrete), rows in _grouped(quantities).items()
        ]

    def fill(self, rows: Block, out: Floats) -> None:
        """Write the quantities of ``rows`` (n,) to ``out`` (Q, n)."""
        for places, filler in self._fillers:
            out[places] = filler(rows)

    def _filler(self, family: str, discrete: bool, of: list[Quantity]) -> Callable[[Block], Any]:
        """Return what gives (m, n) of the quantities ``of`` one family."""
        prefix, places = ("discrete_", [q.discrete for q in of]) if discrete else ("", [q.signal for q in of])
        channels = [place * CHANNELS + q.parts.channel - 1 for place, q in zip(places, of, strict=True)]
        signals = self._subject.discretes if discrete else self._subject.signals
        watched = [signals[place] for place in places] if places[0] >= 0 else []
        state = _of_field(f"{prefix}state", channels)
        match family:
            case "truth" | "voted" | "level" | "reference":
                return _of_field("discrete_truth" if discrete and family == "truth" else f"{prefix}{family}", places)
            case "channel":
                return _of_field("channels", channels)
            case "flight" | "surface":
                return _of_field(family, [q.element for q in of])
            case "error" | "channel error":
                voted = _of_field("voted", places) if family == "error" else _of_field("channels", channels)
                truth = _of_field("truth", places)
                wraps = np.array([each.wraps for each in watched])
                return lambda rows: differences(voted(rows).T, truth(rows).T, wraps).T
            case "threshold":
                return lambda rows: np.broadcast_to([[each.threshold] for each in watched], (len(of), len(rows)))
            case "failed":
                return lambda rows: state(rows) == State.FAILED
            case "count":
                return _Counts(state, np.array([each.persistence for each in watched])).of
            case "healthy":
                acting = [
                    _faults_on(self._subject, each.name, q.parts.channel) for each, q in zip(watched, of, strict=True)
                ]
                return lambda rows: _nothing_acts(rows, acting)
            case "departure":
                return _Departure(self._subject).of
            case "lost":
                return lambda rows: rows["end"] != End.FLYING
            case "acting":
                return lambda rows: rows["acting"].any(axis=1)
            case "onset":
                return Onsets().of
        return lambda rows: np.isin(rows["unit"], _LATE)  # unit.late


def _grouped(quantities: Iterable[Quantity]) -> dict[tuple[str, bool], list[int]]:
    groups: dict[tuple[str, bool], list[int]] = {}
    for i, quantity in enumerate(quantities):
        groups.setdefault((quantity.parts.family, quantity.discrete >= 0), []).append(i)
    return groups


def _together(rows: list[int]) -> slice | list[int]:
    """Return rows as a slice where they are neighbours."""
    return slice(rows[0], rows[-1] + 1) if rows == list(range(rows[0], rows[-1] + 1)) else rows


def _of_field(field: str, places: list[int]) -> Callable[[Block], Any]:
    """Return what gives (m, n) elements of a field, each by its place in a row of it."""
    return lambda rows: rows[field].reshape(len(rows), -1)[:, places].T


def _faults_on(subject: Subject, name: str, channel: int) -> list[int]:
    """Return the numbers of the faults that act on a channel."""
    return [i for i, on in enumerate(subject.faults) if (name, channel) in on]


def _acting_bits(rows: Block) -> NDArray[np.uint8]:
    """Return (n, 64) whether each fault of the scenario acts in ``rows`` (n,)."""
    return np.unpackbits(np.ascontiguousarray(rows["acting"]), axis=1, bitorder="little")


def _nothing_acts(rows: Block, faults: list[list[int]]) -> NDArray[np.bool_]:
    """Return (m, n) whether none of the faults of each channel acts."""
    free = np.ones((len(faults), len(rows)), np.bool_)
    if rows["acting"].any():
        bits = _acting_bits(rows)
        for i, numbers in enumerate(faults):
            if numbers:
                free[i] = ~bits[:, numbers].any(axis=1)
    return free


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


class _Counts:
    """Frames in a row that channels are suspect, over their persistence; 1 where they are failed."""

    def __init__(self, state: Callable[[Block], Any], persistence: NDArray[np.int64]) -> None:
        self._state, self._persistence = state, np.maximum(persistence, 1)
        self._before = np.zeros(len(persistence), np.int64)  # frames in a row up to the last block

    def of(self, rows: Block) -> Floats:
        """Return (m, n)."""
        state = self._state(rows)
        out = np.empty(state.shape)
        counts_of_channels(state, self._persistence, self._before, out)
        return out


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


class TwinColumns:
    """Columns of the twin, whose blocks are of other sizes; NaN after its end."""

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
