"""Kinds of faults of the computers and of their electrical power, with ``[computers] count`` of 2 or more.

A fault acts on one lane, ``computer.B``, on the program of all lanes, ``computer.all``, or on an electrical bus:
``bus.1`` for lanes A and C with their sensors, ``bus.2`` for B and D.  A self-test of the lane detects its faults with
the probability of its coverage, which is drawn once for each fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import model_validator

from rig.core.frame import CHANNELS, COMPUTERS, DISCRETES, MOVED, SIGNALS, SURFACES, LaneTest
from rig.world.faults.effects import Act, Effect
from rig.world.faults.fault_settings import Placed, Size, quantity
from rig.world.faults.places import FLIGHT, Places, Point, Site, lanes_of
from rig.world.faults.servo_parts import ComputerPart

_STOPPED = Effect(Act.SET, 1.0, part=ComputerPart.STOPPED, seen_by_test=LaneTest.WATCHDOG)
_BY_ITS_TEST = "the lane's self-test did not cover it, or it was within the tolerance"
SurfaceName = Literal["elevator", "aileron", "rudder", "throttle"]


class _OnComputer(Placed):
    """A fault of a lane."""

    sites: ClassVar[tuple[Site, ...]] = ("computer",)
    act, changes_samples = Act.SET, False
    of_all: ClassVar[bool] = False

    @model_validator(mode="after")
    def _whose(self) -> _OnComputer:
        if (self.signal == "computer.all") != self.of_all:
            allowed = "computer.all" if self.of_all else ", ".join(f"computer.{name}" for name in COMPUTERS)
            raise ValueError(f"signal: {dict(self)['kind']} cannot act on {self.signal}, allowed: {allowed}")
        return self

    @property
    def targets(self) -> list[Point]:
        """One record for each lane."""
        return [Point(f"computer.{COMPUTERS[lane]}") for lane in lanes_of(self.signal)]


class ComputerStop(_OnComputer):
    """A lane stops: it computes and transmits nothing. Causes: a hung processor, a failed power supply.

    When the fault ends, the lane restarts with the state of the first engaged lane and waits for readmission.
    """

    act, takes_channels = _STOPPED, True
    sentence = "stopped at {at}"
    example = "f16_computer_stop"

    kind: Literal["computer_stop"]


class ClockDrift(_OnComputer):
    """A lane's clock runs at a wrong rate. Cause: a cracked or overheated crystal."""

    sizes = ("drift_ppm",)
    sentence = "clock wrong from {at} on"
    unseen = "its clock stayed within the window, or the clocks run free"
    example = "f16_clock_drift"

    kind: Literal["clock_drift"]
    drift_ppm: float = quantity(
        "ppm", "added to the drift of its clock; above 0 the clock is fast", ge=-500_000, le=500_000
    )

    @property
    def effect(self) -> Effect:
        """The drift in frames per frame."""
        return Effect(Act.SET, 1e-6 * self.drift_ppm, part=ComputerPart.DRIFT)


