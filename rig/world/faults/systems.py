"""Kinds of faults of more than a value: discretes, in-line monitors, actuators, and ice on several sensors at once.

``stuck``, ``dropout``, ``intermittent`` suit a discrete too.
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
    """y = 1 - x. A switch wired to the wrong one of its two contacts, a swapped polarity."""

    sites, act = ("discrete",), Act.INVERT
    example = "b737_gear_down_inverted"

    kind: Literal["inverted"]


class Toggling(Corrupted):
    """y = 1 - x and x in turn. A chattering relay, a bouncing microswitch, a proximity sensor at its limit."""

    sites, act = ("discrete",), Act.INVERT
    example = "b747_engagement_toggling"

    kind: Literal["toggling"]
    period_s: float = quantity("s", "from one wrong value to the next: half of it wrong, half right", gt=0)
    random: bool = quantity("", "both halves are means of exponentially distributed times", False)

    @property
    def pulses(self) -> Pulses:
        """Wrong and right in turn; at least a frame each."""
        return Pulses(DutyCycle.TELEGRAPH if self.random else DutyCycle.CYCLE, self.period_s / 2, self.period_s / 2)


class IlmFault(Placed):
    """The in-line monitor is stuck on one answer, or says the opposite. A self-test that was never wired, or misreads.

    good, or blind: it sees nothing; bad, or false alarm: it accuses a healthy channel; inverted, or wrong: on the two
    good channels and on the two bad ones at once it names the wrong pair.
    """

    sites, act, changes_samples = ("channel", "discrete"), Act.VALID_ONLY, False
    sentence = "in-line monitor wrong from {at} on"
    example = "f16_split_2_2_wrong_ilm"

    kind: Literal["ilm"]
    says: Literal["good", "bad", "inverted", "blind", "false alarm", "wrong"] = quantity("", "the answer")

    @property
    def flag(self) -> Flag:
        """The effect on the in-line monitors of its channels."""
        return _ILM.get(self.says, Flag.INVERT)


class RateLoss(Placed):
    """The surface follows its command, but no faster than a given rate. Low hydraulic pressure, a sticking valve."""

    sites, act, sizes = ("surface",), Act.LIMIT_RATE, ("max_rate_per_s",)
    example = "b747_elevator_rate_loss"

    kind: Literal["rate_loss"]
    max_rate_per_s: float = quantity("signal/s", "rad/s, for the throttle 1/s", gt=0)


class _Weather(Triggered):
    """A fault of the environment: it chooses its signals itself."""

    channels: Channels = quantity("", "counted from 1", [1, 2, 3, 4], min_length=1)
    seen_by_ilm: bool = quantity("", "the in-line monitors of its channels say bad while it acts", False)

    @property
    def signal(self) -> str:
        """The signals that it acts on, for the name."""
        return fault_names.place(dict(self))


class PitotIcing(_Weather):
    """Ice closes pressure lines: what is trapped stays, and creeps. An unheated pitot head, tape on static ports.

    total = trapped total + pitot_rate t,  static = trapped static + static_rate t, each where its line is closed and
    live (static + dynamic, static) where not;  dynamic = total - static.  Trapped is what the channel said in the
    frame before the onset.  With the pitot line closed, the airspeed rises and falls with the altitude.
    """

    act = Act.PITOT_STATIC_ICE
    example = "b737_pitot_icing"

    kind: Literal["pitot_icing"]
    blocked: Literal["pitot", "static", "both"] = quantity("", "the line that is closed", "both")
    pitot_rate_pa_s: float = quantity("Pa/s", "how fast the trapped total pressure changes; a leak lowers it", 0.0)
    static_rate_pa_s: float = quantity("Pa/s", "how fast the trapped static pressure changes", 0.0)

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
    """Vanes freeze together where they stand: two frozen alike outvote a third. Water that turns to ice."""

    act = Act.HOLD
    sentence = "frozen at {value} at {at}"
    example = "b747_vane_icing"

    kind: Literal["vane_icing"]
    vanes: list[Literal["angle_of_attack", "angle_of_sideslip"]] = quantity(
        "", "which", ["angle_of_attack"], min_length=1
    )
    channels: Channels = quantity("", "counted from 1", [1, 2], min_length=1)

    @field_validator("vanes")
    @classmethod
    def _once(cls, vanes: list[str]) -> list[str]:
        if len(set(vanes)) < len(vanes):
            raise ValueError(f"each at most once, got {vanes}")
        return vanes

    @property
    def points(self) -> list[Point]:
        """The values that it acts on."""
        return [Point(vane, channel) for vane in self.vanes for channel in self.channels]
