"""Random settings and rows that reach every rule of the redundancy manager, voted by the compiled kernels.

Everything comes in episodes of some frames, as a fault does: independent numbers in each frame would never persist.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.computer.redundancy.discrete import DiscreteVoter, vote_discretes
from rig.computer.redundancy.discrete_config import DISCRETE_PARAMS
from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.managers import Manager, vote_signals
from rig.core.frame import CHANNELS, Block, D, Ilm, S, nested, new_block
from rig.core.kernels import kernel
from rig.core.units.constants import TWO_PI

# In thresholds: how far a channel is from the truth.  Most often it is healthy, or where another one is too.
OFFSETS = np.array([0.0] * 12 + [3.0] * 5 + [-3.0, 6.0, -9.0, 0.8, 1e4])
FLAGS = np.array([Ilm.GOOD, Ilm.GOOD, Ilm.BAD, Ilm.BAD, Ilm.ABSENT, Ilm.ABSENT, 3, 255])
MAGNITUDES = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, 1.7e308, -1.7e308, 5e-324, -0.0])
HUGE = 1.7e308
NARROW = -4.0  # thresholds below the middle, of a range that ends one above
BOXES: list[Callable[[Generator], NDArray[Any]]] = [
    lambda draw: np.ones(S, int),
    lambda draw: draw.integers(1, 4, S),
    lambda draw: draw.integers(0, 17, S),
]


def random_params(draw: Generator) -> NDArray[Any]:
    """PARAMS records with short persistences; a third of the signals are angles."""
    params = np.zeros(S, PARAMS)
    for name, low, high in (
        *(("persistence", 1, 7), ("split_persistence", 1, 9), ("trend_frames", 1, 9), ("readmit_frames", 1, 12)),
        *(("fade_frames", 0, 5), ("common_persistence", 1, 6), ("common_fails", 0, 2), ("weighted", 0, 2)),
    ):
        params[name] = draw.integers(low, high, S)
    params["fitted"] = draw.choice([4, 4, 4, 3, 2, 1], S)
    params["threshold"] = draw.choice([0.25, 0.1, 1e-3, 40.0], S)
    params["reference_threshold"] = params["threshold"] * draw.choice([0.7, 1.0, 2.0], S)
    params["second_threshold"] = params["threshold"] * draw.choice([0.7, 1.0, 2.0], S)
    params["reference_airspeed_m_s"] = params["reference_threshold"] * draw.choice([0.0, 0.0, 0.3, 1.0], S)
    params["low"], params["high"] = -2e3 * params["threshold"], 2e3 * params["threshold"]
    angle = draw.random(S) < 0.34
    params["wraps"][angle], params["threshold"][angle] = 1, 0.1
    params["low"][angle] = draw.choice([0.0, -np.pi], angle.sum())
    params["high"][angle] = params["low"][angle] + TWO_PI
    levels = draw.choice([1.0, 1.0, 0.6, 1.7, 3.1], (2, S))
    params["threshold_triplex"], params["threshold_duplex"] = params["threshold"] * levels
    params["filter_gain"] = draw.choice([0.0, 0.0, 0.1, 0.5, 0.95], S)
    narrow = ~angle & (draw.random(S) < 0.25)  # samples and references meet the stops
    params["low"][narrow], params["high"][narrow] = NARROW * params["threshold"][narrow], params["threshold"][narrow]
    _give_slow_faults(draw, params)
    _give_rules(draw, params)
    for row in params:
        chosen = draw.permutation(5)[: draw.integers(0, 6)] + 1
        row["tie_break"][: len(chosen)] = chosen
    return params


def _give_slow_faults(draw: Generator, params: NDArray[Any]) -> None:
    """Sums and stale samples, each on in half of the signals."""
    params["slow_allowance"] = params["threshold"] * draw.choice([0.05, 0.2, 0.5], S)
    params["slow_limit"] = params["threshold"] * draw.choice([0.0, 0.0, 0.5, 2.0], S)
    params["stale_frames"] = draw.choice([0, 0, 2, 9], S)


def _give_rules(draw: Generator, params: NDArray[Any]) -> None:
    """What version 3 of a unit's records tells: splits, counts, references that read each other, boxes."""
    params["count_down"] = draw.choice([0.0, 0.0, 0.0, 0.3, 1.0], S)
    params["unresolved_frames"] = draw.choice([0, 0, 9, 14], S)
    params["trend_small"] = np.where(draw.random(S) < 0.5, params["threshold"] * draw.choice([0.1, 0.5, 2.0], S), -1.0)
    for name, share in (("trend_tumbles", 0.3), ("trend_beside_reference", 0.3), ("referred", 0.4)):
        params[name] = draw.random(S) < share
    telling = 1 << np.arange(6)
    params["tells"][:6] = np.where(draw.random(6) < 0.6, telling, 0)
    params["sources"] = draw.choice([0, *telling, *[0b111111] * 6], S)
    params["box"] = BOXES[draw.integers(len(BOXES))](draw)


