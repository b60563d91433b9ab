"""Settings of the redundancy manager: per signal, with units of the signal; counts in frames."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, field_validator, model_validator

from rig.computer.analytic.references import Config as References
from rig.computer.redundancy.box import MOST_BOXES
from rig.computer.redundancy.discrete_config import PERSISTENCE, DiscreteConfigs
from rig.computer.redundancy.lowpass import gain
from rig.computer.redundancy.managers import DEFAULT, MANAGERS
from rig.computer.redundancy.rivals.rival_settings import Rivals
from rig.core import settings
from rig.core.frame import CHANNELS, DISCRETE_INDEX, INDEX, SIGNALS, Block, Resolver, S, to_frame
from rig.core.settings import Settings, in_frames, refuse_both
from rig.core.text import choices, quoted, shorten

ResolverName = Literal["ilm", "lane", "reference", "trend", "extremes", "middle"]
RESOLVERS: Final = len(get_args(ResolverName))
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
    singular_persistence: int = Field(default=10, ge=1)  # frames until a singular pattern is settled
    count_down: float | None = Field(default=None, gt=0)  # what an agreeing frame takes off the count; all of it
    singular_persistence_s: float | None = Field(default=None, gt=0)
    # The last two close the order.
    resolvers: list[ResolverName] = ["ilm", "lane", "reference", "trend", "extremes", "middle"]
    trend_frames: int = Field(default=8, ge=1, le=8)
    trend_window: Literal["sliding", "tumbling"] = "sliding"  # or begun again every trend_frames
    trend_small: float | None = Field(default=None, ge=0)  # changes a frame up to which one frame is trend enough
    trend_beside_reference: bool = False  # ask the trend of a signal with a reference that cannot be used, too
    reference_threshold: float | None = Field(default=None, gt=0)  # as threshold when not given
    # What lasts (slow_faults.py); each 0 or not given: off.
    # Largest difference of a healthy channel that is learned, and compared without.
    bias_bound: float = Field(default=0.0, ge=0)
    bias_s: float = Field(default=10.0, gt=0)  # time constant of the learning
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
        refuse_both(self, "persistence", "singular_persistence")
        if self.count_down is not None and "persistence" not in self.model_fields_set:
            raise ValueError("count_down: give persistence, the count in frames that fails a channel, beside it")
        if self.trend_small is not None and self.trend_window == "tumbling":
            raise ValueError('trend_small: not with trend_window = "tumbling", which only answers after whole windows')
        if (self.slow_allowance is None) != (self.slow_limit is None):
            raise ValueError("slow_allowance, slow_limit: both or neither")
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
        if self.bias_bound > least:
            raise ValueError(f"bias_bound: at most the threshold of every level, {least:g}, got {self.bias_bound:g}")
        return self

    @field_validator("resolvers")
    @classmethod
    def _once_each(cls, resolvers: list[ResolverName]) -> list[ResolverName]:
        if len(set(resolvers)) < len(resolvers):
            raise ValueError(f"each resolver at most once, got {resolvers}")
        return resolvers


_FIELDS: dict[str, Any] = {signal.name: (SignalConfig, ...) for signal in SIGNALS}
SignalConfigs = create_model(
    "SignalConfigs", __base__=Settings, __doc__="One SignalConfig for every signal of the frame.", **_FIELDS
)


class Reset(Settings):
    """A reset command: failed channels that have agreed long enough are readmitted, the others stay out."""

    at_s: float = Field(ge=0)
    signal: str
    channels: list[int] = Field(default=[1, 2, 3, 4], min_length=1)

    @field_validator("signal")
    @classmethod
    def _known(cls, name: str) -> str:
        names = (*INDEX, *DISCRETE_INDEX)
        if name not in names:
            raise ValueError(f"unknown signal, {choices(name, names, 'rig signals')}")
        return name

    @field_validator("channels")
    @classmethod
    def _numbered(cls, channels: list[int]) -> list[int]:
        if any(not 1 <= channel <= CHANNELS for channel in channels):
            raise ValueError(f"channels are numbers from 1 to {CHANNELS}, got {channels}")
        return channels


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
    rivals: Rivals = Rivals()  # what the rivals among MANAGERS are told, each when it is the manager

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

    @field_validator("rivals")
    @classmethod
    def _of_known_signals(cls, rivals: Rivals) -> Rivals:
        rivals.refuse_others(INDEX)
        return rivals


def box_of_signals(boxes: Mapping[str, Sequence[str]], signals: Sequence[str]) -> list[int]:
    """Return the box of each of ``signals``, from 1; all are in box 1 where no ``boxes`` are named.

    ValueError: an unknown signal, one in two boxes or in none, more boxes than MOST_BOXES.
    """
    if not boxes:
        return [1] * len(signals)
    if len(boxes) > MOST_BOXES:
        raise ValueError(f"at most {MOST_BOXES} boxes, got {len(boxes)}")
    found: dict[str, int] = {}
    for number, (box, members) in enumerate(boxes.items(), 1):
        for name in members:
            if name not in signals:
                raise ValueError(f"{shorten(box)}: unknown signal {quoted(name)}, {choices(name, signals)}")
            if name in found:
                other = list(boxes)[found[name] - 1]
                raise ValueError(f"{name} is in two boxes, {shorten(other)} and {shorten(box)}; each is in one")
            found[name] = number
    if missing := [name for name in signals if name not in found]:
        raise ValueError(f"{', '.join(missing)}: in no box; each signal is in one of {', '.join(map(shorten, boxes))}")
    return [found[name] for name in signals]


PARAMS: Final = np.dtype(
    [
        ("threshold", "f8"),
        ("threshold_triplex", "f8"),
        ("threshold_duplex", "f8"),
        ("outlier_threshold", "f8"),  # 0: none
        ("outlier_threshold_triplex", "f8"),
        ("filter_gain", "f8"),  # share of a new sample in the low-pass of the comparison (lowpass.py); 0: none
        ("bias_bound", "f8"),  # 0: no bias is learned (slow_faults.py)
        ("bias_gain", "f8"),  # share of a new residual
        ("slow_allowance", "f8"),
        ("slow_limit", "f8"),  # unit times frames; 0: no sums
        ("stale_frames", "i8"),  # 0: any sample may repeat
        ("reference_threshold", "f8"),
        ("reference_airspeed_m_s", "f8"),  # of a wind, equivalent; 0 where none (reference_monitor.py)
        ("second_threshold", "f8"),
        ("common_persistence", "i8"),
        ("common_fails", "u1"),
        ("low", "f8"),
        ("high", "f8"),
        ("persistence", "i8"),
        ("singular_persistence", "i8"),
        ("trend_frames", "i8"),
        ("readmit_frames", "i8"),
        ("fade_frames", "i8"),
        ("deviation", "f8"),
        ("deviation_frames", "f8"),  # integral in unit times frames
        ("fitted", "i8"),  # channels of the signal
        ("resolvers", "i8", (RESOLVERS,)),  # in order, 0 where none
        ("wraps", "u1"),
        ("weighted", "u1"),
        ("count_down", "f8"),  # 0: an agreeing frame sets the count to zero
        ("unresolved_frames", "i8"),  # 0: a split may stay open
        ("trend_small", "f8"),  # -1: the trend is always of trend_frames
        ("trend_tumbles", "u1"),
        ("trend_beside_reference", "u1"),
        ("referred", "u1"),  # a reference is configured
        ("tells", "i8"),  # the bit of a rate or a load factor, which the inertial unit measures too; 0: another signal
        ("sources", "i8"),  # a bit for each such signal that one of its references reads
        ("box", "i8"),  # from 1; 0: none (box.py)
    ],
    align=True,
)

# What version 2 of a unit's records did not know.
SINCE_3: Final = (
    *("count_down", "unresolved_frames", "trend_small", "trend_tumbles", "trend_beside_reference", "referred"),
    *("tells", "sources", "box"),
)
LASTING: Final = ("bias_bound", "bias_gain", "slow_allowance", "slow_limit", "stale_frames")  # of slow_faults.py


def without_lanes(resolvers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (n, RESOLVERS) resolvers in their order without the lanes' health, which one computer alone has not."""
    rows = [[code for code in row if code != Resolver.LANE] for row in resolvers.tolist()]
    return np.array([row + [0] * (RESOLVERS - len(row)) for row in rows], dtype=np.int64).reshape(-1, RESOLVERS)


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
        settled = in_frames(own.singular_persistence, own.singular_persistence_s, rate_hz)
        if 0 < given_up < settled:
            return (
                f"unresolved_s: {unresolved_s:g} s{default} are {given_up} frames, fewer than the {settled} of "
                f"singular_persistence of {name}; 0: never"
            )
    return ""


