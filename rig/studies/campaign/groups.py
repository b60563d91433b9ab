"""Figures of a campaign by kind of an actuator's fault, by requirement, and of the reply times of a unit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import polars as pl

from rig.flight.time_histogram import names
from rig.studies.campaign.statistics import proportion
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.shown import number_of


def by_kind(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Return, of each kind of fault of an actuator, how many were found by which monitor, and how soon.

    One on a shut-off valve is found by ``valve``, which fails no channel; any other when its channel is shut off.
    """
    acted = faults.filter(pl.col("signal").str.starts_with("actuator.") & pl.col("onset_s").is_not_null())
    figures = []
    for (kind,), part in acted.sort("kind").group_by("kind", maintain_order=True):
        monitors, delays = part["resolver"].drop_nulls(), part["delay_from_onset_s"].drop_nulls()
        counts = monitors.value_counts().sort("count", descending=True).rows()
        found = asdict(proportion(len(monitors), len(part)))
        by = ", ".join(f"{name} {count}" for name, count in counts)
        delay = {"median_s": delays.median(), "longest_s": delays.max()}
        figures.append({"kind": kind, "acted": len(part), "found": found, "by": by, **delay})
    return figures


def by_requirement(runs: pl.DataFrame, requirements: Sequence[Requirement]) -> list[dict[str, Any]]:
    """Return, of each requirement, the share of runs that meet it where it applies, and the run with the least margin.

    A run meets it where it does on every signal.
    """
    given = [(run, json.loads(text)) for run, text in runs.select("run", "requirements").drop_nulls().rows()]
    figures = []
    for each in requirements:
        mine = {run: [v for v in of if v["requirement"] == each.id and v["margin"] is not None] for run, of in given}
        mine = {run: of for run, of in mine.items() if of}
        met = sum(all(verdict["status"] == "met" for verdict in of) for of in mine.values())
        every = [(verdict["margin"], run, verdict) for run, of in mine.items() for verdict in of]
        margin, run, least = min(every, key=lambda one: one[:2], default=(None, None, {}))
        figures.append(
            {
                "requirement": each.id,
                "text": each.text,
                "met": asdict(proportion(met, len(mine))),
                "least_margin": None if margin is None else number_of(margin),
                "least_run": run,
                "signal": least.get("signal"),
                "instant_s": least.get("instant_s"),
            }
        )
    return figures


def replies(runs: pl.DataFrame) -> dict[str, Any] | None:
    """Add up the reply times of a unit under test over all frames of all runs, by histogram.py; None without one."""
    counted = runs["replies"].drop_nulls()
    if counted.is_empty():
        return None
    counts = np.sum([bins.to_numpy() for bins in counted], axis=0)
    return {"runs": len(counted), "frames": int(counts.sum()), "bins_us": names(), "counts": counts.tolist()}
