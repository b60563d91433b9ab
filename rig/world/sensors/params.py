"""Settings and seed as the arrays of the kernel: what is fixed for a flight."""

from __future__ import annotations

from math import cos, exp, floor, pi, sin, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, SIGNALS, S, sig
from rig.core.kept import kept
from rig.core.settings import Settings
from rig.world.sensors.data_sheet import ACCELEROMETERS, GYROS, Sensor

MOST_SHARES: Final = 5  # a gyro's: two other axes, three load factors
PARAMS: Final = np.dtype(
    [
        ("bias", "f8", (CHANNELS,)),
        ("gain", "f8", (CHANNELS,)),  # 1 + scale error
        ("skew", "f8", (CHANNELS,)),  # frames
        ("noise_std", "f8"),
        ("blend", "f8"),  # share of a new sample that passes the lag in one frame
        ("quantum", "f8"),
        ("low", "f8"),
        ("high", "f8"),
        ("wraps", "u1"),
        ("channels", "u1"),
        ("filtered", "u1"),  # low pass or latency
        ("low_pass", "u1"),
        ("delayed", "u1"),
        ("alarms", "u1"),  # its in-line monitors may raise false ones
        ("drifts", "u1"),  # a process of draws.py is added
        ("shares", "u1"),  # how many other signals have a cross-axis effect
        ("source", "i8", (MOST_SHARES,)),  # which
        ("share", "f8", (MOST_SHARES, CHANNELS)),  # and how much of their truth
        ("transition", "f8", (4,)),  # of the low pass, row by row
        ("delay", "i8"),  # whole frames, and what is over
        ("delay_rest", "f8"),
    ],
    align=True,
)


def fixed(suite: Settings, rate_hz: float, seeds: dict[str, SeedSequence]) -> NDArray[np.void]:
    """Return the (S,) PARAMS records; every channel's errors are drawn whether it is fitted or not."""
    params = _of_all_seeds(suite, rate_hz).copy()
    draws = np.random.default_rng(seeds["calibration"]).uniform(-1.0, 1.0, (S, 3, CHANNELS))
    calibrate(params, _tolerances(suite), draws.swapaxes(0, 1))
    _cross_axis(
        params, suite, np.random.default_rng(seeds["misalignment"]), np.random.default_rng(seeds["g_sensitivity"])
    )
    return params


@kept
def _of_all_seeds(suite: Settings, rate_hz: float) -> NDArray[np.void]:
    """Return the (S,) PARAMS records without what is drawn."""
    params = np.zeros(S, PARAMS)
    for signal, row in zip(SIGNALS, params, strict=True):
        sensor = getattr(suite, signal.name)
        row["noise_std"] = sensor.sample_noise_std(rate_hz)
        row["blend"] = 1.0 if sensor.lag_s == 0 else 1.0 - exp(-1.0 / (rate_hz * sensor.lag_s))
        row["quantum"] = sensor.quantum
        row["low"], row["high"] = sensor.limits(signal)
        row["alarms"] = sensor.monitor is not None and sensor.monitor.false_alarm_per_hour > 0
        row["wraps"], row["channels"] = signal.wraps, sensor.channels
        _dynamics(row, sensor, rate_hz)
    return params


class Tolerances(NamedTuple):
    """The tolerances by which channels differ, (S, 1) each; as a Sensor has them of one signal."""

    bias_tolerance: NDArray[np.float64]
    scale_tolerance: NDArray[np.float64]
    skew_frames: NDArray[np.float64]


@kept
def _tolerances(suite: Settings) -> Tolerances:
    sensors = [getattr(suite, signal.name) for signal in SIGNALS]
    return Tolerances(*(np.array([[float(getattr(of, name))] for of in sensors]) for name in Tolerances._fields))