def command(rows: Block, resets: Sequence[Reset], rate_hz: float) -> None:
    """Add the reset commands to ``rows``, whose frames follow each other: each to the first frame not before it."""
    for reset in resets:
        k = to_frame(reset.at_s, rate_hz) - int(rows["frame"][0])
        if 0 <= k < len(rows):
            field, index = ("reset", INDEX) if reset.signal in INDEX else ("discrete_reset", DISCRETE_INDEX)
            rows[field][k, index[reset.signal]] |= bits(reset.channels)


def bits(channels: Iterable[int]) -> int:
    """Return the byte of commanded channels, which count from 1."""
    return sum(1 << (channel - 1) for channel in set(channels))


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
    resolvers = [Resolver[name.upper()] for name in config.resolvers]
    settings.fill(
        row,
        config,
        threshold_triplex=config.threshold_triplex or threshold,
        threshold_duplex=config.threshold_duplex or threshold,
        outlier_threshold=config.outlier_threshold or 0.0,
        outlier_threshold_triplex=config.outlier_threshold_triplex or 0.0,
        filter_gain=gain(config.filter_s, rate_hz),
        bias_gain=min(1.0, 1.0 / (config.bias_s * rate_hz)),
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
        singular_persistence=in_frames(config.singular_persistence, config.singular_persistence_s, rate_hz),
        fade_frames=round(config.fade_s * rate_hz),
        deviation=config.selection_deviation or 2.5 * threshold,
        deviation_frames=(config.selection_integral_s or 5.0 * threshold) * rate_hz,
        fitted=channels,
        resolvers=resolvers + [0] * (RESOLVERS - len(resolvers)),
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
