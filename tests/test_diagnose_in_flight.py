"""What ``rig diagnose`` says of the manager in flight: the decisions of ``rig vote`` with the same settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from foreign_logs import gyros
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


def test_an_angle_recorded_from_0_to_360_has_no_other_unit():
    x = wrapped(headings())
    x[:, 1] %= 360.0
    written(x, "hdg")
    ((channel, _, why),) = told({"signal": {"hdg": HEADING}}, "hdg")
    assert (channel, why) == (2, "invalid")
    assert not [one for one in api.diagnose("a.csv", {"signal": {"hdg": HEADING}}).conventions if one.kind == "unit"]


def test_max_change_and_resets_hold_in_flight():
    x = rates()
    x[SINCE & ((TIME_S < 25.0) | (TIME_S > 35.0)), 1] += 0.05
    written(x)
    again = {**CONFIG, "resets": [{"at_s": 30.0, "signal": "q", "channels": [2]}]}
    assert [channel for channel, _, _ in told(again)] == [2, 2]
    told({"default": {"threshold": 0.02, "max_change": 0.02}})


def test_a_wrong_channel_has_its_number_in_the_recording():
    x = rates(5)
    x[SINCE, 4] += 0.05
    written(x)
    config = {"signal": {"q": {"threshold": 0.02, "channels": [1, 2, 3, 5]}}}
    found = api.diagnose("a.csv", config)
    assert "q.5 (q) is wrong" in repr(found)
    one = found.signals["q"]
    assert (one.channel, one.instance) == (4, "q.5")
    assert [each.instance for each in flight_of(found, "q").isolations] == ["q.5"]
    assert "Channel 4 (recorded as q.5) is wrong" in text_of(found)
    assert [each["recorded"] for each in found.summary["quantities"]["q"]["instances"]] == [1, 2, 3, 5]


def text_of(found: Diagnosis) -> str:
    """The paragraph of the only quantity."""
    (text,) = (one["text"] for one in found.summary["quantities"].values())
    return str(text)


def test_a_split_is_given_up_in_flight_as_by_rig_vote():
    x = rates(2)
    x[:, 0] = 0.0
    written(x)
    given_up = told(CONFIG)
    assert [(channel, why) for channel, _, why in given_up] == [(1, "given_up"), (2, "given_up")]
    text = text_of(api.diagnose("a.csv", CONFIG))
    at_s = f"at {given_up[0][1]:.2f} s by given_up"
    assert f"isolates it {at_s}" in text and f"it also isolates channel 2 (q.2) {at_s}" in text
    assert told({**CONFIG, "unresolved_s": 0}) == []


def test_an_isolation_before_the_dated_beginning_is_told():
    x = rates()
    slow = {"noise_std": 0.002, "bias_tolerance": 0.003, "scale_tolerance": 0.002}
    config = {"default": {"threshold": 0.02, "slow_tests": slow}}
    x[SINCE, 1] += 0.002 * (TIME_S[SINCE] - 20.0)
    written(x)
    ((channel, at_s, why),) = told(config)
    found = api.diagnose("a.csv", config)
    one = found.signals["q"]
    assert (one.verdict, one.channel, channel) == ("channel", 2, 2)
    assert one.since_s is not None and one.since_s > at_s + 0.5
    assert one.in_flight is not None and one.in_flight.isolated and one.in_flight.at_s == pytest.approx(at_s)
    assert f"isolates it at {at_s:.2f} s by {why}, {one.since_s - at_s:.2f} s before the beginning" in text_of(found)


def noisy() -> Array:
    x = rates()
    x[SINCE, 3] += 0.2 * np.random.default_rng(5).standard_normal(SINCE.sum())
    return x


def oscillating() -> Array:
    x = rates()
    x[SINCE, 3] += 0.2 * np.sin(2 * np.pi * 5.0 * TIME_S[SINCE])
    return x


def test_an_isolation_without_a_departure_is_in_title_and_paragraph():
    written(noisy())
    (first, *_) = told(CONFIG)
    found = api.diagnose("a.csv", CONFIG)
    assert found.signals["q"].verdict == "none"
    title = found.summary["title"]
    assert title == f"no channel departs from the others, but the manager isolates q.4 (q) at {first[1]:.2f} s"
    assert f"isolates channel 4 (q.4) at {first[1]:.2f} s by comparison on q." in text_of(found)


def test_a_suspect_channel_without_a_departure_is_in_title_and_paragraph():
    written(oscillating())
    assert told(CONFIG) == []
    found = api.diagnose("a.csv", CONFIG)
    (one,) = flight_of(found, "q").suspects
    channel = api.vote("a.csv", CONFIG).summary["signals"]["q"]["channels"][3]
    assert (one.channel, one.rows) == (4, channel["suspect_rows"])
    assert 20.0 <= one.at_s < 20.5
    assert "but the manager suspects q.4 (q), first at 20." in found.summary["title"]
    assert "suspects, without isolating, channel 4 (q.4) in " in text_of(found)
    assert found.summary["signals"]["q"]["in_flight"]["suspects"][0]["instance"] == "q.4"


def test_two_channels_that_are_both_suspect_are_in_the_paragraph_alone():
    written(oscillating()[:, 2:])
    found = api.diagnose("a.csv", CONFIG | {"unresolved_s": 0})
    assert len(flight_of(found, "q").suspects) == 2
    assert found.summary["title"] == "no channel departs from the others"
    assert "suspects, without isolating, all channels in " in text_of(found)


def test_a_healthy_recording_has_a_plain_title():
    written(rates())
    found = api.diagnose("a.csv", CONFIG)
    assert found.summary["title"] == "no channel departs from the others"
    assert "In flight" not in text_of(found)


def test_channels_of_a_log_that_vote_have_their_numbers():
    Path("a.ulg").write_bytes(gyros(3, rows=400))
    mapping = {f"g.{c + 1}": f"sensor_gyro/{c}:x" for c in range(3)}
    found = api.diagnose("a.ulg", {"mapping": mapping, "signal": {"g": {"threshold": 0.05, "channels": [1, 3]}}})
    instances = found.summary["quantities"]["g"]["instances"]
    assert [(one["recorded"], one["instance"]) for one in instances] == [(1, "sensor_gyro/0"), (3, "sensor_gyro/2")]
