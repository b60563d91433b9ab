"""Searches in this process: the schedule of ``rig search`` over open-loop trials, without a folder; and its spaces.

A space: 1 to 3 faults of one sign on channels of one signal, drifts or offsets, 0.4 to 10 thresholds (drifts: a
twentieth to five thresholds a second), each from 3 to 6 s of a flight of 14 s in light turbulence.  With free signs
each fault is anything up to that size, to either side.
"""

from __future__ import annotations

from typing import Any, Final

from rig.studies.campaign.campaign_file import Campaign, from_what
from rig.studies.search.objective import Measured, chosen
from rig.studies.search.open_loop import trial_row
from rig.studies.search.rounds import Method
from rig.studies.search.search_plan import Asked, SearchPlan

REQUIREMENT: Final = "vote"
DURATION_S: Final = 14.0
START_S: Final = {"low": 3.0, "high": 6.0}
KINDS: Final = {
    "drift": ("rate_thresholds_per_s", {"low": 0.05, "high": 5.0, "log": True}),
    "offset": ("offset_thresholds", {"low": 0.4, "high": 10.0, "log": True}),
}


def space(manager: str, aircraft: str, signal: str, faults: int, free_signs: bool = False) -> Campaign:
    """Return the space of so many faults on the first channels of a signal: an arm of drifts, one of offsets."""
    base = {
        "title": f"{aircraft}, {manager}: {signal}, {faults} fault{'s' if faults > 1 else ''}",
        "aircraft": aircraft,
        "duration_s": DURATION_S,
        "turbulence": "light",
        "redundancy": {"manager": manager},
    }
    return from_what(
        {
            "title": base["title"],
            "base": base,
            "sampling": "random",
            "runs": 1,
            "cases": {"kind": [_case(kind, signal, faults, free_signs) for kind in KINDS]},
        },
        base["title"],
    )


def _case(kind: str, signal: str, faults: int, free_signs: bool) -> dict[str, Any]:
    size, varied = KINDS[kind]
    if free_signs:
        varied = {"low": -varied["high"], "high": varied["high"]}
    tables = [{"kind": kind, "signal": signal, "channels": [i + 1], "start_s": 4.0, size: 1.0} for i in range(faults)]
    vary = {f"faults.{i}.{size}": varied for i in range(faults)}
    starts = {f"faults.{i}.start_s": START_S for i in range(faults)}
    return {"name": kind, "set": {"faults": tables}, "vary": {**vary, **starts}}


def plan_of(campaign: Campaign, flights: int, method: Method = "regions", seed: int = 0) -> SearchPlan:
    """Return the plan of a search for a violated vote."""
    asked = Asked((REQUIREMENT,), flights, method, seed=seed, bench=True)
    return SearchPlan(campaign, campaign.title, asked, chosen([REQUIREMENT]))


def search_here(plan: SearchPlan) -> list[Measured]:
    """Return what each draw of the plan is worth, open loop."""
    rows_of = lambda numbers: [trial_row(plan[number], plan.requirements) for number in numbers]  # noqa: E731
    return plan.search(rows_of, lambda _: None).results
