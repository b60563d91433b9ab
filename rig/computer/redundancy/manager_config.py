"""Settings of the redundancy manager: per signal, with units of the signal; counts in frames."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, field_validator, model_validator

from rig.computer.analytic.references import Config as References
from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.computer.redundancy.box import box_of_signals
from rig.computer.redundancy.discrete_config import PERSISTENCE, DiscreteConfigs
from rig.computer.redundancy.lowpass import gain
from rig.computer.redundancy.managers import DEFAULT, MANAGERS
from rig.computer.redundancy.resets import Reset
from rig.core import settings
from rig.core.frame import INDEX, SIGNALS, DecidedBy, S
from rig.core.settings import Settings, in_frames, refuse_both

TieBreak = Literal["ilm", "lane", "reference", "trend", "extremes", "middle"]
TIE_BREAKS: Final = len(get_args(TieBreak))
CommonMode = Literal["report", "fail"]  # what two references against all channels do to a signal


class SignalConfig(Settings):
    """Monitor and vote of one signal: a ``[redundancy.signals.<name>]`` table."""

    threshold: float = Field(gt=0)  # two samples agree within this, unit of the signal
    # While three samples are compared; threshold if not given.
    threshold_triplex: float | None = Field(default=None, gt=0)
    threshold_duplex: float | None = Field(default=None, gt=0)  # while two are
    # Where four (three) samples agree within the above: how far one may be from the majority; none when not given.
    outlier_threshold: float | None = Field(default=None, gt=0)
    outlier_threshold_triplex: float | None = Field(default=None, gt=0)
    # Time constant of a low-pass that comparisons see, and the vote does not.
    filter_s: float = Field(default=0.0, ge=0)
    persistence: int = Field(default=8, ge=1)  # frames of miscompare until a channel is failed
    persistence_s: float | None = Field(default=None, gt=0)  # the same as a time, in place of the frames
    split_persistence: int = Field(default=10, ge=1)  # frames until a split is settled
    count_down: float | None = Field(default=None, gt=0)  # what an agreeing frame takes off the count; all of it
    split_persistence_s: float | None = Field(default=None, gt=0)
    # The last two close the order.
    tie_break: list[TieBreak] = ["ilm", "lane", "reference", "trend", "extremes", "middle"]
    trend_frames: int = Field(default=8, ge=1, le=8)
    trend_window: Literal["sliding", "tumbling"] = "sliding"  # or begun again every trend_frames
    trend_small: float | None = Field(default=None, ge=0)  # changes a frame up to which one frame is trend enough
    trend_beside_reference: bool = False  # ask the trend of a signal with a reference that cannot be used, too
    reference_threshold: float | None = Field(default=None, gt=0)  # as threshold when not given
    # Slow faults (slow_faults.py); each 0 or not given: off.
    # Largest difference of a healthy channel that is learned, and compared without.
    equalise_bound: float = Field(default=0.0, ge=0)
    equalise_s: float = Field(default=10.0, gt=0)  # time constant of the learning
    slow_allowance: float | None = Field(default=None, gt=0)  # what a deviation may be for ever
    # Sum of what exceeds it that fails a channel, unit times seconds.
    slow_limit: float | None = Field(default=None, gt=0)
    stale_frames: int = Field(default=0, ge=0)  # a sample repeated so often miscompares
    common_mode: CommonMode | None = None  # that of [redundancy] when not given
    mean: Literal["plain", "trend-weighted"] = "plain"
    readmit_frames: int = Field(default=100, ge=1)  # agreement needed before a reset readmits
    fade_s: float = Field(default=0.0, ge=0)  # after a change of level
    # For the manager "selection" alone: a deviation from the mean of all that is tolerated, and the
    # integral over time of what exceeds it that is not (unit times seconds).
    selection_deviation: float | None = Field(default=None, gt=0)  # 2.5 thresholds when not given
    selection_integral_s: float | None = Field(default=None, gt=0)  # 5 thresholds times a second

    @model_validator(mode="after")
    def _fit_together(self) -> SignalConfig:
        refuse_both(self, "persistence", "split_persistence")
        if self.count_down is not None and "persistence" not in self.model_fields_set:
            raise ValueError("count_down: needs persistence, the count in frames that isolates a channel")
        if self.trend_small is not None and self.trend_window == "tumbling":
            raise ValueError(
                'trend_small: not allowed with trend_window = "tumbling", which decides after whole windows only'
            )
        if (self.slow_allowance is None) != (self.slow_limit is None):
            raise ValueError("slow_allowance, slow_limit: give both or neither")
        return self

    @model_validator(mode="after")
    def _outliers_within(self) -> SignalConfig:
        within = {"": self.threshold, "_triplex": self.threshold_triplex or self.threshold}
        for level, most in within.items():
            limit = getattr(self, f"outlier_threshold{level}")
            if limit is not None and limit > most:
                raise ValueError(f"outlier_threshold{level}: at most threshold{level}, {most:g}, got {limit:g}")
        return self

    @model_validator(mode="after")
    def _bias_within(self) -> SignalConfig:
        least = min(x for x in (self.threshold, self.threshold_triplex, self.threshold_duplex) if x is not None)
        if self.equalise_bound > least:
            raise ValueError(
                f"equalise_bound: at most the threshold of every level, {least:g}, got {self.equalise_bound:g}"
            )
        return self

    @field_validator("tie_break")
    @classmethod
    def _once_each(cls, tie_break: list[TieBreak]) -> list[TieBreak]:
        if len(set(tie_break)) < len(tie_break):
            raise ValueError(f"each rule at most once, got {tie_break}")
        return tie_break


_FIELDS: dict[str, Any] = {signal.name: (SignalConfig, ...) for signal in SIGNALS}
SignalConfigs = create_model(
    "SignalConfigs", __base__=Settings, __doc__="One SignalConfig for every signal of the frame.", **_FIELDS
)


class Config(Settings):
    """The ``[redundancy]`` table of an aircraft or scenario."""

    manager: str = DEFAULT  # one of MANAGERS, or module:name of one's own
    # Signals of a box that accuse a channel at once until it is failed on all of them: more than half of the box when
    # not given; 0: never.
    box_signals: int | None = Field(default=None, ge=0)
    box_persistence: int = Field(default=8, ge=1)  # frames for which they do
    boxes: dict[str, list[str]] = {}  # the signals that one unit of each channel measures; all in one when not given
    unresolved_s: float = Field(default=1.0, ge=0)  # of a split that no rule answers until it is given up; 0: never
    discrete_persistence: int = Field(default=PERSISTENCE, ge=1)  # frames, of a discrete that has none of its own
    discretes: DiscreteConfigs = DiscreteConfigs()  # pyright: ignore[reportInvalidTypeForm]  # from the frame's table
    common_mode: CommonMode = "fail"  # of signals without one of their own that the control law does not test itself
    common_persistence: int = Field(default=10, ge=1)  # frames
    resets: list[Reset] = []
    references: References = References()
    signals: SignalConfigs  # pyright: ignore[reportInvalidTypeForm]  # made from the frame's table
    baselines: Baselines = Baselines()  # what each of them is told when it is the manager

    @field_validator("manager")
    @classmethod
    def _known_manager(cls, name: str) -> str:
        if name not in MANAGERS and not re.fullmatch(r"[\w.]+:\w+", name):
            raise ValueError(f"unknown manager, allowed: {', '.join(MANAGERS)} or module:name")
        return name

    @field_validator("boxes")
    @classmethod
    def _each_in_one(cls, boxes: dict[str, list[str]]) -> dict[str, list[str]]:
        if boxes:
            box_of_signals(boxes, tuple(INDEX))
        return boxes

    @field_validator("baselines")
    @classmethod
    def _of_known_signals(cls, baselines: Baselines) -> Baselines:
        baselines.refuse_others(INDEX)
        return baselines


class Param(NamedTuple):
    """One number that the kernels read of a signal's settings, and what a unit under test reads of it."""

    name: str
    base: str  # of its numpy type
    meaning: str  # as a unit's header has it
    part: Literal["signal", "slow_faults", "rules", ""] = "signal"  # record of a unit that holds it; "": none
    shape: tuple[int, ...] = ()


