"""A small league: a campaign of one signal, healthy flights flown once, and made ones of white noise."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rig.campaign.config import read
from rig.campaign.plan import Plan
from rig.league.entrants import OfSignal
from rig.league.healthy import Flight, Healthy
from rig.league.trials import of_signals

CAMPAIGN = Path("docs/examples/league.toml")
HEALTHY = Path("docs/examples/league_healthy.toml")
RATE_HZ = 100.0


@cache
def plan(**sets: Any) -> Plan:
    return Plan(read(CAMPAIGN, {key.replace("__", "."): value for key, value in sets.items()}), "league.toml")


def white_signal(persistence: int = 1) -> OfSignal:
    """Pitch rate with a threshold of 1, failed after so many frames."""
    _, (signal,) = of_signals(plan())
    params = signal.params.copy()
    for field in ("threshold", "threshold_triplex", "threshold_duplex"):
        params[field] = 1.0
    params["persistence"] = params["singular_persistence"] = persistence
    params["low"], params["high"] = -1e9, 1e9
    return signal._replace(params=params)


def white(sigma: float, flights: int, frames: int, seed: int = 1) -> Healthy:
    """Flights of white noise on four channels, without references."""
    rng = np.random.default_rng(seed)
    none = np.full((frames, 2), np.nan)
    made = [Flight(f"{i}", sigma * rng.standard_normal((frames, 4)), none) for i in range(flights)]
    return Healthy({"pitch_rate": made}, flights * frames / RATE_HZ / 3600.0, "")
