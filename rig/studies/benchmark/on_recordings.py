"""A benchmark on recordings: each half calibrates every manager to no false isolation, and the other half tests it.

Recordings are too short for a false-isolation rate.  Every second recording calibrates; the others are tested with a
fault in one channel; then the halves change places.  A piece begins BEFORE_S before the fault, so that a manager that
learns has learned.  The faults are those of the trade-off of ``rig thresholds``; their sizes follow the motion of the
signal.  There is no reference.  Trials of one recording are alike, so intervals count recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from rig.computer.redundancy.slow_tests_config import BIAS, SlowTests, tests_params
from rig.core.errors import BadInput
from rig.log.recordings.vote_config import VoteConfig
from rig.studies.benchmark.benchmark_trials import typed
from rig.studies.benchmark.calibration_data import Flight, Healthy, measured, of_residuals
from rig.studies.benchmark.entrants import (
    BUILT_IN,
    OURS,
    TESTS,
    TUNED,
    Entrant,
    OfSignal,
    designed_values,
    isolates_no_channel,
    levels,
    with_settings_of,
)
from rig.studies.benchmark.fault_places import ALONE
from rig.studies.benchmark.healthy_flights import first_enough, flights_failing, isolations, scaled
from rig.studies.benchmark.injected import BEFORE_S, became, flights_of, isolated, with_faults
from rig.studies.benchmark.outcome_table import RECORDING, differences, table
from rig.studies.benchmark.ranking import losses
from rig.studies.benchmark.second_knobs import choices_of
from rig.studies.thresholds.data import Data
from rig.studies.thresholds.data_check import suspects
from rig.studies.thresholds.design import DataBlock, Grid, of_one_frame
from rig.studies.thresholds.design_signals import stands_out
from rig.studies.thresholds.pieces import four, parameters
from rig.studies.thresholds.residual_series import Residuals, residuals, series
from rig.studies.thresholds.slow_fault_limits import ALLOWANCES, LIMITS, alarms, stale_frames
from rig.studies.thresholds.slow_test_factors import FACTORS, HELD, Measured, bare_tests, keys_of, settled, watched
from rig.studies.thresholds.tradeoff import LATER_S, pieces

Floats = NDArray[np.float64]
PIECES: Final = 48  # of a signal and half
_STEPS: Final = 256  # of 2^(1/16): from 64 times a level's default down to a thousandth of it
_HIGHEST: Final = 64.0
_COMPARED: Final = ("threshold", "threshold_triplex", "threshold_duplex")
MARGINS: Final = (1.0, 1.5, 2.0)  # over the levels that just fail no channel
BIASES_ALONE: Final = 1e6  # factor with which the tests isolate nothing, and learn biases for the sums
BESIDE_SUMS: Final = (1.5, BIASES_ALONE)  # margins of the tests


def benchmark(data: Data, config: VoteConfig, entrants: Sequence[Entrant]) -> dict[str, Any]:
    """Return the levels, the false isolations in the tested halves, the table and the differences.

    A recording with a channel that stands out is left out for its signal, as by ``rig thresholds``, with a note.
    BadInput: fewer than two recordings, or all are too short for a trial; channels that do not differ
    """
    if len(data.names) < 2:
        raise BadInput(
            f"--recordings: {len(data.names)} recording; give 2 or more: one half calibrates, the other is tested"
        )
    found, told = list[pl.DataFrame](), list[dict[str, Any]]()
    silent, notes = list[str](), list(data.notes)
    for place, name in enumerate(data.signals):
        blocks = _healthy(name, data, notes)
        given, fitted, rate_hz = data.settings[name], len(blocks[0].samples), blocks[0].rate_hz
        signal = OfSignal(
            name, parameters(given, fitted, rate_hz), given, config.baselines, rate_hz, data.slow_tests.get(name)
        )
        silent = [entrant.name for entrant in entrants if isolates_no_channel(entrant, signal)]
        for half in (0, 1):
            calibrating, tested = blocks[half::2], blocks[1 - half :: 2]
            values = {entrant.name: _chosen(entrant, signal, calibrating) for entrant in entrants}
            for entrant in entrants:
                count = flights_failing(entrant, signal, values[entrant.name], flights_of(calibrating))
                if count and entrant.name != BUILT_IN:
                    notes.append(f"{entrant.name}: {name}: isolates a channel in {count} of its calibrating recordings")
                false = isolations(entrant, signal, values[entrant.name], flights_of(tested))
                levels_of = {key: value for key, value in values[entrant.name].items() if _is_number(value)}
                told.append({"signal": name, "half": half, "manager": entrant.name, "told": levels_of, "false": false})
            found += _trials(entrants, signal, values, tested, (2 * place + half, 1 - half))
    if not found:
        raise BadInput(f"--recordings: every recording is shorter than a trial of {BEFORE_S + LATER_S:g} s")
    trials = pl.concat(found)
    result = {"hours": data.hours, "recordings": len(data.names), "levels": told, "silent": silent, "notes": notes}
    result |= {"table": table(trials), "differences": differences(trials)}
    return {**result, "losses": losses(result)}


def _healthy(name: str, data: Data, notes: list[str]) -> Sequence[DataBlock]:
    """Return the recordings of a signal in which no channel stands out.  BadInput: fewer than two."""
    blocks, given = data.signals[name], data.settings[name]
    found = {each.flight: each for each in suspects(blocks, given.wraps, max(Grid(0.0).persistence), given.scale)}
    left_out = {f: each for f, each in found.items() if blocks[f].name not in data.healthy}
    notes += [f"{stands_out(name, blocks[f].name, each)}; left out for this signal" for f, each in left_out.items()]
    kept = [block for f, block in enumerate(blocks) if f not in left_out]
    if len(kept) < 2:
        first = next(iter(left_out.items()))
        said = stands_out(name, blocks[first[0]].name, first[1])
        raise BadInput(f"--recordings: {name}: fewer than 2 healthy recordings; {said}")
    return kept


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _chosen(entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock]) -> dict[str, Any]:
    """Return a manager's settings: the lowest levels that isolate no channel in ``blocks``, times a factor.

    The built-in manager with slow-fault tests also gets a persistence and a CUSUM limit.  Each half of ``blocks``
    gives levels, and the factor is the one that isolates most faults in the other half: levels that just isolate no
    channel in some flights do not hold for others.  A single recording is halved in time.
    BadInput: the channels do not differ
    """
    found = dict(_candidates(entrant, signal, blocks))
    if not found:
        raise BadInput(f"--recordings: {signal.name}: the channels do not differ; nothing can be calibrated")
    count = dict.fromkeys(found, 0)
    blocks = blocks if len(blocks) > 1 else _in_time(blocks[0])
    for half in (0, 1) if len(found) > 1 else ():
        others = {name: values for name, values in _candidates(entrant, signal, blocks[half::2]) if name in count}
        count_of = isolated(entrant, signal, blocks[1 - half :: 2], [*others.values()])
        for name, more in zip(others, count_of or (), strict=count_of is not None):
            count[name] += more
    return found[max(found, key=count.__getitem__)]


def _in_time(block: DataBlock) -> list[DataBlock]:
    """Return the two halves of a recording."""
    return [DataBlock(block.name, part, block.rate_hz) for part in np.array_split(block.samples, 2, axis=1)]


def _candidates(
    entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock]
) -> Iterator[tuple[tuple[float, ...], dict[str, Any]]]:
    """Yield the settings that ``blocks`` allow, with each factor over the levels and each other choice."""
    flights = flights_of(blocks)
    if entrant.designed and entrant.name != OURS:
        yield from _tested(entrant, signal, blocks)
    elif entrant.name == OURS:
        values = _ours(entrant, signal, flights)
        for margin in MARGINS:
            yield (margin,), _scaled(values, _COMPARED, margin)
    else:
        healthy = Healthy({signal.name: flights}, 0.0, "")
        given, all_given = measured(entrant, signal, healthy), list[dict[str, Any]]()
        if TUNED in entrant.variant:
            all_given += choices_of(entrant, given, of_residuals(signal, healthy)["bias"], Grid(0.0).persistence)
        for place, settings in enumerate(all_given or [given]):
            of = with_settings_of(signal, entrant, settings)
            asked = [level.name for level in levels(entrant, of)]
            values = _least(entrant, of, settings, flights) if asked else settings
            for margin in MARGINS if asked else (1.0,):
                yield (place, margin), _scaled(values, asked, margin)


def _least(entrant: Entrant, signal: OfSignal, given: dict[str, Any], flights: Sequence[Flight]) -> dict[str, Any]:
    """Return the lowest levels of a grid at which a baseline manager isolates no channel."""
    highest = {**given, **{level.name: level.default * _HIGHEST for level in levels(entrant, signal)}}
    at = first_enough(lambda step: _fails(entrant, signal, scaled(entrant, signal, highest, step), flights), _STEPS)
    return scaled(entrant, signal, highest, (_STEPS if at is None else at) - 1)


def _fails(entrant: Entrant, signal: OfSignal, values: dict[str, Any], flights: Sequence[Flight]) -> bool:
    return flights_failing(entrant, signal, values, flights) > 0


def _ours(entrant: Entrant, signal: OfSignal, flights: Sequence[Flight]) -> dict[str, Any]:
    """Return the built-in manager with the lowest threshold alone."""
    none = ("threshold_triplex", "threshold_duplex", "slow_allowance", "slow_limit", "slow_tests")

    def told(steps: int) -> dict[str, Any]:
        level = signal.threshold * _HIGHEST * 2.0 ** (-steps / 16.0)
        return designed_values(signal, signal.given.model_copy(update={**dict.fromkeys(none), "threshold": level}))

    at = first_enough(lambda steps: _fails(entrant, signal, told(steps), flights), _STEPS)
    return told(max((_STEPS if at is None else at) - 1, 0))


def _tested(
    entrant: Entrant, signal: OfSignal, blocks: Sequence[DataBlock]
) -> Iterator[tuple[tuple[float, ...], dict[str, Any]]]:
    """Yield the built-in manager with each persistence, margin of the tests, CUSUM limit (0: none) and other margins.

    No threshold is within single-frame noise.
    """
    flights, fitted, sums = flights_of(blocks), len(blocks[0].samples), entrant.name != TESTS
    least = of_one_frame(lambda c: [block.samples[list(c)] for block in blocks], signal.given.wraps, fitted, fitted)
    samples = [block.samples for block in blocks]
    given = signal.given.model_copy(update={"persistence_s": None, "split_persistence_s": None})
    beside = [(tests, _residuals(signal, blocks, tests)) for tests in _tests(signal, blocks, sums)]
    for frames in Grid(0.0).persistence:
        of_frames = given.model_copy(update={"persistence": frames, "split_persistence": frames})
        of = signal._replace(given=of_frames)
        plain = _ours(entrant, of, flights) | {"stale_frames": stale_frames(samples, signal.rate_hz)}
        plain |= {name: max(plain[name], least) for name in _COMPARED}
        for place, (tests, (rows, found)) in enumerate(beside):
            values = plain | dict(tests_params(tests, None))
            for limit, allowance in _sums(of, rows, found) if sums else [(0.0, 0.0)]:
                for compared, summed in product(MARGINS, MARGINS if limit else (1.0,)):
                    asked = {"slow_limit": limit * found.spread, "slow_allowance": summed * allowance}
                    yield (frames, place, limit, compared, summed), {**_scaled(values, _COMPARED, compared), **asked}


def _tests(signal: OfSignal, blocks: Sequence[DataBlock], sums: bool) -> Iterator[SlowTests | None]:
    """Yield the tests with each margin that holds in ``blocks``; with sums also those that learn alone.

    There may also be no tests, None, beside sums, or where no margin holds: sensors that are not synchronised differ by
    what is no bias.
    Figures of the sensor that CONFIG does not state are the spread and the largest mean of the residuals.
    """
    (params,), channels = signal.params.copy(), [four(block.samples.T) for block in blocks]
    figures = signal.sensor
    if figures is None:
        plain = signal.given.model_copy(update={"slow_tests": None})
        found = residuals([(block.samples, None) for block in blocks], plain, signal.rate_hz)
        figures = SlowTests(noise_std=found.spread or None, bias_tolerance=float(found.means.max()) / BIAS)
    if not figures.noise_std:
        return

    def measure(factors: Mapping[str, float]) -> list[Measured]:
        return [watched((each, None), params, bare_tests(figures, factors)) for each in channels]

    held = 0  # margins; HELD is what ``settled`` lets a share exceed its factor by
    for margin in BESIDE_SUMS if sums else MARGINS:
        if margin == BIASES_ALONE:
            yield figures.model_copy(update=dict.fromkeys(FACTORS, margin))
        elif (measured := settled(measure, signal.threshold, HELD * margin)) is not None:
            keys, held = keys_of(measured, signal.threshold, HELD * margin), held + 1
            yield figures.model_copy(update={name: keys[name] for name in FACTORS})
    if sums or held == 0:
        yield None


def _residuals(
    signal: OfSignal, blocks: Sequence[DataBlock], tests: SlowTests | None
) -> tuple[list[Floats], Residuals]:
    """Return the residuals of each recording beside the tests, and their spread."""
    given = signal.given.model_copy(update={"slow_tests": tests})
    flights = [(block.samples, None) for block in blocks]
    return [series(flight, given, signal.rate_hz) for flight in flights], residuals(flights, given, signal.rate_hz)


def _sums(signal: OfSignal, rows: Sequence[Floats], found: Residuals) -> Iterator[tuple[float, float]]:
    """Yield no sums, then, if noise dominates, each CUSUM limit with the least allowance that isolates no channel."""
    yield 0.0, 0.0
    allowances = ALLOWANCES * found.spread
    for limit in LIMITS if found.noisy else ():
        asked = {"slow_limit": limit * found.spread / signal.rate_hz, "slow_tests": None}
        given = signal.given.model_copy(update=asked)
        largest = max(float(alarms(row, given, signal.rate_hz, allowances).max()) for row in rows)
        enough = allowances[allowances > largest]
        if len(enough):
            yield limit, float(enough[0])


def _scaled(values: dict[str, Any], names: Sequence[str], factor: float) -> dict[str, Any]:
    """Return ``values`` with those of the names times a factor."""
    return {**values, **{name: factor * values[name] for name in names}}


def _trials(
    entrants: Sequence[Entrant],
    signal: OfSignal,
    values: dict[str, dict[str, Any]],
    blocks: Sequence[DataBlock],
    part: tuple[int, int],
) -> Iterator[pl.DataFrame]:
    """Yield the rows of each fault and manager; part : number of the signal and half, and of its first recording."""
    cut = pieces(blocks, PIECES, BEFORE_S)
    if cut is None:
        return
    recording = pl.Series(RECORDING, part[1] + 2 * cut.flight)
    for number, (name, samples) in enumerate(with_faults(cut, blocks, signal)):
        for entrant in entrants:
            outcome, delay_s = became(entrant, signal, values[entrant.name], cut, samples)
            columns = {
                "combination": 100 * part[0] + number,
                "trial": np.arange(len(samples)),
                **{"signal": signal.name, "place": ALONE, "kind": name, "faults": 1, "size": None},
                "reference": "absent",
                **{"budget_per_h": 0.0, "manager": entrant.name, "outcome": outcome, "delay_s": delay_s, "peak": None},
            }
            yield typed(columns).with_columns(recording)
