"""Run open-loop trials of a campaign's cells that leave two good channels, on several processes, and add them up.

A unit of work is one combination of the campaign's cases, in chunks of at most CHUNK trials.  Each chunk has a seed,
given by the number of its run and its place, so that workers and their order do not change the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray

from rig.bench.one_signal_trials import RESULT, Scratch, Trials, begin_trial, record_trial, run_trials
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, D, S
from rig.studies.campaign.plan import Plan
from rig.studies.reliability.drawn import Cell, cell, draw, refill
from rig.studies.reliability.one_signal import ROW, Recording, recording, setting_key
from rig.studies.reliability.tally import AT_ONCE, CELL, COUNTS, DESIGNS, FALSE_ISOLATIONS, Cells, of_kind
from rig.verdict.monitored_places import allowed_frames, blank_records, lingers
from rig.verdict.signal_kernels import LEVELS, NEVER
from rig.world.faults.fault_records import KEPT, FaultData

CHUNK: Final = 500
GOOD: Final = (4, 3)
# Shares of the trials by good channels and design: terms of first order in the rate need the most.
SHARES: Final = {(4, "single"): 0.6, (3, "single"): 0.2, (4, "near"): 0.05, (4, "alike"): 0.15}
_RECORDING, _TRIALS = 0, 1  # spawn keys of the seed


@dataclass(frozen=True, slots=True)
class Batch:
    """Some trials of the combination of cases of run ``number``."""

    number: int
    chunk: int
    trials: int
    seed: int


@dataclass(frozen=True, slots=True)
class Tally:
    """The results of a batch: sums of whole numbers, which are the same in any order."""

    cell: tuple[str, int, str, str, str]
    counts: NDArray[
        np.int64
    ]  # (5, 5): by good channels before: trials, annunciated losses, undetected errors, settled, their frames
    healthy: NDArray[np.int64]  # (5,) frames of healthy channels by level, and their isolations
    failed: NDArray[np.int64]
    rate_hz: float


class Recordings:
    """The healthy flights of a plan's combinations, each flown once."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._flown: dict[tuple[int, str, str], Recording] = {}

    def __call__(self, unit: Batch, made: Cell, condition: str) -> Recording:
        """Return the healthy flight of a unit, which depends on everything in its scenario but the faults."""
        key = unit.seed, condition, setting_key(self._plan.data(unit.number))
        if key not in self._flown:
            self._flown[key] = recording(made.scenario, recording_seed(unit.seed, condition))
        return self._flown[key]


class TrialRunner:
    """Run batches of a plan in a worker process."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._recordings = Recordings(plan)

    def __call__(self, unit: Batch) -> Tally:
        """One unit."""
        made, key, condition = _cell(self._plan, unit.number)
        seeds = SeedSequence(unit.seed, spawn_key=(_TRIALS, unit.number, unit.chunk))
        drawing, noise, normal = (Generator(SFC64(child)) for child in seeds.spawn(3))
        trials = draw(made, unit.trials, self._recordings(unit, made, condition), drawing)
        results, healthy, failed = fly_trials(made, trials, lambda: refill(trials, noise, normal))
        return Tally(key, tallied(made, trials, results), healthy, failed, made.scenario.rate_hz)


@lru_cache(maxsize=4)
def _cell(plan: Plan, number: int) -> tuple[Cell, tuple[str, int, str, str, str], str]:
    """Return the common part of a combination's units, made once in each process."""
    choice, made = plan.choices[number], cell(plan, number)
    good, design = planned(plan, number)
    fault = made.scenario.faults[made.tested]
    kind, condition = of_kind(fault.kind, choice.get("kind")), choice["condition"]
    return made, (fault.signal, good, design, kind, condition), condition


def planned(plan: Plan, number: int) -> tuple[int, str]:
    """Return the good channels and the design of a run, from the name of its case: ``single 4, channel 1``."""
    choice = plan.choices[number]
    lacking = [group for group in ("design", "condition") if group not in choice]
    if lacking:
        raise BadInput(f"{plan.source}: not a campaign like `reliability`: it has no cases.{lacking[0]}")
    design, _, rest = str(choice["design"]).partition(" ")
    good = rest.partition(",")[0].strip()
    if design not in DESIGNS or not good.isdigit() or not 1 <= int(good) <= CHANNELS:
        said = f"must be one of {', '.join(DESIGNS)} and the number of good channels"
        raise BadInput(f"{plan.source}: cases.design: {choice['design']!r}: {said}, as in 'single 4, channel 1'")
    return int(good), design


