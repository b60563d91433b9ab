"""Calibrate each manager to one false-isolation rate on healthy flights, and count its false isolations in others.

For the built-in manager this is the design of ``rig thresholds``.  For any other manager a series is formed: in each
frame, the largest level of a grid at which the manager isolates a channel, noted as the next level, at which it does
not.  The manager starts again after each isolation.  The tail of the series gives the level for the rate, as it does
for thresholds (thresholds/tail.py).  A wide grid finds the range of a fine one.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.manager_config import SignalConfig
from rig.core.column import Column
from rig.core.errors import BadInput
from rig.core.runs import cluster_starts
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.benchmark.calibration_data import Flight, Healthy, measured, of_residuals
from rig.studies.benchmark.entrants import (
    OURS,
    TESTS,
    TESTS_AND_SUMS,
    TUNED,
    Entrant,
    Level,
    OfSignal,
    Values,
    designed_values,
    isolates_no_channel,
    levels,
    with_settings_of,
)
from rig.studies.benchmark.healthy_flights import exceeded, failing, isolations
from rig.studies.benchmark.injected import blocks_of, isolated
from rig.studies.benchmark.second_knobs import choices_of, in_words
from rig.studies.thresholds.data import Data
from rig.studies.thresholds.design import Grid, Threshold, from_tail
from rig.studies.thresholds.design_signals import MARKED, Signal, extrapolation, of_signal
from rig.studies.thresholds.distances import in_use
from rig.studies.thresholds.slow_fault_limits import RULES, Rule
from rig.studies.thresholds.slow_test_factors import FACTORS
from rig.studies.thresholds.tail import CLUSTERS, GAP_S, LEAST, peaks

Floats = NDArray[np.float64]
WIDE: Final = 2.0 ** np.arange(-9.0, 7.0)  # of a level's default
FINE: Final = 24  # levels of the fine grid
_KEYS: Final = set(SignalConfig.model_fields) - {"persistence_s", "split_persistence_s"}
_AMOUNTS: Final = ("threshold", "slow_")  # that are told in thresholds
_RULES: Final[dict[str, tuple[Rule, ...]]] = {OURS: (), TESTS: ("stale",), TESTS_AND_SUMS: RULES}


@dataclass(frozen=True, slots=True)
class Calibrated:
    """The calibrated settings of one manager for one signal, the events in the data that support them, and notes."""

    manager: str
    signal: str
    values: dict[str, Any] = field(default_factory=dict)  # as entrants.manager takes them
    shown: dict[str, float] = field(default_factory=dict)  # in thresholds, or as a baseline manager has them
    keys: dict[str, Any] = field(default_factory=dict)  # of the built-in manager: the table of the signal in a scenario
    clusters: int | None = None  # events that the tail is fitted to
    shape: float | None = None
    extrapolation: float | None = None  # how many times longer the data would be for one event at the budget
    seen: int | None = None  # false isolations in the calibration's own flights
    three: dict[str, Any] | None = None  # the level that three calibration flights exceed
    three_flights: int | None = None  # which can be more
    others: list[tuple[float, dict[str, Any]]] = field(default_factory=list)  # other budgets, and values for them
    notes: list[str] = field(default_factory=list)


LEVELS: Final = (
    *(Column("signal"), Column("manager")),
    Column("told", lambda row: ", ".join(f"{name} {value:.4g}" for name, value in row["shown"].items())),
    *(Column("events", "clusters", worth=7), Column("extrapolated", "extrapolation", ".3g", "times", worth=8)),
    Column("seen", worth=6),
)


def require_time(budget_per_h: float, hours: float) -> None:
    """Raise BadInput if the rate is further beyond the data than ``rig thresholds`` accepts without a mark."""
    if extrapolation(budget_per_h, hours) > MARKED:
        needed = 1.0 / (budget_per_h * MARKED)
        raise BadInput(
            f"--healthy: {hours:.3g} h is too short for {budget_per_h:g} false isolations an hour; "
            f"record at least {needed:.3g} h (a rate may be {MARKED:g} times rarer than one event in the data)"
        )


def calibrate(
    entrant: Entrant, signal: OfSignal, healthy: Healthy, budget_per_h: float, others: Sequence[float] = ()
) -> Calibrated:
    """Return a manager's settings for a signal.  BadInput: no level reaches the rate, or the data have too few events.

    others : further rates for a curve; a manager may miss them
    """
    flights, given = healthy.flights[signal.name], measured(entrant, signal, healthy, budget_per_h)
    budgets = (budget_per_h, *others)
    if not levels(entrant, with_settings_of(signal, entrant, given)) and not entrant.designed:
        seen = None if isolates_no_channel(entrant, signal) else isolations(entrant, signal, given, flights)
        return Calibrated(entrant.name, signal.name, given, seen=seen)
    if entrant.designed:
        found = _design(entrant, signal, healthy, budgets)
    elif TUNED in entrant.variant:
        found = _tuned(entrant, signal, healthy, budgets, given)
    else:
        found = _levels(entrant, signal, healthy, budgets, given)
    three = exceeded(entrant, signal, found.values, flights)
    return replace(
        found,
        extrapolation=extrapolation(budget_per_h, healthy.hours),
        seen=isolations(entrant, signal, found.values, flights),
        three=None if three is None else three[0],
        three_flights=None if three is None else three[1],
    )


def _tuned(entrant: Entrant, signal: OfSignal, healthy: Healthy, budgets: Sequence[float], given: Values) -> Calibrated:
    """Return the levels of the choice of settings that isolates most injected faults (second_knobs.py).

    BadInput: no choice reaches the rate
    """
    made, refused = list[Calibrated](), list[BadInput]()
    for settings in choices_of(entrant, given, of_residuals(signal, healthy)["bias"]):
        try:
            made.append(_levels(entrant, signal, healthy, budgets, settings))
        except BadInput as error:
            refused.append(error)
    if not made:
        raise refused[0]
    blocks = blocks_of(healthy.flights[signal.name], signal.rate_hz)
    count = isolated(entrant, signal, blocks, [each.values for each in made]) or [0] * len(made)
    chosen = made[max(range(len(made)), key=count.__getitem__)]
    without = f" ({len(refused)} more could not be calibrated)" if refused else ""
    said = f"{entrant.name}: {signal.name}: {in_words(entrant, chosen.values)}"
    note = f"{said}: isolates most injected faults of {len(made)} choices{without}"
    return replace(chosen, notes=[note, *chosen.notes])


def _levels(
    entrant: Entrant, signal: OfSignal, healthy: Healthy, budgets: Sequence[float], given: Values
) -> Calibrated:
    """Return the levels at the first rate, and at each other rate for which all levels are known.

    given : the settings that are not calibrated
    """
    signal = with_settings_of(signal, entrant, given)
    asked = levels(entrant, signal)
    found = {level.name: _level(entrant, signal, level, healthy, budgets, given) for level in asked}
    others = [
        (budget, {**given, **{name: of[budget].upper for name, of in found.items()}})
        for budget in budgets[1:]
        if all(budget in of for of in found.values())
    ]
    at = {name: of[budgets[0]] for name, of in found.items()}
    values, first = {name: of.upper for name, of in at.items()}, next(iter(at.values()))
    clusters = min(of.clusters for of in at.values())
    where = f"no false isolation in {healthy.hours:.3g} h even at the lowest level allowed"
    notes = [
        f"{entrant.name}: {signal.name}: {name}: {where}, {of.upper:.3g}" for name, of in at.items() if not of.clusters
    ]
    made = {"clusters": clusters, "shape": first.shape, "others": others, "notes": notes}
    return Calibrated(entrant.name, signal.name, {**given, **values}, values, **made)


def _design(entrant: Entrant, signal: OfSignal, healthy: Healthy, budgets: Sequence[float]) -> Calibrated:
    """Return the built-in manager as ``rig thresholds`` designs it, with the scenario's persistence and filter."""
    made = [_designed(entrant, signal, healthy, budget) for budget in budgets]
    chosen = made[0].design
    if chosen is None:
        raise too_few(signal, healthy.hours, 0, entrant.name)
    settings, tests = _settings(signal, made[0]), made[0].slow_tests
    amounts = [(name, value) for name, value in chosen.keys().items() if name.startswith(_AMOUNTS)]
    factors = {} if tests is None else {name: tests.keys[name] for name in FACTORS}
    return Calibrated(
        entrant.name,
        signal.name,
        designed_values(signal, settings),
        {name: float(value) / signal.threshold for name, value in amounts} | factors,
        settings.model_dump(include=_KEYS, exclude_none=True),
        chosen.threshold.clusters,
        chosen.threshold.shape,
        others=[
            (budget, designed_values(signal, _settings(signal, of)))
            for budget, of in zip(budgets[1:], made[1:], strict=True)
            if of.design is not None
        ],
        notes=[note for note in made[0].notes if "no slow-fault tests" in note],
    )