PARAM_FIELDS: Final = (
    Param("threshold", "f8", "unit of the signal: two of four samples agree within it"),
    Param("threshold_triplex", "f8", "unit of the signal: two of three samples"),
    Param("threshold_duplex", "f8", "unit of the signal: two samples"),
    Param("outlier_threshold", "f8", "unit of the signal: the narrower one for four samples that all agree; 0: none"),
    Param("outlier_threshold_triplex", "f8", "unit of the signal: the same for three; 0: none"),
    Param("filter_gain", "f8", "1: share of a new sample in the low-pass before the comparison; 0: no filter"),
    Param(
        "equalise_bound",
        "f8",
        "unit of the signal: largest difference that is learned of a channel; 0: none is",
        "slow_faults",
    ),
    Param(
        "equalise_gain",
        "f8",
        "1: share of a new residual in a channel equalisation, once as many frames as its inverse have been seen",
        "slow_faults",
    ),
    Param("slow_allowance", "f8", "unit of the signal: what a residual may be for ever", "slow_faults"),
    Param(
        "slow_limit",
        "f8",
        "unit of the signal times frames: sum of what exceeds it that fails a channel; 0: no sums",
        "slow_faults",
    ),
    Param(
        "stale_frames",
        "i8",
        "frames in which a sample repeats while others move until it is not compared; 0: any may",
        "slow_faults",
    ),
    Param("reference_threshold", "f8", "unit of the signal: a sample and the reference agree within it"),
    Param(
        "reference_airspeed_m_s",
        "f8",
        "m/s: error of a reference that is a dynamic pressure, as an airspeed; 0: of none",
    ),
    Param("second_threshold", "f8", "unit of the signal: as reference_threshold, of the second reference"),
    Param(
        "common_persistence", "i8", "frames in a row of two references against all channels until it is a common mode"
    ),
    Param("common_fails", "u1", "1: a common mode fails all channels; 0: it is reported"),
    Param(
        "low", "f8", "unit of the signal: least sample of the sensor; of an angle that wraps where its circle begins"
    ),
    Param("high", "f8", "unit of the signal: largest sample of the sensor"),
    Param("persistence", "i8", "miscomparing frames in a row until a channel is isolated"),
    Param("split_persistence", "i8", "frames until a split is settled"),
    Param("trend_frames", "i8", "bits of a trend byte, 1 to 8"),
    Param("readmit_frames", "i8", "frames in a row of agreement before a reset readmits a failed channel"),
    Param("fade_frames", "i8", "frames in which the vote fades after a change of level; 0: none"),
    Param("deviation", "f8", "unit of the signal: tolerated deviation from the mean; manager selection alone"),
    Param(
        "deviation_frames",
        "f8",
        "unit of the signal times frames: integral of what exceeds it; manager selection alone",
    ),
    Param("fitted", "i8", "channels that there are, the first ones"),
    Param("tie_break", "i8", "in their order, of DecidedBy; 0 behind the last", shape=(TIE_BREAKS,)),
    Param("wraps", "u1", "1: an angle in rad on the circle, differences go the short way"),
    Param("weighted", "u1", "1: means of the middle samples and of a good pair are weighted by their trend"),
    Param(
        "count_down", "f8", "frames that an agreeing one takes off the count of miscompares; 0: all of them", "rules"
    ),
    Param(
        "unresolved_frames",
        "i8",
        "frames in a row without a tie-break until all channels are isolated; 0: never",
        "rules",
    ),
    Param(
        "trend_small",
        "f8",
        "unit of the signal: changes of at most that are a trend after one frame; -1: none are",
        "rules",
    ),
    Param(
        "trend_tumbles",
        "u1",
        "1: trend bytes begin again every trend_frames frames, and the result of whole ones stands",
        "rules",
    ),
    Param("trend_beside_reference", "u1", "1: the trend is asked of a signal with a reference, too", "rules"),
    Param("referred", "u1", "1: a reference is configured", "rules"),
    Param(
        "tells",
        "i8",
        "the signal's own bit, 1 shifted by its index, if the references of others read it; 0: they do not",
        "rules",
    ),
    Param("sources", "i8", "bits of signals that its references read, of those that have their bit in tells", "rules"),
    Param("box", "i8", "box of the signal, 1 to 16; 0: in none", "rules"),
)
PARAMS: Final = np.dtype([(each.name, each.base, each.shape) for each in PARAM_FIELDS], align=True)