def leaves_two_good(good: int, design: str) -> bool:
    """Return True if enough channels stay good, so that faulty ones cannot decide the vote and move the aircraft."""
    return good - AT_ONCE[design] >= 2


def recording_seed(seed: int, condition: str) -> int:
    """Return the seed of the healthy flight of a condition."""
    state = SeedSequence(seed, spawn_key=(_RECORDING, *condition.encode())).generate_state(1, np.uint64)
    return int(state[0]) >> 1


def shared_out(plan: Plan, runs: int, seed: int, good: Sequence[int] = GOOD) -> list[Batch]:
    """Distribute ``runs`` trials over the combinations with ``good`` channels, by SHARES.  BadInput: there is none."""
    flown = sorted(set(good) - set(GOOD))
    if flown:
        raise BadInput(
            f"--good-before {flown[0]}: open-loop trials allow 4 and 3 good channels; with 2 or 1 the aircraft "
            "follows the vote before the fault is settled; fly the campaign for these"
        )
    groups: dict[tuple[int, str], list[int]] = {}
    for number in combinations(plan):
        place = planned(plan, number)
        if place[0] in good and leaves_two_good(*place):
            groups.setdefault(place, []).append(number)
    if not groups:
        named = " or ".join(map(str, good))
        raise BadInput(f"{plan.source}: no case has {named} good channels and leaves two of them good")
    whole = sum(SHARES[place] for place in groups)
    units: list[Batch] = []
    for place, numbers in groups.items():
        each = int(np.ceil(runs * SHARES[place] / whole / len(numbers)))
        units += [Batch(n, c, min(CHUNK, each - c * CHUNK), seed) for n in numbers for c in range(-(-each // CHUNK))]
    return units


def combinations(plan: Plan) -> list[int]:
    """Return the first run of each combination of cases."""
    firsts: dict[tuple[Any, ...], int] = {}
    for number, choice in enumerate(plan.choices):
        firsts.setdefault(tuple(choice[group] for group in plan.campaign.cases), number)
    return list(firsts.values())


Counts = NDArray[np.int64]


def fly_trials(made: Cell, trials: Trials, drawn: Callable[[], object]) -> tuple[NDArray[Any], Counts, Counts]:
    """Run trials; return (T,) RESULT, and (5,) frames and isolations of healthy channels by level.

    drawn : fills the streams of ``trials``; called whenever they are used up
    """
    results, scratch, done = np.zeros(len(trials.first), RESULT), _scratch(made, trials), 0
    healthy, failed = np.zeros(LEVELS, np.int64), np.zeros(LEVELS, np.int64)
    while done < len(results):
        drawn()
        done = run_trials(trials, done, scratch, results, healthy, failed)
    return results, healthy, failed


def recorded_trials(
    made: Cell, trials: Trials, drawn: Callable[[], object]
) -> Iterator[tuple[slice, dict[str, NDArray[Any]]]]:
    """Yield the input of a manager in trials that all begin with the flight: their numbers, and (T, n, ...) each.

    drawn : as in ``fly_trials``, and with the same samples
    A trial that ends before the longest repeats its last frame.
    """
    scratch, at, frames = _scratch(made, trials), len(trials.noise), trials.last - trials.first
    for begin in range(0, len(frames), S):
        part = slice(begin, min(begin + S, len(frames)))
        longest = int(frames[part].max())
        shape = (part.stop - begin, longest, CHANNELS)
        read = {"channels": np.empty(shape), "valid": np.empty(shape, np.uint8), "ilm": np.empty(shape, np.uint8)}
        both = {"reference": np.empty(shape[:2]), "second_reference": np.full(shape[:2], np.nan)}
        for i, j in enumerate(range(begin, part.stop)):
            if at + frames[j] > len(trials.noise):
                drawn()
                at = 0
            begin_trial(trials, j, scratch)
            record_trial(trials, j, at, scratch, *(each[i] for each in read.values()))
            at += int(frames[j])
            here = slice(trials.first[j], trials.last[j])
            stepped = np.arange(here.start, here.stop) >= trials.reference_from[j]
            both["reference"][i, : frames[j]] = trials.reference[here] + stepped * trials.reference_step[j]
            both["second_reference"][i, : frames[j]] = trials.second[here]
            for each in (*read.values(), *both.values()):
                each[i, frames[j] :] = each[i, frames[j] - 1]
        yield part, {**read, **both}


def _scratch(made: Cell, trials: Trials) -> Scratch:
    one, faults = made.one, made.faults
    data: FaultData = faults.data
    targets = trials.targets.shape[1]
    blank = FaultData(**{**data._asdict(), "kept": np.zeros(targets, KEPT), "clean": faults.clean[:0]})
    params = one.manager.params
    signal = blank_records(params["threshold"], params["fitted"], lingers(params))
    return Scratch(
        row=np.zeros(1, ROW),
        blank_memory=np.zeros_like(one.memory),
        memory=one.memory,
        line=one.line,
        no_drift=np.zeros((0, 0, 0)),
        no_alarms=np.zeros((0, 0, 0), np.uint8),
        no_discretes=np.zeros(D, np.int64)[:0],
        faults=blank,
        blank_kept=np.zeros(1, KEPT),
        manager=one.manager.data,
        blank_manager=one.manager.new_state(),
        signal=signal.copy(),
        blank_signal=signal,
    )


def tallied(made: Cell, trials: Trials, results: NDArray[Any]) -> NDArray[np.int64]:
    """Return the counts by good channels, see Tally; a trial whose channels were isolated before does not count."""
    counted_faults = [made.tested] if made.second is None else [made.tested, made.second]
    columns = made.faults.targets[np.isin(made.faults.targets["fault"], counted_faults)]["column"]
    failed_at = results["failed_at"][:, columns]
    lost = results["lost"] != 0
    off = off_votes(made, results)
    settled = ~lost & ~off & (failed_at != NEVER).all(axis=1)
    frames = np.where(settled, failed_at.max(axis=1) - trials.onset, 0)
    per_trial = np.column_stack([np.ones_like(frames), lost, ~lost & off, settled, frames])
    counts = np.zeros((LEVELS, 5), np.int64)
    counted = results["in_use"] > 0
    np.add.at(counts, results["good_before"][counted], per_trial[counted])
    return counts


def off_votes(made: Cell, results: NDArray[Any]) -> NDArray[np.bool_]:
    """Return (T,) True if the vote was wrong, as in rig/verdict/row_kernel.py."""
    return (results["off"] != 0) | (results["above"] > allowed_frames(made.one.manager.params[0]))


def added_up(tallies: Sequence[Tally], manager: str) -> Cells:
    """Return the cells of all units."""
    rows: dict[tuple[Any, ...], NDArray[np.int64]] = {}
    hours: dict[str, NDArray[np.int64]] = {}
    for tally in tallies:
        signal, _, design, kind, condition = tally.cell
        for good in range(1, LEVELS):
            if not leaves_two_good(good, design):  # healthy channels were isolated before
                continue
            place = signal, good, design, kind, condition
            rows[place] = rows.get(place, 0) + tally.counts[good]
        hours[signal] = hours.get(signal, 0) + np.stack([tally.healthy, tally.failed])
    rate_hz = tallies[0].rate_hz
    counts = [_row(place, found, rate_hz) for place, found in sorted(rows.items()) if found[0] > 0]
    false = [
        (signal, level, float(found[0, level] / rate_hz / 3600.0), int(found[1, level]))
        for signal, found in sorted(hours.items())
        for level in range(CHANNELS, 0, -1)
    ]
    return Cells(
        manager,
        pl.DataFrame(counts, schema=COUNTS, orient="row").sort(CELL),
        pl.DataFrame(false, schema=FALSE_ISOLATIONS, orient="row"),
    )


def _row(place: tuple[Any, ...], found: NDArray[np.int64], rate_hz: float) -> tuple[Any, ...]:
    """Return a row of COUNTS; the trials were open loop, so no aircraft can be lost."""
    trials, known, bad, settled, frames = found.tolist()
    mean = frames / settled / rate_hz if settled else None
    return (*place, trials, trials - known - bad, known, bad, None, None, settled, mean)
