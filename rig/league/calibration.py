"""The level of each entrant for one budget of false isolations, from healthy flights; and what it does in others.

Of ours the design of ``rig thresholds``.  Of any other the series is, frame by frame, the largest level of a grid with
which the manager fails somebody (it begins again after each), given as the next one, which fails nobody; its tail gives
the level for the budget as that of thresholds does (thresholds/tail.py).  A wide grid finds the range for a fine one.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import RIVALS
from rig.errors import BadInput
from rig.league.entrants import BIASED, Entrant, Level, OfSignal, designed_values, levels, manager
from rig.league.healthy import Flight, Healthy
from rig.thresholds.design import DataBlock, Design, Grid, Threshold, designs, from_tail
from rig.thresholds.distances import in_use
from rig.thresholds.lasting import Rule
from rig.thresholds.monitored import failures
from rig.thresholds.run import MARKED, extrapolation
from rig.thresholds.tail import CLUSTERS, GAP_S, LEAST, peaks
from rig.util.runs import cluster_starts

Floats = NDArray[np.float64]
WIDE: Final = 2.0 ** np.arange(-9.0, 7.0)  # of a level's default
FINE: Final = 24  # levels of the fine grid


@dataclass(frozen=True, slots=True)
class Calibrated:
    """What an entrant is told of a signal: settings, how often the data hold what they rest on, and notes."""

    entrant: str
    signal: str
    values: dict[str, float] = field(default_factory=dict)  # as entrants.manager takes them
    shown: dict[str, float] = field(default_factory=dict)  # in thresholds, or as a rival has them
    clusters: int | None = None  # events that the tail is fitted to
    shape: float | None = None
    extrapolation: float | None = None  # how many times longer the data would be for one event at the budget
    seen: int | None = None  # false isolations in the calibration's own flights
    notes: list[str] = field(default_factory=list)


def require_time(budget_per_h: float, hours: float) -> None:
    """Raise BadInput where the budget is further from the data than ``rig thresholds`` goes without a mark."""
    if extrapolation(budget_per_h, hours) > MARKED:
        needed = 1.0 / (budget_per_h * MARKED)
        raise BadInput(
            f"--healthy: {hours:.3g} h is too little for a budget of {budget_per_h:g} an hour: "
            f"{needed:.3g} h are needed, for a budget {MARKED:g} times rarer than what they hold"
        )


def calibrate(entrant: Entrant, signal: OfSignal, healthy: Healthy, budget_per_h: float) -> Calibrated:
    """Return an entrant's settings of a signal.  BadInput: no level reaches the budget, or too few events."""
    flights, asked = healthy.flights[signal.name], levels(entrant, signal)
    if entrant.designed:
        return _design(entrant, signal, healthy, budget_per_h)
    if not asked:
        return Calibrated(entrant.name, signal.name, seen=isolations(entrant, signal, {}, flights))
    found = {level.name: _level(entrant, signal, level, healthy, budget_per_h) for level in asked}
    values = {name: at.upper for name, at in found.items()}
    first = next(iter(found.values()))
    return Calibrated(
        entrant.name,
        signal.name,
        values,
        values,
        min(at.clusters for at in found.values()),
        first.shape,
        extrapolation(budget_per_h, healthy.hours),
        isolations(entrant, signal, values, flights),
    )


def isolations(entrant: Entrant, signal: OfSignal, values: dict[str, float], flights: Sequence[Flight]) -> int:
    """Return how many false isolations, in clusters, an entrant has in whole flights."""
    return sum(len(_clustered(entrant, signal, values, flight)) for flight in flights)


def _clustered(entrant: Entrant, signal: OfSignal, values: dict[str, float], flight: Flight) -> NDArray[Any]:
    at = failures(flight.samples, flight.references, manager(entrant, signal, values))
    return cluster_starts(at, round(GAP_S * signal.rate_hz))


def _stream(entrant: Entrant, signal: OfSignal, *place: int) -> np.random.Generator:
    keys = (zlib.crc32(entrant.name.encode()), zlib.crc32(signal.name.encode()), *place)
    return np.random.default_rng(np.random.SeedSequence(0, spawn_key=keys))


