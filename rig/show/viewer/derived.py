"""Lists of numbers that the viewer computes from the rows, one per frame; the log does not have them.

Each signal has VALUES; a view chooses its lines by their names in NAMES:

    fault, low, high, voted, ch_1 .. ch_4, reference, truth
                    in display units, deg for rad; angles are unwrapped;
                    low and high: the vote -+ its threshold; fault: the vote while a fault on the signal is active
    off_*           voted and channels minus truth, in the same unit; NaN while a channel is not in use
    apart_*         truth and channels minus the vote, in isolation thresholds, within +-LIMIT;
                    apart_fault: 0 while a fault is active; apart_low, apart_high: -1 and 1

Control has DEGREES: commands, autopilot commands and surfaces that are angles or rates.

On the scale of the signal four good channels cover one another, and one hardover flattens the others.  The difference
to the truth separates the channels; the difference to the vote, clipped, leaves the scale to the other channels.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import AUTOPILOT_COMMANDS, CHANNELS, COMMANDS, FLIGHT_INDEX, SIGNALS, SURFACES, Block, S, State
from rig.core.units.angles import differences, short_way
from rig.core.units.quantities import scale_shown
from rig.show.viewer.facts import Facts
from rig.show.viewer.state_strips import acting

VALUES: Final = "rig.Derived"
DEGREES: Final = "rig.Degrees"
LIMIT: Final = 1.5  # thresholds: larger differences are drawn here
_CH: Final = tuple(f"ch_{c + 1}" for c in range(CHANNELS))
NAMES: Final = (
    *("fault", "low", "high", "voted", *_CH, "reference", "truth"),
    *(f"off_{name}" for name in ("voted", *_CH)),
    *(f"apart_{name}" for name in ("fault", "low", "high", "truth", *_CH)),
)
_AT: Final = {name: i for i, name in enumerate(NAMES)}
_WRAPS: Final = np.array([signal.wraps for signal in SIGNALS])
_SCALE: Final = np.array([scale_shown(signal.unit) for signal in SIGNALS])

_Floats = NDArray[np.float64]
_Singles = NDArray[np.float32]


class Derived:
    """The lists of a flight, block after block; it keeps the turns of each angle."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self._threshold = np.array([facts.threshold(i) for i in range(S)])
        self._on = [facts.faults_on(signal.name) for signal in SIGNALS]
        self._last: tuple[_Floats, _Floats] | None = None  # of angles that wrap: truth as it was, without jumps

    def values(self, rows: Block) -> NDArray[np.float32]:
        """Return the numbers of NAMES of all signals: (S, n, m), in single precision."""
        values = np.empty((S, len(rows), len(NAMES)), np.float32)
        by_row = values.swapaxes(0, 1)
        with np.errstate(invalid="ignore", over="ignore"):  # a flight that ends not finite
            voted, truth, acts = rows["voted"], rows["truth"], self._acts(rows)
            every = np.concatenate([voted[..., None], rows["channels"], rows["reference"][..., None]], axis=2)
            off = differences(every.swapaxes(1, 2), truth[:, None], _WRAPS).swapaxes(1, 2)  # from the truth
            apart = differences(rows["channels"].swapaxes(1, 2), voted[:, None], _WRAPS).swapaxes(1, 2)  # from the vote
            self._shown(by_row[..., : _AT["off_voted"]], self._turned(truth), off, acts)
            self._deviation(by_row[..., _AT["off_voted"] : _AT["apart_fault"]], rows, off, apart)
            self._difference(by_row[..., _AT["apart_fault"] :], apart, off[..., 0], acts)
        return values

    def _acts(self, rows: Block) -> NDArray[np.bool_]:
        """Return (n, S) a fault on each signal acts."""
        acts, on_signal = acting(rows, len(self._facts.faults)), np.zeros((len(rows), S), bool)
        for i, numbers in enumerate(self._on):
            if numbers:
                on_signal[:, i] = acts[:, numbers].any(axis=1)
        return on_signal

    def _turned(self, truth: _Floats) -> _Floats:
        """Return ``truth`` (n, S) without the jumps of angles on the circle, through all blocks."""
        angles = truth[:, _WRAPS]
        last, turned = self._last if self._last is not None else (np.nan_to_num(angles[0]), np.nan_to_num(angles[0]))
        finite = _carried(np.concatenate([last[None], angles]))
        steps = np.diff(finite, axis=0)
        whole = turned + np.cumsum(np.nan_to_num(short_way(steps)), axis=0)
        self._last = finite[-1], whole[-1]
        out = truth.copy()
        out[:, _WRAPS] = np.where(np.isfinite(angles), whole, np.nan)
        return out

    def _shown(self, to: _Singles, truth: _Floats, off: _Floats, acts: NDArray[np.bool_]) -> None:
        """Write fault .. truth; ``off`` (n, S, 6) are vote, channels and reference minus truth."""
        around = (truth[..., None] + off) * _SCALE[:, None]
        voted, half = around[..., 0], self._threshold * _SCALE
        to[..., 0] = np.where(acts, voted, np.nan)
        to[..., 1] = voted - half
        to[..., 2] = voted + half
        to[..., 3:-1] = around
        to[..., -1] = truth * _SCALE

    def _deviation(self, to: _Singles, rows: Block, off: _Floats, apart: _Floats) -> None:
        trusted = (rows["state"] == State.OK) & ~(np.abs(apart) > self._threshold[:, None])
        to[..., 0] = off[..., 0] * _SCALE
        to[..., 1:] = np.where(trusted, off[..., 1 : 1 + CHANNELS] * _SCALE[:, None], np.nan)

    def _difference(self, to: _Singles, apart: _Floats, voted: _Floats, acts: NDArray[np.bool_]) -> None:
        """Write apart_*; ``voted`` (n, S) is the vote minus truth."""
        to[..., 0] = np.where(acts, 0.0, np.nan)
        to[..., 1:3] = (-1.0, 1.0)
        to[..., 3] = np.clip(-voted / self._threshold, -LIMIT, LIMIT)
        to[..., 4:] = np.clip(apart / self._threshold[:, None], -LIMIT, LIMIT)


