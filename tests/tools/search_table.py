"""Violations that each method finds, seed by seed, where about 2 % of random flights violate.

    python tests/tools/search_table.py [--trials] [--space f16] [--arms 1] [--method regions] [--seeds 3 11]
                                       [--flights 240] [--workers 1] [--no-trials-first]

A space: two drifts and an offset of one sign on three channels of one signal, each 0.4 to 10 thresholds (drifts: a
twentieth to five thresholds a second) from 3 to 6 s, in a flight of 14 s in light turbulence with the default manager.
The requirement bounds the error of the vote.  Its bound is the one that 2 % of 500 random flights (or trials) pass.
With more arms the others hold the same faults at a fiftieth of the sizes, so that one alone can violate.

apart: violations that are 0.5 of the unit cube apart, the median.  clusters: as a search tells them, the median.
cpu: seconds of the process, flights included: of the whole search, until the first violation, and until five clusters,
as medians; "-": not in half of the searches.  No cluster is confirmed.
beside flights: CPU seconds of the trials before them and, without these, of what chooses them, as medians.
with more arms: violations of the arm that can violate, and of all others.
"""

from __future__ import annotations

import argparse
import math
from functools import cache
from multiprocessing import Pool
from statistics import median
from time import process_time
from typing import Any, Final, NamedTuple, get_args

import numpy as np
from search_here import DURATION_S, KINDS, START_S

from rig.core.interrupt import Stop
from rig.studies.campaign.campaign_file import from_what
from rig.studies.campaign.plan import Run
from rig.studies.campaign.tables import measured as row_of
from rig.studies.search.clusters import clusters
from rig.studies.search.objective import Measured
from rig.studies.search.open_loop import trial_row
from rig.studies.search.rounds import Method
from rig.studies.search.search_plan import Asked, SearchPlan
from rig.studies.search.trials_first import tried
from rig.verdict.requirements.measure import fly_requirements
from rig.verdict.requirements.requirement import Requirement

SPACES: Final = {
    "f16": ("f16", "pitch_rate"),
    "b747": ("b747", "normal_load_factor"),
    "b737": ("b737", "angle_of_attack"),
    "f16-roll": ("f16", "roll_rate"),
    "b747-pitch": ("b747", "pitch_angle"),
    "b737-pressure": ("b737", "static_pressure"),
}
FAULTS: Final = ("drift", "drift", "offset")
ID: Final = "bounded"
RANDOM: Final = 500
SHARE: Final = 0.02
FIVE: Final = 5  # clusters that a search confirms
_RANDOM_SEED: Final = 1000
_HARMLESS: Final = 0.02


class Job(NamedTuple):
    """One search."""

    space: str
    arms: int
    method: Method
    seed: int
    flights: int
    trials: bool
    bound: float
    trials_first: bool = False


def plan_of(job: Job) -> SearchPlan:
    """Return the plan of a search."""
    aircraft, signal = SPACES[job.space]
    cases = [_case(i, signal, 1.0 if i == 0 else _HARMLESS * 0.9**i) for i in range(job.arms)]
    base = {"title": job.space, "aircraft": aircraft, "duration_s": DURATION_S, "turbulence": "light"}
    given = {"base": base, "sampling": "random", "runs": 1, "cases": {"size": cases}}
    formula = f"always[0.1, 6] abs(error.{{signal}}) <= {job.bound!r} * threshold.{{signal}}"
    requirement = Requirement(id=ID, at="each onset", formula=formula)
    asked = Asked((ID,), job.flights, job.method, seed=job.seed, bench=job.trials, trials_first=job.trials_first)
    return SearchPlan(from_what(given, job.space), job.space, asked, [requirement])


def _case(number: int, signal: str, times: float) -> dict[str, Any]:
    tables, vary = [], {}
    for i, kind in enumerate(FAULTS):
        size, varied = KINDS[kind]
        tables.append({"kind": kind, "signal": signal, "channels": [i + 1], "start_s": 4.0, size: times})
        vary |= {f"faults.{i}.{size}": {**varied, "low": times * varied["low"], "high": times * varied["high"]}}
        vary |= {f"faults.{i}.start_s": START_S}
    return {"name": f"size {number}", "set": {"faults": tables}, "vary": vary}


class Results(NamedTuple):
    """What each draw of a plan is worth, with CPU times in seconds."""

    results: list[Measured]
    times: list[float]  # of the process after each draw
    trials_s: float  # of the trials before the flights
    flights_s: float


def results_of(plan: SearchPlan) -> Results:
    """Search by a plan."""
    began, starts = process_time(), dict[str, Any]()
    if plan.asked.trials_first:
        starts = {"starts": tried(plan, Stop()).starts}
    trials_s, flights_s, times = process_time() - began, 0.0, list[float]()

    def rows_of(numbers: list[int]) -> list[dict[str, Any]]:
        nonlocal flights_s
        rows, began = [], process_time()
        for number in numbers:
            rows.append(row(plan[number], plan))
            times.append(process_time())
        flights_s += process_time() - began
        return rows

    results = plan.search(rows_of, lambda _: None, **starts).results
    return Results(results, times, trials_s, flights_s)


