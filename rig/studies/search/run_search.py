"""One search in a folder: draw, fly the missing flights, evaluate; then the worst case of each cluster of finds.

    campaign.json, runs/, ...   the folder of a campaign: all flights of the search
    confirmed/                  another: flights on new seeds, of the candidates and of the shrunk scenarios
    worst.toml, worst_2.toml    the scenarios; search.html  the page; search.json  the figures

The flights depend only on campaign, requirements, options and seed; a resumed search reads the existing table.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
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
from rig.studies.campaign.sampling import seed_of
from rig.studies.campaign.study_folder import write_whole
from rig.studies.campaign.worker import fly_batch
from rig.studies.search import open_loop as bench
from rig.studies.search import picture
from rig.studies.search import search_result as result
from rig.studies.search.clusters import clusters
from rig.studies.search.confirm_worst import Fly, Table
from rig.studies.search.fly_missing import OF_HEALTHY, Flown, Interrupted, flown, refuse_violated, require_known
from rig.studies.search.objective import Measured, measured
from rig.studies.search.search_plan import ConfirmPlan, Searched, SearchPlan
from rig.studies.search.trials_first import trial_plan, tried
from rig.studies.search.worst_cases import worst_cases
from rig.studies.search.worst_flight import worst_flights
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
                    found, more = _searched(plan, flights, stop)
                    # in open loop or not
                    with flown(ConfirmPlan(plan), out / CONFIRMED, pool, stop, unit) as others:
                        figures = _finished(plan, found, others, out, unit, more)
                kill = stop.insisted
                tables = flights.folder.tables
            runs, took_s = tables["runs"], perf_counter() - began
            end: dict[str, Any] = {"interrupted": stop.requested and not figures, "signal": stop.signal}
            return Ended(figures, table.sha256(tables), len(runs), took_s, **end, **not_flown(runs))
    finally:
        pool.close(kill)


def _require_begun_or_new(plan: SearchPlan, out: Path, unit: Unit | None) -> None:
    """Raise BadInput before the first flight if the flights on new seeds or a result could not be written."""
    require_known(ConfirmPlan(plan), out / CONFIRMED, unit)
    if out.is_dir():
        for name in BESIDE_RUNS:
            require_place(out / name)


def _searched(plan: SearchPlan, flights: Flown, stop: Stop) -> tuple[Searched, dict[str, Any]]:
    """Fly the draws; return their values, and the figures of trials before them.  Interrupted: asked to stop."""

    def told(results: list[Measured]) -> None:
        least = robustness_text(min(result.robustness for result in results)) or "none yet"
        tell(f"{len(plan.choices)} flights, least robustness {least}", len(plan.choices) - 1, len(plan))

    if not plan.asked.trials_first:
        return plan.search(flights.rows, told), {}
    trials = tried(plan, stop)
    searched = plan.search(flights.rows, told, starts=trials.starts)
    return searched, {"trials": trials.agreement(searched.results[plan.random :])}


def _finished(
    plan: SearchPlan, searched: Searched, others: Flown, out: Path, unit: Unit | None, more: dict[str, Any]
) -> dict[str, Any]:
    """Confirm and shrink the worst case of each cluster, write scenarios and page; return the figures with ``more``."""
    fly, found = _flying(plan, others, searched.ids), searched.results
    groups = clusters(plan.draws, [each.value for each in found], [each.violated for each in found])
    seeds = (seed_of(plan.campaign, number) for number in count(len(plan) + OF_HEALTHY))
    cases = worst_cases(groups, plan.draws, lambda place: plan.data(place * plan.of_one_draw), seeds, fly)
    figures = result.figures(plan, searched, len(groups), cases, out) | more
    for each, name in zip(cases, result.SCENARIOS, strict=False):
        if each.kept.violations:
            result.write_scenario(out / name, plan, each.kept)
    tell("drawing the worst flights")
    write_whole(out / result.FIGURES, json.dumps(figures, indent=1, allow_nan=False).encode())
    picture.write(out / result.PICTURE, plan, found, figures, worst_flights(plan, found, cases, unit))
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
        return [measured(of_draw, ids) for of_draw in plan.by_draw(rows)]

    return fly