def _design(entrant: Entrant, signal: OfSignal, healthy: Healthy, budget_per_h: float) -> Calibrated:
    """Return ours as ``rig thresholds`` designs it, with the scenario's persistence and filter."""
    flights = healthy.flights[signal.name]
    blocks = [DataBlock(each.name, np.ascontiguousarray(each.samples.T), signal.rate_hz) for each in flights]
    persistence = int(signal.params["persistence"][0])
    lasting: list[Rule] = ["bias"] if entrant.name == BIASED else []
    grid = Grid(budget_per_h, (persistence,), filters_s=(signal.given.filter_s,), lasting=lasting)
    made = designs(blocks, signal.given, grid, zlib.crc32(signal.name.encode()))
    if not made:
        raise too_few(signal, healthy.hours, 0, entrant.name)
    chosen, notes = made[-1], []
    if entrant.name == BIASED and not chosen.outliers:
        notes.append(f"{signal.name}: a learned bias does not lower the threshold: without")
    values = designed_values(signal, chosen.settings(signal.given))
    return Calibrated(
        entrant.name,
        signal.name,
        values,
        _shown(chosen, signal),
        chosen.single.clusters,
        chosen.single.shape,
        extrapolation(budget_per_h, healthy.hours),
        isolations(entrant, signal, values, flights),
        notes,
    )


def _shown(chosen: Design, signal: OfSignal) -> dict[str, float]:
    amounts = ("threshold", "outlier_threshold", "bias_bound")
    return {name: float(value) / signal.threshold for name, value in chosen.keys().items() if name.startswith(amounts)}


def too_few(signal: OfSignal, hours: float, clusters: int, entrant: str) -> BadInput:
    """Return the error of data that hold too few events."""
    needed = f"about {hours * LEAST / clusters:.3g} h are needed" if clusters else "record more"
    return BadInput(
        f"--healthy: {entrant}: {signal.name}: {clusters} events in {hours:.3g} h, of {LEAST} at least: {needed}"
    )


def _level(entrant: Entrant, signal: OfSignal, level: Level, healthy: Healthy, budget_per_h: float) -> Threshold:
    """Return one level: of all choices of so many channels that may be in use the largest."""
    largest: Threshold | None = None
    for choice, channels in enumerate(in_use(signal.fitted, level.channels)):
        flights = [each._replace(samples=each.samples[:, list(channels)]) for each in healthy.flights[signal.name]]
        series = _fine(entrant, signal, level, flights, healthy.hours, budget_per_h)
        tail = peaks(series, [signal.rate_hz] * len(series), budget_per_h)
        if tail.clusters < LEAST:
            raise too_few(signal, healthy.hours, tail.clusters, entrant.name)
        made = from_tail(tail, budget_per_h, level.channels, _stream(entrant, signal, level.channels, choice))
        largest = made if largest is None or made.upper > largest.upper else largest
    assert largest is not None
    return largest


def _fine(
    entrant: Entrant, signal: OfSignal, level: Level, flights: Sequence[Flight], hours: float, budget_per_h: float
) -> list[Floats]:
    """Return the series of each flight on a grid between the level that nothing exceeds and one often exceeded."""
    wide = np.unique(np.maximum(level.default * WIDE, level.least))
    coarse = [_series(entrant, signal, level, flight, wide) for flight in flights]
    counts = np.array([sum(_events(each, at, signal) for each in coarse) for at in wide])
    if counts[-1] > budget_per_h * hours:
        raise BadInput(
            f"--budget {budget_per_h:g}: {entrant.name}: {signal.name}: no {level.name} reaches it: "
            f"at {wide[-1]:.3g} there are {counts[-1]} false isolations in {hours:.3g} h"
        )
    low = int(np.flatnonzero(counts >= CLUSTERS)[-1]) if (counts >= CLUSTERS).any() else 0
    high = int(np.flatnonzero(counts == 0)[0]) if (counts == 0).any() else len(wide) - 1
    grid = np.geomspace(wide[low], max(wide[high], 2.0 * wide[low]), FINE)
    return [_series(entrant, signal, level, flight, grid) for flight in flights]


def _events(series: Floats, at: float, signal: OfSignal) -> int:
    return len(cluster_starts(np.flatnonzero(series > at), round(GAP_S * signal.rate_hz)))


def _series(entrant: Entrant, signal: OfSignal, level: Level, flight: Flight, grid: Floats) -> Floats:
    """Return (n,) the least level of ``grid`` (rising) that fails nobody in each frame; 0 where none does.

    An even split counts as a failure, whatever ``ties`` says: a reference may settle it against the good half.
    A level with which nobody is failed in a flight ends the search: one that is larger fails nobody either.
    """
    found, above = np.zeros(len(flight.samples)), np.append(grid[1:], grid[-1] * grid[-1] / grid[-2])
    for value, following in zip(grid, above, strict=True):
        made = manager(entrant, signal, {level.name: float(value)}, level.channels)
        if entrant.manager in RIVALS:
            made.params["holds_ties"] = 0
        at = failures(flight.samples, flight.references, made)
        if not len(at):
            break
        found[at] = following
    return found
