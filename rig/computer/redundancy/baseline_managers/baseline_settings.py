"""Settings of the baseline managers, ``[redundancy.baselines.<name>]``, and what they add to the records of a signal.

Amounts are in thresholds of the signal (``SignalConfig.threshold``), so that one number stands for all signals; a
table ``signals.<signal>`` has what is different for one.  The defaults hold the sensors of the bundled aircraft, whose
channels differ from their middle by a constant of up to 0.2 thresholds, and by noise of up to 0.04.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, field_validator, model_validator

from rig.core.frame import CHANNELS
from rig.core.settings import Settings
from rig.core.text import choices

WINDOW: Final = 100  # frames, the longest of "glr"
MEDIAN_WINDOW: Final = 51  # frames, the longest of "window_median"
VARIANCE_WINDOW: Final = 64  # frames, the longest of "variance_mean"
MEMBERS: Final = CHANNELS + 1  # of "bayes": the channels, then the reference
SETS: Final = 1 << MEMBERS


class LearnedBias(Settings):
    """Settings of a learned bias, for each manager that compares residuals; all of "cross-voter" and "selection"."""

    learned_bias: float = Field(default=0.0, ge=0)  # largest bias that is learned, thresholds; 0: none is
    learned_frames: int = Field(default=1000, ge=1)  # time constant of the learning
    signals: dict[str, dict[str, Any]] = {}  # of single signals, in place of the others

    @model_validator(mode="after")
    def _single_signals(self) -> Self:
        for name in self.signals:
            self.of(name)
        return self

    def of(self, signal: str) -> Self:
        """Return the settings of one signal.  ValueError: a key or value of its table."""
        own = self.signals.get(signal)
        if own is None:
            return self
        if "signals" in own:
            raise ValueError(f"signals.{signal}.signals: unknown key")
        try:
            return type(self).model_validate({**self.model_dump(exclude={"signals"}), **own})
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = ".".join(("signals", signal, *map(str, first["loc"])))
            raise ValueError(f"{key}: {first['msg'].removeprefix('Value error, ')}") from None


class Baseline(LearnedBias):
    """Settings of each baseline manager."""

    levels: ClassVar[tuple[str, ...]] = ()  # the settings to calibrate: one, or of 4, 3, 2 channels

    ties: Literal["guess", "hold"] = "hold"  # an even split without a usable reference: fails one, or holds the vote
    bounded: bool = True  # what is shorter than the persistence fails no channel; False: as published
    spread: float = Field(default=0.04, gt=0)  # of a healthy channel about its bias, standard deviation, thresholds


class Cusum(Baseline):
    """Sums of residuals beyond an allowance, each side."""

    levels = ("allowance",)

    allowance: float = Field(default=0.35, ge=0)  # what a residual may be for ever, thresholds
    limit: float = Field(default=24.0, gt=0)  # spreads times frames


class Glr(Baseline):
    """Largest log likelihood ratio of a step or ramp that began within a window."""

    levels = ("limit",)

    rms: float = Field(default=0.2, gt=0)  # of a healthy residual, bias and noise, thresholds
    limit: float = Field(default=200.0, gt=0)  # log likelihood ratio
    window: int = Field(default=WINDOW, ge=2, le=WINDOW)  # frames


class Parity(Baseline):
    """Squared length of the parity vector."""

    levels = ("limit", "limit_triplex", "limit_duplex")

    limit: float = Field(default=0.5, gt=0)  # square thresholds, while four samples are compared
    limit_triplex: float | None = Field(default=None, gt=0)  # while three are; limit when not given
    limit_duplex: float | None = Field(default=None, gt=0)
    vote: Literal["mean", "middle"] = "mean"  # of those in use


class Bayes(Baseline):
    """Log odds that a channel is faulty, over all sets of faulty members."""

    levels = ("limit",)

    limit: float = Field(default=10.0, ge=4.59)  # log odds, ln 99 and more
    bias: float = Field(default=0.2, ge=0)  # largest of a healthy channel, three standard deviations, thresholds
    noise: float = Field(default=2.0, gt=0)  # of a sample of a healthy member, spreads
    fault_noise: float = Field(default=4.0, gt=0)  # of a faulty one, spreads
    jump: float = Field(default=2.0, ge=0)  # of a fault at its onset, biases
    walk: float = Field(default=0.05, ge=0)  # of a fault in a frame, spreads
    reference_frames: int = Field(default=100, ge=1)  # correlation of a reference's error
    onset_per_frame: float = Field(default=1e-7, gt=0, lt=1)  # chance of a member


class Innovation(Baseline):
    """Sums of distances to the reference beyond the least."""

    levels = ("allowance",)

    allowance: float = Field(default=0.5, ge=0)  # thresholds
    limit: float = Field(default=24.0, gt=0)  # spreads times frames


class Weighted(Baseline):
    """A weighted average; nothing is monitored."""

    scale: float = Field(default=1.0, gt=0)  # distance at which a sample loses half of its weight, thresholds


class GateMean(Baseline):
    """The mean of the channels whose deviation from it stays within a gate."""

    levels = ("gate",)

    gate: float = Field(default=0.2, gt=0)  # low-passed deviation from the mean that is tolerated, thresholds
    integral_frames: float = Field(default=200.0, gt=0)  # gates times frames: integral of what exceeds it


class WindowMedian(Baseline):
    """The median of each residual over a window."""

    levels = ("limit",)

    limit: float = Field(default=0.3, gt=0)  # of the median's magnitude, thresholds
    window: int = Field(default=25, ge=3, le=MEDIAN_WINDOW)  # frames, an odd number

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        if window % 2 == 0:
            raise ValueError("must be an odd number")
        return window


class VarianceMean(Baseline):
    """A mean weighted by the inverse variance of each channel's last samples; nothing is monitored."""

    window: int = Field(default=8, ge=2, le=VARIANCE_WINDOW)  # frames


