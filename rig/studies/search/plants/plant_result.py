"""The figures of a search over a plant: how much violates, its clusters, each simulated again, and their traces."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.core.outputs import BESIDE_RUNS
from rig.core.progress import tell
from rig.studies.campaign.statistics import at_most, proportion
from rig.studies.campaign.study_folder import write_whole
from rig.studies.search.plants.plant_rounds import Simulated, Simulating, seeds_of
from rig.studies.search.rounds import Draw, first_count
from rig.verdict.requirements.robustness import number_of

SEEDS: Final = 20  # that confirm a cluster
MOST: Final = 5  # clusters that are confirmed
_FRESH: Final = 1 << 40  # number of the first simulation that confirms


def figures_of(
    simulating: Simulating, draws: Sequence[Draw], results: Sequence[Simulated], seed: int, out: Path | None
) -> dict[str, Any]:
    """Return the figures of a search, confirm its clusters, and write ``search.json`` and the traces into ``out``."""
    first = first_count(simulating.space.arms, len(draws))
    at_first = sum(each.violated for each in results[:first])
    failed = [each.failed for each in results if each.failed]
    figures = {
        "simulations": len(results),
        "violated": sum(each.violated for each in results),
        "violating": _by_requirement(simulating, results),
        "first_violation": next((i + 1 for i, each in enumerate(results) if each.violated), None),
        "robustness": number_of(min(each.robustness for each in results)),
        "first": {"simulations": first, "violated": at_first, "upper_95": at_most(at_first, first)},
        "failed": len(failed),
        "first_reason": failed[0] if failed else None,
        "printed": next((each.printed for each in results if each.printed), None),
        "clusters": _confirmed(simulating, draws, results, seed, out),
    }
    if out is not None:
        write_whole(out / BESIDE_RUNS[0], json.dumps(figures, indent=1, allow_nan=False).encode())
    return figures


def _by_requirement(simulating: Simulating, results: Sequence[Simulated]) -> dict[str, int]:
    ids = [each.requirement.id for each in simulating.subject.asked]
    return {name: sum(name in each.violating for each in results) for name in ids}


def _confirmed(
    simulating: Simulating, draws: Sequence[Draw], results: Sequence[Simulated], seed: int, out: Path | None
) -> list[dict[str, Any]]:
    """Return the clusters, each simulated again with seeds, or at points of its ranges, that did not choose it."""
    return []


def write_trace(path: Path, simulating: Simulating, draw: Draw, seed: int) -> None:
    """Simulate a draw once more and write its inputs and columns as CSV, a row for each frame."""
    outcome = simulating.outcomes([simulating.call(draw, seed, None)])[0]
    if outcome.columns is None:
        return
    columns = {name: of.astype(float).tolist() for name, of in outcome.columns.items()}
    count = len(next(iter(columns.values())))
    time_s = (np.arange(count) / simulating.space.plan.rate_hz).tolist()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time_s", *columns])
    writer.writerows(zip(time_s, *columns.values(), strict=True))
    write_whole(path, text.getvalue().encode())
