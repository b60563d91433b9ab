"""Faults: a schedule of what goes wrong on which signal and channel, and when.

A fault acts from ``start_s`` (included) to ``end_s`` (excluded; to the end of the flight when not
given).  Several on one channel act in the order of the schedule.  What a sensor says after that still
cannot leave its range.  A fault sits on channels of a signal, or on one quantity of the inertial unit:
``signal = "inertial.pitch_rate_rad_s"``, without channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Annotated, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from rig.angles import limit
from rig.frame import CHANNELS, INDEX, INERTIAL, SIGNALS, Block, Ilm, S, to_frame
from rig.kernels import kernel
from rig.settings import Settings

_SIGNALS: Final = S
# Where a fault can sit: a signal's index, or behind the signals a quantity of the inertial unit.
PLACES: Final = {**INDEX, **{f"inertial.{name}": S + i for i, name in enumerate(INERTIAL)}}


class Kind(IntEnum):
    """Fault kinds, as kernels know them."""

    OFFSET = 0
    DRIFT = 1
    HARDOVER = 2
    DROPOUT = 3
    ILM = 4


class Flag(IntEnum):
    """What a fault does to the in-line monitors of its channels."""

    LEAVE = 0
    BAD = 1
    GOOD = 2
    INVERT = 3


class _Fault(Settings):
    id: str | None = None  # defaults to "<kind> <signal>.<channels>"
    signal: str
    channels: list[int] = []  # of a signal; the inertial unit has none
    start_s: float = Field(ge=0)
    end_s: float | None = Field(default=None, gt=0)

    @field_validator("signal")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in PLACES:
            raise ValueError(f"unknown signal, allowed: {', '.join(PLACES)}")
        return name

    @field_validator("channels")
    @classmethod
    def _numbered(cls, channels: list[int]) -> list[int]:
        if any(not 1 <= channel <= CHANNELS for channel in channels) or len(set(channels)) < len(channels):
            raise ValueError(f"channels are different numbers from 1 to {CHANNELS}, got {channels}")
        return channels

    @model_validator(mode="after")
    def _ordered(self) -> _Fault:
        if self.end_s is not None and self.end_s <= self.start_s:
            raise ValueError(f"end_s ({self.end_s:g}) must be after start_s ({self.start_s:g})")
        return self

    @model_validator(mode="after")
    def _placed(self) -> _Fault:
        if self.signal in INDEX:
            if not self.channels:
                raise ValueError("channels: at least 1 is needed")
        elif self.channels:
            raise ValueError(f"channels: {self.signal} has none, got {self.channels}")
        elif self.kind not in ("offset", "drift", "hardover"):  # type: ignore[attr-defined]  # every kind has one
            raise ValueError("kind: the inertial unit can have offset, drift and hardover")
        elif getattr(self, "seen_by_ilm", False):
            raise ValueError("seen_by_ilm: the inertial unit has no in-line monitor")
        return self

    @property
    def label(self) -> str:
        """The fault's name in events and tables."""
        place = ".".join(filter(None, (self.signal, ",".join(map(str, self.channels)))))
        return self.id or f"{self.kind} {place}"  # type: ignore[attr-defined]  # every kind has one


class _Spoiled(_Fault):
    """A fault of the sample itself; the channel's in-line monitor may see it."""

    seen_by_ilm: bool = False

    @property
    def flag(self) -> Flag:
        """What happens to the in-line monitors."""
        return Flag.BAD if self.seen_by_ilm else Flag.LEAVE


class Offset(_Spoiled):
    """A constant added to the sample: a bias from a bent vane, a shifted zero, a bad calibration."""

    kind: Literal["offset"]
    offset: float  # unit of the signal

    @property
    def row(self) -> tuple[Kind, float]:
        """Kind and value for the kernel."""
        return Kind.OFFSET, self.offset


class Drift(_Spoiled):
    """An error that grows steadily from the onset: a gyro warming up, a leaking pressure line."""

    kind: Literal["drift"]
    rate_per_s: float  # unit of the signal per second

    @property
    def row(self) -> tuple[Kind, float]:
        """Kind and value for the kernel."""
        return Kind.DRIFT, self.rate_per_s


class Hardover(_Spoiled):
    """The sample goes to the end of the sensor's range: an open or shorted wire, a failed amplifier."""

    kind: Literal["hardover"]
    direction: Literal["high", "low"] = "high"

    @property
    def row(self) -> tuple[Kind, float]:
        """Kind and value for the kernel."""
        return Kind.HARDOVER, 1.0 if self.direction == "high" else -1.0


class Dropout(_Spoiled):
    """No sample: a broken link. The sensor flags it invalid, or, not flagged, says what is no number."""

    kind: Literal["dropout"]
    flagged: bool = True

    @property
    def row(self) -> tuple[Kind, float]:
        """Kind and value for the kernel."""
        return Kind.DROPOUT, 1.0 if self.flagged else 0.0


