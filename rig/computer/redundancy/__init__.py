"""Redundancy management: four channels become one voted value, without knowing the truth."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.analytic.apart import still_within
from rig.computer.analytic.designed import Designed
from rig.computer.analytic.reference_sources import PARTNERS, TELLING, second, source
from rig.computer.analytic.references import ReferenceData, References, refer, remember
from rig.computer.redundancy.box import box_of_signals
from rig.computer.redundancy.discrete import DiscreteData, DiscreteVoter, vote_discretes
from rig.computer.redundancy.discrete_config import discrete_parameters
from rig.computer.redundancy.manager_config import Config, SignalConfig, parameters, without_lanes
from rig.computer.redundancy.managers import DEFAULT, MANAGERS, Manager, manager_kind, vote_signals, with_settings
from rig.computer.redundancy.own import OwnManager, load_manager
from rig.computer.redundancy.state import ManagerData
from rig.core.frame import CHANNELS, INDEX, SIGNALS, D
from rig.core.kept import kept
from rig.core.kernels import kernel
from rig.core.settings import in_frames
from rig.core.trust import Trust
from rig.world.sensors.data_sheet import DataSheet


class RedundancyData(NamedTuple):
    """Data of the stage besides the row, part by part."""

    references: ReferenceData
    manager: ManagerData
    discretes: DiscreteData


class Redundancy:
    """The stage: references, the chosen manager for the continuous signals, the voter for the discretes."""

    def __init__(
        self,
        config: Config,
        ranges: NDArray[np.float64],
        channels: NDArray[np.int64],
        designed: Designed,
        rate_hz: float,
        discrete_channels: NDArray[np.int64] | None = None,
        trust: Trust | None = None,
        tested: Collection[str] = (),
        noise_std: NDArray[np.float64] | None = None,
        computers: int = 1,
        sheets: Sequence[DataSheet] = (),
    ) -> None:
        """Make the stage.  BadInput: the user's manager.

        ranges (S, 2), channels (S,), discrete_channels (D,) : of the sensors; all discretes have four when not given
        trust : whether a manager class that the settings name may be run; it may not when not given
        tested : signals whose common faults the control law finds by itself
        noise_std : (S,) of a sample of each sensor, unit of the signal; none when not given
        computers : fitted; sheets : figures of each signal's sensor, which the slow-fault tests need
        """
        params = flight_parameters(config, ranges, channels, designed, rate_hz, computers, sheets).copy()
        params["common_fails"] = common_fails(config, tested)
        kind = manager_kind(config.manager)
        still = still_within(params["threshold"], np.zeros(len(SIGNALS)) if noise_std is None else noise_std)
        self.references = References(config.references, designed, rate_hz, kind.refers, still)
        own = kind.kernel is None
        self.own: OwnManager | None = load_manager(config.manager, params, trust or Trust()) if own else None
        name = DEFAULT if own else config.manager
        self.manager = Manager(
            name,
            with_settings(params, name, config.baselines, [signal.name for signal in SIGNALS]),
            box_signals=config.box_signals,
            box_persistence=config.box_persistence,
        )
        fitted = np.full(D, CHANNELS) if discrete_channels is None else discrete_channels
        of_discretes = discrete_parameters(config.discretes, fitted, config.discrete_persistence, rate_hz)
        self.discretes = DiscreteVoter(of_discretes)

    @property
    def data(self) -> RedundancyData:
        """Data of ``refer``, ``decide`` and ``conclude`` besides the row."""
        return RedundancyData(self.references.data, self.manager.data, self.discretes.data)


@kept
def flight_parameters(
    config: Config,
    ranges: NDArray[np.float64],
    channels: NDArray[np.int64],
    designed: Designed,
    rate_hz: float,
    computers: int,
    sheets: Sequence[DataSheet],
) -> NDArray[np.void]:
    """Return the (S,) PARAMS records of a flight's manager, shared: to be copied; not what a common mode does.

    ranges (S, 2), channels (S,), sheets : of the sensors; computers : fitted; one has no other's health to ask
    """
    params = parameters(config.signals, ranges, channels, rate_hz, sheets)
    measured_thresholds(params, config, designed)
    if computers == 1:
        params["tie_break"] = without_lanes(params["tie_break"])
    params["common_persistence"] = config.common_persistence
    params["unresolved_frames"] = in_frames(0, config.unresolved_s or None, rate_hz)
    params["box"] = box_of_signals(config.boxes, [signal.name for signal in SIGNALS])
    params["referred"] = [source(config.references, signal.name) != "none" for signal in SIGNALS]
    params["tells"] = [1 << INDEX[signal.name] if signal.name in TELLING else 0 for signal in SIGNALS]
    params["sources"] = [sources_of(config, signal.name) for signal in SIGNALS]
    return params


def common_fails(config: Config, tested: Collection[str]) -> list[bool]:
    """Return for each signal whether a common mode fails it (added); one of ``tested`` only by its own setting."""
    general = {signal.name: "report" if signal.name in tested else config.common_mode for signal in SIGNALS}
    return [(getattr(config.signals, name).common_mode or mode) == "fail" for name, mode in general.items()]


def measured_thresholds(params: NDArray[np.void], config: Config, designed: Designed) -> None:
    """Put the measured thresholds of references into the PARAMS records, of the first where the settings give none."""
    for row, signal in zip(params, SIGNALS, strict=True):
        key = signal.name, source(config.references, signal.name)
        measured, airspeed = designed.error(*key), designed.airspeed_error(*key)
        if measured is not None and getattr(config.signals, signal.name).reference_threshold is None:
            row["reference_threshold"] = measured.threshold
            row["reference_airspeed_m_s"] = 0.0 if airspeed is None else airspeed.threshold
        measured = designed.error(signal.name, second(config.references, signal.name))
        row["second_threshold"] = row["threshold"] if measured is None else measured.threshold


def sources_of(config: Config, signal: str) -> int:
    """Return a bit for each signal in TELLING that a reference of ``signal`` reads (reference_monitor.contradicted)."""
    chosen = source(config.references, signal), second(config.references, signal)
    read = {name for of in chosen for name in PARTNERS.get((signal, of), ()) if name in TELLING}
    return sum(1 << INDEX[name] for name in read)


@kernel
def conclude(bus, fcc, data):
    """After the manager: keep the votes for the next references, and vote the discretes; data : RedundancyData."""
    remember(bus, fcc, data.references)
    vote_discretes(bus, fcc, data.discretes)


__all__ = ["MANAGERS", "Config", "Redundancy", "RedundancyData", "SignalConfig", "conclude", "refer", "vote_signals"]
