"""False isolations by splitting: exact values, weights of drawn errors, degeneracy, bounds, the command."""

import json
from dataclasses import replace

import numpy as np
import pytest
from isolation_exact import isolations
from numpy.typing import NDArray
from reliability_cases import HELD_ONCE, ISOLATIONS, NOISE, Isolation

import rig.studies.reliability.false_isolations as module
from rig.bench.splitting import Windows, run_windows
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.studies.reliability.channel_errors import Ends, corners, drawn_errors
from rig.studies.reliability.false_isolation_target import shown, threshold_for
from rig.studies.reliability.false_isolations import LEAST_SETS, Effort, bound, estimate, estimate_or_bound

SMALL = Effort(flights=500, excursions=3000, most_repetitions=8)
GAUSSIAN = ISOLATIONS[0]
LONG = [pytest.param(name, marks=pytest.mark.long) for name in ("1 sigma, no wait", "2.2 sigma, as flown")]


def named(name: str) -> Isolation:
    return next(case for case in ISOLATIONS if case.name == name)


@pytest.mark.parametrize(("threshold", "expected"), HELD_ONCE.items())
def test_the_exact_values_are_those_of_the_count_that_is_held_once(threshold: float, expected: float):
    assert isolations(threshold, wait=0) == pytest.approx(expected, rel=3e-4)
    assert isolations(threshold) < expected


@pytest.mark.parametrize("name", ["1.5 sigma, as flown", *LONG])
def test_independent_noise_gives_the_exact_rate(name: str):
    case = named(name)
    found = case.obtain(effort=SMALL)
    assert found.few is None and case.intervals(found) <= 2.0
    assert found.per_hour == pytest.approx(case.expected, rel=0.5)


def test_biases_give_the_rate_of_quasi_monte_carlo():
    case = named("biases, 0.0064 rad/s")
    found = case.obtain(effort=SMALL._replace(flights=2000))
    assert found.few is None and case.intervals(found) <= 2.0
    assert found.per_hour == pytest.approx(case.expected, rel=0.6)


def test_few_flights_without_a_tilt_are_refused():
    bench = named("biases, 0.0064 rad/s").bench()
    with pytest.raises(
        BadInput, match=r"pitch_rate: threshold 0\.0064: no estimate: \d+ different sets of errors .*, 20 are needed"
    ):
        estimate_or_bound(bench, effort=Effort(flights=400, excursions=1000, kappas=(1.0,)))


def test_too_few_carrying_sets_are_no_estimate():
    found = estimate(GAUSSIAN.bench(), effort=SMALL._replace(flights=100, excursions=500, most_repetitions=2))
    assert found.few is None
    assert "carry the estimate" in (replace(found, carrying=LEAST_SETS - 1.0).few or "")
    assert "reach level 2 of 2" in (replace(found, sets=[30, LEAST_SETS - 1]).few or "")


def test_weights_make_drawn_errors_uniform():
    signs = np.zeros((2, 3, 4))
    signs[0, 0], signs[1, 0] = (1, -1, -1, -1), (1, 1, -1, -1)
    errors, weights = drawn_errors(Ends(signs), 200_000, np.random.default_rng(3))
    assert errors.shape == (3, 200_000, 4) and np.abs(errors).max() <= 1.0
    assert weights.mean() == pytest.approx(1.0, abs=0.03) and weights.max() <= 10.0 + 1e-9
    assert (weights * errors[0, :, 0]).mean() == pytest.approx(0.0, abs=0.03)
    assert (weights * errors[0, :, 0] ** 2).mean() == pytest.approx(1.0 / 3.0, abs=0.02)
    apart = (errors[0, :, 0] > 0.8) & (errors[0, :, 1:] < -0.8).all(axis=1)
    assert apart.mean() > 0.1 and (weights * apart).mean() == pytest.approx(0.1**4, rel=0.1)


def test_corners_lie_at_the_ends():
    signs = np.zeros((1, 3, 4))
    signs[0, 0] = (1, -1, -1, -1)
    errors = corners(Ends(signs), 5, np.random.default_rng(0))
    assert (errors[0] == signs[0, 0]).all() and (np.abs(errors[1:]) < 1.0).all()