class InverseMean(Baseline):
    """A mean weighted by the inverse mean square of each residual; nothing is monitored."""

    window: int = Field(default=200, ge=1)  # frames, time constant of the mean square


class TrimmedMean(Baseline):
    """A mean without a share of the samples at either end; nothing is monitored."""

    share: float = Field(default=0.2, ge=0, le=0.5)  # 0: the mean, 0.5: the median


class MidValue(Baseline):
    """The middle of the first three channels in service; nothing is monitored."""


class Baselines(Settings):
    """The ``[redundancy.baselines]`` table: all that can be flown."""

    cusum: Cusum = Cusum()
    glr: Glr = Glr()
    parity: Parity = Parity()
    bayes: Bayes = Bayes()
    innovation: Innovation = Innovation()
    weighted: Weighted = Weighted()
    gate_mean: GateMean = GateMean()
    window_median: WindowMedian = WindowMedian()
    variance_mean: VarianceMean = VarianceMean()
    inverse_mean: InverseMean = InverseMean()
    trimmed_mean: TrimmedMean = TrimmedMean()
    mid_value: MidValue = MidValue()
    cross_voter: LearnedBias = LearnedBias()
    selection: LearnedBias = LearnedBias()

    def refuse_others(self, signals: Collection[str]) -> None:
        """ValueError where a table is of another signal than these."""
        for baseline in type(self).model_fields:
            for name in getattr(self, baseline).signals:
                if name not in signals:
                    raise ValueError(f"baselines.{baseline}.signals: unknown signal, {choices(name, signals)}")


# What a signal's record has besides config.PARAMS; amounts in the unit of the signal.
BASELINE_PARAMS: Final = (
    ("holds_ties", "u1"),
    ("bounded", "u1"),
    ("watches", "u1"),  # statistics alone: they fail no channel
    ("bias_bound", "f8"),  # unit of the signal
    ("bias_gain", "f8"),
    ("spread", "f8"),
    ("allowance", "f8"),  # in the unit of ``spread``, as ``limit`` is
    ("limit", "f8", (3,)),  # while 4, 3, 2 samples are compared
    ("rms", "f8"),
    ("window", "i8"),
    ("votes_middle", "u1"),
    ("scale", "f8"),
    ("share", "f8"),
    # Of "bayes", in thresholds: (healthy, faulty).
    ("bias", "f8"),
    ("noise", "f8", (2,)),
    ("jump", "f8"),
    ("walk", "f8"),
    ("onset_per_frame", "f8"),
    ("reference_frames", "f8"),
)


def extended(records: NDArray[np.void], more: Sequence[tuple[Any, ...]]) -> NDArray[np.void]:
    """Return ``records`` with the fields ``more``, which are zero; the same records where they have them.

    These stand first: numba takes longer records for a subtype of the others, and warns.
    """
    names = records.dtype.names or ()
    if all(field[0] in names for field in more):
        return records
    dtype = np.dtype([*more, *((name, records.dtype[name]) for name in names)], align=True)
    made = np.zeros(len(records), dtype)
    for name in names:
        made[name] = records[name]
    return made


def with_baseline(
    params: NDArray[np.void], baseline: str, baselines: Baselines, signals: Sequence[str]
) -> NDArray[np.void]:
    """Return (S,) config.PARAMS of ``signals`` with what a baseline manager is told of each."""
    made = extended(params, BASELINE_PARAMS)
    for row, signal in zip(made, signals, strict=True):
        _tell(row, getattr(baselines, table_of(baseline)).of(signal))
    return made


def table_of(manager: str) -> str:
    """Return the name of a manager's table; "" if it has none."""
    name = manager.replace("-", "_")
    return name if name in Baselines.model_fields else ""


def _tell(row: Any, chosen: LearnedBias) -> None:
    """Write the settings of one signal into its record; what a baseline manager does not have stays as it is."""
    threshold, told = float(row["threshold"]), chosen.model_dump()
    row["bias_bound"], row["bias_gain"] = chosen.learned_bias * threshold, 1.0 / chosen.learned_frames
    if not isinstance(chosen, Baseline):
        return
    row["holds_ties"], row["bounded"] = chosen.ties == "hold", chosen.bounded
    row["spread"] = chosen.spread * threshold
    row["allowance"] = told.get("allowance", 0.0) / chosen.spread
    four = told.get("limit", 0.0)
    row["limit"] = [told.get(name) or four for name in ("limit", "limit_triplex", "limit_duplex")]
    row["rms"], row["scale"] = told.get("rms", 0.0) * threshold, told.get("scale", 0.0) * threshold
    row["window"], row["votes_middle"] = told.get("window", 0), told.get("vote") == "middle"
    row["share"] = told.get("share", 0.0)
    if isinstance(chosen, GateMean):
        row["allowance"] = chosen.gate / chosen.spread
        row["limit"] = chosen.integral_frames * row["allowance"]
    if isinstance(chosen, WindowMedian) and chosen.bounded:
        row["window"] = min(max(chosen.window, 2 * int(row["persistence"]) - 1), MEDIAN_WINDOW)
    if isinstance(chosen, Bayes):
        noise = (chosen.noise * chosen.spread, chosen.fault_noise * chosen.spread)
        row["bias"], row["noise"], row["jump"] = chosen.bias / 3.0, noise, chosen.jump * chosen.bias
        row["reference_frames"] = chosen.reference_frames
        row["walk"], row["onset_per_frame"] = chosen.walk * chosen.spread, chosen.onset_per_frame