class _OfOneSurface(_OnComputer):
    """A wrong number for one surface."""

    sizes = ("offset", "amplitude")
    part: ClassVar[ComputerPart] = ComputerPart.COMMAND

    surface: SurfaceName = quantity("", "surface whose command is wrong")
    does: Literal["offset", "hardover", "stuck", "oscillation"] = quantity("", "error of the command", "hardover")
    offset: float | None = quantity("rad", "`offset`: added to the command; for the throttle a fraction", None)
    direction: Literal["high", "low"] = quantity("", "`hardover`: stop to which the command goes", "high")
    amplitude: float | None = quantity("rad", "`oscillation`: amplitude of the added sine", None, gt=0)
    frequency_hz: float | None = quantity("Hz", "`oscillation`: frequency", None, gt=0, le=500)
    ramp_s: float = quantity("s", "the effect grows linearly from zero over this time", 0.0, ge=0)

    @model_validator(mode="after")
    def _what_it_does(self) -> _OfOneSurface:
        needs = {"offset": ("offset",), "oscillation": ("amplitude", "frequency_hz")}.get(self.does, ())
        for name in ("offset", "amplitude", "frequency_hz"):
            if (getattr(self, name) is not None) != (name in needs):
                raise ValueError(
                    f"{name}: {'is required with' if name in needs else 'is not allowed with'} does = {self.does!r}"
                )
        return self

    @property
    def targets(self) -> list[Point]:
        """One record for each lane, of its surface counted from 1."""
        column = [name.removesuffix("_rad") for name in SURFACES].index(self.surface) + 1
        return [Point(point.place, column) for point in super().targets]

    @property
    def effect(self) -> Effect:
        """An offset, a stop, the last value or a sine."""
        seen = LaneTest.WRAP_AROUND if self.part == ComputerPart.OUTPUT else LaneTest.NONE
        if self.does == "offset":
            return Effect(Act.ADD, self.offset or 0.0, part=self.part, seen_by_test=seen)
        if self.does == "stuck":
            return Effect(Act.HOLD, part=self.part, seen_by_test=seen)
        if self.does == "oscillation":
            wave = self.amplitude or 0.0, self.frequency_hz or 0.0
            return Effect(Act.OSCILLATE, wave[0], frequency_hz=wave[1], part=self.part, seen_by_test=seen)
        return Effect(Act.RANGE_END, 1.0 if self.direction == "high" else -1.0, part=self.part, seen_by_test=seen)


class WrongCommand(_OfOneSurface):
    """A lane computes a wrong command and transmits it to the others. Causes: an arithmetic defect, a flipped bit.

    Its self-tests do not detect it. The vote of the lanes' commands does.
    """

    sentence = "wrong command computed from {at} on"
    example = "f16_wrong_command"

    kind: Literal["wrong_command"]


class Software(_OfOneSurface):
    """All lanes compute the same wrong command. Cause: a defect of their common program.

    A comparison of the lanes cannot detect it. The back-up, another program, flies if the pilot selects it.
    """

    of_all = True
    sentence = "wrong command computed from {at} on"
    unseen = "all lanes computed the same wrong command, which no comparison detects"
    example = "f16_software"

    kind: Literal["software"]


class Dac(_OfOneSurface):
    """A lane's output converter gives a wrong value for one surface. Causes: a stuck bit, a drifting reference.

    The wrap-around test reads the output back. It detects an error above its tolerance, by its coverage.
    """

    part = ComputerPart.OUTPUT
    sentence = "wrong command at its output from {at} on"
    unseen = _BY_ITS_TEST
    example = "f16_dac"

    kind: Literal["dac"]

    @property
    def drives(self) -> tuple[str, int] | None:
        """Surface and channel from 1 of the servo that it drives; None for the throttle, which has none."""
        return (self.surface, lanes_of(self.signal)[0] + 1) if self.surface in MOVED else None


class Checksum(_OnComputer):
    """A lane's program is damaged, and its commands have a scale error. Causes: a worn memory cell, radiation.

    The checksum test of the program detects it at the end of its period.
    """

    sizes = ("factor",)
    sentence = "program damaged at {at}"
    unseen = _BY_ITS_TEST
    example = "f16_checksum"

    kind: Literal["checksum"]
    factor: float = quantity("1", "factor on all its commands", 1.0)

    @property
    def effect(self) -> Effect:
        """A factor, which may be 1."""
        return Effect(Act.SET, self.factor, part=ComputerPart.CODE, seen_by_test=LaneTest.CHECKSUM)

    @property
    def magnitude(self) -> Size:
        """The factor's distance from 1."""
        return Size(abs(1.0 - self.factor), False)


