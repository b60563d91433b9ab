"""Delays and offsets that were put in are found, through noise and beside a bad channel, and taken off."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.bench.vote_rows import vote
from rig.core.errors import BadInput
from rig.log.recordings.align import Correction, align
from rig.log.recordings.delays import interpolated, pair
from rig.log.recordings.read import read
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig

N = 3000
QUAD = Path(__file__).parents[2] / "shared" / "data" / "quad_imu"
DELAYS = np.array([-4.37, 0.0, 1.8, 6.25])
OFFSETS = np.array([0.6, -0.2, 0.2, -1.4])  # their median is zero


def sines(delay: float, fastest: float = 0.06) -> Any:
    """A signal of many periods of 17 frames and more, late by ``delay`` frames; about 1.3 in size."""
    rng = np.random.default_rng(5)
    frequency, phase = rng.uniform(0.002, fastest, 12), rng.uniform(0, 2 * np.pi, 12)
    at = 2 * np.pi * np.outer(np.arange(N) - delay, frequency) + phase
    return np.sin(at) @ (1 / np.arange(1, 13))


def steps(delay: float) -> Any:
    """A few manoeuvres, quiet in between."""
    at = np.arange(N)[:, None] - delay - np.array([300, 1100, 1900, 2500])
    return (np.tanh(at / 15) - np.tanh((at - 120) / 20)) @ np.array([1.0, -0.7, 0.5, 1.2])


def signal(shape: Any, noise: float, seed: int = 1) -> list[Any]:
    rng = np.random.default_rng(seed)
    return [shape(d) + o + noise * rng.normal(size=N) for d, o in zip(DELAYS, OFFSETS, strict=True)]


def aligned(channels: list[Any], **options: Any) -> tuple[Recording, list[Correction]]:
    recording = Recording(np.arange(N) / 100, {"x": Samples(channels)})
    settings = {"x": RecordedSignal(threshold=1.0, **options.pop("settings", {}))}
    moved, found = align(recording, settings, **options)
    return moved, found["x"]


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("shape", [sines, steps])
def test_delays_within_a_tenth_of_a_frame_and_offsets_within_one_percent(shape: Any, noise: float):
    _, found = aligned(signal(shape, noise if shape is sines else noise / 5))
    assert [c.delay_frames for c in found] == pytest.approx(list(DELAYS), abs=0.1)
    assert [c.delay_s for c in found] == pytest.approx(list(DELAYS / 100), abs=0.001)
    scale = np.ptp(OFFSETS)
    assert [c.offset for c in found] == pytest.approx(list(OFFSETS), abs=0.01 * scale)


def test_what_is_taken_off_leaves_channels_that_agree():
    moved, _ = aligned(signal(sines, 0.0))
    channels = np.array(moved.signals["x"].channels)
    assert np.ptp(channels, axis=0).max() < 0.06  # of a signal of 1.3: linear interpolation
    assert moved.first_row == 5 and len(moved.time_s) == N - 5 - 7
    assert moved.time_s[0] == 0.05


def test_the_channel_in_the_middle_keeps_its_own_samples():
    channels = signal(sines, 0.02)
    moved, found = aligned(channels)
    assert found[1].delay_frames == 0
    assert np.allclose(moved.signals["x"].channels[1] + found[1].offset, channels[1][5 : N - 7], atol=1e-12)


@pytest.mark.parametrize("bad", ["noise", "constant", "dead", "another signal"])
def test_one_bad_channel_is_left_alone_and_does_not_move_the_others(bad: str):
    channels = signal(sines, 0.02)
    rng = np.random.default_rng(9)
    channels[2] = {
        "noise": rng.normal(0, 1, N),
        "constant": np.full(N, 3.0),
        "dead": np.full(N, np.nan),
        "another signal": np.cumsum(rng.normal(0, 0.1, N)),
    }[bad]
    _, found = aligned(channels)
    good = [0, 1, 3]
    assert not found[2].aligned and found[2].delay_frames == found[2].offset == 0
    assert [found[c].delay_frames for c in good] == pytest.approx(list(DELAYS[good]), abs=0.1)
    assert np.ptp([found[c].offset - OFFSETS[c] for c in good]) < 0.02


def test_a_channel_that_fails_half_way_is_still_aligned():
    channels = signal(sines, 0.02)
    channels[3][2000:2600] = 30.0
    channels[0][500:520] = np.nan
    _, found = aligned(channels)
    assert [c.delay_frames for c in found] == pytest.approx(list(DELAYS), abs=0.1)
    assert [c.offset for c in found] == pytest.approx(list(OFFSETS), abs=0.02)


def test_the_stretch_is_chosen_by_time():
    channels = signal(sines, 0.02)
    channels[3][:1000] = np.random.default_rng(1).normal(0, 20, 1000)
    _, found = aligned(channels, start_s=10.0, end_s=29.0)
    assert [c.delay_frames for c in found] == pytest.approx(list(DELAYS), abs=0.1)
    with pytest.raises(BadInput, match=r"101 rows from 1 to 2 s; at least 256 are needed"):
        aligned(channels, start_s=1.0, end_s=2.0)


def test_without_motion_only_offsets_are_found():
    rng = np.random.default_rng(2)
    _, found = aligned([o + rng.normal(0, 0.1, N) for o in OFFSETS])
    assert [c.delay_frames for c in found] == [0, 0, 0, 0]
    assert [c.offset for c in found] == pytest.approx(list(OFFSETS), abs=0.02)


def test_an_angle_is_aligned_across_the_jump_of_the_circle():
    turns = [(4.0 * sines(d) + o / 10 + np.pi) % (2 * np.pi) - np.pi for d, o in zip(DELAYS, OFFSETS, strict=True)]
    moved, found = aligned(turns, settings={"wraps": True})
    assert [c.delay_frames for c in found] == pytest.approx(list(DELAYS), abs=0.1)
    assert [c.offset for c in found] == pytest.approx(list(OFFSETS / 10), abs=0.002)
    channels = np.array(moved.signals["x"].channels)
    assert np.abs(channels).max() <= np.pi
    assert np.abs(np.angle(np.exp(1j * (channels - channels[1])))).max() < 0.25


def test_two_channels_share_the_offset():
    first, second = sines(0) + 1.0, sines(2.5)
    _, found = aligned([first, second])
    assert [c.delay_frames for c in found] == pytest.approx([0, 2.5], abs=0.1)
    assert [c.offset for c in found] == pytest.approx([0.5, -0.5], abs=0.01)


@pytest.mark.parametrize("delay", [-31.0, -7.5, 0.0, 12.3, 31.0])
def test_a_pair_is_measured_over_the_whole_range_of_delays(delay: float):
    measured, correlation = pair(sines(delay), sines(0))
    assert measured == pytest.approx(delay, abs=0.02) and correlation > 0.99


def test_a_delay_beyond_the_range_is_not_used():
    assert pair(sines(60.0), sines(0))[1] < 0.9


def test_between_rows_the_line_counts_and_next_to_nothing_is_nothing():
    column = np.array([0.0, 1.0, np.nan, 3.0])
    assert interpolated(column, np.array([0.0, 0.25, 1.0, 1.5, 3.0])).tolist()[:3] == [0.0, 0.25, 1.0]
    assert np.isnan(interpolated(column, np.array([1.5, 2.0]))).all()


@pytest.mark.skipif(not QUAD.is_dir(), reason="the recordings are not here")
def test_four_recorders_on_one_aircraft_agree_once_aligned():
    axes = {"gyro_x": "Gyr_X", "gyro_y": "Gyr_Y", "gyro_z": "Gyr_Z"}
    mapping = {f"{name}.{c}": f"IMU_{c}.csv:{field}" for name, field in axes.items() for c in range(1, 5)}
    config = VoteConfig(default={"threshold": 10.0}, mapping=mapping, time_column="time")
    recording = read(QUAD / "path_1", config)
    settings = config.signals(recording.signals, "")
    moved, found = align(recording, settings)
    raw, clean = vote(recording, settings, []), vote(moved, settings, [])
    assert sum(len(signal.failures) for signal in raw.values()) >= 3
    assert [signal.failures for signal in clean.values()] == [[], [], []]
    of_all = config.model_copy(update={"default": {"threshold": 10.0, "manager": "mean"}})  # which fails no channel
    settings = of_all.signals(recording.signals, "")
    raw, clean = vote(recording, settings, []), vote(moved, settings, [])
    for name in axes:
        assert np.quantile(clean[name].spread, 0.95) < 0.4 * np.quantile(raw[name].spread, 0.95)
        third, fourth = found[name][2].delay_frames, found[name][3].delay_frames
        assert fourth - third == pytest.approx(1.0, abs=0.15)
