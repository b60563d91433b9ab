"""The managers of the rig: what each is, and which one votes the continuous signals (own.py: a manager of the user's).

To add one: its kernel (baselines.py), its row in ``KINDS`` and its branch in ``vote_chosen``.  A baseline manager
(baseline_managers/) has state and settings in its row too, and its line in ``vote_baseline``; it is compiled when
it is first flown.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.baseline_managers import baseline_settings as of_baselines
from rig.computer.redundancy.baseline_managers.averages import (
    INVERSE_STATE,
    VARIANCE_STATE,
    inverse_mean,
    mid_value,
    trimmed_mean,
    variance_mean,
)
from rig.computer.redundancy.baseline_managers.bayes import BAYES_STATE, bayes
from rig.computer.redundancy.baseline_managers.glr import GLR_STATE, glr
from rig.computer.redundancy.baseline_managers.learned_voters import AS_UNIT, cross_voter_learned, selection_learned
from rig.computer.redundancy.baseline_managers.parity import parity
from rig.computer.redundancy.baseline_managers.step import BASELINE_STATE, NO_CHANNEL
from rig.computer.redundancy.baseline_managers.sums import CUSUM_STATE, cusum, innovation
from rig.computer.redundancy.baseline_managers.windows import GATE_STATE, MEDIAN_STATE, gate_mean, window_median
from rig.computer.redundancy.baselines import average, cross_voter, plain_median, select, select_unit, weighted
from rig.computer.redundancy.box import boxes
from rig.computer.redundancy.manager import manage
from rig.computer.redundancy.state import ManagerData, new_state
from rig.core.frame import CHANNELS
from rig.core.kernels import inlined, kernel


class MonitorLevel(NamedTuple):
    """The level of a monitor that a calibration chooses, in thresholds of a signal."""

    name: str
    default: float
    settings: dict[str, float]  # of config.SignalConfig, each so many times the level
    params: tuple[str, ...]  # fields of config.PARAMS that these settings make


class ManagerKind(NamedTuple):
    """Traits of a manager, for what runs it and what assesses it."""

    name: str
    kernel: Any = None  # of a row: bus, fcc, ManagerData, of a baseline manager one more; None: the user's own
    compares: bool = False  # channels with each other, with references and boxes
    latches: bool = False  # keeps a channel that it has failed out for good
    takes_back: bool = False  # fails a channel only for as long as it distrusts it, which it integrates over time
    chooses_units: bool = False  # one channel for all signals that are axes of one unit
    refers: bool = False  # to references
    level: MonitorLevel | None = None  # of a baseline that fails channels
    settings: type[of_baselines.Baseline] | None = None  # whose ``levels`` are what a calibration chooses
    state: tuple[Any, ...] = ()  # of a baseline manager: fields of its record besides STATE and BASELINE_STATE

    @property
    def isolates(self) -> bool:
        """Return True if the manager fails channels at all; the user's own one may."""
        return self.compares or self.latches or self.takes_back or self.name not in MANAGERS

    @property
    def has_threshold(self) -> bool:
        """Return True if a built-in manager fails a channel by the threshold of its signal, after its persistence."""
        return self.compares or self.level is _FROM_THE_VOTE


_THRESHOLDS: Final = ("threshold", "threshold_triplex", "threshold_duplex")
_FROM_THE_VOTE: Final = MonitorLevel("threshold", 1.0, dict.fromkeys(_THRESHOLDS, 1.0), _THRESHOLDS)
_FROM_THE_MEAN: Final = MonitorLevel(
    "deviation", 2.5, {"selection_deviation": 1.0, "selection_integral_s": 2.0}, ("deviation", "deviation_frames")
)
KINDS: Final = (
    ManagerKind("cross-channel", manage, compares=True, latches=True, refers=True),
    ManagerKind("mean", average),
    ManagerKind("median", plain_median),
    ManagerKind("cross-voter", cross_voter, latches=True, level=_FROM_THE_VOTE),
    ManagerKind("selection", select, takes_back=True, chooses_units=True, level=_FROM_THE_MEAN),
    ManagerKind("cusum", cusum, latches=True, refers=True, settings=of_baselines.Cusum, state=CUSUM_STATE),
    ManagerKind("glr", glr, latches=True, refers=True, settings=of_baselines.Glr, state=GLR_STATE),
    ManagerKind("parity", parity, latches=True, refers=True, settings=of_baselines.Parity),
    ManagerKind("bayes", bayes, latches=True, refers=True, settings=of_baselines.Bayes, state=BAYES_STATE),
    ManagerKind("innovation", innovation, latches=True, refers=True, settings=of_baselines.Innovation),
    ManagerKind("weighted", weighted, settings=of_baselines.Weighted),
    ManagerKind("gate_mean", gate_mean, latches=True, refers=True, settings=of_baselines.GateMean, state=GATE_STATE),
    ManagerKind(
        "window_median",
        window_median,
        latches=True,
        refers=True,
        settings=of_baselines.WindowMedian,
        state=MEDIAN_STATE,
    ),
    ManagerKind("variance_mean", variance_mean, settings=of_baselines.VarianceMean, state=VARIANCE_STATE),
    ManagerKind("inverse_mean", inverse_mean, settings=of_baselines.InverseMean, state=INVERSE_STATE),
    ManagerKind("trimmed_mean", trimmed_mean, settings=of_baselines.TrimmedMean),
    ManagerKind("mid_value", mid_value, settings=of_baselines.MidValue),
)
MANAGERS: Final = tuple(kind.name for kind in KINDS)
BASELINES: Final = tuple(kind.name for kind in KINDS if kind.settings is not None)
LEARNERS: Final = {kind.name: table for kind in KINDS if (table := of_baselines.table_of(kind.name))}  # to tables
# Which baseline manager votes: the place of its table has a number, all others None, so that they are not compiled.
Chosen = namedtuple("Chosen", tuple(LEARNERS.values()), defaults=(None,) * len(LEARNERS))
DEFAULT: Final = MANAGERS[0]
_CROSS_CHANNEL, _MEAN, _MEDIAN, _CROSS_VOTER, _SELECTION = range(len(KINDS) - len(BASELINES))
_UNIT: Final = len(KINDS)  # "selection", with all signals the axes of one unit