def calibrate(rows: Any, sensor: Sensor | Tolerances, draw: NDArray[np.float64]) -> None:
    """Write what differs from channel to channel; draw (3, ..., 4) within -1 to 1, for PARAMS of shape (...)."""
    rows["bias"] = sensor.bias_tolerance * draw[0]
    rows["gain"] = 1.0 + sensor.scale_tolerance * draw[1]
    rows["skew"] = sensor.skew_frames * (draw[2] + 1.0) / 2.0


def _dynamics(row: Any, sensor: Sensor, rate_hz: float) -> None:
    """Write low pass and latency."""
    row["filtered"] = sensor.bandwidth_hz > 0 or sensor.latency_s > 0
    row["low_pass"] = sensor.bandwidth_hz > 0
    if sensor.bandwidth_hz > 0:
        omega = natural_frequency(sensor.bandwidth_hz, sensor.damping)
        row["transition"] = transition(omega, sensor.damping, 1.0 / rate_hz).ravel()
    frames = round(sensor.latency_s * rate_hz, 9)  # 0.03 s at 100 Hz is 3 frames, rounding apart
    row["delayed"], row["delay"], row["delay_rest"] = frames > 0, floor(frames), frames - floor(frames)


def _cross_axis(params: NDArray[np.void], suite: Settings, turn: Generator, push: Generator) -> None:
    """Draw each channel's cross-axis sensitivities."""
    turns, pushes = turn.uniform(-1.0, 1.0, (S, 2, CHANNELS)), push.uniform(-1.0, 1.0, (S, 3, CHANNELS))
    for s, signal in enumerate(SIGNALS):
        sensor = getattr(suite, signal.name)
        for triad in (GYROS, ACCELEROMETERS):
            if sensor.misalignment_tolerance_rad > 0 and s in triad:
                others = [t for t in triad if t != s]
                _share(params[s], others, sensor.misalignment_tolerance_rad * turns[s])
        if sensor.g_sensitivity_tolerance > 0:
            _share(params[s], ACCELEROMETERS, sensor.g_sensitivity_tolerance * pushes[s])
        if sensor.position_error_per_rad != 0 or sensor.position_error_per_pa != 0:
            error = np.array([[sensor.position_error_per_rad], [sensor.position_error_per_pa]])
            _share(params[s], [sig.ALPHA, sig.Q_BAR], np.repeat(error, CHANNELS, axis=1))


def _share(row: Any, sources: Any, shares: NDArray[np.float64]) -> None:
    """Add ``shares`` (n, 4) of ``sources`` (n,) to the cross-axis error of a signal."""
    first, last = int(row["shares"]), int(row["shares"]) + len(sources)
    row["source"][first:last], row["share"][first:last] = sources, shares
    row["shares"] = last


def transition(omega: float, damping: float, dt: float) -> NDArray[np.float64]:
    """Return the (2, 2) step of (x, x') of x'' + 2 damping omega x' + omega^2 x = 0 over ``dt`` s, exactly."""
    decay = damping * omega
    inside = 1.0 - damping**2
    if inside > 0:
        turn = omega * sqrt(inside)
        even, odd = exp(-decay * dt) * cos(turn * dt), exp(-decay * dt) * sin(turn * dt) / turn
    elif inside < 0:
        split = omega * sqrt(-inside)
        slow, fast = exp((split - decay) * dt), exp((-split - decay) * dt)
        even, odd = (slow + fast) / 2, (slow - fast) / (2 * split)
    else:
        even, odd = exp(-decay * dt), exp(-decay * dt) * dt
    return np.array([[even + decay * odd, odd], [-(omega**2) * odd, even - decay * odd]])


def natural_frequency(bandwidth_hz: float, damping: float) -> float:
    """Return the rad/s of the low pass whose gain has fallen to 1/sqrt(2) at ``bandwidth_hz``."""
    inside = 1.0 - 2.0 * damping**2
    return 2.0 * pi * bandwidth_hz / sqrt(inside + sqrt(inside**2 + 1.0))
