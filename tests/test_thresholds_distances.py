"""The series whose exceedances are false isolations: exactly what the flight's manager does, at every threshold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.bench.vote_rows import vote
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds import distances
from rig.studies.thresholds.distances import (
    Monitored,
    exceeded,
    exceeded_each,
    in_use,
    invalid_runs,
    middle_gap,
    nearest,
    sliding_minimum,
)
from rig.studies.thresholds.pieces import isolations, low_passed, outcomes
from rig.verdict.signal_kernels import NEVER

RATE = 100.0
FOUR = (0, 1, 2, 3)


def below(value: float) -> float:
    return float(np.nextafter(value, 0.0))


def walk(rng: np.random.Generator, n: int) -> Any:
    return np.cumsum(rng.normal(0.0, 0.4, n))


def one_off(seed: int, n: int = 300, count: int = 4) -> Any:
    """Channels that agree closely but for one, which goes where it likes."""
    rng = np.random.default_rng(seed)
    samples = walk(rng, n) + rng.normal(0.0, 0.01, (count, n))
    samples[seed % count] += walk(rng, n)
    return samples


def recorded(samples: Any, reference: Any = None) -> Recording:
    return Recording(np.arange(samples.shape[1]) / RATE, {"x": Samples(list(samples), reference=reference)})


def first_failure(samples: Any, reference: Any = None, **settings: Any) -> int | None:
    """The frame in which ``rig vote`` first fails a channel."""
    recording = recorded(samples, reference)
    failed = vote(recording, {"x": RecordedSignal(**settings)}, [])["x"].failures
    return min((failure.frame - 1 for failure in failed), default=None)


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("frames", [1, 5, 12])
def test_a_channel_is_failed_exactly_when_the_threshold_is_exceeded(count: int, frames: int):
    for seed in range(8):
        samples = one_off(seed, count=count)
        series = exceeded(samples, Monitored(FOUR[:count], frames, 400))
        most = float(series.max())
        assert most > 0.1
        settings = {"persistence": frames, "split_persistence": 400}
        assert first_failure(samples, threshold=most, **settings) is None
        for part in (below(most), 0.6 * most):
            assert first_failure(samples, threshold=part, **settings) == int(np.argmax(series > part))


@pytest.mark.parametrize("filter_s", [0.02, 0.1])
def test_behind_the_filter_of_the_comparison_no_channel_is_failed_before_it_is_exceeded(filter_s: float):
    """The monitor limits the filter's steps, and counts a sample that is off itself: it fails later, or no channel."""
    for seed in range(6):
        samples = one_off(seed)
        samples[(seed + 1) % 4, 40:42] = np.nan
        given, rate = RecordedSignal(threshold=1.0, filter_s=filter_s), recorded(samples).rate_hz
        series = exceeded(low_passed(samples, given, rate), Monitored(FOUR, 8, 400))
        most = float(series.max())
        settings: dict[str, Any] = {"persistence": 8, "split_persistence": 400, "filter_s": filter_s}
        assert first_failure(samples, threshold=most, **settings) is None
        failed = first_failure(samples, threshold=below(most), **settings)
        assert failed is None or failed >= int(np.argmax(series >= most))
        assert first_failure(samples, threshold=0.3 * most, **settings) is not None


@pytest.mark.parametrize("frames", [1, 4, 10])
def test_two_against_two_are_settled_exactly_when_the_middle_gap_exceeds_the_threshold(frames: int):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        pair = rng.normal(0.0, 0.01, (4, 200))
        pair[2:] += 1.0 + np.abs(walk(rng, 200))
        series, far = (
            exceeded(pair, Monitored(FOUR, 250, frames)),
            np.full(200, -10.0),
        )  # below both: the lower is right
        most = float(series.max())
        settings: dict[str, Any] = {"persistence": 250, "split_persistence": frames, "tie_break": ["reference"]}
        assert first_failure(pair, far, threshold=most, **settings) is None
        assert first_failure(pair, far, threshold=below(most), **settings) == int(np.argmax(series >= most))


