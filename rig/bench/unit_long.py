"""Long sessions for the conformance test of a unit: faults that need thousands of frames.

Examples are counters of eight and sixteen bits, cleared memories, a lost fade or lost weights, a second reference
that is ignored after a while.  The inputs are drawn from seeds, with no setting at its default.  The answers are those
of the built-in manager; tests compare them with the independent implementation on the same inputs.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, SURFACES, D, DecidedBy, Ilm, S
from rig.core.units.constants import TWO_PI
from rig.unit.unit_records import CONFIG, INPUT, MORE_THAN_HALF, TO_UNIT, Kind, Role, blank

RATE_HZ: Final = 100.0
FRAMES: Final = 5000
MOST_FRAMES: Final = 70_000  # more than a counter of sixteen bits has
TITLES: Final = (
    "long session, short memories",
    "long session, counts beyond eight bits",
    "long session, boxes and angles",
    "long session, slow faults",
    "long session, splits and disputes",
    "long session, slow-fault tests",
)
# Of them: with sums and stale samples; with splits; with slow-fault tests.
SLOW_FAULTS, SPLITS, SLOW_TESTS = 3, 4, 5
_HERE: Final = np.array([0.0] * 14 + [0.25, -0.25])  # offsets in thresholds: of a healthy channel,
_GONE: Final = np.array([3.0, -3.0, 6.0, -6.0, 9.5, np.nan])  # and of one with a fault
_OFF: Final = np.array([0.0] * 6 + [0.5, 3.0, -3.0, np.nan, np.nan])  # of a reference
# Offsets of all four channels in thresholds: together, also where a held vote may be; two against two, and apart.
_TOGETHER: Final = np.outer([0] * 40 + [-4, -2, 2, 2, 4, 4, 8], np.ones(CHANNELS))
_APART: Final = np.array([[0, 0, 4, 4], [4, 0, 0, 4], [4, 0, 4, 0], [0, 4, 8, -4], [8, 0, -4, 4], [0, -8, 4, -4]])
_SPLIT: Final = np.concatenate([_TOGETHER, _APART])
_STOPS: Final = (-3.0, 2.5)  # thresholds, of a signal whose samples and references meet the ends of the range
_SLOPES: Final = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.125, -0.125, 0.375])  # thresholds a frame, there and back
_NOISE: Final = 0.0207  # thresholds, of a healthy channel where slow faults are tested
_WORD: Final = 1 << 16
_BUMP: Final = 24  # frames there, and as many back: at rest a signal that is lost finds its held vote again


def inputs_of(number: int, frames: int = FRAMES) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return CONFIG (1,) and INPUT (frames,) of a long session; number : of TITLES."""
    draw = np.random.default_rng((number, 3))
    config, inputs = _config(draw, number), blank(INPUT, TO_UNIT, Kind.FRAME).repeat(frames)
    inputs["frame"], rare = np.arange(frames), (70, 24, 90, 90, 60, 90)[number]
    inputs["time_s"] = inputs["frame"] / RATE_HZ
    for i, row in enumerate(config["signal"][0]):
        _give_signal(draw, inputs, i, row, rare, splits=number == SPLITS)
        if number == SLOW_FAULTS:
            _give_slow_faults(draw, inputs, i, row, config["slow_faults"][0, i])
        if number == SLOW_TESTS:
            _give_small_faults(draw, inputs, i, row)
    _give_discretes(draw, inputs)
    _give_patience(inputs, config["signal"][0, -1], (_WORD, 1000, *[256] * 4)[number])
    return config, inputs


