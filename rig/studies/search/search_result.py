"""The results of a search: figures as ``--json`` prints them, and the scenario files of the worst cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from rig.core.outputs import BESIDE_RUNS
from rig.studies.campaign.statistics import at_most
from rig.studies.campaign.study_folder import write_whole
from rig.studies.search.confirm_worst import Confirmed
from rig.studies.search.fault_sentences import fault_places, fault_sentences, shown
from rig.studies.search.objective import Measured
from rig.studies.search.search_plan import Searched, SearchPlan
from rig.studies.search.worst_cases import Case
from rig.verdict.requirements.requirement import load_requirements, names
from rig.verdict.requirements.robustness import number_of

FIGURES, PICTURE, *SCENARIOS = BESIDE_RUNS  # a scenario of each case


def figures(plan: SearchPlan, searched: Searched, clusters: int, cases: Sequence[Case], out: Path) -> dict[str, Any]:
    """Return the figures of a search; clusters : in all; cases : of the first ones."""
    found, flights, most = searched.results, len(plan.choices), len(plan)
    at_random = sum(each.violated for each in found[: plan.random])
    spent = f"all {most} flights are flown" if flights == most else f"no further draw fits into {most} flights"
    return {
        "flights": flights,
        "violated": sum(each.violated for each in found),
        "robustness": number_of(min(each.robustness for each in found)),
        "clusters_found": clusters,
        "clusters": [
            _of_case(plan, found, each, out / name) for each, name in zip(cases, SCENARIOS, strict=False)
        ],
        "random": {"flights": plan.random, "violated": at_random, "upper_95": at_most(at_random, plan.random)},
        "ended": "; ".join(filter(None, [spent, searched.standing])),
        "left_out": [each for each in plan.asked.requirements if each not in searched.ids],
    }  # fmt: skip


def _of_case(plan: SearchPlan, found: Sequence[Measured], case: Case, scenario: Path) -> dict[str, Any]:
    run, arm, table = case.place * plan.of_one_draw, plan.arms[case.cluster.arm], case.found.table
    varied = [plan.choices[place * plan.of_one_draw] for place in case.cluster.places]
    ranges = {key: [min(each[key] for each in varied), max(each[key] for each in varied)] for key in arm.valuers}
    return {
        "arm": arm.name,
        "faults": fault_places(table),
        "ranges": ranges,
        "ranges_shown": {key: _range(key, ends[0], ends[1], table) for key, ends in ranges.items()},
        "flights": len(case.cluster.places),
        "robustness": number_of(found[case.cluster.places[0]].robustness),
        "run": run,
        "varied": plan.choices[run],
        **_share(case.found),
        "median_robustness": number_of(case.found.median_robustness),
        "smallest": {"faults": fault_sentences(case.smallest.table), **_share(case.smallest)},
        "scenario": str(scenario) if case.kept.violations else None,
    }


def _range(key: str, least: Any, most: Any, table: dict[str, Any]) -> str:
    """Return a range as text, with its unit once."""
    low, high = shown(key, least, table), shown(key, most, table)
    unit = low.partition(" ")[2]
    return low if low == high else f"{low.removesuffix(f' {unit}')} to {high}"


def _share(confirmed: Confirmed) -> dict[str, Any]:
    share = confirmed.share
    return {
        "confirmed": [confirmed.violations, len(confirmed.seeds)],
        "interval": [share.low, share.high],
        "violating": confirmed.violating,
    }


def write_scenario(path: Path, plan: SearchPlan, kept: Confirmed) -> None:
    """Write the scenario of a worst case, with a seed that violates, and the bundled sets of its requirements."""
    asked = plan.asked
    requirements = [each for each in plan.requirements if each.id in kept.violating]
    base = plan.campaign.title or str(kept.table.get("title", plan.source))
    seeds = len(kept.seeds)
    violated = ", ".join(f"{name} violated in {count} of {seeds} seeds" for name, count in kept.violating.items())
    other = "" if asked.against is None else f", and met with {asked.against}"
    texts = [f"#   {each.id}: {' '.join(each.formula.split())}" for each in requirements]
    head = "\n".join([f"# Found by rig search: {violated}{other}. Violated requirements:", *texts])
    table = {**kept.table, "title": f"{base}: {violated}", "seed": kept.seed}
    asked_for = [dict(each) for each in requirements]
    sets = [name for name in names() if any(dict(each) in asked_for for each in load_requirements([name]))]
    if sets:
        table["requirements"] = sets
    write_whole(path, f"{head}\n{tomli_w.dumps(_simple_first(table))}".encode())


def _simple_first(table: dict[str, Any]) -> dict[str, Any]:
    """Return a table with its title first and its subtables last."""
    nested = {key: value for key, value in table.items() if isinstance(value, dict) or key == "faults"}
    return {"title": table["title"], **{key: value for key, value in table.items() if key not in nested}, **nested}
