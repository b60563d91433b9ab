"""Places of a flight on which faults sit, and the settings of their monitors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from rig.computer.analytic.reference_sources import FROM_UNIT, source
from rig.computer.redundancy import Config, flight_parameters
from rig.computer.redundancy.box import boxes
from rig.computer.redundancy.discrete_config import discrete_parameters
from rig.core.frame import INDEX, INERTIAL
from rig.scenario.scenario import Scenario
from rig.verdict.lane_tally import columns_of
from rig.verdict.signal_kernels import LONG_AGO, NEVER, SIGNAL
from rig.verdict.tally_records import FAULT
from rig.world import sensors
from rig.world.faults import Fault
from rig.world.faults.places import CHANNELLED, Places, number, site

MARGIN: Final = 10  # frames: counts that wait after a split, lags of the sensors
_LATEST: Final[list[tuple[ref[Scenario], NDArray[np.void], NDArray[np.void]]]] = []  # one at most; settings are frozen
_HALF: Final = 0.5  # an error of a discrete is 0 or 1


def monitor(scenario: Scenario) -> NDArray[np.void]:
    """Return the (S,) config.PARAMS records of the flight's manager."""
    suite, config = scenario.sensors, scenario.redundancy
    ranges, channels = sensors.ranges(suite), sensors.channels(suite)
    sheets = sensors.data_sheets(suite, scenario.rate_hz, scenario.computers.apart_frames)
    return flight_parameters(
        config, ranges, channels, scenario.references, scenario.rate_hz, scenario.computers.count, sheets
    ).copy()


def lingers(params: NDArray[np.void]) -> NDArray[np.int64]:
    """Return (S,) frames for which a fault that has ceased can be the cause of a failure: the longer persistence."""
    return np.maximum(params["persistence"], params["split_persistence"])


def allowed_frames(p: NDArray[np.void]) -> int:
    """Return for how many frames after a fault a kept vote may be off; p : PARAMS of the signal."""
    return int(p["persistence"]) + int(p["split_persistence"]) + MARGIN


class Monitored(NamedTuple):
    """Those who watch the places, of a flight or of a recording: settings, and blank records of what they see."""

    params: NDArray[np.void]  # (S,) config.PARAMS
    signals: NDArray[Any]  # (S,) SIGNAL
    discretes: NDArray[Any]  # (D,) SIGNAL

    @classmethod
    def of(cls, params: NDArray[np.void], discretes: NDArray[np.void], box_signals: int | None) -> Monitored:
        """Return the blank records; params, discretes : config.PARAMS and DISCRETE_PARAMS."""
        signals = blank_records(params["threshold"], params["fitted"], lingers(params))
        watched = blank_records(np.full(len(discretes), _HALF), discretes["fitted"], discretes["persistence"])
        signals["box"] = params["box"]
        signals["box_needed"] = boxes(params["box"], box_signals, 1)["needed"][0][params["box"]]
        return cls(params, signals, watched)


def settings_of(scenario: Scenario) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return config.PARAMS (S,) and DISCRETE_PARAMS (D,) of a flight, read once; the caller's own."""
    for latest, params, discretes in _LATEST:
        if latest() is scenario:
            return params.copy(), discretes.copy()
    fitted, config = sensors.discrete_channels(scenario.sensors), scenario.redundancy
    discretes = discrete_parameters(config.discretes, fitted, config.discrete_persistence, scenario.rate_hz)
    params = monitor(scenario)
    _LATEST[:] = [(ref(scenario), params, discretes)]
    return params.copy(), discretes.copy()


def of_scenario(scenario: Scenario) -> Monitored:
    """Return what is monitored in a flight."""
    return Monitored.of(*settings_of(scenario), scenario.redundancy.box_signals)


def blank_records(threshold: Any, fitted: Any, linger: NDArray[Any]) -> NDArray[Any]:
    """Return (n,) SIGNAL before the first row; threshold of a single channel, channels fitted, linger in frames."""
    records = np.zeros(len(linger), SIGNAL)
    records["threshold"], records["fitted"], records["level"], records["linger"] = threshold, fitted, fitted, linger
    records["failed_at"] = NEVER
    for field in ("wrong_at", "error_at", "disturbed"):
        records[field] = LONG_AGO
    return records


def fault_records(
    faults: Sequence[Fault], monitored: Monitored, places: Places, config: Config | None = None
) -> NDArray[Any]:
    """Return (F,) FAULT, blank: each fault at each of its channels, or once where it sits on none.

    config : of the flight, whose references faults may change; None: a recording
    """
    on = [(i, name, channel) for i, fault in enumerate(faults) for name, channel in channels_of(fault) or [("", 0)]]
    records = np.zeros(len(on), FAULT)
    for field in ("signal", "channel", "surface", "inertial", "reference", "onset", "exceeded_at", "failed_at"):
        records[field] = NEVER
    records["acted_at"] = records["beyond_at"] = LONG_AGO
    records["peak"] = records["sample"] = records["load_factor_change"] = np.nan
    for record, (i, name, channel) in zip(records, on, strict=True):
        fault = faults[i]
        record["number"], record["columns"] = i, columns_of(fault)
        if name and places.site(name) in CHANNELLED:
            discrete, place = places.site(name) == "discrete", places.number(name)
            record["signal"], record["channel"], record["discrete"] = place, channel - 1, discrete
            record["changes"] = discrete or fault.changes_samples  # a discrete that says bad of itself is not voted
            record["threshold"] = (monitored.discretes if discrete else monitored.signals)[place]["threshold"]
            continue
        record["references"] = 0 if config is None else _bits(references_of(fault, config))
        if (where := site(fault.signal)) in ("surface", "inertial", "reference"):
            record[where] = number(fault.signal)
    return records


def _bits(numbers: Sequence[int]) -> int:
    return sum(1 << number for number in set(numbers))


def channels_of(fault: Fault) -> list[tuple[str, int]]:
    """Return (signal, channel from 1) of all that a fault changes; empty for one that sits on no channel."""
    return [(point.place, point.channel) for point in fault.points if point.channel is not None]


def references_of(fault: Fault, config: Config) -> list[int]:
    """Return the signals whose reference a fault can change: it sits there, or on the unit that it is read from."""
    where = site(fault.signal)
    if where == "reference":
        return [number(fault.signal)]
    if where != "inertial":
        return []
    quantity = INERTIAL[number(fault.signal)]
    fed = [name for name, read in FROM_UNIT.items() if quantity in read]
    return [INDEX[name] for name in fed if source(config.references, name) == "inertial"]
