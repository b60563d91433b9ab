"""What drifts: Allan deviation and spectrum against theory, each within its own statistical error.

The variance of an Allan estimate follows from theory alone: with c(L) the covariance of neighbouring cluster means'
differences, L clusters apart, n of them, it is (n c(0)^2 + 2 sum (n - L) c(L)^2) / (2 n^2).
"""

import re
from functools import cache
from math import exp, sqrt
from pathlib import Path

import numpy as np
import pytest
from one_stage import WIDE, sense, suite, truths
from scipy.signal import welch

from rig.core.frame import INDEX
from rig.scenario import aircraft

Q = INDEX["pitch_rate"]
RATE, FRAMES = 10.0, 400_000
N, STD, T, K = 2e-4, 3e-4, 20.0, 1e-6
SIGMAS = 4.0
IMUS = Path(__file__).parent.parent.parent / "shared" / "data" / "quad_imu" / "path_1"
WHITE = {"noise_density": N}
MARKOV = {"bias_instability_std": STD, "bias_correlation_s": T}
WALK = {"rate_random_walk": K}


def drift(settings, seed=1, frames=FRAMES):
    """(frames, 4) of a gyro at rest."""
    return sense(truths(frames), suite(pitch_rate={**settings, **WIDE}), seed=seed, rate_hz=RATE, split=5000)[:, Q]


