"""Designs of a signal: the budget is met in data that did not make them, and what is told of the data is right."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from rig.core.units.angles import into_range, short_way
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.data import Data
from rig.studies.thresholds.data_check import BEYOND, Envelope, beyond, envelope, suspects
from rig.studies.thresholds.design import DataBlock, Design, Grid, Threshold, designs, rounded_up
from rig.studies.thresholds.design_signals import design
from rig.studies.thresholds.holdout import Count, count, holdout
from rig.studies.thresholds.tradeoff import Found, Kind, Tradeoff, faulty, inject, pieces, ranked, tradeoff

GIVEN = RecordedSignal(threshold=1.0)
RATE = 100.0


def flight(seed: int, seconds: float = 60.0, channels: int = 4, swing: float = 3.0) -> DataBlock:
    """A common motion of period 5 s with white noise of 1 on each channel."""
    n = round(seconds * RATE)
    rng = np.random.default_rng(seed)
    motion = swing * np.sin(2 * np.pi * np.arange(n) / RATE / 5.0)
    return DataBlock(f"flight {seed}", motion + rng.normal(size=(channels, n)), RATE)


@pytest.fixture(scope="module")
def made() -> list[Design]:
    grid = Grid(20.0, (2, 4), (4, 3, 2), (0.0, 0.05))
    return designs([flight(k) for k in range(20)], GIVEN, grid)


def test_every_filter_and_persistence_has_a_threshold_a_level(made: list[Design]):
    assert [(one.filter_s, one.persistence, one.in_split) for one in made] == [
        *((0.0, 2, 2), (0.0, 4, 4)),
        *((0.05, 2, 2), (0.05, 4, 4)),
    ]
    for one in made:
        assert list(one.thresholds) == [4, 3, 2]
        assert all(at.upper >= at.point > 0 and at.clusters >= 40 for at in one.thresholds.values())
        assert one.thresholds[2].upper > one.thresholds[4].upper  # two channels differ more than the nearest of three


def test_the_budget_is_met_in_other_flights(made: list[Design]):
    """20 events are allowed in the hour; a threshold a seventh lower has several times as many."""
    others = [flight(100 + k, 600.0) for k in range(6)]
    found = count(others, GIVEN, made[0], 20.0)[4]
    assert found.hours == pytest.approx(1.0)
    assert 2 <= found.counted <= 30 and not found.over
    at = made[0].thresholds[4]
    lower = Design(0.0, 2, 2, {4: Threshold(4, 0.85 * at.upper, at.point, 0, 0.0)})
    assert count(others, GIVEN, lower, 20.0)[4].over


def test_the_design_is_the_same_again_and_another_by_another_seed():
    flights = [flight(k, 30.0) for k in range(10)]
    first, again, other = (designs(flights, GIVEN, Grid(20.0, (4,), (4,), (0.0,), seed)) for seed in (1, 1, 2))
    assert first == again != other
    assert first[0].threshold.point == other[0].threshold.point


def test_settings_of_a_design_are_those_that_are_written():
    levels = {4: Threshold(4, 1.00001, 0.9, 40, 0.1), 3: Threshold(3, 2.0, 1.0, 40, 0.1)}
    chosen = Design(0.1, 24, 12, levels).settings(RecordedSignal(threshold=9.0, persistence_s=1.0, fade_s=0.5))
    assert (chosen.threshold, chosen.threshold_triplex, chosen.threshold_duplex) == (1.001, 2.0, None)
    assert (chosen.persistence, chosen.persistence_s, chosen.split_persistence) == (24, None, 12)
    assert (chosen.filter_s, chosen.fade_s) == (0.1, 0.5)


def test_a_split_persistence_that_is_given_stays():
    flights = [flight(k, 30.0) for k in range(4)]
    for given in (
        RecordedSignal(threshold=1.0, split_persistence=7),
        RecordedSignal(threshold=1.0, split_persistence_s=0.07),
    ):
        assert designs(flights, given, Grid(20.0, (4,), (4,), (0.0,)))[0].in_split == 7


def test_signals_of_three_channels_have_two_levels():
    found = designs([flight(k, 30.0, channels=3) for k in range(4)], GIVEN, Grid(20.0, (4,), (4, 3, 2), (0.0,)))
    assert list(found[0].thresholds) == [3, 2]
    assert set(found[0].keys()) >= {"threshold", "threshold_duplex"}


def test_nothing_is_designed_from_channels_that_do_not_differ():
    same = DataBlock("same", np.ones((4, 5000)), RATE)
    assert designs([same] * 3, GIVEN, Grid(10.0, (4,), (4,), (0.0,))) == []


@pytest.mark.parametrize(
    ("value", "wanted"), [(1.0, 1.0), (1.00001, 1.001), (12345.0, 12350.0), (0.00123456, 0.001235)]
)
def test_a_threshold_is_rounded_up(value: float, wanted: float):
    assert rounded_up(value) == wanted


def test_a_faulty_channel_of_one_flight_is_told():
    flights = [flight(k, 20.0) for k in range(5)]
    assert suspects(flights, wraps=False, longest=48) == []
    flights[2].samples[1, 900:1200] += 12.0
    told = suspects(flights, wraps=False, longest=48)
    assert [(one.flight, one.channel) for one in told] == [(2, 2)]
    assert told[0].why.startswith("for 1 s from ")
    flights[3].samples[2, 100:150] = np.nan
    flights[4].samples[0, 500:700] = 0.25
    told = suspects(flights, wraps=False, longest=48)
    assert [(one.flight, one.channel) for one in told] == [(2, 2), (3, 3), (4, 1)]
    assert "48 samples or more" in told[1].why and "repeats one value for 1 s from 5.0 s" in told[2].why


def test_a_channel_that_stands_out_in_a_flight_of_ours_without_faults_is_kept():
    flights = [flight(seed, 20.0) for seed in range(10)]
    flights[3].samples[1, 500:] += 15.0
    named = [DataBlock(f"flight {i}", one.samples, one.rate_hz) for i, one in enumerate(flights)]
    settings, grid = RecordedSignal(threshold=1.0), Grid(20.0, (4,), (4,), (0.0,))
    data = Data([one.name for one in named], 100.0, 1.0, {"x": named}, {"x": settings})
    known = replace(data, healthy={one.name for one in named})
    left_out, kept = (design(one, grid)["x"] for one in (data, known))
    assert (left_out.flights, kept.flights) == (9, 10) and kept.left_out == []


def test_the_envelope_of_a_sine_is_that_of_a_sine():
    """95 % of |sin| stay within sin(0.95 pi / 2), of its rate within 2 pi f times it."""
    clean = DataBlock("sine", np.tile(10.0 * np.sin(2 * np.pi * np.arange(100_000) / RATE / 4.0), (4, 1)), RATE)
    found = envelope([clean], wraps=False)
    share = np.sin(0.95 * np.pi / 2)
    assert found.value == pytest.approx(10.0 * share, rel=0.01)
    assert found.rate_per_s == pytest.approx(10.0 * 2 * np.pi / 4.0 * share, rel=0.01)
    assert found.noise == 0.0 and not found.still
    assert envelope([flight(1, 60.0, swing=0.0)], wraps=False).still


def test_data_that_move_more_are_told():
    design = {"x": Envelope(10.0, 100.0, 1.0)}
    assert beyond(design, {"x": Envelope(10.0 * BEYOND, 100.0 * BEYOND, 9.0), "y": Envelope(99.0, 9.0, 1.0)}) == []
    assert beyond(design, {"x": Envelope(16.0, 90.0, 1.0)}) == [
        "x: 95 % of its motion is within 16, of the design data within 10; the thresholds are not valid for it"
    ]
    assert "a second" in beyond(design, {"x": Envelope(9.0, 151.0, 1.0)})[0]


def test_faults_are_what_they_are_called():
    cut = pieces([flight(k, 20.0) for k in range(3)], 8)
    assert cut is not None and cut.samples.shape == (8, 901, 4) and cut.onset == 100
    healthy, after = cut.samples[np.arange(8), :, cut.channel], slice(cut.onset, None)

    def change(kind: Kind, size: float):
        found = faulty(cut, kind, size)
        assert np.array_equal(found[:, : cut.onset], healthy[:, : cut.onset])
        return found[:, after], healthy[:, after]

    found, was = change("offset", 2.0)
    assert np.abs(found - was) == pytest.approx(2.0) and len(np.unique(np.sign(found - was))) == 2
    found, was = change("ramp", 3.0)
    assert np.abs(found - was)[:, 200] == pytest.approx(6.0)
    found, was = change("gain", 0.5)
    assert found == pytest.approx(0.5 * was)
    found, was = change("stuck", 0.0)
    assert (found == healthy[:, cut.onset - 1 : cut.onset]).all()
    found, was = change("noise", 10.0)
    middle = np.median(cut.samples, axis=2)[:, after]
    assert found - middle == pytest.approx(10.0 * (was - middle))


@pytest.mark.parametrize("kind", ["offset", "small", "ramp", "noise", "stuck"])
def test_faults_of_an_angle_are_the_same_across_the_end_of_its_circle(kind: Kind):
    """An offset beyond the end was invalid, and isolated as that."""
    plain = pieces([flight(k, 20.0) for k in range(3)], 8)
    assert plain is not None
    scale = 0.01 / np.abs(plain.samples).max()
    at_zero, at_the_end = (
        replace(plain, samples=into_range(plain.samples * scale + off, -pi, -pi, True)) for off in (0.0, pi)
    )
    found = [faulty(cut, kind, 0.02 if kind != "noise" else 10.0, -pi) for cut in (at_zero, at_the_end)]
    assert np.abs(short_way(found[1] - found[0] - pi)).max() < 1e-9
    assert ((found[1] >= -pi) & (found[1] < pi)).all()


def test_a_large_offset_is_found_and_a_small_one_is_not(made: list[Design]):
    cut = pieces([flight(k) for k in range(20)])
    assert cut is not None
    found = tradeoff(cut, made[1], GIVEN, 50.0)
    assert found.kinds["offset 1"].correct >= 46 and found.kinds["offset 1"].delay_s == pytest.approx(0.03)
    assert inject(cut, made[1].settings(GIVEN), "offset", 0.1).correct == 0
    assert found.smallest_offset is not None
    exact = inject(cut.short(), made[1].settings(GIVEN), "offset", found.smallest_offset)
    less = inject(cut.short(), made[1].settings(GIVEN), "offset", found.smallest_offset / 1.1)
    assert exact.correct >= 0.95 * 48 > less.correct
    assert 0.0 < found.share < 1.0


def test_the_best_design_finds_most_and_of_equals_the_shortest_is_taken():
    def row(right: int) -> Tradeoff:
        return Tradeoff(None, Found(0, 0, 48, None, None), {"gain": Found(right, 0, 48 - right, 0.1, 0.2)})

    threshold = {4: Threshold(4, 1.0, 1.0, 40, 0.0)}
    asked = [Design(f, n, n, threshold) for f in (0.0, 0.1) for n in (8, 24)]
    assert ranked(asked, [row(40), row(41), row(30), row(41)]) == [1, 3, 0, 2]
    assert ranked(asked, [row(41), row(41), row(41), row(41)])[0] == 0


def test_halves_are_flown_with_the_thresholds_of_the_other():
    flights = [flight(k) for k in range(12)]
    grid = Grid(30.0, (2,), (4, 2), (0.0,))
    found = holdout(flights, GIVEN, grid, designs(flights, GIVEN, grid)[0])
    assert found is not None and set(found) == {4, 2}
    assert found[4].hours == pytest.approx(12 / 60) and found[2].hours == pytest.approx(6 * 12 / 60)
    assert found[4].expected == pytest.approx(6.0) and not found[4].over
    assert holdout(flights[:1], GIVEN, grid, designs(flights, GIVEN, grid)[0]) is None


def test_a_count_is_over_when_chance_would_not_have_it():
    """Poisson of 6: 11 or more in 4.3 % of trials, 12 in 2.0 %."""
    assert not Count(11, 0.2, 30.0).over and Count(12, 0.2, 30.0).over
    assert not Count(0, 0.0, 30.0).over
