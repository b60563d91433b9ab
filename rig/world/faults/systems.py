"""Kinds of faults of discretes, in-line monitors and surfaces, and of ice on several sensors at once.

``stuck``, ``dropout`` and ``intermittent`` apply to a discrete too.
"""

from __future__ import annotations

import math
from typing import Literal

from pydantic import field_validator

from rig.core import fault_names
from rig.world.faults.effects import Act, Effect, Flag
from rig.world.faults.fault_settings import Channels, Corrupted, Placed, Triggered, quantity
from rig.world.faults.places import Point
from rig.world.faults.trigger import DutyCycle, Pulses

_ILM = {"good": Flag.GOOD, "blind": Flag.GOOD, "bad": Flag.BAD, "false alarm": Flag.BAD}


class Inverted(Corrupted):
    """y = 1 - x. Causes: a switch wired to the wrong contact, a swapped polarity."""

    sites, act = ("discrete",), Act.INVERT
    example = "b737_gear_down_inverted"

    kind: Literal["inverted"]


class Toggling(Corrupted):
    """y = 1 - x and x in turn. Causes: a chattering relay, a bouncing switch, a proximity sensor at its limit."""

    sites, act = ("discrete",), Act.INVERT
    example = "b747_engagement_toggling"

    kind: Literal["toggling"]
    period_s: float = quantity("s", "period; the value is wrong for the first half", gt=0)
    random: bool = quantity("", "true: both halves are exponentially distributed with this mean", False)

    @property
    def pulses(self) -> Pulses:
        """Wrong and right in turn; at least a frame each."""
        return Pulses(DutyCycle.TELEGRAPH if self.random else DutyCycle.CYCLE, self.period_s / 2, self.period_s / 2)


class IlmFault(Placed):
    """The in-line monitor transmits a constant or an inverted result. Cause: a self-test wired or set up wrongly.

    `good` or `blind`: it detects no fault. `bad` or `false alarm`: it reports a fault of a healthy channel.
    `inverted` or `wrong`: it transmits the opposite. On all four channels of a 2:2 split it marks the wrong pair.
    """

    sites, act, changes_samples = ("channel", "discrete"), Act.VALID_ONLY, False
    sentence = "in-line monitor wrong from {at} on"
    example = "f16_split_2_2_wrong_ilm"

    kind: Literal["ilm"]
    says: Literal["good", "bad", "inverted", "blind", "false alarm", "wrong"] = quantity(
        "", "result that the monitor transmits"
    )

    @property
    def flag(self) -> Flag:
        """The effect on the in-line monitors of its channels."""
        return _ILM.get(self.says, Flag.INVERT)


class RateLoss(Placed):
    """The rate of the surface is limited. Causes: low hydraulic pressure, a sticking valve."""

    sites, act, sizes = ("surface",), Act.LIMIT_RATE, ("max_rate_per_s",)
    example = "b747_elevator_rate_loss"

    kind: Literal["rate_loss"]
    max_rate_per_s: float = quantity("signal/s", "largest rate: rad/s, for the throttle 1/s", gt=0)


class _Weather(Triggered):
    """A fault of the environment, which has fixed signals."""

    channels: Channels = quantity("", "channels, from 1", [1, 2, 3, 4], min_length=1)
    seen_by_ilm: bool = quantity("", "true: the in-line monitors of its channels report bad while it acts", False)

    @property
    def signal(self) -> str:
        """The signals that it acts on, for the name."""
        return fault_names.place(dict(self))


class PitotIcing(_Weather):
    """Pressure lines are closed and keep the trapped pressure. Causes: an unheated pitot head, tape on static ports.

    total = trapped total + pitot_rate t, static = trapped static + static_rate t for a closed line; an open line has
    the true pressure. dynamic = total - static, without compressibility. The trapped pressure is the sample in the
    frame before the onset. With the pitot line closed, the measured airspeed rises and falls with the altitude.
    """

    act = Act.PITOT_STATIC_ICE
    example = "b737_pitot_icing"

    kind: Literal["pitot_icing"]
    blocked: Literal["pitot", "static", "both"] = quantity("", "closed line", "both")
    pitot_rate_pa_s: float = quantity("Pa/s", "rate of the trapped total pressure; below 0: a leak", 0.0)
    static_rate_pa_s: float = quantity("Pa/s", "rate of the trapped static pressure", 0.0)

    @property
    def points(self) -> list[Point]:
        """The values that it changes: the dynamic pressure, and the static one if its line is closed."""
        names = ("dynamic_pressure",) if self.blocked == "pitot" else ("static_pressure", "dynamic_pressure")
        return [Point(name, channel) for name in names for channel in self.channels]

    @property
    def targets(self) -> list[Point]:
        """One record does both pressures of a channel."""
        return [Point("static_pressure", channel) for channel in self.channels]

    @property
    def effect(self) -> Effect:
        """Finite rates for the lines that are closed."""
        pitot = math.nan if self.blocked == "static" else self.pitot_rate_pa_s
        static = math.nan if self.blocked == "pitot" else self.static_rate_pa_s
        return Effect(Act.PITOT_STATIC_ICE, pitot, static_rate_pa_s=static, source_place="dynamic_pressure")


class VaneIcing(_Weather):
    """Vanes freeze at their position at the onset. Two that freeze alike can outvote a third. Cause: ice."""

    act = Act.HOLD
    sentence = "frozen at {value} at {at}"
    example = "b747_vane_icing"

    kind: Literal["vane_icing"]
    vanes: list[Literal["angle_of_attack", "angle_of_sideslip"]] = quantity(
        "", "frozen vanes", ["angle_of_attack"], min_length=1
    )
    channels: Channels = quantity("", "channels, from 1", [1, 2], min_length=1)

    @field_validator("vanes")
    @classmethod
    def _once(cls, vanes: list[str]) -> list[str]:
        if len(set(vanes)) < len(vanes):
            raise ValueError(f"each is allowed once, got {vanes}")
        return vanes

    @property
    def points(self) -> list[Point]:
        """The values that it acts on."""
        return [Point(vane, channel) for vane in self.vanes for channel in self.channels]