def manager_kind(name: str) -> ManagerKind:
    """Return the row of a manager; for the user's own one that claims nothing."""
    return KINDS[MANAGERS.index(name)] if name in MANAGERS else ManagerKind(name)


def with_settings(
    params: NDArray[np.void], name: str, baselines: of_baselines.Baselines | None = None, signals: Sequence[str] = ()
) -> NDArray[np.void]:
    """Return (S,) config.PARAMS with what a baseline manager is told of each signal; as they are for another manager.

    baselines : its settings, by default when not given; signals : names of the records
    """
    names, given = signals or [""] * len(params), baselines or of_baselines.Baselines()
    learns = name in LEARNERS and any(getattr(given, LEARNERS[name]).of(each).learned_bias > 0.0 for each in names)
    return of_baselines.with_baseline(params, name, given, names) if name in BASELINES or learns else params


class Manager:
    """A manager of the house; ``state`` is plain data and can be copied.

    name : of KINDS; params : (S,) config.PARAMS, those of a baseline manager by ``with_settings``, or defaults
    box_signals, box_persistence : as in config.Config, of the boxes in ``params``; 0: no channel is isolated as a box
    as_unit : the signals are the axes of one unit, of which "selection" selects one channel
    watches : a baseline manager computes its statistics, and isolates no channel by them
    """

    def __init__(
        self,
        name: str,
        params: NDArray[np.void],
        *,
        box_signals: int | None = 0,
        box_persistence: int = 1,
        as_unit: bool = False,
        watches: bool = False,
    ) -> None:
        self.choice = _UNIT if as_unit else MANAGERS.index(name)
        self.params = params if "watches" in (params.dtype.names or ()) else with_settings(params, name)
        table = LEARNERS.get(name) if "watches" in (self.params.dtype.names or ()) else None
        self.baseline = Chosen(**{table: AS_UNIT if as_unit else 1}) if table else None
        if watches:
            self.params["watches"] = 1
        self.state = self.new_state()
        self.boxes = boxes(self.params["box"], box_signals, box_persistence)
        self.lanes = np.zeros(CHANNELS, np.uint8)

    def new_state(self) -> NDArray[np.void]:
        """Return (S,) records of the state at the first frame."""
        blank = new_state(self.params)
        if self.baseline is None:
            return blank
        of_kind = KINDS[self.choice].state if self.choice < len(KINDS) else ()
        state = of_baselines.extended(blank, (*BASELINE_STATE, *of_kind))
        state["run_of"] = NO_CHANNEL
        return state

    @property
    def data(self) -> ManagerData:
        """Data of ``vote_signals`` besides the row."""
        return ManagerData(self.choice, self.params, self.state, self.boxes, self.lanes, self.baseline)


@inlined
def vote_signals(bus, fcc, data):
    """Vote a row by the chosen manager."""
    vote_chosen(bus, fcc, data, data.baseline)


@kernel
def vote_chosen(bus, fcc, data, baseline):
    """Vote a row by the chosen manager, its place in KINDS, or by ``baseline``: the other branch is not compiled.

    numba calls no kernel that a table holds.  baseline : Chosen or None
    """
    if baseline is not None:
        vote_baseline(bus, fcc, data, baseline)
    else:
        choice = data.choice
        if choice == _CROSS_CHANNEL:
            manage(bus, fcc, data)
        elif choice == _MEAN:
            average(bus, fcc, data)
        elif choice == _MEDIAN:
            plain_median(bus, fcc, data)
        elif choice == _CROSS_VOTER:
            cross_voter(bus, fcc, data)
        elif choice == _SELECTION:
            select(bus, fcc, data)
        else:  # _UNIT
            select_unit(bus, fcc, 0, len(data.params), data)


@kernel
def vote_baseline(bus, fcc, data, baseline):
    """Vote a row by a baseline manager; baseline : Chosen."""
    for s in range(len(data.params)):
        p, st = data.params[s], data.state[s]
        cusum(bus, fcc, s, p, st, baseline.cusum)
        glr(bus, fcc, s, p, st, baseline.glr)
        parity(bus, fcc, s, p, st, baseline.parity)
        bayes(bus, fcc, s, p, st, baseline.bayes)
        innovation(bus, fcc, s, p, st, baseline.innovation)
        weighted(bus, fcc, s, p, st, baseline.weighted)
        gate_mean(bus, fcc, s, p, st, baseline.gate_mean)
        window_median(bus, fcc, s, p, st, baseline.window_median)
        variance_mean(bus, fcc, s, p, st, baseline.variance_mean)
        inverse_mean(bus, fcc, s, p, st, baseline.inverse_mean)
        trimmed_mean(bus, fcc, s, p, st, baseline.trimmed_mean)
        mid_value(bus, fcc, s, p, st, baseline.mid_value)
        cross_voter_learned(bus, fcc, s, p, st, baseline.cross_voter)
    selection_learned(bus, fcc, data, baseline.selection)
