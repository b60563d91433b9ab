"""A small benchmark: a campaign of one signal, healthy flights flown once, and made ones of white noise."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rig.computer.redundancy.managers import Manager, vote_signals
from rig.core.frame import State
from rig.studies.benchmark.benchmark_trials import of_signals
from rig.studies.benchmark.calibration_data import Flight, Healthy
from rig.studies.benchmark.entrants import OfSignal
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan

CAMPAIGN = Path("docs/examples/benchmark.toml")
SMALL = Path("docs/examples/benchmark_small.toml").resolve()
HEALTHY = Path("docs/examples/benchmark_healthy.toml")
RATE_HZ = 100.0


@cache
def plan() -> Plan:
    """Return the example with pitch rate alone."""
    campaign = read(CAMPAIGN, {})
    cases = {**campaign.cases, "signal": campaign.cases["signal"][:1]}
    return Plan(campaign.model_copy(update={"cases": cases}), "benchmark.toml")


@cache
def small() -> Plan:
    return Plan(read(SMALL, {}), str(SMALL))


class Wrapped:
    """A manager of the rig as one of the user's own."""

    name = "cross-voter"

    def __init__(self, params: Any) -> None:
        self.manager = Manager(self.name, params.copy())

    def step(self, bus: Any, fcc: Any, k: int) -> None:
        vote_signals(bus[k], fcc[k], self.manager.data)


class WrappedInnovation(Wrapped):
    """One that reads the reference."""

    name = "innovation"


class Limited:
    """Fails a channel at the first sample that is further than ``limit`` thresholds from zero."""

    calibrate = "limit"
    limit = 2.0

    def __init__(self, params: Any) -> None:
        self.most, self.failed = self.limit * params["threshold"][:, None], np.zeros((len(params), 4), bool)

    def step(self, bus: Any, fcc: Any, k: int) -> None:
        self.failed |= np.abs(bus[k]["channels"][: len(self.failed)]) > self.most
        n = len(self.failed)
        fcc[k]["voted"][:n], fcc[k]["level"][:n] = 0.0, (~self.failed).sum(axis=1)
        fcc[k]["state"][:n] = np.where(self.failed, State.FAILED, State.OK)


class Nameless(Limited):
    """Names a number that it does not have."""

    calibrate = "gain"


class Raising(Limited):
    """Raises in its third frame."""

    def step(self, bus: Any, fcc: Any, k: int) -> None:
        super().step(bus, fcc, k)
        if k == 2:
            raise ValueError("no third frame")


def white_signal(persistence: int = 1) -> OfSignal:
    """Pitch rate with a threshold of 1, failed after so many frames, whose samples may repeat."""
    _, (signal,) = of_signals(plan())
    params = signal.params.copy()
    for field in ("threshold", "threshold_triplex", "threshold_duplex"):
        params[field] = 1.0
    params["persistence"] = params["split_persistence"] = persistence
    params["low"], params["high"], params["stale_frames"] = -1e9, 1e9, 0
    return signal._replace(params=params)


def white(sigma: float, flights: int, frames: int, seed: int = 1) -> Healthy:
    """Flights of white noise on four channels, without references."""
    rng = np.random.default_rng(seed)
    none = np.full((frames, 2), np.nan)
    made = [Flight(f"{i}", sigma * rng.standard_normal((frames, 4)), none) for i in range(flights)]
    return Healthy({"pitch_rate": made}, flights * frames / RATE_HZ / 3600.0, "")


class NoStep:
    limit = 1.0


class Designed(Limited):
    """Takes its limit from the healthy data: the largest magnitude of a sample, with a margin."""

    margin = 1.5
    calibrate = None

    @classmethod
    def design(cls, healthy: Any) -> dict[str, Any]:
        largest = max(float(np.abs(each).max()) for each in healthy.channels)
        return {"limit": cls.margin * largest / healthy.threshold}


class DesignedAndCalibrated(Limited):
    """Takes weights of the channels from the healthy data; its limit is calibrated behind them."""

    weights: Any = (1.0, 1.0, 1.0, 1.0)

    @classmethod
    def design(cls, healthy: Any) -> dict[str, Any]:
        return {"weights": 1.0 / np.concatenate(healthy.channels).std(axis=0)}

    def step(self, bus: Any, fcc: Any, k: int) -> None:
        self.most = self.limit / np.array(self.weights)
        super().step(bus, fcc, k)


class Odd(Limited):
    """Returns what ``answer`` is."""

    answer: Any = None

    @classmethod
    def design(cls, healthy: Any) -> Any:
        if cls.answer == "write":
            healthy.channels[0][:] = 0.0
        if cls.answer == "unlock":
            healthy.channels[0].setflags(write=True)
        return cls.answer
