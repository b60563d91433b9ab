"""Healthy flights for a calibration: the channels and references of one signal, read from logs flight by flight."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import LEARNERS, manager_kind
from rig.core.errors import BadInput
from rig.core.units.angles import differences
from rig.log import read_log
from rig.log.recordings.flown_log import recorded
from rig.log.recordings.own_logs import of_log
from rig.log.recordings.vote_config import VoteConfig
from rig.studies.benchmark.entrants import BIAS, LEARNED_BIAS, VARIANTS, Entrant, OfSignal
from rig.studies.benchmark.own_class import HealthyData, designed
from rig.studies.thresholds.data import SAME_RATE, columns, recordings, without_faults

Floats = NDArray[np.float64]


class Flight(NamedTuple):
    """One signal of one flight."""

    name: str
    samples: Floats  # (n, C), NaN where the manager would not compare a sample
    references: Floats  # (n, 2)


class Healthy(NamedTuple):
    """The flights of each signal, and their checksum."""

    flights: dict[str, list[Flight]]
    hours: float
    sha256: str


def read(folder: Path, aircraft: str, signals: Sequence[OfSignal], option: str = "--healthy") -> Healthy:
    """Read the logs of ``aircraft`` in ``folder``.  BadInput: one has a fault or another rate, or there is none."""
    flights: dict[str, list[Flight]] = {signal.name: [] for signal in signals}
    frames, digest, rate_hz = 0, hashlib.sha256(), signals[0].rate_hz
    for path in recordings([folder], VoteConfig()):
        if not without_faults(path):
            raise BadInput(f"{option}: {path}: not a flight log of rig")
        flown = recorded(path)
        if flown.scenario.aircraft != aircraft:
            continue
        if abs(flown.scenario.rate_hz - rate_hz) > SAME_RATE * rate_hz:
            raise BadInput(
                f"{option}: {path}: flown at {flown.scenario.rate_hz:g} frames a second, the campaign at {rate_hz:g}"
            )
        found = _flights(path, signals)
        frames += len(next(iter(found.values())).samples)
        for name, flight in found.items():
            flights[name].append(flight)
            digest.update(np.ascontiguousarray(flight.samples).tobytes() + flight.references.tobytes())
    if frames == 0:
        raise BadInput(f"{option} {folder}: no flight of {aircraft}, the aircraft of the campaign")
    return Healthy(flights, frames / rate_hz / 3600.0, digest.hexdigest())


def _flights(path: Path, signals: Sequence[OfSignal]) -> dict[str, Flight]:
    recording, found = of_log(read_log(path), path), {}
    for signal in signals:
        samples = recording.signals[signal.name]
        if len(samples.channels) != signal.fitted:
            count = len(samples.channels)
            raise BadInput(f"{path}: {signal.name} has {count} channels, the campaign has {signal.fitted}")
        assert samples.reference is not None and samples.second_reference is not None  # a log of rig has both
        both = np.column_stack([samples.reference, samples.second_reference])
        found[signal.name] = Flight(path.name, np.ascontiguousarray(columns(samples, signal.given).T), both)
    return found


def measured(entrant: Entrant, signal: OfSignal, healthy: Healthy, budget_per_h: float = 0.0) -> dict[str, Any]:
    """Return what a manager is given of healthy data before its calibration, in thresholds.

    A baseline manager gets statistics of the residuals, and with its variant the bound of a learned bias; a class of
    the user gets what its method ``design`` makes of the data.
    """
    if entrant.is_own:
        flights = healthy.flights[signal.name]
        channels = [_read_only(each.samples) for each in flights]
        references = [_read_only(each.references) for each in flights]
        about = (signal.rate_hz, signal.threshold, bool(signal.given.wraps), budget_per_h)
        return designed(entrant.manager, HealthyData(signal.name, channels, references, *about))
    if entrant.manager not in LEARNERS:
        return {}
    kind, found = manager_kind(entrant.manager).settings, of_residuals(signal, healthy)
    given = {} if kind is None else {name: value for name, value in found.items() if name in kind.model_fields}
    if BIAS in entrant.variant:
        given[LEARNED_BIAS] = found["bias"]
    for word in entrant.variant:
        given |= VARIANTS[word]
    return given


def _read_only(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a copy in memory that cannot be made writable again."""
    return np.frombuffer(values.tobytes(), values.dtype).reshape(values.shape)


def of_residuals(signal: OfSignal, healthy: Healthy) -> dict[str, float]:
    """Return the statistics of healthy residuals from the median, in thresholds.

    ``spread``: standard deviation within a flight; ``bias``: the largest mean over a flight; ``rms``: over all flights
    """
    squares, within, frames, bias = 0.0, 0.0, 0, 0.0
    for flight in healthy.flights[signal.name]:
        samples = flight.samples[np.isfinite(flight.samples).all(axis=1)]
        if len(samples):
            apart = differences(samples, samples[:, :1], signal.given.wraps)
            residual = (apart - np.median(apart, axis=1)[:, None]) / signal.threshold
            bias = max(bias, float(np.abs(residual.mean(axis=0)).max()))
            squares, within = (
                squares + float((residual**2).sum()),
                within + float(residual.var(axis=0).sum()) * len(samples),
            )
            frames += residual.size
    noisy = {"spread": math.sqrt(within / frames), "rms": math.sqrt(squares / frames)} if within > 0.0 else {}
    return {"bias": bias, **noisy}
