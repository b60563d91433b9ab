"""The pilot: sticks and autopilot commands over time.

Manoeuvres add up on their axis.  Stick axes are normalised deflections (-1 to 1, clipped); autopilot
axes are changes from the values held at engagement, in rad, m or m/s.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from rig.core.frame import DISCRETE_INDEX, INDEX, Block
from rig.core.settings import Settings

STICKS: Final = ("stick_pitch", "stick_roll", "pedal")
_STICKS: Final = slice(INDEX["stick_pitch"], INDEX["pedal"] + 1)
AUTOPILOT_AXES: Final = ("pitch_angle", "roll_angle", "altitude", "heading", "airspeed")
Axis = Literal["stick_pitch", "stick_roll", "pedal", "pitch_angle", "roll_angle", "altitude", "heading", "airspeed"]
Times = NDArray[np.float64]


class _Manoeuvre(Settings):
    axis: Axis
    start_s: float = Field(ge=0)
    amplitude: float  # in the unit of the axis


class _Timed(_Manoeuvre):
    duration_s: float = Field(gt=0)

    def inside(self, t: Times) -> NDArray[np.bool_]:
        """Return True where the manoeuvre acts: start included, end excluded."""
        return (t >= self.start_s) & (t < self.start_s + self.duration_s)


class Step(_Manoeuvre):
    """``amplitude`` from ``start_s`` on, for good."""

    kind: Literal["step"]

    def at(self, t: Times) -> Times:
        """Return the deflection at times ``t`` (n,), s."""
        return np.where(t >= self.start_s, self.amplitude, 0.0)


class Hold(_Timed):
    """``amplitude`` for ``duration_s``, then back."""

    kind: Literal["hold"]

    def at(self, t: Times) -> Times:
        """Return the deflection at times ``t`` (n,), s."""
        return np.where(self.inside(t), self.amplitude, 0.0)


class Doublet(_Timed):
    """One half of ``duration_s`` up, the other half down."""

    kind: Literal["doublet"]

    def at(self, t: Times) -> Times:
        """Return the deflection at times ``t`` (n,), s."""
        return _alternate(self, t, (1, 1))


class ThreeTwoOneOne(_Timed):
    """The identification input 3-2-1-1: alternating pulses of 3, 2, 1 and 1 sevenths of ``duration_s``."""

    kind: Literal["3-2-1-1"]

    def at(self, t: Times) -> Times:
        """Return the deflection at times ``t`` (n,), s."""
        return _alternate(self, t, (3, 2, 1, 1))


class Sweep(_Timed):
    """A sine whose frequency goes linearly from ``start_hz`` to ``end_hz``."""

    kind: Literal["sine-sweep"]
    start_hz: float = Field(gt=0)
    end_hz: float = Field(gt=0)

    def at(self, t: Times) -> Times:
        """Return the deflection at times ``t`` (n,), s: A sin(2 pi (f0 tau + (f1 - f0) tau^2 / 2T))."""
        tau = t - self.start_s
        cycles = self.start_hz * tau + (self.end_hz - self.start_hz) * tau**2 / (2 * self.duration_s)
        return np.where(self.inside(t), self.amplitude * np.sin(2 * np.pi * cycles), 0.0)


def _alternate(manoeuvre: _Timed, t: Times, parts: tuple[int, ...]) -> Times:
    """Return +A and -A in turn, for as many equal parts of the duration as ``parts`` has."""
    edges = np.cumsum(parts) / sum(parts) * manoeuvre.duration_s
    pulse = np.searchsorted(edges, t - manoeuvre.start_s, side="right")
    return np.where(manoeuvre.inside(t), manoeuvre.amplitude * (1 - 2 * (pulse % 2)), 0.0)


Manoeuvre = Annotated[Step | Hold | Doublet | ThreeTwoOneOne | Sweep, Field(discriminator="kind")]


class Config(Settings):
    """The ``[pilot]`` table of a scenario."""

    autopilot_engaged: bool = True  # at the start
    engage_s: float | None = Field(default=None, ge=0)
    disengage_s: float | None = Field(default=None, ge=0)
    manoeuvres: list[Manoeuvre] = []

    @model_validator(mode="after")
    def _ordered(self) -> Config:
        if self.engage_s is not None and self.engage_s == self.disengage_s:
            raise ValueError("engage_s and disengage_s must differ")
        return self


class Pilot:
    """Write the truth of the sticks, the autopilot commands and the engage switch, a block at a time."""

    def __init__(self, config: Config, rate_hz: float) -> None:
        self._config = config
        self._rate_hz = rate_hz

    def prepare(self, block: Block) -> None:
        """Fill ``truth`` of the sticks, ``autopilot_command`` and ``discrete_truth`` of all rows of ``block``."""
        t = block["frame"] / self._rate_hz
        truth, autopilot_command = block["truth"], block["autopilot_command"]
        truth[:, _STICKS] = 0.0
        autopilot_command[:] = 0.0
        for manoeuvre in self._config.manoeuvres:
            axis = manoeuvre.axis
            column = truth[:, INDEX[axis]] if axis in STICKS else autopilot_command[:, AUTOPILOT_AXES.index(axis)]
            column += manoeuvre.at(t)
        np.clip(truth[:, _STICKS], -1.0, 1.0, out=truth[:, _STICKS])
        block["discrete_truth"][:, DISCRETE_INDEX["autopilot_engaged"]] = self._engaged(t)

    def _engaged(self, t: Times) -> NDArray[np.bool_]:
        """Return the switch: as at the start, then as the last of the two moments that has passed."""
        config = self._config
        engaged = np.full(len(t), config.autopilot_engaged)
        moments = [(config.engage_s, True), (config.disengage_s, False)]
        for moment, value in sorted((m, v) for m, v in moments if m is not None):
            engaged[t >= moment] = value
        return engaged
