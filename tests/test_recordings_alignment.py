"""The stretch that alignment is found in, what the user is told, and misalignment of triads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.log.recordings.align_matrix import take_off_matrices
from rig.log.recordings.alignment import AlignOptions, run_alignment, stretch
from rig.log.recordings.injection_file import Injected
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig, read_config

N = 3000
AXES = ("x", "y", "z")
TRIADS = {"gyro": list(AXES)}
SETTINGS = {axis: RecordedSignal(threshold=1.0) for axis in AXES}


def motion(seed: int = 5) -> Any:
    """(3, N): slow motion of about 1 about every axis."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.001, 0.008, (3, 6)), rng.uniform(0, 2 * np.pi, (3, 6))
    at = 2 * np.pi * np.arange(N)[:, None, None] * frequency + phase
    return np.sin(at).sum(axis=2).T


def channels(noise: float = 0.05, seed: int = 1) -> Any:
    """(3, 4, N) axes of four recorders that differ by noise."""
    rng = np.random.default_rng(seed)
    return motion()[:, None] + noise * rng.normal(size=(3, 4, N))


def recording(x: Any, rate_hz: float = 100.0) -> Recording:
    signals = {axis: Samples(list(x[i])) for i, axis in enumerate(AXES)}
    return Recording(np.arange(x.shape[2]) / rate_hz, signals)


def test_the_stretch_is_the_first_six_seconds_or_what_is_given():
    assert stretch(recording(channels()), AlignOptions()) == (0.0, 6.0)
    assert stretch(recording(channels()), AlignOptions(from_s=10.0)) == (10.0, 16.0)
    assert stretch(recording(channels()), AlignOptions(from_s=1.0, to_s=20.0)) == (1.0, 20.0)
    assert stretch(recording(channels(), 10.0), AlignOptions()) == (0.0, 25.5)  # 256 rows
    assert stretch(recording(channels()), AlignOptions(from_s=28.0)) == (28.0, pytest.approx(29.99))


def test_a_fault_after_the_stretch_is_not_taken_for_an_offset_and_is_told():
    x = channels()
    x[0, 1, 800:] += 5.0
    moved, found = run_alignment(recording(x), SETTINGS, AlignOptions(), {})
    first = found.corrections["x"][1]
    assert abs(first.offset) < 0.05 and found.moves["x"][1].offset_move == pytest.approx(5.0, abs=0.1)
    assert (found.from_s, found.to_s, found.rows, found.by_default) == (0.0, 6.0, 601, True)
    assert [text.split(":")[0] for text in found.warnings] == ["x.2"]
    off = moved.signals["x"].channels[1] - moved.signals["x"].channels[0]
    assert np.median(off[1000:]) == pytest.approx(5.0, abs=0.2)
    whole = run_alignment(recording(x), SETTINGS, AlignOptions(to_s=30.0), {})[1]
    assert whole.corrections["x"][1].offset == pytest.approx(5.0, abs=0.2) and not whole.by_default


def test_a_healthy_recording_has_no_warning_and_a_fault_in_the_stretch_one():
    _, healthy = run_alignment(recording(channels()), SETTINGS, AlignOptions(), {})
    assert healthy.warnings == []
    late = Injected(0, "offset x.2", "offset", "x", 2, 700, N - 1)
    early = Injected(1, "noise y.1", "noise", "y", 1, 500, 650)
    _, found = run_alignment(recording(channels()), SETTINGS, AlignOptions(), {}, [late, early])
    [warning] = found.warnings
    assert warning.startswith("noise y.1: y.1 is faulty from 5 s, within the alignment segment")


def test_an_offset_on_the_circle_is_no_move_where_the_angle_jumps():
    turns = (channels()[0] * 3.0 + np.pi) % (2 * np.pi) - np.pi
    settings = {"x": RecordedSignal(threshold=0.1, wraps=True)}
    _, found = run_alignment(Recording(np.arange(N) / 100, {"x": Samples(list(turns))}), settings, AlignOptions(), {})
    assert found.warnings == [] and max(move.offset_move for move in found.moves["x"]) < 0.1


