"""The figures of a search over a plant, as ``--json`` prints them, and the traces of its clusters."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.core.outputs import BESIDE_RUNS
from rig.studies.campaign.study_folder import write_whole
from rig.studies.search.plants.plant_call import Columns
from rig.studies.search.plants.plant_clusters import confirmed, found_in, inputs_of
from rig.studies.search.plants.plant_rounds import Simulated, Simulating, first_violation
from rig.studies.search.rounds import Draw, first_count
from rig.verdict.requirements.robustness import number_of

FIGURES, PICTURE, *_ = BESIDE_RUNS


def figures_of(
    simulating: Simulating,
    draws: Sequence[Draw],
    results: Sequence[Simulated],
    seed: int,
    standing: str,
    out: Path | None,
) -> dict[str, Any]:
    """Return the figures of a search, and write them and the traces of its clusters into ``out``.

    standing : of the method at its end
    """
    first, found = first_count(simulating.space.arms, len(draws)), found_in(draws, results)
    failed = [i for i, each in enumerate(results) if each.failed]
    cases = confirmed(simulating, draws, results, found, seed)
    figures = {
        "simulations": len(results),
        "violated": sum(each.violated for each in results),
        "violating": _by_requirement(simulating, results),
        "first_violation": first_violation(results),
        "robustness": number_of(min(each.robustness for each in results)),
        "first": {"simulations": first, "violated": sum(each.violated for each in results[:first])},
        "failed": len(failed),
        "first_failed": _of_failed(simulating, draws[failed[0]], results[failed[0]], failed[0]) if failed else None,
        "printed": next((each.printed for each in results if each.printed), None),
        "clusters_found": len(found),
        "clusters": [each.figures for each in cases],
        "ended": "; ".join(filter(None, [f"all {len(results)} simulations are run", standing])),
    }
    if out is not None:
        traces: list[plant_page.Traces] = []
        for number, each in enumerate(cases, 1):
            path = out / f"cluster_{number}.csv"
            traces.append(
                (
                    columns_of(simulating, each.draw, each.seeds),
                    columns_of(simulating, each.smallest, each.smallest_seeds),
                )
            )
            write_trace(path, simulating, traces[-1][0])
            each.figures["trace"] = str(path)
        write_whole(out / FIGURES, json.dumps(figures, indent=1, allow_nan=False).encode())
        from rig.studies.search.plants import plant_page  # plotly takes a second to be imported

        plant_page.write(out / PICTURE, simulating, draws, results, figures, traces)
    return figures


def _of_failed(simulating: Simulating, draw: Draw, result: Simulated, place: int) -> dict[str, Any]:
    return {"number": place + 1, "reason": result.failed, "inputs": inputs_of(simulating, draw)}


def _by_requirement(simulating: Simulating, results: Sequence[Simulated]) -> dict[str, int]:
    ids = [each.requirement.id for each in simulating.subject.asked]
    return {name: sum(name in each.violating for each in results) for name in ids}


def columns_of(simulating: Simulating, draw: Draw, seeds: Sequence[int]) -> Columns:
    """Simulate a draw once more; return all columns (n,) with the seed of the least robustness; empty: it fails now."""
    outcomes = simulating.outcomes([simulating.call(draw, seed, None) for seed in seeds])
    made = [each.columns for each in outcomes if each.columns is not None]
    least = lambda columns: min(each.robustness for each in simulating.subject.verdicts(columns))  # noqa: E731
    return min(made, key=least, default={})


def write_trace(path: Path, simulating: Simulating, columns: Columns) -> None:
    """Write the inputs and columns (n,) of a simulation as CSV, a row for each frame."""
    count = len(next(iter(columns.values()), ()))
    time_s = (np.arange(count) / simulating.space.plan.rate_hz).tolist()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time_s", *columns])
    writer.writerows(zip(time_s, *(of.astype(float).tolist() for of in columns.values()), strict=True))
    write_whole(path, text.getvalue().encode())
