"""What a diagnosis finds in made-up and recorded flights: short versions of tests/tools/diagnosis_tables.py."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnosis_tables import (
    AXES,
    UNITS,
    changed,
    clipped,
    diagnosed,
    freeze,
    group_of,
    late,
    recorded,
    scaled,
    since,
    some,
)
from diagnosis_tables import step as put_step
from foreign_logs import PX4_LOGS
from sensor_flights import Kind, flown

import rig as api
from rig.bench.diagnose.one_quantity import QuantityDiagnosis
from rig.bench.diagnose.sensor_groups import Group

DATA = Path(__file__).parents[2] / "shared" / "data"
FLIGHTS = [folder for name in ("quad_imu", "quad_imu_horizontal") if (folder := DATA / name).is_dir()]


def verdicts(found: QuantityDiagnosis) -> set[str]:
    return {one.verdict for one in found.signals.values()}


def flight(name: str = "gyro", count: int = 3, seed: int = 21, rate_hz: float = 25.0, **more: Any) -> Group:
    return group_of(flown(Kind(seed=seed, rate_hz=rate_hz, count=count, **more)), name)


@pytest.mark.parametrize("count", [2, pytest.param(3, marks=pytest.mark.long), 4])
@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 4))])
def test_no_channel_of_a_healthy_flight_departs(seed: int, name: str, count: int):
    several: tuple[dict[str, Any], ...] = (
        {},
        {"vibration": 1.0},
        {"delays_s": (0.0, 0.06)},
        {"motion": 0.05, "burst": 3.0},
    )
    for more in several:
        found = diagnosed(flight(name, count, seed, **more))
        assert verdicts(found) == {"none"}
        assert all((one.in_thresholds or 0.0) < 1.0 for one in found.signals.values())


@pytest.mark.parametrize("count", [3, pytest.param(4, marks=pytest.mark.long)])
@pytest.mark.parametrize(("name", "size"), [("gyro", 0.5), ("accel", 5.0)])
def test_a_step_in_one_of_several_is_named_with_its_time_and_size(name: str, size: float, count: int):
    made = flight(name, count)
    for c in range(count):
        found = diagnosed(changed(made, c, put_step(1, size)))
        one = found.signals[f"{name}_y"]
        assert (one.verdict, one.channel, one.instance) == ("channel", c + 1, f"imu{c}")
        assert one.since_s == pytest.approx(24.0, abs=0.5)
        assert one.difference == pytest.approx(size, rel=0.25)
        assert one.smallest_told is not None and one.smallest_told < size
        assert {found.signals[f"{name}_{axis}"].verdict for axis in "xz"} == {"none"}


def test_a_step_in_one_of_two_is_one_of_two():
    one = diagnosed(changed(flight(count=2), 1, put_step(0, 0.4))).signals["gyro_x"]
    assert (one.verdict, one.channel, one.instance) == ("one_of", None, None)
    assert one.since_s == pytest.approx(24.0, abs=0.5)


@pytest.mark.parametrize("count", [2, 3])
def test_a_frozen_unit_is_named_even_beside_one_other(count: int):
    found = diagnosed(changed(flight(count=count), 0, freeze(0, 1, 2)))
    for one in found.signals.values():
        assert (one.verdict, one.channel, one.kind) == ("channel", 1, "frozen")
        assert one.since_s == pytest.approx(24.0, abs=0.1)


def test_a_frozen_axis_is_named_and_the_others_are_not():
    found = diagnosed(changed(flight(), 2, freeze(1)))
    assert [one.verdict for one in found.signals.values()] == ["none", "channel", "none"]
    assert found.signals["gyro_y"].channel == 3


@pytest.mark.parametrize("what", AXES)
@pytest.mark.parametrize("name", ["gyro", pytest.param("accel", marks=pytest.mark.long)])
def test_other_axes_are_told_and_taken_off_and_a_fault_beside_them_is_found(name: str, what: str):
    made = changed(flight(name), 1, AXES[what])
    (one,) = [one for one in diagnosed(made).conventions if one.kind in ("axes", "mounting")]
    assert (one.instance.channel, one.named, one.corrected) == (2, True, True)
    assert one.kind == ("mounting" if what.startswith("mounted") else "axes")
    assert verdicts(diagnosed(made)) == {"none"}
    found = diagnosed(changed(made, 2, put_step(0, 14 * UNITS[name][1])))
    assert (found.signals[f"{name}_x"].verdict, found.signals[f"{name}_x"].channel) == ("channel", 3)


@pytest.mark.parametrize("name", UNITS)
def test_another_unit_is_told_with_its_factor(name: str):
    factor = UNITS[name][2]
    found = diagnosed(changed(flight(name), 0, scaled(factor)))
    (one,) = [one for one in found.conventions if one.kind == "unit"]
    assert one.instance.channel == 1
    assert one.value == pytest.approx(factor)
    assert verdicts(found) == {"none"}


@pytest.mark.parametrize("seconds", [0.06, 0.15])
def test_a_delay_is_told_in_seconds(seconds: float):
    found = diagnosed(changed(flight(seed=22, rate_hz=100.0), 1, late(seconds)))
    (one,) = [one for one in found.conventions if one.kind == "delay"]
    assert one.instance.channel == 2
    assert one.value == pytest.approx(seconds, abs=0.01)


def test_a_constant_difference_is_told_and_is_no_verdict():
    found = diagnosed(changed(flight(), 1, lambda _, v: v + np.array([[0.3], [0.0], [0.0]])))
    (one,) = [one for one in found.conventions if one.kind == "offset"]
    assert (one.instance.channel, one.signal) == (2, "gyro_x")
    assert one.value == pytest.approx(0.3, abs=0.05)
    assert verdicts(found) == {"none"}


@pytest.mark.parametrize("count", [2, 3, 4])
def test_two_at_the_end_of_their_range_are_no_fault(count: int):
    for seed in (1, 2, 3):
        assert verdicts(diagnosed(clipped(flight(count=count, seed=seed, burst=6.0), (0, 1), 2.0))) == {"none"}


@pytest.mark.parametrize(("seed", "rate_hz", "limit"), [(3, 50.0, 1.5), (3, 100.0, 2.0), (4, 100.0, 2.0)])
def test_two_at_their_ends_in_steady_large_motion_are_no_fault(seed: int, rate_hz: float, limit: float):
    flight_ = flown(Kind(seed=seed, rate_hz=rate_hz, motion=1.2))
    flight_.gyro += np.random.default_rng(seed).normal(0.0, 0.3, flight_.gyro.shape)
    assert verdicts(diagnosed(clipped(group_of(flight_, "gyro"), (0, 1), limit))) == {"none"}


def test_two_that_reach_the_end_of_one_range_one_after_the_other_are_no_fault():
    def knock(by: float) -> Any:
        return lambda t, v: v + 4.0 * (np.abs(since(t) - by) < 0.05) * np.array([[1.0], [0.0], [0.0]])

    made = flight(rate_hz=50.0, motion=0.3, burst=0.3)
    for c in (0, 1):
        made = changed(made, c, knock(float(c)))
    for by in (5.0, 5.1, 5.2):  # the knock that one has alone
        made = changed(made, 0, knock(by))
    assert verdicts(diagnosed(clipped(made, (0, 1), 2.0))) == {"none"}


def test_a_hum_with_another_phase_in_each_axis_is_no_mounting_and_no_delay():
    for seed in (1, 3, 4, 5):
        for count, rate_hz in ((3, 10.0), (2, 5.0)):
            found = diagnosed(
                flight("gyro", count, seed, rate_hz, motion=0.0005, burst=0.0, vibration=1.0, noise=0.003)
            )
            assert not [one for one in found.conventions if one.kind != "offset"]


def test_vibration_that_a_slow_log_shows_as_a_swing_is_no_fault():
    t = np.arange(0.0, 90.0, 0.2)
    begun = np.where(t > 60.0, 1.0, 0.0)
    for seed in range(4):
        made = flight("accel", 4, seed, 5.0, motion=0.0005, burst=0.0, vibration=0.0, seconds=90.0)
        phase = np.random.default_rng(seed).uniform(0.0, 6.28, 4)
        for c in range(4):
            wave = 1.5 * begun * np.sin(2 * np.pi * 0.29 * t + phase[c])
            made = changed(made, c, lambda at, v, w=wave: v + np.interp(at - at[0], t, w))
        assert "channel" not in verdicts(diagnosed(made))


def test_one_alone_at_the_end_of_its_range_is_told():
    found = diagnosed(clipped(flight(burst=6.0), (1,), 2.0))
    told = [one for one in found.signals.values() if one.kind == "end of range"]
    assert told and {one.channel for one in told} == {2}


def test_a_short_recording_is_unknown():
    found = diagnosed(flight(seconds=2.0))
    assert verdicts(found) == {"unknown"}
    assert "too short to compare" in found.remarks[0]


@pytest.mark.skipif(not FLIGHTS, reason="the recorded flights are not here")
@pytest.mark.parametrize("most", [1, pytest.param(None, marks=pytest.mark.long)], ids=["one of each", "all"])
def test_no_channel_of_the_recorded_flights_departs(most: int | None):
    count = 0
    for folder in FLIGHTS:
        for group in islice(recorded(folder), most and 2 * most):  # two quantities a flight
            for channels in ((0, 1, 2, 3), (0, 1)):
                assert verdicts(diagnosed(some(group, channels))) == {"none"}
            count += 1
    assert count == (2 * most * len(FLIGHTS) if most else 36)


@pytest.mark.skipif(not PX4_LOGS.is_dir(), reason="the recorded PX4 logs are not here")
@pytest.mark.parametrize("name", ["battery_brownout", "ekf_failure", "gps_interference"])
def test_no_channel_of_the_recorded_px4_logs_departs(name: str):
    found = api.diagnose(PX4_LOGS / f"{name}.ulg")
    assert {one.verdict for one in found.signals.values()} == {"none"}
    assert all("are not detected" in " ".join(one.remarks) for one in found.quantities.values())
