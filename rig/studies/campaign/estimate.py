"""Estimate the time and disk space of a campaign from the shortest of its first runs, flown in a separate process."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Final

from rig.core.errors import RigError
from rig.studies.campaign.plan import Plan, rig_identity
from rig.studies.campaign.run_campaign import workers_of
from rig.studies.campaign.worker import Orders, fly_alone, keeps, log_path
from rig.unit.unit_file import Unit

ROW_BYTES: Final = 1_500  # of all tables together, a run
_LOOKED_AT: Final = 200


@dataclass(frozen=True, slots=True)
class Estimate:
    """The estimate for the first ``runs`` runs of a plan."""

    runs: int
    flight_s: float  # simulated, all runs
    workers: int
    wall_s: float
    logs: int  # kept; unknown in advance for ``failures``
    disk_bytes: int
    us_per_frame: float  # measured, everything included


def estimate(plan: Plan, runs: int | None = None, unit: Unit | None = None) -> Estimate:
    """Fly one run twice, the first time to warm up, and extrapolate from it; unit : under test, which flies it."""
    count, workers = plan.count(runs), workers_of(unit, None) or plan.campaign.run.workers
    how = plan.campaign.run
    durations = _durations(plan, count)
    rate_hz = plan[0].scenario().rate_hz
    shortest = min(range(min(count, _LOOKED_AT)), key=durations.__getitem__)
    cost_s, log_bytes = _probe(plan, shortest, unit)
    per_frame_s = cost_s / (durations[shortest] * rate_hz)
    orders = Orders(how.logs, len(plan), "", 0.0, plan.campaign.baseline, "")
    kept = [durations[number] for number in range(count) if keeps(orders, number, in_trouble=False)]
    return Estimate(
        runs=count,
        flight_s=sum(durations),
        workers=workers,
        wall_s=sum(durations) * rate_hz * per_frame_s / workers,
        logs=len(kept),
        disk_bytes=round(sum(kept) / durations[shortest] * log_bytes) + count * ROW_BYTES,
        us_per_frame=per_frame_s * 1e6,
    )


def _durations(plan: Plan, count: int) -> list[float]:
    """Return the seconds of every run; runs are built one by one only if they may differ."""
    sets = (case.set for case in plan.campaign.all_cases())
    differ = "duration_s" in (*(key for key, _ in plan.campaign.varied()), *chain(*sets))
    return [_duration(plan, number) for number in range(count)] if differ else [_duration(plan, 0)] * count


def _duration(plan: Plan, number: int) -> float:
    choice = plan.choices[number]
    return float((choice if "duration_s" in choice else plan.data(number)).get("duration_s", 60.0))


def _probe(plan: Plan, number: int, unit: Unit | None) -> tuple[float, int]:
    """Return the seconds of one flight, and the size of its log."""
    how = plan.campaign.run
    with tempfile.TemporaryDirectory() as folder:
        logs = "none" if how.logs == "none" else "all"
        orders = Orders(
            logs,
            len(plan),
            folder,
            how.timeout_s,
            plan.campaign.baseline,
            rig_identity(),
            unit=unit,
            unit_build="" if unit is None else unit.build(),
            requirements=plan.requirements,
        )
        rows = fly_alone([plan[number], plan[number]], orders)["runs"]
        if rows[-1]["outcome"] != "flown":
            raise RigError(f"run {number}, flown for the estimate: {rows[-1]['outcome']}: {rows[-1]['reason']}")
        path = log_path(Path(folder), number)
        return rows[-1]["wall_s"], path.stat().st_size if path.exists() else 0
