"""What the monitors of servo actuators found in a campaign: columns of its tables, and figures by kind of fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final

import polars as pl

from rig.assess import FaultScore
from rig.campaign.statistics import proportion
from rig.faults import Fault
from rig.scenario import Scenario

Coils = dict[str, dict[int, tuple[float, str]]]  # as Flight.coils_failed: by surface and channel, time [s] and monitor
RUNS: Final[dict[str, Any]] = {
    "coils_failed": pl.Int64,  # channels of servos that were shut off; empty without servos
    "healthy_coils_failed": pl.Int64,  # of these, without a fault on them or on what they share
}
FAULTS: Final[dict[str, Any]] = {
    "shut_off_by": pl.String,  # the monitor that shut off the channel, or the first one of a surface
    "shut_off_after_s": pl.Float64,  # the onset
}


def run_columns(scenario: Scenario, coils: Coils) -> dict[str, Any]:
    """Return the columns of RUNS."""
    if not scenario.has_servos:
        return {}
    failed = [(surface, channel) for surface, channels in coils.items() for channel in channels]
    healthy = sum(not any(_on(fault, *each) for fault in scenario.faults) for each in failed)
    return {"coils_failed": len(failed), "healthy_coils_failed": healthy}


def _on(fault: Fault, surface: str, channel: int) -> bool:
    """Return whether a fault sits on a channel of an actuator, or on what its channels share."""
    return fault.signal == f"actuator.{surface}" and (not fault.channels or channel in fault.channels)


def fault_columns(fault: FaultScore, coils: Coils, rate_hz: float) -> dict[str, Any]:
    """Return the columns of FAULTS; empty unless a channel that it sits on was shut off after its onset."""
    head, _, surface = fault.signal.partition(".")
    if head != "actuator" or fault.onset_frame is None:
        return {}
    onset_s, channels = fault.onset_frame / rate_hz, coils.get(surface, {})
    sat_on = channels if fault.channel is None else {fault.channel: channels.get(fault.channel, (-1.0, ""))}
    time_s, monitor = min((each for each in sat_on.values() if each[0] >= onset_s), default=(-1.0, ""))
    return {"shut_off_by": monitor, "shut_off_after_s": time_s - onset_s} if monitor else {}


def by_kind(faults: pl.DataFrame) -> list[dict[str, Any]]:
    """Return, of each kind of fault of an actuator, how many were found by which monitor, and how soon."""
    acted = faults.filter(pl.col("signal").str.starts_with("actuator.") & pl.col("onset_s").is_not_null())
    groups = acted.sort("kind").group_by("kind", maintain_order=True)
    return [{"kind": kind, **_found(part)} for (kind,), part in groups]


def _found(part: pl.DataFrame) -> dict[str, Any]:
    monitors, delays = part["shut_off_by"].drop_nulls(), part["shut_off_after_s"].drop_nulls()
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
