"""Settings of one recorded signal: a ``[signal.<name>]`` table of CONFIG, with its unit and range."""

from __future__ import annotations

import sys
from math import pi
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, field_validator, model_validator

from rig.computer.redundancy.manager_config import SignalConfig
from rig.computer.redundancy.managers import DEFAULT, MANAGERS, manager_kind
from rig.computer.redundancy.slow_tests_config import refusal
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.core.units.constants import TWO_PI
from rig.core.units.conversion import conversion

ANY_NUMBER: Final = (-sys.float_info.max, sys.float_info.max)  # finite: infinity is never a sample
TURN_SLACK: Final = 1e-3  # so that a turn may be written as 6.283
AMOUNTS: Final = (  # settings of a signal that have its unit
    *("threshold", "threshold_triplex", "threshold_duplex"),
    *("reference_threshold", "selection_deviation", "selection_integral_s"),
    *("slow_allowance", "slow_limit", "max_change"),
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
    channels: list[int] | None = Field(default=None, min_length=2, max_length=CHANNELS)  # recorded ones that vote
    bad_from_start: list[int] = []  # channels that begin isolated
    max_change: float | None = Field(default=None, gt=0)  # from row to row; a sample that changes by more is invalid

    @field_validator("manager")
    @classmethod
    def _known_manager(cls, name: str) -> str:
        if name not in MANAGERS and ":" not in name:
            raise ValueError(f"unknown manager, allowed: {', '.join(MANAGERS)} or module:name")
        return name

    @field_validator("channels")
    @classmethod
    def _different(cls, numbers: list[int] | None) -> list[int] | None:
        if numbers is not None and (len(set(numbers)) < len(numbers) or min(numbers) < 1):
            raise ValueError(f"must be different recorded channels, from 1 on, got {numbers}")
        return numbers

    @model_validator(mode="after")
    def _some_good(self) -> RecordedSignal:
        bad = self.bad_from_start
        if any(not 1 <= c <= CHANNELS for c in bad) or len(set(bad)) < len(bad):
            raise ValueError(f"bad_from_start: must be different channels, 1 to {CHANNELS}, got {bad}")
        if bad and not manager_kind(self.manager).latches:
            allowed = ", ".join(name for name in MANAGERS if manager_kind(name).latches)
            raise ValueError(f"bad_from_start: manager {self.manager} isolates no channel for good; allowed: {allowed}")
        return self

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

    def in_si(self, factor: float, si: str, range_is_assumed: bool) -> RecordedSignal:
        """Return these settings, amounts in SI units, with what is known of their unit."""
        made = self.model_copy()
        made._scale, made._si, made._range_is_assumed = factor, si, range_is_assumed
        return made


def unit_of(settings: RecordedSignal, si: str | None, where: str) -> tuple[float, str]:
    """Return the factor from the unit of a signal to SI and the name of that; BadInput: a unit that it cannot have."""
    if settings.unit is None:
        return 1.0, si or ("rad" if settings.wraps else "")
    try:
        return conversion(settings.unit, "rad" if settings.wraps else si)
    except ValueError as error:
        raise BadInput(f"{where}: unit: {error}") from None


def check_range(settings: RecordedSignal, where: str) -> None:
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
