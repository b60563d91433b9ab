"""The figures of a search over a plant, as ``--json`` prints them, and the traces of its clusters."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.core.outputs import BESIDE_RUNS
from rig.studies.campaign.study_folder import write_whole
from rig.studies.search.plants.plant_clusters import confirmed, found_in
from rig.studies.search.plants.plant_rounds import Simulated, Simulating, seeds_of
from rig.studies.search.rounds import Draw, first_count
from rig.verdict.requirements.robustness import number_of

FIGURES: Final = BESIDE_RUNS[0]


def figures_of(
    simulating: Simulating, draws: Sequence[Draw], results: Sequence[Simulated], seed: int, out: Path | None
) -> dict[str, Any]:
    """Return the figures of a search, and write them and the traces of its clusters into ``out``."""
    first, found = first_count(simulating.space.arms, len(draws)), found_in(draws, results)
    failed = [each.failed for each in results if each.failed]
    told = confirmed(simulating, draws, results, found, seed)
    figures = {
        "simulations": len(results),
        "violated": sum(each.violated for each in results),
        "violating": _by_requirement(simulating, results),
        "first_violation": next((i + 1 for i, each in enumerate(results) if each.violated), None),
        "robustness": number_of(min(each.robustness for each in results)),
        "first": {"simulations": first, "violated": sum(each.violated for each in results[:first])},
        "failed": len(failed),
        "first_reason": failed[0] if failed else None,
        "printed": next((each.printed for each in results if each.printed), None),
        "clusters_found": len(found),
        "clusters": told,
    }
    if out is not None:
        repeats = simulating.space.plan.repeats
        for number, each in enumerate(told, 1):
            path, place = out / f"cluster_{number}.csv", each["number"] - 1
            write_trace(path, simulating, draws[place], seeds_of(seed, place * repeats, 1)[0])
            each["trace"] = str(path)
        write_whole(out / FIGURES, json.dumps(figures, indent=1, allow_nan=False).encode())
    return figures


def _by_requirement(simulating: Simulating, results: Sequence[Simulated]) -> dict[str, int]:
    ids = [each.requirement.id for each in simulating.subject.asked]
    return {name: sum(name in each.violating for each in results) for name in ids}


def write_trace(path: Path, simulating: Simulating, draw: Draw, seed: int) -> None:
    """Simulate a draw once more and write its inputs and columns as CSV, a row for each frame."""
    columns = simulating.outcomes([simulating.call(draw, seed, None)])[0].columns
    if columns is None:
        return
    count = len(next(iter(columns.values())))
    time_s = (np.arange(count) / simulating.space.plan.rate_hz).tolist()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time_s", *columns])
    writer.writerows(zip(time_s, *(of.astype(float).tolist() for of in columns.values()), strict=True))
    write_whole(path, text.getvalue().encode())
