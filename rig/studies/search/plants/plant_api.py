"""``rig.search``: search for inputs of a Python function that violate requirements on what it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.studies.campaign.manager_source import sources_beside
from rig.studies.search.plants.plant_call import Function
from rig.studies.search.plants.plant_file import PlantPlan, read_plan
from rig.studies.search.plants.plant_workers import Here, processes, split_reference
from rig.studies.search.plants.run_plant_search import PlantAsked, PlantSearched, search_plant


def search(
    function: Function | str,
    plan: PlantPlan | Path | str | Mapping[str, Any],
    *,
    simulations: int = 300,
    requirements: Sequence[str] = (),
    method: str = "regions",
    seed: int = 0,
    out: Path | str | None = None,
    workers: int = 1,
) -> PlantSearched:
    """Search for numbers and signals with which a plant violates its requirements.

    function : of the arguments that the plan names, which returns times (n,) in s and a table of columns (n,) by name;
        it runs in this process.  Or "FILE.py:function"
    plan : TOML file, or its tables
    simulations : number of points that are simulated
    requirements : ids; all of the plan if there are none
    method : regions, cma or random
    seed : seed of the search
    out : folder for the results, in which an unfinished search resumes; None: nothing is written
    workers : number of processes for "FILE.py:function"
    BadInput, one line: names the file and the key.
    """
    settings = plan if isinstance(plan, PlantPlan) else read_plan(plan)
    asked = PlantAsked(simulations, tuple(dict.fromkeys(requirements)), method, seed)
    folder = None if out is None else Path(out)
    if isinstance(function, str):
        with processes(function, settings.timeout_s, workers) as runner:
            return search_plant(settings, asked, runner, folder, sources_beside(split_reference(function)[0]))
    runner = Here(function, settings.timeout_s)
    return search_plant(settings, asked, runner, folder, {"function": runner.called})