def differences(x, tau):
    m = round(tau * RATE)
    clusters = x[: len(x) // m * m].reshape(-1, m, x.shape[1]).mean(axis=1)
    return np.diff(clusters, axis=0)


def white(tau, lags):
    r = np.zeros(lags + 2)
    r[0] = N**2 / tau
    return covariance(r)


def markov(tau, lags):
    """From the covariance of two means of m samples whose own is STD^2 exp(-|t| / T)."""
    m, keep = round(tau * RATE), exp(-1 / (RATE * T))
    j = np.arange(1, m)
    start, across = STD**2 * (m + 2 * ((m - j) * keep**j).sum()) / m**2, (1 - keep**m) / (1 - keep) / m
    r = STD**2 * across**2 * keep * keep ** (m * (np.arange(lags + 2) - 1.0))
    r[0] = start
    return covariance(r)


def covariance(r):
    """Of the differences, from that of the means."""
    before = np.r_[r[1], r[:-2]]
    return 2 * r[:-1] - before - r[1:]


def walk(tau, lags):
    """Two triangles overlap by one cluster; 1 / (2 m^2) is the step of a sampled walk."""
    c: np.ndarray = np.zeros(lags + 1)
    m = tau * RATE
    c[:2] = K**2 * tau * 2 / 3 * (1 + 1 / (2 * m**2)), K**2 * tau / 6 * (1 - 1 / m**2)
    return c


CASES = [
    *(
        pytest.param(*one, marks=pytest.mark.long, id=one[1][0].__name__)
        for one in ((WHITE, [white]), (MARKOV, [markov]), (WALK, [walk]))
    ),
    pytest.param({**WHITE, **MARKOV, **WALK}, [white, markov, walk], id="all"),
]


@pytest.mark.parametrize(("settings", "theory"), CASES)
def test_the_allan_deviation_is_that_of_the_settings(settings, theory):
    x = drift(settings)
    for tau in (0.2, 1.0, 5.0, 20.0, 37.8, 100.0, 400.0):
        d = differences(x, tau)
        n = len(d)
        c = np.sum([part(tau, n - 1) for part in theory], axis=0)
        expected = c[0] / 2
        error = sqrt((n * c[0] ** 2 + 2 * ((n - np.arange(1, n)) * c[1:n] ** 2).sum()) / (2 * n**2) / 4)
        assert abs((d**2).mean() / 2 - expected) < SIGMAS * error, tau
        assert error < 0.25 * expected  # or the test could not fail


def test_the_theory_has_the_values_that_data_sheets_are_read_by():
    """Angle random walk is the deviation at 1 s; instability peaks at 1.89 T with 0.617 std; slopes are -1/2, +1/2."""
    deviation = lambda part, tau: sqrt(part(tau, 1)[0] / 2)  # noqa: E731
    assert deviation(white, 1.0) == pytest.approx(N)
    assert deviation(white, 100.0) == pytest.approx(N / 10)
    assert deviation(markov, 1.89 * T) == pytest.approx(0.617 * STD, rel=1e-3)
    for u in (0.5, 2.0, 20.0):  # the closed form of the unsampled process
        closed = 2 * STD**2 / u * (1 - (3 - 4 * exp(-u) + exp(-2 * u)) / (2 * u))
        assert deviation(markov, u * T) == pytest.approx(sqrt(closed), rel=1e-4)
    assert deviation(markov, 1.89 * T) > max(deviation(markov, 1.7 * T), deviation(markov, 2.1 * T))
    assert deviation(walk, 3.0) == pytest.approx(K, rel=1e-3)
    assert deviation(walk, 300.0) == pytest.approx(10 * K, rel=1e-3)


def test_bias_instability_has_its_spread_from_the_first_frame_on():
    first = np.concatenate([drift(MARKOV, seed, 1)[0] for seed in range(500)])
    assert first.std() == pytest.approx(STD, rel=SIGMAS / sqrt(2 * len(first)))


def test_channels_wander_apart_and_a_random_walk_starts_at_zero():
    x = drift(WALK, frames=2)
    assert np.abs(x[0]).max() < SIGMAS * K / sqrt(RATE) and len(set(x[0])) == 4


def test_the_table_in_the_docs_is_what_a_class_gives():
    rates = aircraft.sensor_classes()["tactical-grade MEMS"].rates
    assert rates is not None
    n, std, t = rates.noise_density, rates.bias_instability_std, rates.bias_correlation_s
    keys = {"noise_density": n, "bias_instability_std": std, "bias_correlation_s": t, **WIDE}
    x = sense(truths(200_000), suite(pitch_rate=keys), seed=1)[:, Q]
    page = (Path(__file__).parent.parent / "docs" / "reference" / "sensors-and-redundancy.md").read_text()
    rows = re.findall(r"^\| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", page, re.MULTILINE)
    assert len(rows) == 4
    for tau, measured, theory in (map(float, row) for row in rows):
        clusters = x[: 200_000 // round(tau * 100) * round(tau * 100)].reshape(-1, round(tau * 100), 4).mean(axis=1)
        found, u = sqrt((np.diff(clusters, axis=0) ** 2).mean() / 2), tau / t
        expected = n**2 / tau + 2 * std**2 / u * (1 - (3 - 4 * exp(-u) + exp(-2 * u)) / (2 * u))
        assert np.degrees(found) * 3600 == pytest.approx(measured, abs=0.0051)
        assert np.degrees(sqrt(expected)) * 3600 == pytest.approx(theory, abs=0.0051)


@pytest.mark.skipif(not IMUS.is_dir(), reason="the recorded flights are not here")
def test_real_gyros_in_flight_disagree_by_far_more_than_the_noise_of_a_sheet():
    """Vibration, mounting and lack of synchronism: what a class does not know, and a recorded file does."""
    gyros = [np.loadtxt(IMUS / f"IMU_{i}.csv", delimiter=",", skiprows=1)[:, 7:10] for i in range(1, 5)]
    rows = np.array([gyro[: min(map(len, gyros))] for gyro in gyros])
    apart = np.diff(rows - rows.mean(axis=0), axis=1)
    deviation = np.sqrt((apart**2).mean(axis=(0, 1)) / 2 * 4 / 3)  # deg/s, the mean of four being one of them
    rates = aircraft.sensor_classes()["MEMS consumer"].rates
    assert rates is not None
    assert np.degrees(rates.noise_density) * sqrt(120) == pytest.approx(0.055, abs=0.001)
    assert (deviation > 1.0).all() and (deviation < 11.0).all()


MODE = {"mode_rms": 0.01, "mode_frequency_hz": 8.0, "mode_damping": 0.05}


@cache
def mode(frames=400_000, **settings):
    return sense(truths(frames), suite(pitch_rate={**MODE, **settings}), seed=3, split=5000)[:, Q]


def test_a_structural_mode_is_the_same_on_every_channel_beside_independent_noise():
    assert (np.ptp(mode(1000), axis=1) == 0).all()
    both = mode(100_000, noise_std=0.01)
    assert np.asarray(np.corrcoef(both.T))[0, 1:] == pytest.approx(np.full(3, 0.5), abs=0.05)


def test_a_structural_mode_has_its_rms_within_the_error_of_the_estimate():
    x, n = mode()[:, 0], 400_000
    omega, damping, lag = 2 * np.pi * 8.0, 0.05, np.arange(1, 400) / 100
    turn = omega * sqrt(1 - damping**2)
    r = np.exp(-damping * omega * lag) * (np.cos(turn * lag) + damping * omega / turn * np.sin(turn * lag))
    error = sqrt(2 / n * (1 + 2 * (r**2).sum()))
    assert abs((x**2).mean() / 0.01**2 - 1) < SIGMAS * error < 0.1


def test_the_spectrum_of_a_structural_mode_is_that_of_the_resonance():
    f, g = welch(mode()[:, 0], 100.0, nperseg=2000, noverlap=0)
    omega, at = 2 * np.pi * 8.0, 2 * np.pi * f
    theory = 2 * 4 * 0.05 * omega**3 * 0.01**2 / ((omega**2 - at**2) ** 2 + (2 * 0.05 * omega * at) ** 2)
    near = (f > 3) & (f < 13)
    segments = 400_000 / 2000
    ratio = g[near] / theory[near]
    assert np.abs(ratio - 1).max() < SIGMAS / sqrt(segments) + 0.02  # the window blurs the peak by under 2 %
    assert abs(f[np.argmax(g)] - 8.0 * sqrt(1 - 2 * 0.05**2)) < 0.05 * 8.0  # within the half-power width


def test_one_more_wandering_part_shifts_no_other():
    """Every process of every signal has a stream of its own."""
    base = {"noise_std": 0.01, **MARKOV, **WIDE}
    plain = sense(truths(500), suite(pitch_rate=base, yaw_rate=base))
    more = sense(truths(500), suite(pitch_rate={**base, **WALK, **MODE}, yaw_rate=base))
    assert np.array_equal(plain[:, INDEX["yaw_rate"]], more[:, INDEX["yaw_rate"]])
    alone = sense(truths(500), suite(pitch_rate={**WALK, **MODE, **WIDE}))
    assert np.allclose(more[:, Q] - plain[:, Q], alone[:, Q], atol=1e-15)
