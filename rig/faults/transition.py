"""Transitions that trigger a fault: of the autopilot, or of what is decided about a signal or a discrete."""

from __future__ import annotations

from typing import Any, Final, Literal, NamedTuple

from pydantic import Field, model_validator

from rig.faults.record import code
from rig.frame import CHANNELS, DISCRETE_INDEX, INDEX, Pattern, Resolver, Source, State
from rig.settings import Settings
from rig.text import choices, quoted

_OF_SIGNAL: Final = ("level", "pattern", "resolver", "source", "state")  # keys, and fields of FRAME
_OF_DISCRETE: Final = ("level", "state")
_LABELS: Final = {pattern.label: pattern for pattern in Pattern}


class Watched(NamedTuple):
    """A number of the frame, by its place among those that are watched, and the value that it must change to."""

    place: int
    value: int


class Transition(Settings):
    """A change that triggers a fault: ``{ autopilot = ... }``, or ``{ signal = ... }`` with one of the other keys.

    ``state`` is that of ``channel``; a discrete has levels and states only.
    """

    autopilot: Literal["engaged", "disengaged"] | None = None
    signal: str | None = None
    level: int | None = Field(default=None, ge=0, le=CHANNELS)
    pattern: Literal["normal", "isolated", "2:2", "1:1:1:1", "1:1:1", "1:1", "lost"] | None = None
    resolver: Literal["none", "ilm", "trend", "reference", "extremes", "middle", "unresolved", "box"] | None = None
    source: Literal["voted", "reference", "degraded"] | None = None
    channel: int | None = Field(default=None, ge=1, le=CHANNELS)
    state: Literal["ok", "suspect", "failed"] | None = None

    @model_validator(mode="after")
    def _one(self) -> Transition:
        given = [key for key in _OF_SIGNAL if getattr(self, key) is not None]
        if self.signal is None:
            if self.autopilot is None or given or self.channel is not None:
                raise ValueError(f"must be {{ autopilot = 'engaged' or 'disengaged' }} or {{ signal = ..., {_KEYS} }}")
            return self
        if self.autopilot is not None:
            raise ValueError("autopilot: does not go with signal")
        if self.signal not in INDEX and self.signal not in DISCRETE_INDEX:
            known = choices(self.signal, (*INDEX, *DISCRETE_INDEX), "rig signals")
            raise ValueError(f"signal: unknown signal {quoted(self.signal)}, {known}")
        if len(given) != 1:
            raise ValueError(f"must be {{ signal = ..., {_KEYS} }}")
        if self.signal in DISCRETE_INDEX and given[0] not in _OF_DISCRETE:
            raise ValueError(f"{given[0]}: {self.signal} is a discrete, allowed: {', '.join(_OF_DISCRETE)}")
        if (self.channel is None) != (self.state is None):
            raise ValueError("channel and state: go together")
        return self

    @property
    def watched(self) -> Watched:
        """What must change to what."""
        if self.signal is None:
            return Watched(
                code("discrete_voted", DISCRETE_INDEX["autopilot_engaged"]), int(self.autopilot == "engaged")
            )
        key, value = next((key, getattr(self, key)) for key in _OF_SIGNAL if getattr(self, key) is not None)
        discrete = self.signal in DISCRETE_INDEX
        row = DISCRETE_INDEX[self.signal] if discrete else INDEX[self.signal]
        channel = () if self.channel is None else (self.channel - 1,)
        return Watched(code(f"discrete_{key}" if discrete else key, row, *channel), _number(key, value))


_KEYS: Final = "level or pattern or resolver or source = ..., or channel = ..., state = ..."


def _number(key: str, value: Any) -> int:
    """A value as it stands in the frame."""
    if key == "pattern":
        return int(_LABELS[value])
    enums = {"resolver": Resolver, "source": Source, "state": State}
    return int(enums[key][value.upper()]) if key in enums else int(value)
