"""CONFIG of ``rig vote``: how each recorded signal is monitored and voted, and where its channels are.

    [default]          # for all signals; keys and defaults are those of rig.computer.redundancy.SignalConfig
    [signal.<name>]    # for one, key by key over the default
    [discrete.<name>]  # columns <name>.1 to .4 of a yes/no quantity, with its fail-safe value
    [triads]           # three signals that are the axes of one vector: gyro = ["gyro_x", "gyro_y", "gyro_z"]
    [mapping]          # columns of a foreign recording: "gyro.1" = "/imu1:angular_velocity.x"
    [[resets]]         # commands to readmit, as in a scenario
    [baselines.<name>]    # settings of a baseline manager; as [redundancy.baselines.<name>] of a
    flight
    [boxes]            # signals that one unit of each channel measures, each signal in one; all in one when not given
    box_signals        # signals of a box that miscompare at once until a channel is isolated on all of them; 0: never;
                       # if not given: never without [boxes], with them more than half of the box
    box_persistence    # frames of such a miscompare
    unresolved_s       # time of an undecided split until the signal is given up; 0: never
    time_column        # of tables, "time_s" when not given; time_unit: "s"; separator, decimal: found by looking

Amounts in a signal's table have its ``unit``; in the settings that ``VoteConfig.signals`` gives they are SI.
Everything is checked before a row is voted; errors name the file and the key.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, field_validator, model_validator

from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.computer.redundancy.box import box_of_signals
from rig.computer.redundancy.discrete_config import DiscreteConfig
from rig.computer.redundancy.manager_config import Config as FlightConfig
from rig.computer.redundancy.manager_config import SignalConfig, short_wait
from rig.computer.redundancy.managers import DEFAULT, MANAGERS, manager_kind
from rig.computer.redundancy.resets import Reset as FlightReset
from rig.computer.redundancy.resets import bits
from rig.computer.redundancy.slow_tests_config import refusal
from rig.core.errors import BadInput
from rig.core.frame import DISCRETE_INDEX, DISCRETES, INDEX, SIGNALS
from rig.core.settings import Settings, build, read_toml, unknown_key
from rig.core.text import choices, quoted, shorten
from rig.core.units.constants import TWO_PI
from rig.core.units.conversion import conversion
from rig.log.recordings.csv_file import TableFormat
from rig.log.recordings.stamps import digits

ANY_NUMBER: Final = (-sys.float_info.max, sys.float_info.max)  # finite: infinity is never a sample
TURN_SLACK: Final = 1e-3  # so that a turn may be written as 6.283
AMOUNTS: Final = (  # settings of a signal that have its unit
    *("threshold", "threshold_triplex", "threshold_duplex", "outlier_threshold", "outlier_threshold_triplex"),
    *("reference_threshold", "selection_deviation", "selection_integral_s"),
    *("equalise_bound", "slow_allowance", "slow_limit"),
)
V = TypeVar("V", float, NDArray[np.float64])
MOST_ANGLE_RAD: Final = 1e6  # beyond it the fraction of a turn is lost to rounding


class RecordedSignal(SignalConfig):
    """A ``[signal.<name>]`` table: the settings of flight and what flight knows from its sensors.

    ``range`` and ``wraps`` of a signal that is called as one of the rig's own are by default those of flight.
    """

    range: list[float] | None = Field(default=None, min_length=2, max_length=2)  # a sample outside is invalid
    unit: str | None = None  # of the file and of the amounts here; None: that of a signal of the rig's, else unknown
    wraps: bool = False  # an angle
    manager: str = DEFAULT  # one of rig.computer.redundancy.MANAGERS, or module:name

    @field_validator("manager")
    @classmethod
    def _known_manager(cls, name: str) -> str:
        if name not in MANAGERS and ":" not in name:
            raise ValueError(f"unknown manager, allowed: {', '.join(MANAGERS)} or module:name")
        return name

    @model_validator(mode="after")
    def _has_noise(self) -> RecordedSignal:
        if self.slow_tests is not None and (why := refusal(self.slow_tests, self.least_threshold, None)):
            raise ValueError(why)
        return self

    _scale: float = PrivateAttr(1.0)
    _si: str = PrivateAttr("")
    _range_is_assumed: bool = PrivateAttr(False)

    @property
    def scale(self) -> float:
        """Return how many SI units one ``unit`` is."""
        return self._scale

    @property
    def si(self) -> str:
        """The SI unit of the quantity; "" if CONFIG gives none."""
        return self._si

    @property
    def range_is_assumed(self) -> bool:
        """Return True if the limits are those of flight, or of one turn, and not those of CONFIG."""
        return self._range_is_assumed

    def shown(self, value: V) -> V:
        """Return a value in SI units in ``unit``."""
        return value / self._scale

    def scaled(self, factor: float) -> RecordedSignal:
        """Return these settings with every amount times ``factor``."""
        given: dict[str, Any] = {
            name: amount * factor for name in AMOUNTS if (amount := getattr(self, name)) is not None
        }
        if self.range is not None:
            given["range"] = [limit * factor for limit in self.range]
        if self.slow_tests is not None:
            given["slow_tests"] = self.slow_tests.scaled(factor)
        return self.model_copy(update=given)

    @property
    def limits(self) -> tuple[float, float]:
        """The range with its default: one turn for an angle, otherwise all numbers."""
        if self.range is not None:
            return self.range[0], self.range[1]
        return (-pi, pi) if self.wraps else ANY_NUMBER


class RecordedDiscrete(DiscreteConfig):
    """A ``[discrete.<name>]`` table.

    ``fail_safe`` of a discrete that is called as one of the rig's own is by default that of flight.
    """


class Reset(FlightReset):
    """A reset command, for a signal of any name."""

    at_s: float = Field(ge=0, le=1e11)  # in the recording's time, which may be that of a calendar

    @field_validator("signal")
    @classmethod
    def _known(cls, name: str) -> str:
        return name  # whether the recording has it is checked when it has been read


class VoteRules(NamedTuple):
    """Settings for all signals of a vote: keys of ``redundancy.Config``; by default neither box nor split fails."""

    box_signals: int | None = 0
    box_persistence: int = 1
    boxes: Mapping[str, Sequence[str]] = {}
    unresolved_s: float = 0.0


class VoteConfig(Settings):
    """The whole file; tables of signals are checked by ``signals`` when their names are known."""

    keys_are_in: ClassVar[str] = "docs/reference/recordings.md"

    default: dict[str, Any] | None = None
    signal: dict[str, dict[str, Any]] = {}
    discrete: dict[str, RecordedDiscrete] = {}
    triads: dict[str, list[str]] = {}
    baselines: Baselines = Baselines()
    mapping: dict[str, str] = {}
    time_column: str = "time_s"
    time_unit: str = "s"
    separator: str | None = Field(default=None, min_length=1, max_length=1)
    decimal: Literal[".", ","] | None = None
    resets: list[Reset] = []
    boxes: dict[str, list[str]] = {}
    box_signals: int | None = Field(default=None, ge=0)
    box_persistence: int = Field(default=8, ge=1)
    unresolved_s: float = Field(default=FlightConfig.model_fields["unresolved_s"].default, ge=0)

    @field_validator("time_unit")
    @classmethod
    def _of_time(cls, unit: str) -> str:
        conversion(unit, "s")
        return unit

    @property
    def tables(self) -> TableFormat:
        """Return how tables are written."""
        return TableFormat(self.time_column, self.time_unit, self.separator, self.decimal)

    @property
    def rules(self) -> VoteRules:
        """Return what holds for all signals."""
        needed = 0 if self.box_signals is None and not self.boxes else self.box_signals
        return VoteRules(needed, self.box_persistence, self.boxes, self.unresolved_s)

    def refuse_short_wait(self, signals: Mapping[str, SignalConfig], rate_hz: float, source: str) -> None:
        """Raise BadInput if a given ``unresolved_s`` is shorter than a decision takes; the default is raised."""
        if "unresolved_s" in self.model_fields_set and (short := short_wait(self.unresolved_s, signals, rate_hz)):
            raise BadInput(f"{source}: {short}")

    def refuse_late_resets(self, time_s: NDArray[np.float64], source: str) -> None:
        """Raise BadInput for a reset before the first row of a recording or after its last."""
        first, last = float(time_s[0]), float(time_s[-1])
        for i, reset in enumerate(self.resets):
            if not first <= reset.at_s <= last:
                since = f"; {reset.at_s:g} s after the first row is {digits(first + reset.at_s)}"
                hint = since if reset.at_s <= last - first else ""
                raise BadInput(
                    f"{source}: resets.{i}.at_s: must be from {digits(first)} to {digits(last)} s, the times of the "
                    f"recording, got {digits(reset.at_s)}{hint}"
                )

    def signals(self, present: Collection[str], source: str) -> dict[str, RecordedSignal]:
        """Return settings of the signals to be voted, those of ``present`` that a table or the default names."""
        asked = [*self.signal, *(reset.signal for reset in self.resets if reset.signal not in self.discrete)]
        for name in asked:
            if name not in present:
                raise BadInput(f"{source}: signal {quoted(name)} is not in the input; {choices(name, present)}")
        chosen = [name for name in present if name in self.signal or self.default is not None]
        if not chosen and not self.discrete:
            raise BadInput(f"{source}: no signal to vote: add [signal.<name>], [discrete.<name>] or [default]")
        try:
            self.baselines.refuse_others(present)
        except ValueError as error:
            raise BadInput(f"{source}: {error}") from None
        try:
            box_of_signals(self.boxes, chosen)
        except ValueError as error:
            raise BadInput(f"{source}: boxes: {error}") from None
        signals = {name: self._settings(name, source) for name in chosen}
        for triad, axes in self.triads.items():
            _check_triad(f"{source}: triads.{shorten(triad)}", axes, signals)
        return signals

    def discretes(self, present: Collection[str], source: str) -> dict[str, RecordedDiscrete]:
        """Return settings of the discretes, each with its fail-safe value; all of them must be ``present``."""
        discretes: dict[str, RecordedDiscrete] = {}
        for name, given in self.discrete.items():
            if name not in present:
                raise BadInput(f"{source}: discrete {quoted(name)} is not in the input; {choices(name, present)}")
            fail_safe = given.fail_safe
            if fail_safe is None and name in DISCRETE_INDEX:
                fail_safe = DISCRETES[DISCRETE_INDEX[name]].fail_safe
            if fail_safe is None:
                raise BadInput(f"{source}: discrete.{name}: fail_safe: field required, 0 or 1")
            discretes[name] = given.model_copy(update={"fail_safe": fail_safe})
        return discretes

    def _settings(self, name: str, source: str) -> RecordedSignal:
        """Return the settings of one signal, in SI units."""
        own = self.signal.get(name, {})
        where = f"{source}: {f'signal.{name}' if own or self.default is None else 'default'}"
        signal = SIGNALS[INDEX[name]] if name in INDEX else None
        given = {**({} if signal is None else {"wraps": signal.wraps}), **(self.default or {}), **own}
        settings = build(RecordedSignal, given, where)
        factor, si = _conversion(settings, None if signal is None else signal.unit, where)
        has_unit = settings.unit is not None or settings.wraps or (signal is not None and settings.range is None)
        made = settings.scaled(factor).model_copy(update={"unit": settings.unit or (si if has_unit else None)})
        made._scale, made._si = factor, si
        if made.range is None and signal is not None:
            made = made.model_copy(update={"range": [signal.low, signal.high]})
        made._range_is_assumed = settings.range is None and made.limits != ANY_NUMBER
        _check_range(made, where)
        return made


def _conversion(settings: RecordedSignal, si: str | None, where: str) -> tuple[float, str]:
    """Return the factor from the unit of a signal to SI and the name of that; BadInput: a unit that it cannot have."""
    if settings.unit is None:
        return 1.0, si or ("rad" if settings.wraps else "")
    try:
        return conversion(settings.unit, "rad" if settings.wraps else si)
    except ValueError as error:
        raise BadInput(f"{where}: unit: {error}") from None


def _check_range(settings: RecordedSignal, where: str) -> None:
    """BadInput unless the range, in SI units, is one, and of an angle that wraps one turn."""
    low, high = settings.limits
    shown = [float(f"{settings.shown(limit):.12g}") for limit in (low, high)]
    unit = settings.unit or ("rad" if settings.wraps else "")
    if low >= high:
        raise BadInput(f"{where}: range: low must be below high, got {shown}")
    if not settings.wraps:
        return
    if abs(high - low - TWO_PI) > TURN_SLACK:
        turn = f"one turn in {unit} ({settings.shown(TWO_PI):.6g})"
        degrees = '; is the file in degrees? unit = "deg"' if high - low > TWO_PI and unit == "rad" else ""
        raise BadInput(
            f"{where}: range: {shown[1] - shown[0]:g} is not {turn}; an angle that wraps needs a whole turn in {unit}, "
            f"got {shown}{degrees}"
        )
    if max(-low, high) > MOST_ANGLE_RAD:
        raise BadInput(f"{where}: range: an angle that wraps stays within {MOST_ANGLE_RAD:g} rad, got {shown} {unit}")


def _check_triad(where: str, axes: list[str], settings: dict[str, RecordedSignal]) -> None:
    """BadInput unless three signals can be the axes of one vector (that each is in one triad, ``read_config`` sees)."""
    for axis in axes:
        if axis not in settings:
            raise BadInput(f"{where}: {quoted(axis)} is not voted; {choices(axis, settings)}")
        if settings[axis].unit != settings[axes[0]].unit:
            raise BadInput(f"{where}: unit: {axis} and {axes[0]} have different units, the axes of a vector need one")
        if settings[axis].wraps:
            raise BadInput(f"{where}: {axis} is an angle that wraps, no axis of a vector")
    managers = {settings[axis].manager for axis in axes}
    of_units = next((name for name in managers if manager_kind(name).chooses_units), None)
    if len(managers) > 1 and of_units is not None:
        raise BadInput(
            f"{where}: manager: {of_units} chooses one channel for all axes; set it for all of them or for none"
        )


def read_config(path: Path) -> VoteConfig:
    """Return the CONFIG at ``path``; BadInput names the file and the key."""
    return config_of(read_toml(path), path)


def config_of(data: dict[str, Any], path: Path) -> VoteConfig:
    """Return the tables of a CONFIG, checked; BadInput names ``path`` and the key."""
    config = build(VoteConfig, data, str(path))
    _check_axes(path, config.triads)
    for name in config.discrete:
        if name in config.signal:
            raise BadInput(f"{path}: {name!r} is a signal and a discrete: keep one of the tables")
    for table, keys in (("default", config.default or {}), *((f"signal.{n}", t) for n, t in config.signal.items())):
        for key in keys:
            if key not in RecordedSignal.model_fields:
                raise BadInput(f"{path}: {table}.{unknown_key(key, RecordedSignal, VoteConfig.keys_are_in)}")
    return config


def _check_axes(path: Path, triads: dict[str, list[str]]) -> None:
    """Three different signals each, no signal in two triads."""
    taken: set[str] = set()
    for triad, axes in triads.items():
        if len(set(axes)) != 3:
            raise BadInput(f"{path}: triads.{shorten(triad)}: must be three different signals, got {quoted(axes)}")
        if twice := [axis for axis in axes if axis in taken]:
            raise BadInput(f"{path}: triads.{shorten(triad)}: {quoted(twice[0])} is in another triad already")
        taken.update(axes)


def commands(resets: list[Reset], name: str, time_s: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(n,) the reset commands for one signal as in the frame; each acts in the first row at or after its time."""
    given = np.zeros(len(time_s), np.uint8)
    for reset in resets:
        row = np.searchsorted(time_s, reset.at_s)
        if reset.signal == name and row < len(given):
            given[row] |= bits(reset.channels)
    return given