def _settings(signal: OfSignal, made: Signal) -> RecordedSignal:
    """Return the settings of a design, whose tests stand in the place of the scenario's."""
    tests = None
    if made.slow_tests is not None and signal.sensor is not None:
        tests = signal.sensor.model_copy(update=made.slow_tests.keys)
    assert made.design is not None
    return made.design.settings(signal.given.model_copy(update={"slow_tests": tests}))


def _designed(entrant: Entrant, signal: OfSignal, healthy: Healthy, budget_per_h: float) -> Signal:
    """Return the design of a signal that ``rig thresholds`` chooses; none if the data have too few events."""
    flights = healthy.flights[signal.name]
    blocks = blocks_of(flights, signal.rate_hz)
    persistence = (int(signal.params["persistence"][0]),)
    rules, tested = _RULES[entrant.name], entrant.name != OURS
    grid = Grid(budget_per_h, persistence, filters_s=(signal.given.filter_s,), slow_faults=rules, transients=True)
    untested = signal.given.model_copy(update={"slow_tests": None})
    data = Data([block.name for block in blocks], signal.rate_hz, healthy.hours, {signal.name: blocks}, {})
    data.settings[signal.name] = untested
    if signal.sensor is not None:
        data.slow_tests[signal.name] = signal.sensor
    return of_signal(signal.name, data, grid, True, tested)


