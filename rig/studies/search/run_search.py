"""One search in a folder: draw, fly the missing flights, evaluate; then confirm the worst case and shrink it.

    campaign.json, runs/, ...   the folder of a campaign: all flights of the search
    confirmed/                  another: flights on new seeds, of the candidates and of the shrunk scenarios
    worst.toml, search.html     the scenario, the page; search.json  the figures

The flights depend only on campaign, requirements, options and seed; a resumed search reads the existing table.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.files import require_place
from rig.core.interrupt import Stop, interruptible
from rig.core.outputs import BESIDE_RUNS
from rig.core.progress import tell
from rig.scenario.overrides import parse_set, set_key
from rig.studies.campaign import tables as table
from rig.studies.campaign.folder import not_flown
from rig.studies.campaign.run_campaign import Ending, pool_of
from rig.studies.campaign.study_folder import write_whole
from rig.studies.campaign.worker import fly_batch
from rig.studies.search import open_loop as bench
from rig.studies.search import picture
from rig.studies.search import search_result as result
from rig.studies.search.confirm_worst import SEEDS, Confirmed, Fly, Table, confirm, least_apart, new_seeds, worst
from rig.studies.search.fly_missing import Flown, Interrupted, flown, refuse_violated, require_known
from rig.studies.search.objective import Measured, deciding, measured
from rig.studies.search.search_plan import ConfirmPlan, SearchPlan
from rig.studies.search.shrink import SEEDS as SHRINK_SEEDS
from rig.studies.search.shrink import shrink, simplest
from rig.studies.search.trials_first import trial_plan, tried
from rig.studies.search.worst_flight import decision
from rig.unit.unit_file import Unit
from rig.verdict.requirements.robustness import robustness_text

CONFIRMED: Final = "confirmed"


@dataclass(frozen=True, slots=True)
class Ended(Ending):
    """The end of a call of ``run``."""

    figures: dict[str, Any]  # as ``--json`` prints them; empty when interrupted
    table_sha256: str
    flights: int  # in the folder
    wall_s: float


def run(
    plan: SearchPlan,
    out: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    unit: Unit | None = None,
) -> Ended:
    """Search into the folder ``out``, or resume there; unit : under test, which flies.

    BadInput before anything is written; RigError: the disk is full, or workers keep stopping.
    """
    if unit is not None and (plan.asked.bench or plan.asked.trials_first):
        option = "--bench" if plan.asked.bench else "--trials-first"
        raise BadInput(f"--unit: not with {option}, which votes without a flight")
    began, batch = perf_counter(), bench.run_batch if plan.asked.bench else fly_batch
    pool, kill = pool_of(plan, workers, scheduler, unit), True
    try:
        plan.check()
        if plan.asked.bench:
            bench.check(plan)
        if plan.asked.trials_first:
            trial_plan(plan)
        _require_begun_or_new(plan, out, unit)
        with interruptible(again=True) as stop:
            try:
                refuse_violated(plan, out, pool, stop, unit)
            except Interrupted:
                kill = stop.insisted
                return Ended({}, "", 0, perf_counter() - began, interrupted=True, signal=stop.signal)
            with flown(plan, out, pool, stop, unit, batch) as flights:
                figures: dict[str, Any] = {}
                with suppress(Interrupted):  # the flown flights are in the folder; the same command resumes
                    found = _searched(plan, flights, stop)
                    # in open loop or not
                    with flown(ConfirmPlan(plan), out / CONFIRMED, pool, stop, unit) as others:
                        figures = _finished(plan, found, others, out)
                kill = stop.insisted
                tables = flights.folder.tables
            runs, took_s = tables["runs"], perf_counter() - began
            end: dict[str, Any] = {"interrupted": stop.requested and not figures, "signal": stop.signal}
            return Ended(figures, table.sha256(tables), len(runs), took_s, **end, **not_flown(runs))
    finally:
        pool.close(kill)


@dataclass(frozen=True, slots=True)
class _Found:
    """The values that a search measured, and the requirements that it used."""

    ids: tuple[str, ...]
    results: list[Measured]  # of each draw, in their order
    trials: dict[str, int]  # figures of those before the flights; empty if there are none


def _require_begun_or_new(plan: SearchPlan, out: Path, unit: Unit | None) -> None:
    """Raise BadInput before the first flight if the flights on new seeds or a result could not be written."""
    require_known(ConfirmPlan(plan), out / CONFIRMED, unit)
    if out.is_dir():
        for name in BESIDE_RUNS:
            require_place(out / name)


def _searched(plan: SearchPlan, flights: Flown, stop: Stop) -> _Found:
    """Fly the draws; return the value of each.  Interrupted: asked to stop."""
    trials = tried(plan, stop) if plan.asked.trials_first else None
    results: list[Measured] = []
    ids: tuple[str, ...] = ()
    coming = plan.schedule(starts=trials.starts) if trials else plan.schedule()
    next(coming)
    numbers = list(range(len(plan.choices)))  # the first flights are in the plan already
    while True:
        rows = flights.rows(numbers)
        together = plan.of_one_draw
        draws = [rows[i : i + together] for i in range(0, len(rows), together)]
        ids = ids or deciding(draws, plan.asked.requirements)  # the draws that no method chose come first
        new = [measured(draw, ids) for draw in draws]
        results += new
        least = robustness_text(min(result.robustness for result in results)) or "none yet"
        tell(f"{len(plan.choices)} flights, least robustness {least}", len(plan.choices) - 1, len(plan))
        try:
            numbers = plan.add(coming.send(new))
        except StopIteration:
            return _Found(ids, results, trials.agreement(results[plan.random :]) if trials else {})


def _finished(plan: SearchPlan, searched: _Found, others: Flown, out: Path) -> dict[str, Any]:
    """Confirm, shrink, write scenario and page; return the figures."""
    tell("confirming on new seeds")
    fly, found = _flying(plan, others, searched.ids), searched.results
    places = least_apart(plan.draws, [each.value for each in found])
    first = len(plan)
    seeds = new_seeds(plan.campaign, first, SEEDS)
    candidates = confirm([plan.data(i * plan.of_one_draw) for i in places], seeds, fly)
    chosen = worst(candidates)
    shrunk: Confirmed = chosen
    if chosen.violations:
        tell("shrinking")
        few = new_seeds(plan.campaign, first + SEEDS, SHRINK_SEEDS)
        kept = shrink(chosen.table, few, fly)
        last = new_seeds(plan.campaign, first + SEEDS + SHRINK_SEEDS, SEEDS)
        shrunk = simplest(kept, last, fly)
    figures = result.figures(plan, found, places, candidates, chosen, shrunk, out)
    figures["left_out"] = [each for each in plan.asked.requirements if each not in searched.ids]
    if searched.trials:
        figures["trials"] = searched.trials
    if shrunk.violations:
        result.write_scenario(out / result.SCENARIO, plan, shrunk)
    tell("drawing the worst flight")
    write_whole(out / result.FIGURES, json.dumps(figures, indent=1, allow_nan=False).encode())
    drawn = decision(plan, figures["worst"]["run"])
    picture.write(out / result.PICTURE, plan, found, figures, shrunk.table, drawn)
    return figures


def _flying(plan: SearchPlan, others: Flown, ids: tuple[str, ...]) -> Fly:
    """Return the function that flies other tables, each in both settings if the search is against another."""
    confirming, against = others.plan, plan.asked.against
    assert isinstance(confirming, ConfirmPlan)

    def fly(tables: Sequence[Table]) -> list[Measured]:
        pairs = [[each] for each in tables]
        if against is not None:
            key, value = parse_set(against)
            pairs = [[each, set_key(each, key, value, "--against")] for each in tables]
        rows = others.rows(confirming.add([each for pair in pairs for each in pair]))
        return [measured(rows[i : i + plan.of_one_draw], ids) for i in range(0, len(rows), plan.of_one_draw)]

    return fly