def test_two_channels_are_settled_exactly_when_their_distance_exceeds_the_threshold():
    samples = one_off(3, count=2)
    series = exceeded(samples, Monitored((0, 1), 8, 6))
    most, far = float(series.max()), samples[0] - 100.0 * np.sign(samples[1] - samples[0])
    settings: dict[str, Any] = {"persistence": 350, "split_persistence": 6, "tie_break": ["reference"]}
    assert first_failure(samples, far, threshold=most, **settings) is None
    assert first_failure(samples, far, threshold=below(most), **settings) == int(np.argmax(series >= most))


def test_an_angle_is_near_its_neighbour_across_the_turn():
    samples = np.array([[3.1, 3.1], [-3.1, -3.1], [3.12, -3.12], [3.0, 3.0]])
    turned = exceeded(samples, Monitored(FOUR, 1, 1), wraps=True)
    assert turned == pytest.approx([0.1, 0.1])  # the fourth from the first
    assert exceeded(samples, Monitored(FOUR, 1, 1))[0] > 6.0


def test_a_sample_that_is_not_comparable_counts_at_every_threshold():
    samples = one_off(1)[:3]
    samples[1, 50:58] = np.nan
    assert np.isinf(exceeded(samples, Monitored((0, 1, 2), 8, 400))[57])
    assert np.isfinite(exceeded(samples, Monitored((0, 1, 2), 9, 400))).all()
    assert invalid_runs(samples, 8) == [1] and invalid_runs(samples, 9) == []


def test_distances_and_gaps_are_those_of_the_ranks():
    rng = np.random.default_rng(2)
    samples = rng.normal(size=(4, 500))
    ranked = np.sort(samples, axis=0)
    assert np.array_equal(middle_gap(samples), ranked[2] - ranked[1])
    for c, found in enumerate(nearest(samples)):
        rest = np.delete(samples, c, axis=0)
        assert np.array_equal(found, np.abs(rest - samples[c]).min(axis=0))


@pytest.mark.parametrize("frames", [1, 2, 3, 8, 12, 31, 100, 101])
def test_the_sliding_minimum_is_that_of_every_window(frames: int):
    series = np.random.default_rng(frames).random(100)
    wanted = [series[k - frames + 1 : k + 1].min() if k >= frames - 1 else 0.0 for k in range(100)]
    assert np.array_equal(sliding_minimum(series, frames), wanted)


def test_the_channels_in_use_are_all_choices():
    assert in_use(4, 3) == [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]
    assert len(in_use(4, 2)) == 6 and in_use(3, 3) == [(0, 1, 2)]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_pieces_are_failed_as_rig_vote_fails_them(count: int):
    """A threshold a level, a filter, and samples that are missing."""
    rng = np.random.default_rng(count)
    settings = RecordedSignal(
        threshold=0.5, threshold_triplex=0.8, threshold_duplex=1.2, persistence=6, split_persistence=9, filter_s=0.03
    )
    every = np.stack([one_off(seed, 400, count) + 0.4 * walk(rng, 400) for seed in range(6)])
    every[2, 0, 100:120] = np.nan
    pieces, rate_hz = np.ascontiguousarray(every.transpose(0, 2, 1)), recorded(every[0]).rate_hz
    found = outcomes(pieces, np.zeros(6, np.int64), 400, settings, rate_hz)["failed_at"][:, :count]
    for piece, frames in zip(every, found, strict=True):
        recording = recorded(piece)
        wanted = np.full(count, NEVER)
        for failure in vote(recording, {"x": settings}, [])["x"].failures:
            wanted[failure.channel - 1] = failure.frame - 1
        assert np.array_equal(frames, wanted)
    assert (found != NEVER).any()


def test_a_flight_goes_on_after_an_isolation_and_one_event_counts_once():
    samples = np.zeros((1000, 4))
    samples[100:300, 1] = samples[320:330, 1] = samples[700:720, 2] = 5.0
    settings = RecordedSignal(threshold=1.0, persistence=4, split_persistence=4)
    assert isolations(samples, settings, RATE, 50).tolist() == [103, 703]
    assert isolations(samples, settings, RATE, 10).tolist() == [103, 323, 703]


def test_chunks_are_seamless(monkeypatch: pytest.MonkeyPatch):
    samples = one_off(5)
    whole = exceeded_each(samples, [(8, 8), (24, 10)])
    monkeypatch.setattr(distances, "CHUNK", 17)
    for part, wanted in zip(exceeded_each(samples, [(8, 8), (24, 10)]), whole, strict=True):
        assert np.array_equal(part, wanted)
