"""A benchmark on recordings: each half calibrates every manager to no false isolation, and the other half tests it.

Recordings are too short for a false-isolation rate.  Every second recording calibrates; the others are tested with a
fault in one channel; then the halves change places.  A piece begins BEFORE_S before the fault, so that a manager that
learns has learned.  The faults are those of the trade-off of ``rig thresholds``; their sizes follow the motion of the
signal.  There is no reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.log.recordings.vote_config import VoteConfig
from rig.studies.benchmark.benchmark_trials import typed
from rig.studies.benchmark.calibration_data import Flight, Healthy, measured
from rig.studies.benchmark.entrants import (
    EQUALISED,
    SLOW_FAULTS,
    Entrant,
    OfSignal,
    designed_values,
    levels,
    manager,
    with_settings_of,
)
from rig.studies.benchmark.healthy_flights import first_enough, flights_failing, isolations, scaled
from rig.studies.benchmark.outcome_table import differences, table
from rig.studies.benchmark.own_class import voted
from rig.studies.thresholds.data import Data
from rig.studies.thresholds.data_check import envelope
from rig.studies.thresholds.design import DataBlock, Grid, of_one_frame
from rig.studies.thresholds.pieces import four, outcomes_of, parameters
from rig.studies.thresholds.slow_fault_limits import ALLOWANCES, LIMITS, residuals, stale_frames
from rig.studies.thresholds.tradeoff import GAIN, LATER_S, NOISE, SHARES, SMALL, Kind, Pieces, faulty, pieces
from rig.verdict.signal_kernels import first_failed, trial_words

BEFORE_S: Final = 10.0
PIECES: Final = 48  # of a signal and half
CHOOSING: Final = 16  # of half the calibrating recordings, by which margins are chosen
_STEPS: Final = 256  # of 2^(1/16): from 64 times a level's default down to a thousandth of it
_HIGHEST: Final = 64.0
_OUTLIERS: Final = ("outlier_threshold", "outlier_threshold_triplex")
_COMPARED: Final = ("threshold", "threshold_triplex", "threshold_duplex", *_OUTLIERS)
MARGINS: Final = (1.0, 1.5, 2.0)  # over the levels that just fail no channel
Faults = Sequence[tuple[str, Kind, float]]


def benchmark(data: Data, config: VoteConfig, entrants: Sequence[Entrant]) -> dict[str, Any]:
    """Return the levels, the false isolations in the tested halves, the table and the differences.

    BadInput: fewer than two recordings, or all are too short for a trial
    """
    if len(data.names) < 2:
        raise BadInput(
            f"--recordings: {len(data.names)} recording; give 2 or more: one half calibrates, the other is tested"
        )
    found, told = list[pl.DataFrame](), list[dict[str, Any]]()
    for place, (name, blocks) in enumerate(data.signals.items()):
        given, fitted, rate_hz = data.settings[name], len(blocks[0].samples), blocks[0].rate_hz
        signal = OfSignal(name, parameters(given, fitted, rate_hz), given, config.baselines, rate_hz)
        for half in (0, 1):
            calibrating, tested = blocks[half::2], blocks[1 - half :: 2]
            values = {entrant.name: _chosen(entrant, signal, calibrating) for entrant in entrants}
            for entrant in entrants:
                false = isolations(entrant, signal, values[entrant.name], _flights(tested))
                levels_of = {key: value for key, value in values[entrant.name].items() if isinstance(value, float)}
                told.append({"signal": name, "half": half, "manager": entrant.name, "told": levels_of, "false": false})
            found += _trials(entrants, signal, values, tested, 2 * place + half)
    if not found:
        raise BadInput(f"--recordings: every recording is shorter than a trial of {BEFORE_S + LATER_S:g} s")
    trials = pl.concat(found)
    return {"hours": data.hours, "levels": told, "table": table(trials), "differences": differences(trials)}


def _flights(blocks: Sequence[DataBlock]) -> list[Flight]:
    return [
        Flight(block.name, np.ascontiguousarray(block.samples.T), np.full((block.samples.shape[1], 2), np.nan))
        for block in blocks
    ]


def _chosen(entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock]) -> dict[str, Any]:
    """Return a manager's settings: the lowest levels that isolate no channel in ``blocks``, times a factor.

    The built-in manager with all slow-fault rules also gets a persistence and a CUSUM limit.  Each half of ``blocks``
    gives levels, and the factor is the one that isolates most faults in the other half: levels that just isolate no
    channel in some flights do not hold for others.
    """
    found = dict(_candidates(entrant, signal, blocks))
    count = dict.fromkeys(found, 0)
    for half in (0, 1) if len(found) > 1 and len(blocks) > 1 else ():
        cut, others = pieces(blocks[1 - half :: 2], CHOOSING, BEFORE_S), blocks[half::2]
        if cut is not None:
            faults = [samples for _, samples in _with_faults(cut, blocks[1 - half :: 2], signal)]
            for name, values in _candidates(entrant, signal, others):
                if name in count:
                    outcomes = [_became(entrant, signal, values, cut, samples)[0] for samples in faults]
                    count[name] += sum(int((outcome == "isolated").sum()) for outcome in outcomes)
    return found[max(found, key=count.__getitem__)]


def _candidates(
    entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock]
) -> Iterator[tuple[tuple[float, ...], dict[str, Any]]]:
    """Yield the settings that ``blocks`` allow, with each factor over the levels and each other choice."""
    flights = _flights(blocks)
    if entrant.name == SLOW_FAULTS:
        yield from _slow_faults(entrant, signal, blocks)
    elif entrant.designed:
        bound = _bound(signal, blocks) if entrant.name == EQUALISED else 0.0
        values = _ours(entrant, signal, flights, signal.threshold * _HIGHEST, bound)
        for margin in MARGINS:
            yield (margin,), _scaled(values, _COMPARED, margin)
    else:
        given = measured(entrant, signal, Healthy({signal.name: flights}, 0.0, ""))
        of = with_settings_of(signal, entrant, given)
        asked = [level.name for level in levels(entrant, of)]
        values = _least(entrant, of, given, flights) if asked else given
        for margin in MARGINS if asked else (1.0,):
            yield (margin,), _scaled(values, asked, margin)


def _bound(signal: OfSignal, blocks: Sequence[DataBlock]) -> float:
    """Return the bound of channel equalisation: the largest mean of a residual over a recording."""
    return float(residuals([block.samples for block in blocks], signal.given.wraps).means.max())


def _least(entrant: Entrant, signal: OfSignal, given: dict[str, Any], flights: Sequence[Flight]) -> dict[str, Any]:
    """Return the lowest levels of a grid at which a baseline manager isolates no channel."""
    highest = {**given, **{level.name: level.default * _HIGHEST for level in levels(entrant, signal)}}
    at = first_enough(lambda step: _fails(entrant, signal, scaled(entrant, signal, highest, step), flights), _STEPS)
    return scaled(entrant, signal, highest, (_STEPS if at is None else at) - 1)


def _fails(entrant: Entrant, signal: OfSignal, values: dict[str, Any], flights: Sequence[Flight]) -> bool:
    return flights_failing(entrant, signal, values, flights) > 0


def _ours(
    entrant: Entrant, signal: OfSignal, flights: Sequence[Flight], highest: float, bound: float = 0.0
) -> dict[str, Any]:
    """Return the built-in manager with the lowest threshold, and within ``bound`` the lowest isolation threshold."""
    if bound > 0.0:
        highest = _ours(entrant, signal, flights, highest)["threshold"]
    none = ("threshold_triplex", "threshold_duplex", "outlier_threshold", "outlier_threshold_triplex")
    plain: dict[str, Any] = {**dict.fromkeys(none), "equalise_bound": 0.0, "slow_allowance": None, "slow_limit": None}

    def told(steps: int) -> dict[str, Any]:
        level = highest * 2.0 ** (-steps / 16.0)
        update = {**plain, "threshold": level}
        if bound > 0.0:
            learned = {"outlier_threshold": level, "outlier_threshold_triplex": level, "equalise_bound": bound}
            update |= {"threshold": max(highest, bound), **learned}
        return designed_values(signal, signal.given.model_copy(update=update))

    at = first_enough(lambda steps: _fails(entrant, signal, told(steps), flights), _STEPS)
    return told(max((_STEPS if at is None else at) - 1, 0))


def _slow_faults(
    entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock]
) -> Iterator[tuple[tuple[float, ...], dict[str, Any]]]:
    """Yield the built-in manager with each persistence, CUSUM limit (0: none) and factor over the levels.

    No isolation threshold is within single-frame noise, as with ``rig thresholds``.
    """
    flights, bound, fitted = _flights(blocks), _bound(signal, blocks), len(blocks[0].samples)
    least = of_one_frame(lambda c: [block.samples[list(c)] for block in blocks], signal.given.wraps, fitted, fitted)
    for frames in Grid(0.0).persistence:
        of_frames = {"persistence": frames, "split_persistence": frames}
        given = signal.given.model_copy(update={**of_frames, "persistence_s": None, "split_persistence_s": None})
        of = signal._replace(given=given)
        biased = _ours(entrant, of, flights, signal.threshold * _HIGHEST, bound)
        biased |= {name: max(biased[name], least) for name in _COMPARED}
        for limit, values in _with_sums(entrant, of, blocks, biased):
            for compared, summed in product(MARGINS, MARGINS if limit else (1.0,)):
                wider = _scaled(_scaled(values, _COMPARED, compared), ("slow_allowance",), summed)
                yield (frames, limit, compared, summed), wider


def _scaled(values: dict[str, Any], names: Sequence[str], factor: float) -> dict[str, Any]:
    """Return ``values`` with those of the names times a factor."""
    return {**values, **{name: factor * values[name] for name in names}}


def _with_sums(
    entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock], biased: dict[str, Any]
) -> Iterator[tuple[float, dict[str, Any]]]:
    """Yield the built-in manager with stale samples, then, if noise dominates, with each CUSUM limit and allowance."""
    samples, flights = [block.samples for block in blocks], _flights(blocks)
    of, last = residuals(samples, signal.given.wraps), len(ALLOWANCES) - 1
    plain = {**biased, "stale_frames": stale_frames(samples, signal.rate_hz)}
    yield 0.0, plain
    for limit in LIMITS if of.noisy else ():

        def told(step: int, limit: float = limit) -> dict[str, Any]:
            allowance = float(ALLOWANCES[last - step])
            return {**plain, "slow_limit": limit * of.spread, "slow_allowance": allowance * of.spread}

        at = first_enough(lambda step, told=told: _fails(entrant, signal, told(step), flights), last)
        if at != 0:
            yield limit, told(last if at is None else at - 1)


def _with_faults(
    cut: Pieces, blocks: Sequence[DataBlock], signal: OfSignal
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the name of each fault and the pieces (R, n, C) that have it."""
    motion = envelope(blocks, signal.given.wraps)
    for name, kind, size in _faults(max(motion.value, motion.noise)):
        samples = cut.samples.copy()
        samples[np.arange(len(samples)), :, cut.channel] = faulty(cut, kind, size)
        yield name, samples


