"""What the pictures of a flight show, gathered block by block: thinned lines of all of it, all rows of stretches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import degrees
from typing import NamedTuple

import numpy as np

from rig.frame import FLIGHT_INDEX, INDEX, SIGNALS, SURFACES, Block, LaneBlock, lane_rows
from rig.report.lines import Array, Line, Thinning, line
from rig.units.angles import near
from rig.view.series import Series, ends_of, reach, series

Stretch = tuple[int, int]  # first frame, end (excluded)


class SignalLines(NamedTuple):
    """A signal as it is drawn, in the unit that people read; ends : of the axis."""

    voted: Line
    truth: Line
    channels: list[Line]
    ends: tuple[float, float]


def signal_lines(shown: Series, ends: tuple[float, float]) -> SignalLines:
    """Return the lines of a signal over some rows."""
    voted, truth, *channels = (line(shown.time_s, values) for values in _lines_of(shown))
    return SignalLines(voted, truth, channels, ends)


def _lines_of(shown: Series) -> Iterator[Array]:
    yield from (shown.voted, shown.truth, *shown.channels.T)


class SignalThinning:
    """Makes the lines of a signal over a whole flight; limit : SI, what channels may be off the vote."""

    def __init__(self, name: str, limit: float, frames: int, rate_hz: float) -> None:
        self._name, self._limit, self._rate_hz = name, limit, rate_hz
        self._lines = [Thinning(frames) for _ in range(2 + SIGNALS[INDEX[name]].channels)]
        self._turned, self._ends = np.nan, (np.inf, -np.inf)

    def add(self, rows: Block) -> None:
        """Take the next rows (n,)."""
        shown = series(rows, self._rate_hz, self._name, self._turned)
        finite = shown.truth[np.isfinite(shown.truth)]
        self._turned = float(finite[-1]) if len(finite) else self._turned
        low, high = reach(shown, self._limit)
        self._ends = min(self._ends[0], low), max(self._ends[1], high)
        for thinning, values in zip(self._lines, _lines_of(shown), strict=True):
            thinning.add(values)

    def lines(self) -> SignalLines:
        """Return what is drawn of all rows that came."""
        voted, truth, *channels = (thinning.line(self._rate_hz) for thinning in self._lines)
        return SignalLines(voted, truth, channels, ends_of(*self._ends))


def errors(rows: Block, name: str) -> Array:
    """Return vote less truth (n,) of a signal, SI, angles the short way round; NaN where either is no number."""
    voted, truth = rows["voted"][:, INDEX[name]], rows["truth"][:, INDEX[name]]
    with np.errstate(invalid="ignore"):
        return (near(voted, truth) if SIGNALS[INDEX[name]].wraps else voted) - truth


class SurfaceLines(NamedTuple):
    """A surface, degrees, or the throttle; changed : a fault changed what reached the actuator."""

    command: Line
    actuated: Line
    position: Line
    changed: bool


class SurfaceThinning:
    """Makes the lines of surface ``i`` over a whole flight."""

    def __init__(self, i: int, frames: int, rate_hz: float) -> None:
        self._i, self._rate_hz, self._changed = i, rate_hz, False
        self._scale = degrees(1.0) if SURFACES[i].endswith("_rad") else 1.0
        self._lines = [Thinning(frames) for _ in range(3)]

    def add(self, rows: Block) -> None:
        """Take the next rows (n,)."""
        i, position = self._i, rows["flight"][:, FLIGHT_INDEX[SURFACES[self._i]]]
        command, actuated = rows["surface"][:, i], rows["actuator"][:, i]
        self._changed = self._changed or not np.array_equal(command, actuated, equal_nan=True)
        for thinning, values in zip(self._lines, (command, actuated, position), strict=True):
            thinning.add(values * self._scale)

    def lines(self) -> SurfaceLines:
        """Return what is drawn of all rows that came."""
        command, actuated, position = (thinning.line(self._rate_hz) for thinning in self._lines)
        return SurfaceLines(command, actuated, position, self._changed)


class Kept(NamedTuple):
    """All rows of a stretch of a flight, and those of lanes, none where the flight has none."""

    rows: Block
    lanes: LaneBlock


class Keeping:
    """Keeps all rows of a stretch of a flight."""

    def __init__(self, stretch: Stretch) -> None:
        self._stretch = stretch
        self._rows: list[Block] = []
        self._lanes: list[LaneBlock] = []

    def add(self, first: int, rows: Block, lanes: LaneBlock | None) -> None:
        """Take the next rows (n,), from frame ``first`` on."""
        begin, end = (max(at - first, 0) for at in self._stretch)
        if rows[begin:end].size:
            self._rows.append(rows[begin:end].copy())  # a view would keep the whole block
            self._lanes += [] if lanes is None else [lanes[begin:end].copy()]

    def kept(self) -> Kept:
        """Return what was kept of all rows that came."""
        return Kept(np.concatenate(self._rows), np.concatenate(self._lanes) if self._lanes else lane_rows(0))


class Gathered(NamedTuple):
    """What the pictures show; errors : votes less the truth, in thresholds."""

    signals: dict[str, SignalLines]
    errors: dict[str, Line]
    surfaces: list[SurfaceLines]
    stretches: dict[Stretch, Kept]


class Gathering:
    """Gathers what the pictures show.

    frames : of the flight
    limits : by the signals that are drawn, SI: what channels may be off the vote
    thresholds : by the signals whose vote's error is drawn, SI
    stretches : whose rows are all kept
    """

    def __init__(
        self,
        frames: int,
        rate_hz: float,
        limits: Mapping[str, float],
        thresholds: Mapping[str, float],
        stretches: Sequence[Stretch],
    ) -> None:
        self._rate_hz, self._thresholds, self.frames = rate_hz, thresholds, 0
        self._signals = {name: SignalThinning(name, limit, frames, rate_hz) for name, limit in limits.items()}
        self._errors = {name: Thinning(frames) for name in thresholds}
        self._surfaces = [SurfaceThinning(i, frames, rate_hz) for i in range(len(SURFACES))]
        self._stretches = {stretch: Keeping(stretch) for stretch in stretches}

    def add(self, rows: Block, lanes: LaneBlock | None = None) -> None:
        """Take the next rows (n,), and those of lanes beside them."""
        for one in (*self._signals.values(), *self._surfaces):
            one.add(rows)
        for name, thinning in self._errors.items():
            thinning.add(errors(rows, name) / self._thresholds[name])
        for keeping in self._stretches.values():
            keeping.add(self.frames, rows, lanes)
        self.frames += len(rows)

    def gathered(self) -> Gathered:
        """Return what the pictures show of all rows that came."""
        return Gathered(
            {name: one.lines() for name, one in self._signals.items()},
            {name: thinning.line(self._rate_hz) for name, thinning in self._errors.items()},
            [one.lines() for one in self._surfaces],
            {stretch: keeping.kept() for stretch, keeping in self._stretches.items()},
        )