def _config(draw: Generator, number: int) -> NDArray[Any]:
    """Return settings, none at its default; counts beyond eight bits except in the first session."""
    config = blank(CONFIG, TO_UNIT, Kind.CONFIG)
    config["rate_hz"], config["role"] = RATE_HZ, Role.REDUNDANCY
    boxes = ((0, 1), (3, 12), (MORE_THAN_HALF, 20), (0, 1), (MORE_THAN_HALF, 9), (MORE_THAN_HALF, 9))
    config["box_signals"], config["box_persistence"] = boxes[number]
    config["surface_low"], config["surface_high"] = -0.5, [*[0.5] * (len(SURFACES) - 1), 1.0]
    signal, counts = config["signal"][0], (1, 40, 7, 3, 1, 1)[number]
    beside = 1.0 / 1024  # no distance is exactly a threshold, where rounding would decide
    for name, low, high in (("persistence", 3, 9), ("split_persistence", 4, 12), ("fade_frames", 3, 9)):
        signal[name] = draw.integers(low, high, S) * counts
    signal["common_persistence"] = draw.integers(4, 9, S) * counts
    signal["readmit_frames"] = draw.integers(60, 90, S) * draw.choice(([1], [4, 4, 15], [2], [1], [1], [1])[number], S)
    if number == SPLITS:
        signal["readmit_frames"] //= 8
    signal["trend_frames"], signal["weighted"] = draw.integers(1, 9, S), draw.random(S) < 0.7
    signal["common_fails"], signal["fitted"] = draw.random(S) < 0.5, draw.choice([4, 4, 4, 3], S)
    signal["threshold"] = 1.0 + beside
    for name in ("threshold_triplex", "threshold_duplex", "reference_threshold", "second_threshold"):
        signal[name] = draw.choice([0.75, 1.5, 2.0], S) + beside
    signal["low"], signal["high"] = -1e4, 1e4
    if number >= SLOW_FAULTS:
        signal["low"][::3], signal["high"][::3] = (stop * signal["threshold"][::3] for stop in _STOPS)
    signal["deviation"], signal["deviation_frames"] = 2.5, 500.0
    if number == 2:
        _turn(signal)
    if number >= 2:
        signal["filter_gain"][1::4] = draw.choice([0.1, 0.5])
    if number == SLOW_FAULTS:
        _last(config["slow_faults"][0], signal, draw)
    if number == SLOW_TESTS:
        _test(config[0]["slow_tests"], config[0]["slow_faults"], signal, draw)
    if number > 0:  # the first is of what every version of the records knows
        _rule(config["rules"][0], signal, draw, one_box=number == 1)
    else:
        config["rules"]["box"], config["rules"]["trend_small"] = 1, -1.0
    signal["readmit_frames"][-1] = 200  # of _give_patience
    for row in signal:
        order = draw.permutation([DecidedBy.ILM, DecidedBy.REFERENCE, DecidedBy.TREND])
        row["tie_break"] = [*order, *([DecidedBy.EXTREMES, DecidedBy.MIDDLE] if draw.random() < 0.7 else [0, 0])]
    discrete = config["discrete"][0]
    discrete["fitted"], discrete["fail_safe"] = draw.integers(3, 5, D), [1, 0, 1]
    discrete["persistence"], discrete["readmit_frames"] = 5 * counts, 60 * counts
    return config


def _turn(signal: NDArray[Any]) -> None:
    """Make half of the signals angles."""
    half = slice(0, S, 2)
    for name in (name for name in signal.dtype.names or () if "threshold" in name):
        signal[name][half] *= 0.02
    signal["wraps"][half], signal["low"][half], signal["high"][half] = 1, 0.0, TWO_PI


def _last(slow_faults: NDArray[Any], signal: NDArray[Any], draw: Generator) -> None:
    """Turn on slow faults, each part on most signals; the last signal is at rest, and may repeat its samples."""
    threshold = signal["threshold"]
    slow_faults["slow_allowance"] = 0.1003 * threshold
    slow_faults["slow_limit"] = threshold * draw.choice([0.0, 10.007, 30.007], S)
    slow_faults["stale_frames"] = draw.choice([0, 20, 300], S)
    slow_faults["stale_frames"][-1] = 0


def _test(slow_tests: NDArray[Any], slow_faults: NDArray[Any], signal: NDArray[Any], draw: Generator) -> None:
    """Turn on slow-fault tests on all signals, of most with a reference, of some with sums beside them."""
    for name in ("slow_means", "slow_squares", "slow_halves"):
        slow_tests[name] = draw.choice([1.0, 1.0, 1.3007], S)
    slow_tests["slow_bias"], slow_tests["slow_scale"] = draw.choice([0.0507, 0.3007], S), draw.choice([0.0, 0.0107], S)
    slow_tests["slow_noise"], slow_tests["slow_skew"] = 0.5 * _NOISE, draw.choice([0.0, 0.5007], S)
    slow_tests["slow_reference"] = _NOISE * draw.choice([0.0, 0.5007, 1.5007], S)
    slow_tests["slow_reference_frames"] = draw.choice([0.0, 1.007], S)
    for name in ("slow_bias", "slow_noise", "slow_reference"):
        slow_tests[name] *= signal["threshold"]
    slow_faults["slow_allowance"] = 0.0803 * signal["threshold"]
    slow_faults["slow_limit"] = signal["threshold"] * draw.choice([0.0, 0.0, 5.007], S)