def row(run: Run, plan: SearchPlan) -> dict[str, Any]:
    if plan.asked.bench:
        return trial_row(run, plan.requirements)
    return row_of(fly_requirements(run.scenario(_tables(run.aircraft)), plan.requirements))


@cache
def _tables(aircraft: str) -> dict[str, Any]:
    from rig.scenario.aircraft import tables

    return tables(aircraft)


def bound_of(given: tuple[str, bool]) -> float:
    """Return the bound in thresholds that the SHARE of random flights of a space passes."""
    name, trials = given
    plan = plan_of(Job(name, 1, "random", _RANDOM_SEED, RANDOM, trials, 0.0))
    return round(float(-np.quantile([each.robustness for each in results_of(plan).results], SHARE)), 3)


class Found(NamedTuple):
    """What a search found."""

    violations: int
    first: int | None
    apart: int
    clusters: int
    cpu_s: float
    first_s: float  # CPU time until the first violation; infinite if there is none
    five_s: float  # until five clusters
    trials_s: float
    choosing_s: float  # neither trials nor flights
    others: int  # violations of arms that should not violate


def search(job: Job) -> Found:
    """Search once."""
    began, plan = process_time(), plan_of(job)
    results, times, trials_s, flights_s = results_of(plan)
    found = [i for i, each in enumerate(results) if each.violated]
    kept: list[int] = []
    for i in found:
        near = (k for k in kept if plan.draws[k].arm == plan.draws[i].arm)
        if all(np.linalg.norm(plan.draws[k].point - plan.draws[i].point) >= 0.5 for k in near):
            kept.append(i)
    first_s = times[found[0]] - began if found else math.inf
    counts = [clusters_of(plan, results[: i + 1]) for i in found]
    five_s = next((times[i] - began for i, count in zip(found, counts, strict=True) if count >= FIVE), math.inf)
    first, last = found[0] + 1 if found else None, counts[-1] if found else 0
    cpu_s, others = times[-1] - began, sum(plan.draws[i].arm != 0 for i in found)
    choosing_s = cpu_s - trials_s - flights_s
    return Found(len(found), first, len(kept), last, cpu_s, first_s, five_s, trials_s, choosing_s, others)


def clusters_of(plan: SearchPlan, results: list[Measured]) -> int:
    """Return the number of clusters of the first draws of a plan."""
    draws = plan.draws[: len(results)]
    return len(clusters(draws, [each.value for each in results], [each.violated for each in results]))


def show(name: str, method: str, found: list[Found], arms: int) -> None:
    """Print the line of a method: violations by seed, least and median, first violation."""
    counts, firsts = [each.violations for each in found], [each.first or 10**9 for each in found]
    text = " ".join(f"{count:3d}" for count in counts)
    first = " ".join("  -" if each.first is None else f"{each.first:3d}" for each in found)
    within = sum(each <= 100 for each in firsts)
    others = sum(each.others for each in found)
    by_arm = f" | by arm: {sum(counts) - others}, others {others}" if arms > 1 else ""
    print(
        f"{name:14} {method:8} {text} | least {min(counts):3d} median {np.median(counts):5.1f} | first {first}, "
        f"within 100: {within} of {len(found)} | apart {np.median([f.apart for f in found]):.0f} "
        f"clusters {np.median([f.clusters for f in found]):.0f} | "
        f"cpu {_median(found, 'cpu_s')} s, {_median(found, 'first_s')} s, {_median(found, 'five_s')} s"
        f" | beside flights {_median(found, 'trials_s')} s, {_median(found, 'choosing_s')} s{by_arm}",
        flush=True,
    )


def _median(found: list[Found], name: str) -> str:
    value = median([getattr(each, name) for each in found])
    return f"{value:.1f}" if math.isfinite(value) else "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", action="store_true", help="open-loop trials in place of flights")
    parser.add_argument("--space", action="append", choices=SPACES)
    parser.add_argument("--method", action="append", choices=get_args(Method))
    parser.add_argument("--arms", type=int, action="append")
    parser.add_argument("--seeds", type=int, nargs=2, default=(3, 11))
    parser.add_argument("--flights", type=int, default=240)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--trials-first", action=argparse.BooleanOptionalAction, default=True, help="for regions")
    parser.add_argument("--bound", type=float, help="in thresholds, known from an earlier call; for one space")
    given = parser.parse_args()
    with Pool(given.workers) as pool:
        for name in given.space or list(SPACES):
            bound = given.bound or pool.apply(bound_of, ((name, given.trials),))
            print(f"{name}: bound {bound} thresholds, {'trials' if given.trials else 'flights'}", flush=True)
            for arms in given.arms or [1]:
                for method in given.method or get_args(Method):
                    seeds = range(*given.seeds)
                    trials_first = given.trials_first and not given.trials and method == "regions"
                    size = given.flights, given.trials, bound, trials_first
                    found = pool.map(search, [Job(name, arms, method, seed, *size) for seed in seeds], 1)
                    show(f"{name}, {arms}", f"{method}{', trials first' if trials_first else ''}", found, arms)


if __name__ == "__main__":
    main()
