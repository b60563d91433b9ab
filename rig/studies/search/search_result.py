"""The results of a search: figures as ``--json`` prints them, and the scenario file of the worst case."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from rig.core.outputs import BESIDE_RUNS
from rig.studies.campaign.statistics import at_most
from rig.studies.campaign.study_folder import write_whole
from rig.studies.search.confirm_worst import SEEDS, Confirmed
from rig.studies.search.objective import Measured
from rig.studies.search.search_plan import SearchPlan
from rig.verdict.requirements.requirement import load_requirements, names
from rig.verdict.requirements.robustness import number_of

FIGURES, SCENARIO, PICTURE = BESIDE_RUNS


def figures(
    plan: SearchPlan,
    found: Sequence[Measured],
    places: Sequence[int],
    candidates: Sequence[Confirmed],
    chosen: Confirmed,
    shrunk: Confirmed,
    out: Path,
) -> dict[str, Any]:
    """Return the figures of a search; ``places``: of the candidates among the draws ``found``."""
    at_random = sum(each.violated for each in found[: plan.random])
    worst = places[list(candidates).index(chosen)]
    return {
        "flights": len(plan.choices),
        "violated": sum(each.violated for each in found),
        "random": {"flights": plan.random, "violated": at_random, "upper_95": at_most(at_random, plan.random)},
        "robustness": number_of(min(each.robustness for each in found)),
        "worst": {
            "run": worst * plan.of_one_draw,
            "arm": plan.arms[plan.draws[worst].arm].name,
            "robustness": number_of(found[worst].robustness),
            "median_robustness": number_of(chosen.median_robustness),
            "confirmed": [chosen.violations, len(chosen.seeds)],
            "varied": plan.choices[worst * plan.of_one_draw],
        },
        "scenario": str(out / SCENARIO) if shrunk.violations else None,
        "confirmed": [shrunk.violations, SEEDS],
        "violating": shrunk.violating,
    }


def write_scenario(path: Path, plan: SearchPlan, shrunk: Confirmed) -> None:
    """Write the scenario of a worst case, with a seed that violates, and the bundled sets of its requirements."""
    asked = plan.asked
    requirements = [each for each in plan.requirements if each.id in shrunk.violating]
    base = plan.campaign.title or str(shrunk.table.get("title", plan.source))
    seeds = len(shrunk.seeds)
    violated = ", ".join(f"{name} violated in {count} of {seeds} seeds" for name, count in shrunk.violating.items())
    other = "" if asked.against is None else f", and met with {asked.against}"
    texts = [f"#   {each.id}: {' '.join(each.formula.split())}" for each in requirements]
    head = "\n".join([f"# Found by rig search: {violated}{other}. Violated requirements:", *texts])
    table = {**shrunk.table, "title": f"{base}: {violated}", "seed": shrunk.seed}
    asked_for = [dict(each) for each in requirements]
    sets = [name for name in names() if any(dict(each) in asked_for for each in load_requirements([name]))]
    if sets:
        table["requirements"] = sets
    write_whole(path, f"{head}\n{tomli_w.dumps(_simple_first(table))}".encode())


def _simple_first(table: dict[str, Any]) -> dict[str, Any]:
    """Return a table with its title first and its subtables last."""
    nested = {key: value for key, value in table.items() if isinstance(value, dict) or key == "faults"}
    return {"title": table["title"], **{key: value for key, value in table.items() if key not in nested}, **nested}