def rotation(degrees: float) -> Any:
    """About the axis (1, 1, 1)."""
    k = np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]]) / np.sqrt(3)
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def turned(noise: float = 0.3) -> Any:
    """Recorder 2 is turned by 3 degrees; all vibrate."""
    x, clean = channels(noise), motion()
    x[:, 1] += rotation(3.0) @ clean - clean
    return x


def test_a_turned_recorder_is_turned_back_through_vibration():
    moved, found = take_off_matrices(recording(turned()), SETTINGS, TRIADS, (0.0, 30.0))
    assert [one.channel for one in found] == [1, 2, 3, 4] and all(one.applied for one in found)
    first, second = (np.array(found[c].matrix) for c in (0, 1))  # the median of all is turned a little too
    assert second @ np.linalg.inv(first) == pytest.approx(rotation(-3.0), abs=0.01)
    assert all(gain == pytest.approx(1.0, abs=0.02) for one in found for gain in one.gains)
    for old, new in ((turned(), False), (np.array([moved.signals[axis].channels for axis in AXES]), True)):
        off = old[:, 1] - old[:, 0]
        shared = np.abs(np.corrcoef(off[0], motion()[1])[0, 1])
        assert shared < 0.05 if new else shared > 0.1


def test_a_missing_axis_stays_missing_and_does_not_spread():
    x = turned(0.0)
    x[0, 1, 100:200] = np.nan
    moved, _ = take_off_matrices(recording(x), SETTINGS, TRIADS, (0.0, 30.0))
    assert np.isnan(moved.signals["x"].channels[1][100:200]).all()
    for axis in ("y", "z"):
        assert moved.signals[axis].channels[1] == pytest.approx(motion()[AXES.index(axis)], abs=0.05)


def test_without_motion_and_with_another_signal_a_recorder_is_left_alone():
    still = 0.1 * np.random.default_rng(2).normal(size=(3, 4, N))
    moved, found = take_off_matrices(recording(still), SETTINGS, TRIADS, (0.0, 30.0))
    assert not any(one.applied for one in found)
    assert np.array(moved.signals["x"].channels).tobytes() == still[0].tobytes()
    dead = channels()
    dead[:, 2] = 0.0
    assert [one.applied for one in take_off_matrices(recording(dead), SETTINGS, TRIADS, (0.0, 30.0))[1]][2] is False


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[triads]\ng = ['x', 'y']", "triads.g: must be three different signals, got ['x', 'y']"),
        ("[triads]\ng = ['x', 'y', 'z']\nh = ['u', 'v', 'x']", "triads.h: 'x' is in another triad already"),
        ("[triads]\ng = ['x', 'y', 'w']", "triads.g: 'w' is not voted; allowed: x, y, z"),
        ("[signal.x]\nwraps = true\n[triads]\ng = ['x', 'y', 'z']", "triads.g: x is an angle that wraps"),
        ("[signal.x]\nmanager = 'selection'\n[triads]\ng = ['x', 'y', 'z']", "triads.g: manager: selection chooses"),
    ],
)
def test_a_triad_that_is_no_vector_is_refused(tmp_path: Any, text: str, says: str):
    path = tmp_path / "c.toml"
    path.write_text("[default]\nthreshold = 1.0\n" + text)
    with pytest.raises(BadInput) as caught:
        read_config(path).signals(AXES, "c.toml")
    assert says in str(caught.value)


def test_matrices_need_triads_of_as_many_channels():
    with pytest.raises(BadInput, match=r"--align-matrix needs \[triads\] in CONFIG"):
        run_alignment(recording(channels()), SETTINGS, AlignOptions(matrix=True), {})
    fewer = recording(channels())
    fewer.signals["y"] = Samples(fewer.signals["y"].channels[:3])
    with pytest.raises(BadInput, match=r"triad gyro: its signals have \[4, 3, 4\] channels"):
        take_off_matrices(fewer, VoteConfig(default={"threshold": 1.0}).signals(AXES, ""), TRIADS, (0.0, 30.0))
