"""The decisions of the manager in flight: a vote of the rows as joined, with the settings of each signal.

Units, axes and mountings are converted first, as an autopilot does by its settings; delays and offsets are not.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.bench.diagnose.findings import Fault, InFlight, Isolation
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.vote_rows import vote
from rig.computer.redundancy.managers import DEFAULT
from rig.core.settings import in_frames
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.stamps import Floats

_EARLY_S: Final = 0.5  # a fault is dated by means, which a decision on rows may precede


def fly(
    group: Group, x: Floats, threshold_of: str, faults: dict[str, Fault]
) -> tuple[dict[str, InFlight], list[Floats]]:
    """Return the decisions on every signal, and the voted values (n,) of each.

    x : (axes, C, n), SI, converted, NaN without a sample
    """
    settings = {name: own.model_copy(update={"manager": DEFAULT}) for name, own in group.settings.items()}
    samples = {name: Samples(list(np.ascontiguousarray(axis))) for name, axis in zip(settings, x, strict=True)}
    voted = vote(Recording(group.time_s, samples), settings, [])
    made: dict[str, InFlight] = {}
    first_s = float(group.time_s[0])
    for a, (name, own) in enumerate(settings.items()):
        isolations = tuple(Isolation(f.channel, f.time_s - first_s) for f in voted[name].failures)
        fault = faults.get(name)
        hit = None if fault is None else _isolation(fault, isolations, first_s)
        error = None if fault is None else _vote_error(group, x[a], voted[name].voted, fault)
        frames = in_frames(own.persistence, own.persistence_s, group.rate_hz)
        made[name] = InFlight(
            DEFAULT,
            float(own.shown(own.threshold)),
            threshold_of,
            frames / group.rate_hz,
            hit is not None,
            None if hit is None else hit.at_s,
            None if error is None else float(own.shown(error)),
            isolations,
        )
    return made, [voted[name].voted for name in settings]


def _isolation(fault: Fault, isolations: tuple[Isolation, ...], first_s: float) -> Isolation | None:
    """Return the isolation of the faulty channel since the fault."""
    since = fault.time_s - first_s - _EARLY_S
    of = (i for i in isolations if i.at_s >= since and (not fault.channel or i.channel == fault.channel))
    return next(of, None)


def _vote_error(group: Group, x: Floats, voted: Floats, fault: Fault) -> float | None:
    """Return the largest distance of the vote from the middle of the other channels, since the fault."""
    if not fault.channel:
        return None
    others = np.delete(x, fault.channel - 1, axis=0)[:, group.time_s >= fault.time_s]
    middle = np.median(others, axis=0)
    error = np.abs(voted[group.time_s >= fault.time_s] - middle)
    error = error[np.isfinite(error)]
    return float(error.max()) if len(error) else None
