"""What ``rig diagnose`` says of the manager in flight: the decisions of ``rig vote`` with the same settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

import rig as api
from rig.bench.diagnose.diagnosis import Diagnosis
from rig.bench.diagnose.findings import InFlight
from rig.core.units.angles import short_way

Array = NDArray[np.float64]
RATE_HZ, N = 50, 2000
TIME_S = np.arange(N) / RATE_HZ
SINCE = TIME_S >= 20.0
CONFIG: dict[str, Any] = {"default": {"threshold": 0.02}}
HEADING = {"unit": "deg", "wraps": True, "range": [-180, 180], "threshold": 3.0}


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)


def rates(count: int = 4) -> Array:
    """Healthy rates (n, count) of one motion."""
    rng = np.random.default_rng(3)
    motion = 0.1 * np.sin(2 * np.pi * 0.3 * TIME_S) + 0.05 * np.sin(2 * np.pi * 0.11 * TIME_S)
    return motion[:, None] + 0.002 * rng.standard_normal((N, count))


def headings() -> Array:
    """Healthy headings (n, 4), deg, that go round several times, without the jumps of a turn."""
    rng = np.random.default_rng(8)
    return 170.0 + 12.0 * TIME_S[:, None] + rng.uniform(-0.5, 0.5, 4) + 0.1 * rng.standard_normal((N, 4))


def wrapped(angles: Array) -> Array:
    return short_way(angles, 180.0)


def written(x: Array, signal: str = "q") -> Path:
    """Write a table of one signal."""
    columns = {f"{signal}.{c}": column for c, column in enumerate(x.T, 1)}
    pl.DataFrame({"time_s": TIME_S, **columns}).write_csv("a.csv")
    return Path("a.csv")


def isolated(config: dict[str, Any], signal: str) -> list[tuple[int, float, str]]:
    """The isolations of ``rig vote``: channel, seconds since the first row, rule."""
    channels = api.vote("a.csv", config).summary["signals"][signal]["channels"]
    found = [(one["channel"], each["time_s"] - TIME_S[0], each["why"]) for one in channels for each in one["failed"]]
    return sorted(found, key=lambda each: each[1])


def flight_of(found: Diagnosis, signal: str) -> InFlight:
    flight = found.signals[signal].in_flight
    assert flight is not None
    return flight


def told(config: dict[str, Any], signal: str = "q") -> list[tuple[int, float, str]]:
    """The isolations of the diagnosis; they are those of ``rig vote``."""
    isolations = flight_of(api.diagnose("a.csv", config), signal).isolations
    found = [(one.channel, one.at_s, one.why) for one in isolations]
    assert found == isolated(config, signal)
    return found


def test_no_angle_that_goes_round_is_isolated_in_flight():
    written(wrapped(headings()), "hdg")
    assert told({"signal": {"hdg": HEADING}}, "hdg") == []


def test_the_wrong_one_of_angles_that_go_round_is_isolated_as_by_rig_vote():
    x = headings()
    x[SINCE, 2] += 10.0
    written(wrapped(x), "hdg")
    ((channel, at_s, _),) = told({"signal": {"hdg": HEADING}}, "hdg")
    assert channel == 3 and 20.0 < at_s < 20.5
    one = api.diagnose("a.csv", {"signal": {"hdg": HEADING}}).signals["hdg"]
    assert (one.verdict, one.channel) == ("channel", 3)
    assert one.in_flight is not None and one.in_flight.vote_error is not None and one.in_flight.vote_error < 3.0


def test_max_change_and_resets_hold_in_flight():
    x = rates()
    x[SINCE & ((TIME_S < 25.0) | (TIME_S > 35.0)), 1] += 0.05
    written(x)
    again = {**CONFIG, "resets": [{"at_s": 30.0, "signal": "q", "channels": [2]}]}
    assert [channel for channel, _, _ in told(again)] == [2, 2]
    told({"default": {"threshold": 0.02, "max_change": 0.02}})
