"""The decisions of the manager in flight: those of ``rig vote`` on the rows as joined, with all its settings.

Units, axes and mountings are converted first, as an autopilot does by its settings; delays and offsets are not.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from rig.bench.diagnose.findings import EARLY_S, Doubted, Fault, InFlight, Isolation
from rig.bench.diagnose.flight_votes import FlightVotes
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.vote_rows import Voted
from rig.core.settings import in_frames
from rig.core.units.angles import into_range, near
from rig.flight.suspects import doubted, is_many
from rig.log.recordings.stamps import Floats


def fly(
    group: Group,
    votes: FlightVotes,
    x: Floats,
    converted: Collection[int],
    threshold_of: str,
    faults: Mapping[str, Fault],
    zero_s: float,
) -> tuple[dict[str, InFlight], list[Floats]]:
    """Return the decisions on every signal, and the voted values (n,) of each, angles unrolled as ``x``.

    x : (axes, C, n), SI, converted, angles unrolled, NaN without a sample
    converted : channels, from 0, whose unit or axes were converted; the others are voted as recorded
    zero_s : time from which seconds are counted
    """
    voted = votes.voted(_columns(group, x, converted))
    made: dict[str, InFlight] = {}
    shown: list[Floats] = []
    for a, name in enumerate(group.settings):
        one, own = voted[name], voted[name].settings
        shown.append(near(one.voted, _middle(x[a])) if own.wraps else one.voted)
        isolations = tuple(_isolations(one, group, zero_s))
        fault = faults.get(name)
        hit = None if fault is None else _isolation(fault, isolations, zero_s)
        error = None if fault is None else _vote_error(group, x[a], shown[a], fault)
        frames = in_frames(own.persistence, own.persistence_s, group.rate_hz)
        made[name] = InFlight(
            own.manager,
            float(own.shown(own.threshold)),
            threshold_of,
            frames / group.rate_hz,
            hit is not None,
            None if hit is None else hit.at_s,
            None if error is None else float(own.shown(error)),
            isolations,
            tuple(_suspects(one, group, x[a], zero_s)),
        )
    return made, shown


def _columns(group: Group, x: Floats, converted: Collection[int]) -> dict[tuple[str, int], Floats]:
    """Return the samples (n,) of the converted channels by signal and channel; angles within their turn."""
    columns: dict[tuple[str, int], Floats] = {}
    for a, (name, own) in enumerate(group.settings.items()):
        for c in converted:
            inside = into_range(x[a, c], *own.limits, True) if own.wraps else x[a, c]
            columns[name, c] = np.ascontiguousarray(inside)
    return columns


def _middle(x: Floats) -> Floats:
    """Return (n,) the first channel of x (C, n) that has a number in the row; NaN where none has."""
    first = np.argmax(np.isfinite(x), axis=0)
    return np.take_along_axis(x, first[None], axis=0)[0]


def _isolations(one: Voted, group: Group, zero_s: float) -> list[Isolation]:
    names = {instance.channel: instance.name for instance in group.instances}
    return [Isolation(f.channel, names[f.channel], f.time_s - zero_s, f.why) for f in one.failures]


def _suspects(one: Voted, group: Group, x: Floats, zero_s: float) -> Iterator[Doubted]:
    """Yield the channels that ``rig vote`` tells as suspect and never isolated; x : (C, n)."""
    failed = {failure.channel for failure in one.failures}
    for c, (instance, rows) in enumerate(zip(group.instances, one.suspect, strict=True)):
        if instance.channel not in failed and is_many(rows, len(one.voted)):
            first = int(np.argmax(doubted(one.state[c], np.isfinite(x[c]))))
            at_s = float(group.time_s[first]) - zero_s
            yield Doubted(instance.channel, instance.name, at_s, rows, len(one.voted))


def _isolation(fault: Fault, isolations: tuple[Isolation, ...], zero_s: float) -> Isolation | None:
    """Return the first isolation of the faulty channel since the fault; without one the last before it.

    A fault is dated by where means part by enough, which the manager may precede by much, as in a slow drift.
    """
    since = fault.time_s - zero_s - EARLY_S
    of = [i for i in isolations if not fault.channel or i.channel == fault.channel]
    return next((i for i in of if i.at_s >= since), of[-1] if of else None)


def _vote_error(group: Group, x: Floats, voted: Floats, fault: Fault) -> float | None:
    """Return the largest distance of the vote from the middle of the other channels, since the fault."""
    if not fault.channel:
        return None
    others = np.delete(x, fault.channel - 1, axis=0)[:, group.time_s >= fault.time_s]
    middle = np.median(others, axis=0)
    error = np.abs(voted[group.time_s >= fault.time_s] - middle)
    error = error[np.isfinite(error)]
    return float(error.max()) if len(error) else None