# Slow-fault tests, which learn for seconds before they isolate ----------------------------------------------

SIGMA = 0.02  # thresholds: noise of a healthy channel
SMALL = np.array([0.0] * 30 + [0.1, -0.1, 0.2, -0.4])  # thresholds, of a channel, or of two at once
NOISY = np.array([1.0] * 40 + [6.0])  # times the noise
AWAY = np.array([0.0] * 60 + [4.0])  # thresholds, which the comparison finds


def give_slow_tests(draw: Generator, params: NDArray[Any]) -> None:
    """Slow-fault tests on all signals."""
    threshold = params["threshold"]
    for name, choices in (("slow_means", [1.0, 1.3]), ("slow_squares", [1.0, 1.7]), ("slow_halves", [1.0, 1.0, 2.0])):
        params[name] = draw.choice(choices, S)
    params["slow_bias"], params["slow_scale"] = threshold * draw.choice([0.05, 0.3], S), draw.choice([0.0, 0.01], S)
    params["slow_noise"], params["slow_skew"] = 0.5 * SIGMA * threshold, draw.choice([0.0, 0.5], S)
    params["slow_reference"] = SIGMA * threshold * draw.choice([0.0, 0.5, 2.0, 2.0], S)
    params["slow_reference_frames"] = draw.choice([0.0, 1.0], S)


def slow_rows(draw: Generator, params: NDArray[Any], frames: int, hostile: bool = False) -> Block:
    """Rows of noise and small biases, with rare small faults of a channel or of two, and rarer large ones."""
    rows, threshold = new_block(frames), params["threshold"]
    moving = episodes(draw, frames, (S,), np.array([-0.02, 0.0, 0.0, 0.0, 0.02]), 200.0)
    truth = 0.5 * (params["low"] + params["high"]) + threshold * np.cumsum(moving, axis=0)
    shape = (frames, S, CHANNELS)
    pair = draw.random((S, 3))
    member = (np.arange(CHANNELS) == 0) | (np.arange(CHANNELS) == 1 + pair.argmax(axis=1)[:, None])
    channels = SIGMA * episodes(draw, frames, shape[1:], NOISY, 300.0) * draw.standard_normal(shape)
    channels += draw.uniform(-0.04, 0.04, shape[1:]) + episodes(draw, frames, shape[1:], SMALL, 300.0)
    channels += episodes(draw, frames, (S, 1), SMALL, 300.0) * member
    channels += episodes(draw, frames, shape[1:], AWAY, 300.0)
    channels = truth[..., None] + threshold[:, None] * channels
    channels[draw.random(shape) < 5e-4] = np.nan
    if hostile:
        wild = draw.random(shape) < 1e-3
        channels[wild] = draw.choice(MAGNITUDES, wild.sum())
    rows["channels"], rows["valid"] = _on_the_circle(channels, params), 1
    rows["ilm"] = Ilm.ABSENT
    off = draw.uniform(-0.2, 0.2, S) + 0.2 * SIGMA * draw.standard_normal((frames, S))
    rows["reference"] = _on_the_circle(truth + threshold * np.where(draw.random(S) < 0.8, off, np.nan), params)
    rows["second_reference"] = np.nan
    rows["reset"] = np.where(draw.random((frames, S)) < 0.02, draw.integers(0, 256, (frames, S)), 0)
    random_discrete_rows(draw, rows)
    return rows


def random_discretes(draw: Generator) -> NDArray[Any]:
    """DISCRETE_PARAMS records with short persistences."""
    params = np.zeros(D, DISCRETE_PARAMS)
    params["fitted"], params["fail_safe"] = draw.integers(2, 5, D), draw.integers(0, 2, D)
    params["persistence"], params["readmit_frames"] = draw.integers(1, 8, D), draw.integers(1, 12, D)
    return params


def episodes(
    draw: Generator, frames: int, shape: tuple[int, ...], choices: NDArray[Any], length: float
) -> NDArray[Any]:
    """(frames, *shape) numbers from ``choices``, each for ``length`` frames on the average."""
    fresh = draw.choice(choices, (frames, *shape))
    changes = draw.random((frames, *shape)) < 1.0 / length
    changes[0] = True
    since = np.maximum.accumulate(np.where(changes, np.arange(frames).reshape(-1, *[1] * len(shape)), 0), axis=0)
    return np.take_along_axis(fresh, since, axis=0)