class _OfItsChannels(_OnComputer):
    """A fault of all channels that a lane samples."""

    changes_samples = True

    @property
    def points(self) -> list[Point]:
        """The channels of its lanes, of all signals."""
        return [Point(signal.name, lane + 1) for lane in lanes_of(self.signal) for signal in SIGNALS]

    @property
    def targets(self) -> list[Point]:
        """The same, and the lanes."""
        return [*self.points, *super().targets]

    def check_fitted(self, fitted: Mapping[str, int], places: Places = FLIGHT) -> None:
        """Raise nothing for channels that are not fitted, because they are not sampled."""
        unlimited = {name: CHANNELS if self.on is None or self.on.signal != name else n for name, n in fitted.items()}
        super().check_fitted(unlimited, places)


class Adc(_OfItsChannels):
    """A lane's input converter gives wrong samples of all signals. Causes: a failed multiplexer, a drifting reference.

    The wrap-around test detects `zero` and `last`. The reference-voltage test detects `scale` and `offset` above its
    tolerance.
    """

    sizes = ("factor", "offset")
    sentence = "input samples wrong from {at} on"
    example = "f16_adc"

    kind: Literal["adc"]
    says: Literal["zero", "last", "scale", "offset"] = quantity("", "error of its samples")
    factor: float | None = quantity("1", "`scale`: factor on each sample", None)
    offset: float | None = quantity("1", "`offset`: added, as a fraction of each sensor's range", None)

    @model_validator(mode="after")
    def _what_it_says(self) -> Adc:
        needed = {"scale": "factor", "offset": "offset"}.get(self.says)
        for name in ("factor", "offset"):
            if (getattr(self, name) is not None) != (name == needed):
                raise ValueError(
                    f"{name}: {'is needed with' if name == needed else 'is not allowed with'} {'says'} = {self.says!r}"
                )
        return self

    @property
    def magnitude(self) -> Size | None:
        """Return how far the scale is from 1, or the offset from 0."""
        return super().magnitude if self.factor is None else Size(abs(1.0 - self.factor), False)

    def effect_on(self, point: Point) -> Effect:
        """Return the effect on a channel, or on the lane with the self-test that may detect it."""
        if FLIGHT.site(point.place) != "computer":
            return self.effect
        if self.says in ("zero", "last"):
            return Effect(Act.SET, 1.0, part=ComputerPart.INPUT, seen_by_test=LaneTest.WRAP_AROUND)
        off = abs((self.factor or 0.0) - 1.0) if self.says == "scale" else abs(self.offset or 0.0)
        test = LaneTest.REFERENCE_VOLTAGE
        return Effect(Act.SET, 1.0, part=ComputerPart.SCALE, seen_by_test=test, test_error=off)

    @property
    def effect(self) -> Effect:
        """Return the effect on a channel."""
        if self.says == "zero":
            return Effect(Act.SET, 0.0)
        if self.says == "last":
            return Effect(Act.HOLD)
        if self.says == "scale":
            return Effect(Act.SCALE, self.factor or 0.0)
        return Effect(Act.ADD, self.offset or 0.0, of_range=True)


class PowerLoss(_OfItsChannels):
    """An electrical bus fails, with two lanes and all their sensors. Causes: a tripped breaker, a failed generator.

    Their samples are flagged invalid and are not numbers. The inertial unit has a separate supply.
    """

    sites: ClassVar[tuple[Site, ...]] = ("bus",)
    act = Effect(Act.NO_NUMBER, invalid=True)
    sentence = "power lost at {at}"
    example = "f16_power_loss"

    kind: Literal["power_loss"]

    @property
    def points(self) -> list[Point]:
        """The channels of its lanes, of all signals and discretes."""
        return [Point(one.name, lane + 1) for lane in lanes_of(self.signal) for one in (*SIGNALS, *DISCRETES)]

    def effect_on(self, point: Point) -> Effect:
        """Return the effect on a channel or on a lane."""
        where = FLIGHT.site(point.place)
        if where == "computer":
            return _STOPPED
        return Effect(Act.VALID_ONLY, invalid=True) if where == "discrete" else self.effect