def _carried(values: _Floats) -> _Floats:
    """Return ``values`` (n, m) with each non-finite one replaced by the last finite one of its column."""
    finite = np.isfinite(values)
    if finite.all():
        return values
    rows = np.maximum.accumulate(np.where(finite, np.arange(len(values))[:, None], 0), axis=0)
    return np.take_along_axis(values, rows, axis=0)


# Angles and rates of control, in the order of the list.
_COMMANDS: Final = [i for i, name in enumerate(COMMANDS) if name.endswith(("_rad", "_rad_s"))]
_AUTOPILOT_COMMANDS: Final = [i for i, name in enumerate(AUTOPILOT_COMMANDS) if name.endswith("_rad")]
_SURFACES: Final = [i for i, name in enumerate(SURFACES) if name.endswith("_rad")]
_POSITIONS: Final = [FLIGHT_INDEX[SURFACES[i]] for i in _SURFACES]
DEGREE_NAMES: Final = (
    *(f"command_{COMMANDS[i]}" for i in _COMMANDS),
    *(f"autopilot_command_{AUTOPILOT_COMMANDS[i]}" for i in _AUTOPILOT_COMMANDS),
    *(f"{what}_{SURFACES[i]}" for what in ("surface", "surface_command", "position") for i in _SURFACES),
)
_ROUND: Final = [DEGREE_NAMES.index("command_heading_rad")]


def degrees(rows: Block) -> _Floats:
    """Return the numbers of DEGREE_NAMES in deg or deg/s: (n, m); the commanded heading within 180 deg of north."""
    parts = [
        rows["command"][:, _COMMANDS],
        rows["autopilot_command"][:, _AUTOPILOT_COMMANDS],
        rows["surface"][:, _SURFACES],
        rows["surface_command"][:, _SURFACES],
        rows["flight"][:, _POSITIONS],
    ]
    numbers = np.concatenate(parts, axis=1) * scale_shown("rad")
    numbers[:, _ROUND] = short_way(numbers[:, _ROUND], 180.0)
    return numbers