def too_few(signal: OfSignal, hours: float, clusters: int, entrant: str) -> BadInput:
    """Return the error of data that hold too few events."""
    needed = f"record about {hours * LEAST / clusters:.3g} h" if clusters else "record more flights"
    return BadInput(
        f"--healthy: {entrant}: {signal.name}: {clusters} events in {hours:.3g} h, at least {LEAST} needed; {needed}"
    )


def _level(
    entrant: Entrant, signal: OfSignal, level: Level, healthy: Healthy, budgets: Sequence[float], given: Values
) -> dict[float, Threshold]:
    """Return the level for each rate: the largest over all choices of the given number of channels in use."""
    found: dict[float, list[Threshold]] = {budget: [] for budget in budgets}
    names = zlib.crc32(entrant.name.encode()), zlib.crc32(signal.name.encode())
    for choice, channels in enumerate(in_use(signal.fitted, level.channels)):
        flights = [each._replace(samples=each.samples[:, list(channels)]) for each in healthy.flights[signal.name]]
        series = _fine(entrant, signal, level, flights, healthy.hours, budgets[0], given)
        for budget in list(found):
            tail = peaks(series, [signal.rate_hz] * len(series), budget)
            if tail.clusters >= LEAST:
                of = np.random.SeedSequence(0, spawn_key=(*names, level.channels, choice))
                found[budget].append(from_tail(tail, budget, level.channels, np.random.default_rng(of)))
            elif level.least > 0.0 and not tail.clusters:  # it cannot alarm more often
                found[budget].append(Threshold(level.channels, level.least, level.least, 0, 0.0))
            elif budget == budgets[0]:
                raise too_few(signal, healthy.hours, tail.clusters, entrant.name)
            else:
                del found[budget]
    return {budget: max(choices, key=lambda at: at.upper) for budget, choices in found.items()}


def _fine(
    entrant: Entrant,
    signal: OfSignal,
    level: Level,
    flights: Sequence[Flight],
    hours: float,
    budget_per_h: float,
    given: Values,
) -> list[Floats]:
    """Return the series of each flight, on a grid from a level that is often exceeded to one that never is."""
    wide = np.unique(np.maximum(level.default * WIDE, level.least))
    coarse = _series(entrant, signal, level, flights, wide, given)
    gap = round(GAP_S * signal.rate_hz)
    counts = np.array([sum(len(cluster_starts(np.flatnonzero(each > at), gap)) for each in coarse) for at in wide])
    if counts[-1] > budget_per_h * hours:
        raise BadInput(
            f"--budget {budget_per_h:g}: {entrant.name}: {signal.name}: no {level.name} reaches this rate; "
            f"{wide[-1]:.3g} still gives {counts[-1]} false isolations in {hours:.3g} h"
        )
    low = int(np.flatnonzero(counts >= CLUSTERS)[-1]) if (counts >= CLUSTERS).any() else 0
    high = int(np.flatnonzero(counts == 0)[0]) if (counts == 0).any() else len(wide) - 1
    grid = np.geomspace(wide[low], max(wide[high], 2.0 * wide[low]), FINE)
    return _series(entrant, signal, level, flights, grid, given)


def _series(
    entrant: Entrant, signal: OfSignal, level: Level, flights: Sequence[Flight], grid: Floats, given: Values
) -> list[Floats]:
    """Return for each flight (n,) the lowest level of ``grid`` (rising) that isolates no channel; 0 if none isolates.

    An even split counts as an isolation, whatever ``ties`` is set to: a reference may settle it against the healthy
    half.  The search in a flight ends at a level that isolates no channel: no larger level isolates one.
    """
    found, above = [np.zeros(len(each.samples)) for each in flights], [*grid[1:], grid[-1] * grid[-1] / grid[-2]]
    left = list(range(len(flights)))
    for value, following in zip(grid, above, strict=True):
        some = [flights[i] for i in left]
        at_level = {**given, level.name: float(value)}
        all_at = failing(entrant, signal, at_level, some, level.channels, guesses=True)
        for i, at in zip(left, all_at, strict=True):
            found[i][at] = following
        left = [i for i, at in zip(left, all_at, strict=True) if len(at)]
        if not left:
            break
    return found
