"""A voted signal as every picture of it shows it: channels, vote, and what each channel is from the vote in thresholds.

``rig.vote(...).plot()``, ``rig view`` and the pages draw the same numbers.  Time counts from the first row, because
recordings have times of the calendar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import State
from rig.core.runs import runs_where
from rig.core.text import choices, quoted
from rig.core.units.angles import near, unwrapped

Array = NDArray[np.float64]
Codes = NDArray[np.uint8]
SINCE: Final = "time since the first row, s"
ROOM: Final = 3.0  # thresholds above and below the vote
NEAR: Final = 15.0  # thresholds: a channel in use within this distance of the vote is in the picture
_OF_TWO: Final = 0.5  # thresholds: the vote is in the middle of two channels


class Mark(NamedTuple):
    """An isolation; channel : from 1."""

    channel: int
    time_s: float


@dataclass(frozen=True, slots=True)
class ShownSignal:
    """A signal or discrete of any name in the unit of its owner; every array (n,), channels: one array each."""

    name: str
    unit: str  # "": not known
    time_s: Array  # since the first row
    channels: Sequence[Array]  # none: the file does not have them
    voted: Array
    states: Sequence[Codes]  # of each channel, State
    level: Codes  # number of channels in use
    pattern: Codes | None = None  # Pattern; None: there is none
    decided_by: Codes | None = None  # DecidedBy
    threshold: Array | None = None  # two samples in use agree within it, in ``unit``; None: not known
    discrete: bool = False  # 0 or 1

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    @property
    def measure(self) -> str:
        """The unit of ``apart``."""
        return "thresholds" if self.threshold is not None else self.unit or "SI unit"

    def apart(self, c: int) -> Array:
        """Return channel ``c`` (from 0) minus the vote (n,), in thresholds, or in ``unit`` if none is known."""
        with np.errstate(invalid="ignore", over="ignore"):
            off = self.channels[c] - self.voted
            return off if self.threshold is None else off / self.threshold

    @property
    def bound(self) -> Array:
        """(n,) thresholds: what a channel that agrees is from the vote at most; half of one where two are in use."""
        return np.where(self.level == 2, _OF_TWO, 1.0)

    @property
    def isolations(self) -> list[Mark]:
        """Isolations in the order of time, a channel that is isolated in the first row among them."""
        found = [
            Mark(c, float(self.time_s[first]))
            for c, states in enumerate(self.states, 1)
            for first, _ in runs_where(states == State.FAILED)
        ]
        return sorted(found, key=lambda mark: (mark.time_s, mark.channel))

    @property
    def noted(self) -> bool:
        """True if a channel was not ok in a row."""
        return any(bool(np.isin(states, (State.SUSPECT, State.FAILED)).any()) for states in self.states)

    def ends(self) -> tuple[float, float]:
        """Return the ends of the axis: the vote with its thresholds, and near channels in use.

        A channel that went to the end of its range leaves the picture and does not flatten the others.
        """
        room = np.zeros(len(self.voted)) if self.threshold is None else self.threshold
        drawn = [self.voted - ROOM * room, self.voted + ROOM * room]
        for c, channel in enumerate(self.channels):
            used = self.states[c] != State.FAILED
            if self.threshold is not None:
                with np.errstate(invalid="ignore"):
                    used &= np.abs(self.apart(c)) <= NEAR
            drawn.append(channel[used])
        values = np.concatenate(drawn)
        values = values[np.isfinite(values)]
        if not len(values):
            return -1.0, 1.0
        low, high = float(values.min()), float(values.max())
        rest = 0.05 * (high - low) or 0.5
        return low - rest, high + rest


def since_first(time_s: Array) -> Array:
    """Return times (n,) since the first."""
    return time_s - time_s[0] if len(time_s) else time_s


def around(voted: Array, channels: Sequence[Array], wraps: bool) -> tuple[Array, list[Array]]:
    """Return vote and channels (n,), rad if they wrap: the vote without jumps of a turn, channels near it."""
    if not wraps:
        return voted, list(channels)
    whole = unwrapped(voted)
    return whole, [near(channel, whole) for channel in channels]


def chosen(signals: Sequence[ShownSignal], name: str | None) -> list[ShownSignal]:
    """Return the signal ``name``, or all of them; BadInput: unknown name."""
    if name is None:
        return list(signals)
    found = [signal for signal in signals if signal.name == name]
    if not found:
        raise BadInput(f"unknown signal {quoted(name)}, {choices(name, [signal.name for signal in signals])}")
    return found