def random_rows(draw: Generator, params: NDArray[Any], frames: int, hostile: bool = False) -> Block:
    """Rows with channels, monitors, references and resets.  ``hostile``: numbers near the largest ones too."""
    rows = new_block(frames)
    threshold, middle = params["threshold"], 0.5 * (params["low"] + params["high"])
    moving = episodes(draw, frames, (S,), np.array([-0.4, 0.0, 0.0, 0.4]), 15.0)
    noise = 0.2 * episodes(draw, frames, (S,), np.array([0.0, 1.0, 1.0, 3.0]), 40.0)
    truth = middle + threshold * np.cumsum(moving, axis=0)
    channels = episodes(draw, frames, (S, CHANNELS), OFFSETS, 60.0)
    channels += noise[..., None] * draw.standard_normal(channels.shape)
    common = episodes(draw, frames, (S,), np.array([0.0, 0.0, 0.0, 5.0]), 60.0)
    channels = truth[..., None] + threshold[:, None] * (channels + common[..., None])
    dead = episodes(draw, frames, (1, CHANNELS), np.array([0] * 12 + [1]), 25.0) == 1  # a box, on most signals
    dead = dead & (draw.random((S, 1)) < 0.8)
    sick = episodes(draw, frames, channels.shape[1:], np.arange(60), 8.0)
    channels[dead | (sick == 0)] = np.nan
    grid = np.where(draw.random(S) < 0.4, threshold / 2.0, 0.0)  # so that distances are exactly a threshold
    channels = _at_stops(_on_the_circle(_rounded(channels, grid[:, None]), params), params, sick)
    stuck = episodes(draw, frames, channels.shape[1:], np.arange(20) == 0, 12.0)
    since = np.maximum.accumulate(np.where(stuck, 0, np.arange(frames)[:, None, None]), axis=0)
    rows["channels"] = np.take_along_axis(channels, since, axis=0)
    if hostile:
        wild = sick == 1
        rows["channels"][wild] = draw.choice(MAGNITUDES, wild.sum())
    rows["valid"] = sick != 2
    rows["ilm"] = episodes(draw, frames, (S, CHANNELS), FLAGS, 25.0)
    rows["reset"] = np.where(draw.random((frames, S)) < 0.15, draw.integers(0, 256, (frames, S)), 0)
    for name in ("reference", "second_reference"):
        off = episodes(draw, frames, (S,), np.array([0.0, 0.0, 0.0, 0.5, 2.0, 3.0, np.nan, np.inf]), 40.0)
        rows[name] = _on_the_circle(_rounded(truth + threshold * off, grid), params)
        if hostile:
            wild = draw.random((frames, S)) < 0.05
            rows[name][wild] = draw.choice(MAGNITUDES, wild.sum())
    random_discrete_rows(draw, rows)
    return rows


def _rounded(values: NDArray[np.float64], grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """``values`` at multiples of ``grid`` where that is not zero."""
    step = np.where(grid > 0.0, grid, 1.0)
    return np.where(grid > 0.0, np.round(values / step) * step, values)


def _on_the_circle(values: NDArray[np.float64], params: NDArray[Any]) -> NDArray[np.float64]:
    """The same with angles in their ranges."""
    shape = (S,) + (1,) * (values.ndim - 2)
    low = params["low"].reshape(shape)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.where(params["wraps"].reshape(shape) != 0, (values - low) % TWO_PI + low, values)


def _at_stops(channels: NDArray[Any], params: NDArray[Any], sick: NDArray[Any]) -> NDArray[np.float64]:
    """The same of sensors with a narrow range saturated, but where they are out of it by a fault."""
    low, high = params["low"][:, None], params["high"][:, None]
    narrow = (params["wraps"] == 0) & (params["low"] == NARROW * params["threshold"])
    return np.where(narrow[:, None] & (sick != 3), np.clip(channels, low, high), channels)


def random_discrete_rows(draw: Generator, rows: Block) -> None:
    """The discretes of ``rows``."""
    frames = len(rows)
    truth = episodes(draw, frames, (D, 1), np.array([0, 1]), 60.0)
    wrong = episodes(draw, frames, (D, CHANNELS), np.array([0, 0, 0, 1]), 12.0)
    rows["discrete_channels"] = np.where(wrong == 1, 1 - truth, truth)
    rows["discrete_channels"] *= draw.choice(np.array([1, 1, 7], "u1"), rows["discrete_channels"].shape)
    rows["discrete_valid"] = episodes(draw, frames, (D, CHANNELS), np.array([1, 1, 1, 1, 0]), 8.0)
    rows["discrete_ilm"] = episodes(draw, frames, (D, CHANNELS), FLAGS, 8.0)
    rows["discrete_reset"] = np.where(draw.random((frames, D)) < 0.1, draw.integers(0, 256, (frames, D)), 0)


def vote(
    rows: Block, params: NDArray[Any], discretes: NDArray[Any], box_signals: int | None, box_persistence: int
) -> Manager:
    """Vote every row with the kernels; the manager that did."""
    manager = Manager("cross-channel", params, box_signals=box_signals, box_persistence=box_persistence)
    voter = DiscreteVoter(discretes)
    vote_all(nested(rows), manager.data, voter.data)
    return manager


@kernel
def vote_all(rows, signals, discretes):
    """All rows through manager and voter; rows : FRAME records."""
    for k in range(len(rows)):
        vote_signals(rows[k]["bus"], rows[k]["fcc"], signals)
        vote_discretes(rows[k]["bus"], rows[k]["fcc"], discretes)