def told(part: str) -> tuple[str, ...]:
    """Return the fields of PARAMS that a record of a unit holds."""
    return tuple(each.name for each in PARAM_FIELDS if each.part == part)


def without_lanes(tie_break: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (n, TIE_BREAKS) tie-break rules in their order without the lanes' health: one computer has no lanes."""
    rows = [[code for code in row if code != DecidedBy.LANE] for row in tie_break.tolist()]
    return np.array([row + [0] * (TIE_BREAKS - len(row)) for row in rows], dtype=np.int64).reshape(-1, TIE_BREAKS)


def refuse_short_wait(config: Config, rate_hz: float) -> None:
    """Raise ValueError where a split would be given up before an answer to it can have stood long enough."""
    of_signals = {signal.name: getattr(config.signals, signal.name) for signal in SIGNALS}
    if short := short_wait(config.unresolved_s, of_signals, rate_hz):
        raise ValueError(f"redundancy.{short}")


def short_wait(unresolved_s: float, signals: Mapping[str, SignalConfig], rate_hz: float) -> str:
    """Return why ``unresolved_s`` is too short for one of ``signals``, "" where it is long enough."""
    given_up = in_frames(0, unresolved_s or None, rate_hz)
    default = ", the default," if unresolved_s == Config.model_fields["unresolved_s"].default else ""
    for name, own in signals.items():
        settled = in_frames(own.split_persistence, own.split_persistence_s, rate_hz)
        if 0 < given_up < settled:
            return (
                f"unresolved_s: {unresolved_s:g} s{default} are {given_up} frames, fewer than the {settled} of "
                f"split_persistence of {name}; 0: never"
            )
    return ""


def parameters(
    configs: Any, ranges: NDArray[np.float64], channels: NDArray[np.int64], rate_hz: float
) -> NDArray[np.void]:
    """Return the (S,) PARAMS records of a ``SignalConfigs``; ``ranges`` (S, 2) and ``channels`` (S,) of the sensors."""
    params = np.zeros(S, PARAMS)
    for i, signal in enumerate(SIGNALS):
        config: SignalConfig = getattr(configs, signal.name)
        fill(params[i], config, (ranges[i, 0], ranges[i, 1]), int(channels[i]), signal.wraps, rate_hz)
    return params


def fill(
    row: Any, config: SignalConfig, limits: tuple[float, float], channels: int, wraps: bool, rate_hz: float
) -> None:
    """Write one signal's settings into its PARAMS record, without what its references and common mode add."""
    threshold = config.threshold
    tie_break = [DecidedBy[name.upper()] for name in config.tie_break]
    settings.fill(
        row,
        config,
        threshold_triplex=config.threshold_triplex or threshold,
        threshold_duplex=config.threshold_duplex or threshold,
        outlier_threshold=config.outlier_threshold or 0.0,
        outlier_threshold_triplex=config.outlier_threshold_triplex or 0.0,
        filter_gain=gain(config.filter_s, rate_hz),
        equalise_gain=min(1.0, 1.0 / (config.equalise_s * rate_hz)),
        slow_allowance=config.slow_allowance or 0.0,
        slow_limit=(config.slow_limit or 0.0) * rate_hz,
        reference_threshold=config.reference_threshold or threshold,
        reference_airspeed_m_s=0.0,
        second_threshold=threshold,
        common_persistence=1,
        common_fails=0,
        low=limits[0],
        high=limits[1],
        persistence=in_frames(config.persistence, config.persistence_s, rate_hz),
        split_persistence=in_frames(config.split_persistence, config.split_persistence_s, rate_hz),
        fade_frames=round(config.fade_s * rate_hz),
        deviation=config.selection_deviation or 2.5 * threshold,
        deviation_frames=(config.selection_integral_s or 5.0 * threshold) * rate_hz,
        fitted=channels,
        tie_break=tie_break + [0] * (TIE_BREAKS - len(tie_break)),
        wraps=wraps,
        weighted=config.mean == "trend-weighted",
        count_down=config.count_down or 0.0,
        unresolved_frames=0,
        trend_small=-1.0 if config.trend_small is None else config.trend_small,
        trend_tumbles=config.trend_window == "tumbling",
        referred=0,
        tells=0,
        sources=0,
        box=1,
    )
