"""Kinds of faults of more than a value: in-line monitors, actuators, and ice on several sensors at once."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import field_validator

from rig.faults.places import Point, Site
from rig.faults.settings import Act, Channels, Effect, Flag, Placed, Triggered, quantity
from rig.util import fault_names

_ILM = {"good": Flag.GOOD, "blind": Flag.GOOD, "bad": Flag.BAD, "false alarm": Flag.BAD}


class IlmFault(Placed):
    """The in-line monitor is stuck on one answer, or says the opposite. A self-test that was never wired, or misreads.

    good, or blind: it sees nothing; bad, or false alarm: it accuses a healthy channel; inverted, or lying: on the two
    good channels and on the two bad ones at once it makes a lying pair.
    """

    sites: ClassVar[tuple[Site, ...]] = ("channel", "discrete")
    kind: Literal["ilm"]
    says: Literal["good", "bad", "inverted", "blind", "false alarm", "lying"] = quantity("", "the answer")

    effect: ClassVar[Effect] = Effect(Act.NOTHING)

    @property
    def flag(self) -> Flag:
        """What happens to the in-line monitors of its channels."""
        return _ILM.get(self.says, Flag.INVERT)


class RateLoss(Placed):
    """The surface follows its command, but no faster than a given rate. Low hydraulic pressure, a sticking valve."""

    sites: ClassVar[tuple[Site, ...]] = ("surface",)
    kind: Literal["rate_loss"]
    max_rate_per_s: float = quantity("signal/s", "rad/s, for the throttle 1/s", gt=0)

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.LIMIT_RATE, self.max_rate_per_s)


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
    def effect(self) -> Effect:
        """For the kernel; which lines are closed is told by finite rates."""
        pitot = float("nan") if self.blocked == "static" else self.pitot_rate_pa_s
        static = float("nan") if self.blocked == "pitot" else self.static_rate_pa_s
        return Effect(Act.ICE, pitot, static)


class VaneIcing(_Weather):
    """Vanes freeze together where they stand: two frozen alike outvote a third. Water that turns to ice."""

    kind: Literal["vane_icing"]
    vanes: list[Literal["angle_of_attack", "angle_of_sideslip"]] = quantity(
        "", "which", ["angle_of_attack"], min_length=1
    )
    channels: Channels = quantity("", "counted from 1", [1, 2], min_length=1)
    effect: ClassVar[Effect] = Effect(Act.HOLD)

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