class IlmFault(_Fault):
    """An in-line monitor that is stuck on one answer, or says the opposite of what it should."""

    kind: Literal["ilm"]
    says: Literal["good", "bad", "inverted"]

    @property
    def row(self) -> tuple[Kind, float]:
        """Kind and value for the kernel."""
        return Kind.ILM, 0.0

    @property
    def flag(self) -> Flag:
        """What happens to the in-line monitors."""
        return {"good": Flag.GOOD, "bad": Flag.BAD, "inverted": Flag.INVERT}[self.says]


Fault = Annotated[Offset | Drift | Hardover | Dropout | IlmFault, Field(discriminator="kind")]

SCHEDULE: Final = np.dtype(
    [
        ("kind", "u1"),
        ("wraps", "u1"),
        ("flag", "u1"),
        ("channel", "u1", (CHANNELS,)),
        ("signal", "i8"),
        ("first", "i8"),
        ("last", "i8"),  # excluded
        ("value", "f8"),
        ("low", "f8"),
        ("high", "f8"),
    ],
    align=True,
)
FOREVER: Final = int(np.iinfo(np.int64).max)
_HARD, _DRIFT, _DROPOUT, _ILM = (int(k) for k in (Kind.HARDOVER, Kind.DRIFT, Kind.DROPOUT, Kind.ILM))
_LEAVE, _FLAG_BAD, _FLAG_GOOD = int(Flag.LEAVE), int(Flag.BAD), int(Flag.GOOD)
_BAD, _GOOD = int(Ilm.BAD), int(Ilm.GOOD)


def window(fault: Fault, rate_hz: float) -> tuple[int, int]:
    """The frames in which a fault acts: first (included) and last (excluded)."""
    last = FOREVER if fault.end_s is None else to_frame(fault.end_s, rate_hz)
    return to_frame(fault.start_s, rate_hz), last


class Faults:
    """Corrupts the channels of each frame according to the schedule."""

    def __init__(self, faults: Sequence[Fault], ranges: NDArray[np.float64], rate_hz: float) -> None:
        """``ranges`` (S, 2): the lowest and highest sample of each signal's sensor, then of the inertial unit's
        quantities if faults sit on them.
        """
        self._dt_s = 1.0 / rate_hz
        self.schedule = np.zeros(len(faults), SCHEDULE)
        for row, fault in zip(self.schedule, faults, strict=True):
            place = PLACES[fault.signal]
            row["kind"], row["value"] = fault.row
            row["flag"] = fault.flag
            row["signal"], row["wraps"] = place, place < S and SIGNALS[place].wraps
            row["low"], row["high"] = ranges[place]
            for channel in fault.channels:
                row["channel"][channel - 1] = 1
            row["first"], row["last"] = window(fault, rate_hz)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``corrupt`` needs besides the row."""
        return self.schedule, self._dt_s

    def step(self, block: Block, k: int) -> None:
        """Corrupt row k in place and write how many faults acted."""
        corrupt(block, k, *self.arguments)


@kernel
def corrupt(block, k, schedule, dt_s):
    """Apply every fault that is due to the channels of row k.

    offset: x + d    drift: x + d (t - t0)    hardover: the end of the range    dropout: invalid, or NaN
    block : FRAME records; schedule : (F,) SCHEDULE records; dt_s : frame period, s
    Writes channels, valid, ilm, inertial and acting.
    """
    row = block[k]
    channels, valid, ilm = row["channels"], row["valid"], row["ilm"]
    frame = row["frame"]
    acting = row["acting"]
    for f in range(len(schedule)):
        fault = schedule[f]
        if frame < fault["first"] or frame >= fault["last"]:
            continue
        acting[f >> 3] |= np.uint8(1 << (f & 7))
        s = fault["signal"]
        if s >= _SIGNALS:  # no dropout there, so nobody's validity is touched
            spoil(row["inertial"], valid[0], s - _SIGNALS, fault, (frame - fault["first"]) * dt_s)
            continue
        mask = fault["channel"]
        for c in range(CHANNELS):
            if mask[c] != 0:
                spoil(channels[s], valid[s], c, fault, (frame - fault["first"]) * dt_s)
                ilm[s, c] = flagged(ilm[s, c], fault["flag"])


@kernel
def spoil(samples, valid, c, fault, elapsed_s):
    """What a fault that has acted for ``elapsed_s`` makes of sample ``c`` and of its validity."""
    kind = fault["kind"]
    if kind == _HARD:
        samples[c] = fault["high"] if fault["value"] > 0.0 else fault["low"]
    elif kind == _DROPOUT:
        if fault["value"] != 0.0:
            valid[c] = 0
        else:
            samples[c] = np.nan
    elif kind != _ILM:
        error = fault["value"] * (elapsed_s if kind == _DRIFT else 1.0)
        samples[c] = limit(samples[c] + error, fault["low"], fault["high"], fault["wraps"])


@kernel
def flagged(says, flag):
    """The in-line monitor's answer under a fault; one that is not fitted stays absent."""
    if flag == _LEAVE or (says != _BAD and says != _GOOD):
        return says
    if flag == _FLAG_BAD:
        return _BAD
    if flag == _FLAG_GOOD:
        return _GOOD
    return _BAD if says == _GOOD else _GOOD