def test_a_threshold_far_out_has_a_bound_and_nothing_is_split():
    case = replace(named("biases, 0.0064 rad/s"), threshold=0.02)
    found = estimate_or_bound(case.bench())
    assert found.per_hour is None and 0.0 < found.high < 1e-12
    assert bound(named("biases, 0.0064 rad/s").bench(), 0) > 1.0


def test_the_same_seed_gives_the_same_and_another_one_another():
    effort = Effort(flights=100, excursions=300, most_repetitions=2)
    one, same, other = (GAUSSIAN.obtain(seed, effort).per_hour for seed in (1, 1, 2))
    assert one == same != other


def test_the_threshold_of_a_target_meets_it():
    case = named("1 sigma, as flown")
    found = threshold_for(
        lambda t: replace(case, threshold=t).bench(), 1.2 * 0.0009, 0.05, 0, Effort(300, 1000, most_repetitions=8)
    )
    exact = isolations(found.threshold / 0.0009)
    assert shown(found) <= 0.05 and 0.015 < exact < 0.05


def test_the_command_says_what_the_bundled_threshold_gives(rig_command):
    code, out, _ = rig_command("reliability", "false-isolations", "pitch_rate", "--set", "duration_s=2.5", "--json")
    [found] = json.loads(out)["false_isolations"]
    assert code == 0 and found["threshold"] == 0.05 and found["high"] < 1e-12 and found["per_hour"] is None


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["pitch_rates"], "unknown signal 'pitch_rates'"),
        (["pitch_rate", "--threshold", "0.1,x"], "must be numbers above 0, separated by commas, got 0.1,x"),
        (["pitch_rate", "--target", "1e-15"], "--target: must be from 1e-12 to 1 false isolations per channel hour"),
        (
            ["pitch_rate", "--set", "redundancy.manager=median"],
            "redundancy.manager: 'median': must be cross-channel or cross-voter",
        ),
    ],
)
def test_bad_input_is_one_line(rig_command, more: list[str], said: str):
    code, out, err = rig_command("reliability", "false-isolations", *more)
    assert (code, out) == (2, "") and said in err and len(err.splitlines()) == 1


def failed_in(case: Isolation, flights: int, frames: int) -> NDArray[np.int64]:
    """Channels failed in each of so many flights, frame by frame: no splitting, no error drawn towards an end."""
    bench, rng = case.bench(), np.random.default_rng(11)
    held = bench.held(rng.uniform(-1.0, 1.0, (3, flights, CHANNELS)))
    windows = Windows(np.zeros(flights, np.int64), frames, 0, *np.zeros((2, flights), np.int64))
    work, out, j = bench.particles(1), bench.particles(1), 0
    noise = np.empty((max(frames, 8192), 1, CHANNELS), np.float32)
    while j < flights:
        rng.standard_normal(out=noise, dtype=np.float32)
        j, _ = run_windows(held, work, j, windows, noise, out, 0)
    return windows.at_start


@pytest.mark.parametrize(
    ("threshold", "biased", "frames"),
    [
        pytest.param(0.8 * NOISE, False, 8000, id="noise", marks=pytest.mark.long),
        pytest.param(0.0046, True, 1000, id="biases"),
    ],
)
def test_splitting_gives_the_rate_of_brute_force(threshold: float, biased: bool, frames: int):
    case = Isolation("brute force", threshold, 0.0, biased, waits=True)
    failed = failed_in(case, 2_000_000 // frames, frames)
    per_hour = 360_000.0 / (frames * CHANNELS)  # of a channel, of one a flight
    seen, error = per_hour * failed.mean(), per_hour * failed.std() / len(failed) ** 0.5
    found = case.obtain(effort=SMALL._replace(flights=2000))
    assert failed.sum() >= 30 and found.few is None and found.per_hour is not None
    assert abs(found.per_hour - seen) <= 2.0 * ((found.high - found.per_hour) ** 2 + (2.0 * error) ** 2) ** 0.5
    assert found.per_hour == pytest.approx(seen, rel=0.5)


def test_too_few_sets_leave_the_bound_where_it_says_something(monkeypatch: pytest.MonkeyPatch):
    bench = named("biases, 0.0064 rad/s").bench()
    effort = Effort(flights=400, excursions=1000, kappas=(1.0,))
    monkeypatch.setattr(module, "bound", lambda bench, seed: 2.1e-5)
    found = estimate_or_bound(bench, effort=effort)
    assert (found.per_hour, found.low, found.high) == (None, None, 2.1e-5) and found.few is not None
