"""The rates file: failure rates of channels, kinds of failure and common mode; each figure has its source.

[pitch_rate]
per_hour = [1e-3, 2e-3]        # of one channel; several are swept
source = "..."
beta = [0.0, 0.01]             # common mode: this share of per_hour hits two channels alike
beta_source = "assumed"
kinds = { hardover = 0.5, drift = 0.4, "slow drift" = 0.1 }   # names as in the folders of cells
kinds_source = "assumed"
false_isolations_per_channel_hour = 1e-9   # instead of the campaign's count
false_isolations_source = "..."
box_per_hour = 1e-5            # failures of the LRU that carries one channel of all its signals
box_source = "..."
manoeuvre_every_h = 0.5        # time between manoeuvres; without it none is flown before the end
manoeuvre_source = "..."

[[layers]]                     # a part that is not flown, in series with the signal
name = "computers"
channels = 4
per_hour = 3.26e-5
not_covered = [1e-4, 1e-3, 0.5, 1.0]
source = "..."

[[severity]]                   # of `rig reliability fmea`: between within the transient limits and aircraft lost
name = "major"
beyond_limits_s = 0.5          # longer than this time
source = "..."

[causes]                       # of `rig reliability fmea` as well, by kind of fault
stuck = "frozen gyro"
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from pydantic import Field, field_validator, model_validator

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, INDEX
from rig.core.settings import Settings, build, read_toml
from rig.core.text import choices, quoted
from rig.world.faults import KINDS

WITHIN: Final = 1e-6  # of one, the sum of the shares of kinds
ASSUMED: Final = "assumed"


def kind_of_fault(kind: str) -> str:
    """Return the kind of fault of a cell's kind: `drift` for `slow drift`."""
    return kind.rpartition(" ")[2]


class SignalRates(Settings):
    """The failure rates and kinds of the channels of one signal."""

    per_hour: list[float] = Field(min_length=1, max_length=10)
    source: str = Field(min_length=1)
    beta: list[float] = Field(default=[0.0], min_length=1, max_length=10)
    beta_source: str = Field(default=ASSUMED, min_length=1)
    kinds: dict[str, float] = Field(min_length=1)
    kinds_source: str = Field(default=ASSUMED, min_length=1)
    # Of healthy channels; if not given, the campaign's count, which rests on few hours below level 4.
    false_isolations_per_channel_hour: float | None = Field(default=None, ge=0, le=1)
    false_isolations_source: str = Field(default=ASSUMED, min_length=1)
    box_per_hour: float = Field(default=0.0, ge=0, le=1)
    box_source: str = Field(default=ASSUMED, min_length=1)
    manoeuvre_every_h: float | None = Field(default=None, gt=0, le=1e4)
    manoeuvre_source: str = Field(default=ASSUMED, min_length=1)

    def level(self, hours: float) -> float:
        """Return the chance that a second fault of a flight comes before the next manoeuvre; 1 if none is given."""
        return 1.0 if self.manoeuvre_every_h is None else min(1.0, self.manoeuvre_every_h / hours)

    @field_validator("per_hour")
    @classmethod
    def _rates(cls, rates: list[float]) -> list[float]:
        if any(not 0.0 < rate <= 1.0 for rate in rates):
            raise ValueError(f"rates per hour must be above 0 and at most 1, got {rates}")
        return rates

    @field_validator("beta")
    @classmethod
    def _shares(cls, betas: list[float]) -> list[float]:
        if any(not 0.0 <= beta < 1.0 for beta in betas):
            raise ValueError(f"shares must be from 0 to below 1, got {betas}")
        return betas

    @field_validator("kinds")
    @classmethod
    def _all_kinds(cls, kinds: dict[str, float]) -> dict[str, float]:
        for kind, share in kinds.items():
            if kind_of_fault(kind) not in KINDS:
                raise ValueError(f"unknown kind {quoted(kind)}, {choices(kind, KINDS)}")
            if not 0.0 < share <= 1.0:
                raise ValueError(f"{kind}: a share must be above 0 and at most 1, got {share:g}")
        if abs(sum(kinds.values()) - 1.0) > WITHIN:
            raise ValueError(f"the shares of the kinds must add up to 1, got {sum(kinds.values()):g}")
        return kinds


class Layer(Settings):
    """A redundant part that is not flown: its coverages are given, and the result lists them as assumptions."""

    name: str = Field(min_length=1)
    channels: int = Field(ge=1, le=CHANNELS)
    per_hour: float = Field(gt=0, le=1)
    not_covered: list[float]  # of the first, second ... fault: the chance that it loses the layer
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _one_a_fault(self) -> Layer:
        if len(self.not_covered) != self.channels or any(not 0.0 <= u <= 1.0 for u in self.not_covered):
            raise ValueError(f"not_covered: must be {self.channels} chances from 0 to 1, got {self.not_covered}")
        return self


class Severity(Settings):
    """The user's severity for a fault beyond the transient limits that does not lose the aircraft."""

    name: str = Field(min_length=1)
    beyond_limits_s: float = Field(ge=0)  # for which rig score counts the flight beyond its transient limits
    source: str = Field(min_length=1)


class Rates(Settings):
    """The signals of a rates file, and the layers in series with each of them."""

    signals: dict[str, SignalRates] = Field(min_length=1)
    layers: list[Layer] = []
    severity: list[Severity] = []  # for `rig reliability fmea`, as are causes, by kind of fault
    causes: dict[str, str] = {}

    @field_validator("signals")
    @classmethod
    def _known(cls, signals: dict[str, SignalRates]) -> dict[str, SignalRates]:
        for name in signals:
            if name not in INDEX:
                raise ValueError(f"unknown signal {quoted(name)}, {choices(name, INDEX, 'rig signals')}")
        return signals

    def of(self, signal: str | None, source: str) -> tuple[str, SignalRates]:
        """Return a signal of the file, its only one if none is named.  BadInput names the file."""
        if signal is None and len(self.signals) == 1:
            return next(iter(self.signals.items()))
        if signal not in self.signals:
            asked = "--signal: none given" if signal is None else f"no rates of {quoted(signal)}"
            raise BadInput(f"{source}: {asked}, {choices(signal or '', self.signals)}")
        return signal, self.signals[signal]


def read_rates(path: Path) -> Rates:
    """Return the rates in a TOML file.  BadInput names the file and the wrong key."""
    data: dict[str, Any] = dict(read_toml(path))
    others = {key: data.pop(key) for key in ("layers", "severity", "causes") if key in data}
    if not data:
        raise BadInput(f"{path}: has no signal; add a table such as [pitch_rate] with per_hour, source and kinds")
    for name, table in data.items():
        if not isinstance(table, dict):
            raise BadInput(f"{path}: {name}: must be a table of rates such as [pitch_rate]")
    signals = {name: build(SignalRates, table, f"{path}: {name}") for name, table in data.items()}
    return build(Rates, {"signals": signals, **others}, str(path))
