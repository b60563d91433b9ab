"""Settings of the redundancy manager: per signal, with units of the signal; counts in frames."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, field_validator, model_validator

from rig.computer.analytic.references import Config as References
from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.computer.redundancy.box import box_of_signals
from rig.computer.redundancy.discrete_config import PERSISTENCE, DiscreteConfigs
from rig.computer.redundancy.lowpass import gain
from rig.computer.redundancy.manager_params import PARAMS, TIE_BREAKS, TieBreak
from rig.computer.redundancy.managers import DEFAULT, MANAGERS
from rig.computer.redundancy.resets import Reset
from rig.computer.redundancy.slow_tests_config import SlowTests, refusal, tests_params
from rig.core import settings
from rig.core.frame import INDEX, SIGNALS, DecidedBy, S
from rig.core.settings import Settings, in_frames, refuse_both
from rig.world.sensors.data_sheet import DataSheet

CommonMode = Literal["report", "fail"]  # what two references against all channels do to a signal


class SignalConfig(Settings):
    """Monitor and vote of one signal: a ``[redundancy.signals.<name>]`` table."""

    threshold: float = Field(gt=0)  # two samples agree within this, unit of the signal
    # While three samples are compared; threshold if not given.
    threshold_triplex: float | None = Field(default=None, gt=0)
    threshold_duplex: float | None = Field(default=None, gt=0)  # while two are
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
    # Slow faults (slow_faults.py, slow_tests.py); each 0 or not given: off.
    slow_allowance: float | None = Field(default=None, gt=0)  # what a deviation may be for ever
    # Sum of what exceeds it that fails a channel, unit times seconds.
    slow_limit: float | None = Field(default=None, gt=0)
    stale_frames: int = Field(default=0, ge=0)  # a sample repeated so often miscompares
    slow_tests: SlowTests | None = None  # off when not given, or false
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

    @field_validator("slow_tests", mode="before")
    @classmethod
    def _switched_off(cls, given: Any) -> Any:
        if given is True or not isinstance(given, dict | bool | SlowTests | None):
            raise ValueError("must be a table, or false")
        return None if given is False else given

    def with_figures(self, sheet: DataSheet) -> SignalConfig:
        """Return these settings with the figures of the sensor in ``slow_tests``, those that it does not give."""
        tests = self.slow_tests
        return self if tests is None else self.model_copy(update={"slow_tests": tests.with_figures(sheet)})

    @property
    def least_threshold(self) -> float:
        """Return the smallest of the thresholds of four, three and two samples."""
        return min(x for x in (self.threshold, self.threshold_triplex, self.threshold_duplex) if x is not None)

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


def without_lanes(tie_break: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (n, TIE_BREAKS) tie-break rules in their order without the lanes' health: one computer has no lanes."""
    rows = [[code for code in row if code != DecidedBy.LANE] for row in tie_break.tolist()]
    return np.array([row + [0] * (TIE_BREAKS - len(row)) for row in rows], dtype=np.int64).reshape(-1, TIE_BREAKS)


def refuse_short_wait(config: Config, rate_hz: float) -> None:
    """Raise ValueError where a split would be given up before an answer to it can have stood long enough."""
    of_signals = {signal.name: getattr(config.signals, signal.name) for signal in SIGNALS}
    if short := short_wait(config.unresolved_s, of_signals, rate_hz):
        raise ValueError(f"redundancy.{short}")


def refuse_blind_tests(config: Config, sheets: Sequence[DataSheet]) -> None:
    """Raise ValueError where slow-fault tests cannot be run; ``sheets`` of each signal's sensor."""
    for signal, sheet in zip(SIGNALS, sheets, strict=True):
        own: SignalConfig = getattr(config.signals, signal.name)
        if own.slow_tests is not None and (why := refusal(own.slow_tests, own.least_threshold, sheet)):
            raise ValueError(f"redundancy.signals.{signal.name}.{why}")


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
    configs: Any,
    ranges: NDArray[np.float64],
    channels: NDArray[np.int64],
    rate_hz: float,
    sheets: Sequence[DataSheet] = (),
) -> NDArray[np.void]:
    """Return the (S,) PARAMS records of a ``SignalConfigs``; ranges (S, 2), channels, sheets (S,) : of the sensors."""
    params = np.zeros(S, PARAMS)
    for i, signal in enumerate(SIGNALS):
        config: SignalConfig = getattr(configs, signal.name)
        sheet = sheets[i] if sheets else None
        fill(params[i], config, (ranges[i, 0], ranges[i, 1]), int(channels[i]), signal.wraps, rate_hz, sheet)
    return params


def fill(
    row: Any,
    config: SignalConfig,
    limits: tuple[float, float],
    channels: int,
    wraps: bool,
    rate_hz: float,
    sheet: DataSheet | None = None,
) -> None:
    """Write one signal's settings into its PARAMS record, without what its references and common mode add."""
    threshold = config.threshold
    tie_break = [DecidedBy[name.upper()] for name in config.tie_break]
    settings.fill(
        row,
        config,
        threshold_triplex=config.threshold_triplex or threshold,
        threshold_duplex=config.threshold_duplex or threshold,
        filter_gain=gain(config.filter_s, rate_hz),
        slow_allowance=config.slow_allowance or 0.0,
        slow_limit=(config.slow_limit or 0.0) * rate_hz,
        **tests_params(config.slow_tests, sheet),
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
