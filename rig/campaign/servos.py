"""What the monitors of servo actuators found in a campaign: columns of its tables, and figures by kind of fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final

import polars as pl

from rig.campaign.statistics import proportion
from rig.faults import Fault
from rig.frame import COMPUTERS
from rig.scenario import Scenario

Coils = dict[str, dict[int, tuple[float, str]]]  # as Flight.coils_failed: by surface and channel, time [s] and monitor
RUNS: Final[dict[str, Any]] = {
    "coils_failed": pl.Int64,  # channels of servos that were shut off; empty without servos
    "healthy_coils_failed": pl.Int64,  # of these, without a fault on them or on what they share
}


def run_columns(scenario: Scenario, coils: Coils, unit_lane: str | None = None) -> dict[str, Any]:
    """Return the columns of RUNS; unit_lane : the lane that a unit under test is, whose channels are not healthy."""
    if not scenario.has_servos:
        return {}
    failed = [(surface, channel) for surface, channels in coils.items() for channel in channels]
    of_unit = 0 if unit_lane is None else COMPUTERS.index(unit_lane) + 1
    healthy = sum(
        not any(_on(fault, surface, channel) for fault in scenario.faults)
        for surface, channel in failed
        if channel != of_unit
    )
    return {"coils_failed": len(failed), "healthy_coils_failed": healthy}


def _on(fault: Fault, surface: str, channel: int) -> bool:
    """Return whether a fault sits on a channel of an actuator, drives it, or sits on what its channels share."""
    if fault.drives == (surface, channel):
        return True
    return fault.signal == f"actuator.{surface}" and (not fault.channels or channel in fault.channels)


def by_kind(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Return, of each kind of fault of an actuator, how many were found by which monitor, and how soon.

    One on a shut-off valve is found by ``valve``, which fails nobody; any other when its channel is shut off for it.
    """
    acted = faults.filter(pl.col("signal").str.starts_with("actuator.") & pl.col("onset_s").is_not_null())
    groups = acted.sort("kind").group_by("kind", maintain_order=True)
    return [{"kind": kind, **_found(part)} for (kind,), part in groups]


def _found(part: pl.DataFrame) -> dict[str, Any]:
    monitors, delays = part["resolver"].drop_nulls(), part["delay_from_onset_s"].drop_nulls()
    return {
        "acted": len(part),
        "found": asdict(proportion(len(monitors), len(part))),
        "by": ", ".join(_counted(monitors)),
        "median_s": delays.median(),
        "longest_s": delays.max(),
    }


def _counted(monitors: pl.Series) -> Iterator[str]:
    counts: Sequence[tuple[str, int]] = monitors.value_counts().sort("count", descending=True).rows()
    yield from (f"{name} {count}" for name, count in counts)