def _rule(rules: NDArray[Any], signal: NDArray[Any], draw: Generator, one_box: bool) -> None:
    """Turn on the rules that signals share, and other rules of splits and counts, each on many signals."""
    rules["box"] = 1 if one_box else draw.integers(0, 4, S)
    telling = 1 << np.arange(S // 2)
    rules["tells"][: S // 2] = np.where(draw.random(S // 2) < 0.7, telling, 0)
    rules["sources"] = draw.choice([0, *telling], S) | draw.choice([0, *telling], S)
    rules["count_down"] = draw.choice([0.0, 0.0, 0.5, 1.0, 2.5], S)
    rules["unresolved_frames"] = draw.choice([0, 1, 2], S) * signal["split_persistence"]
    rules["trend_small"] = np.where(draw.random(S) < 0.4, 0.2507 * signal["threshold"], -1.0)
    for name in ("trend_tumbles", "trend_beside_reference", "referred"):
        rules[name] = draw.random(S) < 0.4


def _episodes(
    draw: Generator, frames: int, shape: tuple[int, ...], choices: NDArray[Any], length: float
) -> NDArray[Any]:
    """Return (frames, *shape) of ``choices``, each for ``length`` frames on the average."""
    fresh, changes = draw.choice(choices, (frames, *shape)), draw.random((frames, *shape)) < 1.0 / length
    changes[0] = True
    numbers = np.arange(frames).reshape(-1, *[1] * len(shape))
    since = np.maximum.accumulate(np.where(changes, numbers, 0), axis=0)
    return np.take_along_axis(fresh, since, axis=0)


def _give_signal(draw: Generator, inputs: NDArray[Any], i: int, row: NDArray[Any], rare: int, *, splits: bool) -> None:
    """Write the samples, monitors, references and resets of one signal; one channel of ``rare`` is wrong.

    splits : all channels are apart, or two against two, for some of the time
    """
    frames, threshold = len(inputs), float(row["threshold"])
    length = 1.2 * float(row["persistence"]) + 8.0
    bumps = np.repeat(draw.choice(_SLOPES, frames // (2 * _BUMP) + 1), 2 * _BUMP)[:frames]
    there = np.arange(frames) % (2 * _BUMP)
    truth = threshold * bumps * np.minimum(there, 2 * _BUMP - there)
    wrong = _episodes(draw, frames, (CHANNELS,), np.arange(rare), length) == 0
    all_off = _episodes(draw, frames, (), np.array([0.0] * (rare // 2) + [5.0]), length)
    here = _episodes(draw, frames, (CHANNELS,), _HERE, 25.0)
    gone = _episodes(draw, frames, (CHANNELS,), _GONE, length)
    if splits:
        length += float(row["split_persistence"])
        here += _SPLIT[_episodes(draw, frames, (), np.arange(len(_SPLIT)), length)]
    channels = truth[:, None] + threshold * (np.where(wrong, gone, here) + all_off[:, None])
    inputs["channels"][:, i] = _in_range(channels, row)
    inputs["valid"][:, i] = _episodes(draw, frames, (CHANNELS,), np.arange(3 * rare) != 0, 4.0)
    says = np.array([*[Ilm.ABSENT] * 3, *[Ilm.GOOD] * 3, Ilm.BAD])
    inputs["ilm"][:, i] = _episodes(draw, frames, (CHANNELS,), says, length)
    for name, beside in (("reference", 1 / 512), ("second_reference", 1 / 256)):
        off = _episodes(draw, frames, (), _OFF, 2.0 * length) + beside
        inputs[name][:, i] = _on_circle(truth + threshold * off, row)
    commanded = draw.random(frames) < 4.0 / float(row["readmit_frames"])
    inputs["reset"][:, i] = np.where(commanded, draw.integers(1, 16, frames), 0)


def _give_slow_faults(
    draw: Generator, inputs: NDArray[Any], i: int, row: NDArray[Any], slow_faults: NDArray[Any]
) -> None:
    """Make the samples of one signal dither, differ by biases, drift apart for a while, and stick."""
    frames, channels = len(inputs), inputs["channels"][:, i]
    each, numbers = (CHANNELS,), np.arange(frames)[:, None]
    biases = draw.choice([0.0, 0.125, 0.25, -0.375], CHANNELS)
    drifts = _episodes(draw, frames, each, np.array([0.0] * 12 + [0.5, -0.5]), 150.0)
    dither = draw.integers(-8, 9, channels.shape) / 1024.0
    channels = channels + float(row["threshold"]) * (biases + drifts + dither)
    stuck = _episodes(draw, frames, each, np.arange(25) == 0, 1.5 * float(slow_faults["stale_frames"]) + 20.0)
    since = np.maximum.accumulate(np.where(stuck, 0, numbers), axis=0)
    inputs["channels"][:, i] = _in_range(np.take_along_axis(channels, since, axis=0), row)
    inputs["valid"][:, i] = _episodes(draw, frames, each, np.arange(60) != 0, 2.0)  # gaps, which end no count


def _give_small_faults(draw: Generator, inputs: NDArray[Any], i: int, row: NDArray[Any]) -> None:
    """Make one signal noisy and slow; of its channels one, or two alike, are off by little, noisier or far off.

    Two alike also stand still at times, without noise: beside them the other two look noisy.  Where the truth stands
    still as well, their samples repeat.
    """
    frames, each, threshold = len(inputs), (CHANNELS,), float(row["threshold"])
    truth = threshold * 0.5 * np.sin(np.arange(frames) / draw.choice([150.25, 40.25, 1e18]))
    louder = _episodes(draw, frames, each, np.array([1.0] * 24 + [8.0]), 250.0)
    pair = np.isin(np.arange(CHANNELS), draw.permutation(CHANNELS)[:2])
    still = pair * _episodes(draw, frames, (1,), np.array([0.0, 0.0, 0.0, 1.0]), 1000.0)
    noise = louder * draw.standard_normal((frames, CHANNELS))
    channels = _NOISE * np.where(still, 0.02, noise) + draw.uniform(-0.05, 0.05, CHANNELS)
    channels += _episodes(draw, frames, each, np.array([0.0] * 50 + [0.1507, -0.2507]), 250.0)
    alike = _episodes(draw, frames, (1,), np.array([0.0, 0.0, 0.0, 0.1507, -0.2507]), 400.0)
    channels += alike * pair
    channels += 4.0 * (_episodes(draw, frames, each, np.arange(60), 40.0) == 0)
    channels += 5.0 * (_episodes(draw, frames, (1,), np.arange(60), 40.0) == 0)
    inputs["channels"][:, i] = _in_range(truth[:, None] + threshold * channels, row)
    inputs["valid"][:, i] = draw.random((frames, CHANNELS)) > 1e-3
    off = draw.choice([0.0, 0.2007]) + 0.2 * _NOISE * draw.standard_normal(frames)
    inputs["reference"][:, i] = truth + threshold * off
    inputs["second_reference"][:, i] = truth + threshold / 256


def _give_patience(inputs: NDArray[Any], row: NDArray[Any], frames: int) -> None:
    """Keep the last signal at rest: a channel fails, agrees for longer than ``frames``, and is then readmitted."""
    last, back = S - 1, 100 + 2 * int(row["persistence"])
    inputs["channels"][:, last], inputs["valid"][:, last], inputs["reset"][:, last] = 0.0, 1, 0
    inputs["channels"][100:back, last, 0] = 4.0 * float(row["threshold"])
    inputs["reset"][back + frames + int(row["readmit_frames"]) // 2 :, last] = 1


def _on_circle(values: NDArray[np.float64], row: NDArray[Any]) -> NDArray[np.float64]:
    """Return the same, angles on their circle."""
    low = float(row["low"])
    return (values - low) % TWO_PI + low if row["wraps"] else values


def _in_range(values: NDArray[np.float64], row: NDArray[Any]) -> NDArray[np.float64]:
    """Return the same, of a sensor that stays at its stops; angles on their circle."""
    return _on_circle(values, row) if row["wraps"] else np.clip(values, row["low"], row["high"])


def _give_discretes(draw: Generator, inputs: NDArray[Any]) -> None:
    frames, each = len(inputs), (D, CHANNELS)
    truth = _episodes(draw, frames, (D, 1), np.array([0, 1]), 90.0)
    wrong = _episodes(draw, frames, each, np.arange(40) == 0, 20.0)
    inputs["discrete_channels"] = truth ^ wrong
    inputs["discrete_valid"] = _episodes(draw, frames, each, np.array([1] * 20 + [0]), 20.0)
    says = np.array([*[Ilm.GOOD] * 8, Ilm.ABSENT, Ilm.ABSENT, Ilm.BAD])
    inputs["discrete_ilm"] = _episodes(draw, frames, each, says, 3.0)
    commanded = draw.random((frames, D)) < 0.01
    inputs["discrete_reset"] = np.where(commanded, draw.integers(1, 16, (frames, D)), 0)
