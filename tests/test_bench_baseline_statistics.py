"""Statistics of the baseline managers against independent computations: theory, brute force, plain numpy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg, stats

from rig.bench.baseline_statistics import Statistics, statistics
from rig.computer.redundancy.baseline_managers.baseline_settings import BASELINE_PARAMS, Baselines, extended
from rig.computer.redundancy.baseline_managers.sums import summed
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.managers import KINDS, with_settings
from rig.core.frame import nested, new_block
from rig.core.kernels import long_kernel

Floats = NDArray[np.float64]


def watch(baseline: str, samples: Floats, reference: Any = np.nan, persistence: int = 8, **settings: Any) -> Statistics:
    """Run ``samples`` (n, channels) of one signal with a threshold of 1 through a baseline manager."""
    channels = samples.shape[1]
    params = np.zeros(1, PARAMS)
    fill(params[0], SignalConfig(threshold=1.0, persistence=persistence), (-1e6, 1e6), channels, False, 100.0)
    params = with_settings(params, baseline, Baselines.model_validate({baseline: settings}), ["x"])
    block = new_block(len(samples))
    block["channels"][:, 0] = np.nan
    block["channels"][:, 0, :channels], block["valid"][:, 0] = samples, 1
    block["ilm"][:, 0], block["reference"][:, 0], block["second_reference"][:, 0] = 2, reference, np.nan
    return statistics(nested(block), baseline, params)


def noise(n: int, channels: int = 4, seed: int = 1) -> Floats:
    return np.random.default_rng(seed).normal(0.0, 1.0, (n, channels))


@long_kernel
def run_lengths(u, limit, p, out):
    """Fill ``out`` with run lengths of one-sided sums over the stream u."""
    total, length, found = 0.0, 0, 0
    for k in range(len(u)):
        total, length = summed(total, u[k], limit, p), length + 1
        if total > limit:
            out[found], total, length, found = length, 0.0, 0, found + 1
            if found == len(out):
                return


def markov_run_length(shift: float, k: float, h: float, states: int = 400) -> float:
    """Brook and Evans 1972: the sum as a Markov chain of so many states, with cells of equal width and 0 a half."""
    width = 2.0 * h / (2 * states - 1)
    at = np.arange(states) * width
    upper = stats.norm.cdf(at[None, :] + 0.5 * width - at[:, None] + k - shift)
    stay = np.diff(upper, axis=1, prepend=0.0)
    return float(np.linalg.solve(np.eye(states) - stay, np.ones(states))[0])


@pytest.mark.parametrize(("shift", "k", "h"), [(0.0, 0.5, 4.0), (0.0, 0.25, 6.0), (1.0, 0.5, 5.0)])
def test_the_run_length_of_an_unbounded_cusum_is_that_of_theory(shift: float, k: float, h: float):
    p = extended(np.zeros(1, PARAMS), BASELINE_PARAMS)
    p["allowance"], p["bounded"] = k, 0
    lengths = np.zeros(6000)
    run_lengths(np.random.default_rng(3).normal(shift, 1.0, 3_000_000), h, p[0], lengths)
    assert (lengths > 0).all()
    theory = markov_run_length(shift, k, h)
    assert lengths.mean() == pytest.approx(theory, abs=4.0 * lengths.std() / math.sqrt(len(lengths)))
    drift, b = shift - k, h + 1.166  # Siegmund 1985, with the correction for the excess over the boundary
    assert (math.exp(-2 * drift * b) + 2 * drift * b - 1) / (2 * drift**2) == pytest.approx(theory, rel=0.06)


def test_the_sums_of_the_cusum_are_those_of_its_definition():
    samples = noise(300) * 0.1 + [0, 0, 0, 0.3]
    r = samples - np.median(samples, axis=1)[:, None]
    for bounded in (True, False):
        found = watch("cusum", samples, bounded=bounded, spread=0.1, allowance=0.15, limit=12.0)
        up, down = np.zeros(4), np.zeros(4)
        for k, u in enumerate(r / 0.1):
            most = 12.0 / 8 if bounded else np.inf
            up = np.maximum(up + np.minimum(u - 1.5, most), 0.0)
            down = np.maximum(down + np.minimum(-u - 1.5, most), 0.0)
            assert found.statistic[k, 0] == pytest.approx(np.maximum(up, down), abs=1e-9)
            assert found.alarm[k, 0] == (max(up.max(), down.max()) > 12.0)
        assert found.alarm.any()


def test_the_sums_of_the_innovation_are_those_of_its_definition():
    samples = noise(200) * 0.1 + [0, 0, 0.4, 0]
    found = watch("innovation", samples, reference=0.05, spread=0.1, allowance=0.2, limit=16.0)
    sums = np.zeros(4)
    for k, x in enumerate(samples):
        far = np.abs(x - 0.05)
        if k:  # there is no reference in the first frame
            sums = np.maximum(sums + np.minimum((far - far.min()) / 0.1 - 2.0, 2.0), 0.0)
        assert found.statistic[k, 0] == pytest.approx(sums, abs=1e-9)
    assert found.alarm.any()


@pytest.mark.parametrize(("bounded", "window"), [(False, 100), (True, 100), (False, 20)])
def test_the_likelihood_ratio_is_the_largest_over_all_onsets(bounded: bool, window: int):
    samples = noise(160) * 0.3
    samples[100:, 1] += np.linspace(0, 2, 60)
    samples[60:, 2] -= 0.4
    found = watch("glr", samples, bounded=bounded, window=window, rms=0.3, limit=40.0)
    u = (samples - np.median(samples, axis=1)[:, None]) / 0.3
    u = np.clip(u, -math.sqrt(10.0), math.sqrt(10.0)) if bounded else u
    for k in (0, 5, 50, 99, 100, 130, 159):
        for c in range(4):
            best = 0.0
            for onset in range(max(0, k + 1 - window), k + 1):
                y = u[onset : k + 1, c]
                for shape in (np.ones(len(y)), np.arange(1.0, len(y) + 1)):
                    amplitude = (y @ shape) / (shape @ shape)
                    best = max(best, 0.5 * (y @ y - ((y - amplitude * shape) ** 2).sum()))
            assert found.statistic[k, 0, c] == pytest.approx(best, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("channels", [4, 3, 2])
def test_the_parity_vector_of_white_samples_is_chi_square_with_a_channel_less(channels: int):
    limit, n = 3.0, 40_000
    found = watch("parity", noise(n, channels), bounded=False, limit=limit)
    expected = stats.chi2.sf(limit, channels - 1)
    assert found.alarm.mean() == pytest.approx(expected, abs=4 * math.sqrt(expected * (1 - expected) / n))


@pytest.mark.parametrize("channels", [4, 3, 2])
def test_what_each_channel_has_of_the_parity_vector_is_that_of_an_orthonormal_basis(channels: int):
    samples = noise(20, channels)
    v = linalg.null_space(np.ones((1, channels))).T  # V V' = I, V H = 0
    p = samples @ v.T
    expected = (p @ v) ** 2 / (v**2).sum(axis=0)
    assert watch("parity", samples).statistic[:, 0, :channels] == pytest.approx(expected, rel=1e-9)


def posterior_odds(x: Floats, noises: Floats, priors: Floats, told: dict[str, float]) -> Floats:
    """Log odds that each member is faulty, by adding up all paths of sets; x : (frames, members).

    At most one member turns faulty in a frame.  The quantity is flat in every frame: what is left of it are the
    differences to the first member, whose joint distribution over all frames is normal.
    noises : (2, members) variances, healthy and faulty; priors : (members,) variances of a healthy constant
    """
    frames, members = x.shape
    onset = told["onset"]
    joint: Any = stats.multivariate_normal
    differences = np.kron(np.eye(frames), np.hstack([-np.ones((members - 1, 1)), np.eye(members - 1)]))
    faulty, healthy = np.zeros(members), np.zeros(members)
    for begins in itertools.product(range(frames + 1), repeat=members):  # frames: never
        first = [b for b in begins if b < frames]
        if len(set(first)) < len(first):
            continue
        weight = onset ** len(first)
        for t in range(frames):
            if t not in first:
                weight *= (1 - onset) ** sum(b > t for b in begins)
        cov = np.zeros((frames, members, frames, members))
        for i, b in enumerate(begins):
            for s, t in itertools.product(range(frames), repeat=2):
                common = min(s, t) - b + 1
                walked = told["jump"] + told["walk"] * common if common > 0 else 0.0
                cov[s, i, t, i] = priors[i] + walked + (noises[int(t >= b), i] if s == t else 0.0)
        d = differences @ cov.reshape(frames * members, -1) @ differences.T
        weight *= joint(np.zeros(len(d)), d).pdf(differences @ x.ravel())
        for i, b in enumerate(begins):
            (faulty if b < frames else healthy)[i] += weight
    return np.log(faulty / healthy)


CHANNELS_ONLY = np.array([[0.0, 0.1, -0.1], [0.2, 0.0, 0.6], [0.1, -0.2, 0.9], [0.1, 0.0, 1.2]])


def odds_of_both(samples: Floats, **told: float) -> tuple[Floats, Floats]:
    """Log odds of the channels after the last frame: of the baseline manager, and of the brute force."""
    settings: dict[str, Any] = {"bias": 0.0, "jump": 0.0, "walk": 0.0, "onset_per_frame": 1e-4, **told}
    found = watch("bayes", samples, bounded=False, spread=0.1, noise=2.0, fault_noise=8.0, **settings)
    squares = {
        "onset": 1e-4,
        "jump": (settings["jump"] * settings["bias"]) ** 2,
        "walk": (settings["walk"] * 0.1) ** 2,
    }
    noises = np.repeat([[0.2**2], [0.8**2]], samples.shape[1], axis=1)
    priors = np.full(samples.shape[1], (settings["bias"] / 3) ** 2)
    return found.statistic[-1, 0, : samples.shape[1]], posterior_odds(samples, noises, priors, squares)


def test_without_memory_the_posterior_is_that_of_brute_force():
    found, expected = odds_of_both(CHANNELS_ONLY)
    assert found == pytest.approx(expected, abs=1e-3)  # members that never read, the reference, may fail too
    assert expected[2] > 0 > expected[0]


def test_with_constants_and_jumps_a_first_frame_is_that_of_brute_force():
    found, expected = odds_of_both(np.array([[0.0, 0.1, 1.5]]), bias=0.6, jump=2.0, walk=0.5)
    assert found == pytest.approx(expected, abs=1e-3)


def test_over_frames_the_posterior_stays_near_that_of_brute_force():
    """What is left out of the estimates, their correlation, costs less than a unit of the log odds; the limit is 10."""
    found, expected = odds_of_both(CHANNELS_ONLY, bias=0.3, jump=2.0, walk=0.5)
    assert found == pytest.approx(expected, abs=1.0)


@pytest.mark.parametrize(
    "baseline", [kind.name for kind in KINDS if kind.settings is not None and kind.settings.levels]
)
def test_a_manager_that_only_watches_fails_no_channel(baseline: str):
    samples = noise(60) * 0.02
    samples[20:, 3] += 5.0
    found = watch(baseline, samples, reference=0.0)
    assert found.alarm[-1, 0] == 1 and found.alarm[:20].sum() == 0
    assert found.statistic[-1, 0].argmax() == 3


def test_the_weights_are_those_of_the_formula():
    samples = noise(30)
    found = watch("weighted", samples, scale=0.7)
    for x, got in zip(samples, found.statistic[:, 0], strict=True):
        apart = ((x[:, None] - x[None, :]) / 0.7) ** 2
        np.fill_diagonal(apart, 1.0)
        assert got == pytest.approx(1.0 / (1.0 + apart.prod(axis=1)), rel=1e-9)