def _trials(
    entrants: Sequence[Entrant],
    signal: OfSignal,
    values: dict[str, dict[str, Any]],
    blocks: Sequence[DataBlock],
    part: int,
) -> Iterator[pl.DataFrame]:
    """Yield the rows of each fault and manager; part : number of the signal and half."""
    cut = pieces(blocks, PIECES, BEFORE_S)
    if cut is None:
        return
    for number, (name, samples) in enumerate(_with_faults(cut, blocks, signal)):
        for entrant in entrants:
            outcome, delay_s = _became(entrant, signal, values[entrant.name], cut, samples)
            columns = {
                "combination": 100 * part + number,
                "trial": np.arange(len(samples)),
                **{"signal": signal.name, "kind": name, "faults": 1, "size": None, "reference": "absent"},
                **{"budget_per_h": 0.0, "manager": entrant.name, "outcome": outcome, "delay_s": delay_s, "peak": None},
            }
            yield typed(columns)


def _faults(motion: float) -> Faults:
    small: list[tuple[str, Kind, float]] = [(f"small offset {x:g}", "small", x * motion) for x in SMALL]
    offsets: list[tuple[str, Kind, float]] = [(f"offset {x:g}", "offset", x * motion) for x in SHARES]
    return [
        *small,
        *offsets,
        ("ramp", "ramp", SHARES[0] * motion),
        ("noise", "noise", NOISE),
        ("gain", "gain", GAIN),
        ("stuck", "stuck", 0.0),
    ]


def _became(
    entrant: Entrant, signal: OfSignal, values: dict[str, Any], cut: Pieces, samples: NDArray[np.float64]
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return the outcome (R,) and the delay (R,), s, of ``samples`` (R, n, C), the pieces with a fault."""
    if entrant.is_own:
        failed_at = first_failed(voted(entrant.manager, values, signal.params, {"channels": four(samples)})[0])
    else:
        failed_at = outcomes_of(samples, cut.channel, cut.onset, manager(entrant, signal, values))["failed_at"]
    tested = np.arange(CHANNELS) == cut.channel[:, None]
    outcome, frames = trial_words(failed_at, np.full(len(samples), cut.onset), tested, ~tested)
    return outcome, frames / cut.rate_hz
