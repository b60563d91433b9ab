"""The air of a flight: steady wind, steps, 1-cosine gusts, and turbulence.

Wind is the velocity of the air: north, east and down, in m/s.  Turbulence is JSBSim's Dryden model
after MIL-F-8785C (its Tustin form), seeded, so that a flight can be repeated bit for bit.

The standard deviations of its levels are in dryden.py.
"""

from __future__ import annotations

from math import cos, inf, pi
from typing import Final, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from rig.core.settings import Settings

Turbulence = Literal["none", "light", "moderate", "severe"]
Velocity = tuple[float, float, float]  # north, east, down, m/s
CALM: Final[Velocity] = (0.0, 0.0, 0.0)


class Severity(NamedTuple):
    """JSBSim's settings of one level of turbulence."""

    exceedance_index: int  # curve of MIL-F-8785C, figure 7; rules above 2000 ft
    wind_at_20ft_knots: float  # rules below 1000 ft


SEVERITY: Final[dict[Turbulence, Severity]] = {
    "none": Severity(0, 0.0),
    "light": Severity(3, 15.0),  # exceeded with a probability of 1e-2,
    "moderate": Severity(4, 30.0),  # 1e-3,
    "severe": Severity(6, 45.0),  # 1e-5
}


class Step(Settings):
    """Wind added from ``start_s`` until ``end_s``; if it is not given, until the end of the flight."""

    start_s: float = Field(ge=0.0)
    end_s: float | None = None
    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0

    @model_validator(mode="after")
    def _ends_after_start(self) -> Self:
        if self.end_s is not None and self.end_s <= self.start_s:
            raise ValueError("end_s must be later than start_s")
        return self


class Gust(Settings):
    """A gust of the form (1 - cos)/2 that rises to these speeds and falls again within ``duration_s``."""

    start_s: float = Field(ge=0.0)
    duration_s: float = Field(gt=0.0)
    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0


class Config(Settings):
    """The ``[wind]`` table of a scenario.

    The aircraft is trimmed in the steady horizontal wind; all the rest acts from the first step on.
    """

    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0
    steps: list[Step] = Field(default_factory=list)
    gusts: list[Gust] = Field(default_factory=list)

    @property
    def steady(self) -> Velocity:
        """North, east, down, m/s."""
        return (self.north_m_s, self.east_m_s, self.down_m_s)


def added(config: Config, time_s: float) -> Velocity:
    """Return the velocity added to the steady horizontal wind at this flight time: down, steps and gusts."""
    north, east, down = 0.0, 0.0, config.down_m_s
    for step in config.steps:
        if step.start_s <= time_s and (step.end_s is None or time_s < step.end_s):
            north, east, down = north + step.north_m_s, east + step.east_m_s, down + step.down_m_s
    for gust in config.gusts:
        phase = (time_s - gust.start_s) / gust.duration_s
        if 0.0 <= phase <= 1.0:
            part = 0.5 * (1.0 - cos(2.0 * pi * phase))
            north, east = north + part * gust.north_m_s, east + part * gust.east_m_s
            down += part * gust.down_m_s
    return (north, east, down)


def next_change(config: Config, time_s: float) -> float:
    """Return the earliest time at which ``added`` may differ from now: now itself within a gust, inf after the last."""
    later = [inf]
    for gust in config.gusts:
        if gust.start_s <= time_s <= gust.start_s + gust.duration_s:
            return time_s
        later.append(gust.start_s)
    for step in config.steps:
        later += [step.start_s, inf if step.end_s is None else step.end_s]
    return min(time for time in later if time > time_s)
