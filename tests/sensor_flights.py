"""Made-up flights of several inertial units: what each instance measures, with faults, in the formats of autopilots.

Motion is a sum of sines, so a delay is exact.  Every instance has gains, biases, misalignment, a delay, noise and
vibration of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from foreign_logs import IMU, IMU_UNITS, RosBag, dataflash, ulog
from numpy.typing import NDArray

Array = NDArray[np.float64]
GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class Kind:
    """How a flight is made."""

    seed: int = 1
    rate_hz: float = 50.0
    seconds: float = 60.0
    count: int = 3
    motion: float = 0.15  # rad/s, rms of each axis
    burst: float = 1.5  # rad/s, of manoeuvres
    noise: float = 0.01  # rad/s
    vibration: float = 0.05  # rad/s
    delays_s: tuple[float, ...] = ()  # beside those of a few milliseconds
    start_s: float = 100.0


@dataclass
class Flight:
    """gyro and accel (C, n, 3), rad/s and m/s^2, at time_s (C, n)."""

    kind: Kind
    time_s: Array
    gyro: Array
    accel: Array

    def copy(self) -> Flight:
        """A flight of which the samples can be changed."""
        return replace(self, gyro=self.gyro.copy(), accel=self.accel.copy())

    def since(self, c: int, share: float = 0.4) -> tuple[NDArray[np.bool_], Array]:
        """True from ``share`` of the flight on, and seconds since then."""
        onset = self.kind.start_s + share * self.kind.seconds
        return self.time_s[c] >= onset, np.maximum(self.time_s[c] - onset, 0.0)


def motion(kind: Kind) -> Callable[[Array], tuple[Array, Array]]:
    """The true rates and specific forces (n, 3) at given times."""
    rng = np.random.default_rng([kind.seed, 1])
    hz = rng.uniform(0.05, 2.0, (3, 12))
    size = kind.motion * np.sqrt(2 / 12) * rng.uniform(0.3, 1.7, (3, 12))
    phase = rng.uniform(0, 2 * np.pi, (6, 12))
    at = kind.start_s + np.sort(rng.uniform(0.05, 0.95, max(1, int(kind.seconds / 15)))) * kind.seconds
    bursts = rng.normal(0, 1, (len(at), 6))

    def true(t: Array) -> tuple[Array, Array]:
        of = [np.sin(2 * np.pi * hz[a % 3] * t[:, None] + phase[a]) @ size[a % 3] for a in range(6)]
        shapes = [np.exp(-0.5 * ((t - middle) / 0.8) ** 2) for middle in at]
        for shape, sizes in zip(shapes, bursts, strict=True):
            for a in range(6):
                of[a] = of[a] + kind.burst * sizes[a] * shape
        rates, forces = np.stack(of[:3], 1), 3.0 * np.stack(of[3:], 1)
        return rates, GRAVITY + forces

    return true


def flown(kind: Kind) -> Flight:
    """What healthy instances measure."""
    true = motion(kind)
    rng = np.random.default_rng([kind.seed, 2])
    n = int(kind.rate_hz * kind.seconds)
    times, gyros, accels = [], [], []
    hum = rng.uniform(0.21, 0.46) * kind.rate_hz
    for c in range(kind.count):
        t = kind.start_s + np.arange(n) / kind.rate_hz + rng.uniform(0, 0.3) / kind.rate_hz
        late = rng.uniform(0, 0.006) + (kind.delays_s[c] if c < len(kind.delays_s) else 0.0)
        rates, forces = true(t - late)
        turn = rotation(rng.normal(0, np.radians(0.8), 3))
        shake = np.sin(2 * np.pi * hum * t[:, None] + rng.uniform(0, 6, 6)) * rng.uniform(0.5, 1.5, 6) * kind.vibration
        gains = rng.normal(1, 0.01, 6)
        noise = rng.normal(0, kind.noise * rng.uniform(0.7, 1.4), (n, 6))
        bias = rng.normal(0, 1, 6)
        times.append(t)
        gyros.append(rates @ turn.T * gains[:3] + 0.01 * bias[:3] + noise[:, :3] + shake[:, :3])
        accels.append(forces @ turn.T * gains[3:] + 0.1 * bias[3:] + 10 * (noise[:, 3:] + shake[:, 3:]))
    return Flight(kind, np.array(times), np.array(gyros), np.array(accels))


def rotation(vector: Array) -> Array:
    """The matrix of a rotation vector, rad."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def parquet(path: Path, flight: Flight, quantities: str = "gyro accel") -> dict[str, Any]:
    """Write a table on the times of the first instance; return its CONFIG."""
    t = flight.time_s[0]
    columns: dict[str, Array] = {"time_s": t}
    signal: dict[str, Any] = {}
    triads: dict[str, list[str]] = {}
    for name, unit, threshold in (("gyro", "rad/s", 0.05), ("accel", "m/s^2", 0.5)):
        if name not in quantities:
            continue
        triads[name] = [f"{name}_{axis}" for axis in "xyz"]
        for a, axis in enumerate("xyz"):
            signal[f"{name}_{axis}"] = {"unit": unit, "threshold": threshold, "persistence_s": 1.0}
            for c, values in enumerate(getattr(flight, name)):
                columns[f"{name}_{axis}.{c + 1}"] = values[:, a]
    frame = pl.DataFrame(columns)
    frame.write_csv(path) if path.suffix == ".csv" else frame.write_parquet(path)
    return {"signal": signal, "triads": triads}


def ardupilot(path: Path, flight: Flight) -> None:
    """Write a dataflash log."""
    rows = [
        (round(1e6 * t), c, *g, *a)
        for c in range(flight.kind.count)
        for t, g, a in zip(flight.time_s[c], flight.gyro[c], flight.accel[c], strict=True)
    ]
    path.write_bytes(dataflash({"IMU": (*IMU, rows)}, {"IMU": IMU_UNITS}))


def px4(path: Path, flight: Flight) -> None:
    """Write a ULog of vehicle_imu."""
    fields = {"timestamp": "uint64_t", "device_id": "uint32_t", "x": "float", "y": "float", "z": "float"}
    topics: dict[Any, Any] = {}
    for name, values in (("sensor_gyro", flight.gyro), ("sensor_accel", flight.accel)):
        for c in range(flight.kind.count):
            rows = [(round(1e6 * t), 11 * (c + 1), *v) for t, v in zip(flight.time_s[c], values[c], strict=True)]
            topics[name, c] = (fields, rows)
    path.write_bytes(ulog(topics))


def ros2(path: Path, flight: Flight, mcap: bool = False) -> None:
    """Write a bag of Imu topics."""
    with RosBag(path, mcap) as bag:
        for k in range(flight.time_s.shape[1]):
            for c in range(flight.kind.count):
                values = [*flight.gyro[c, k].tolist(), *flight.accel[c, k].tolist()]
                bag.imu(f"/imu{c}", round(1e9 * flight.time_s[c, k]), values)
