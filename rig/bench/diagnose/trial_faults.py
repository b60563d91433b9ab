"""Faults put into copies of a recording: what a diagnosis of this very log would find.

Each fault begins at 40 % of the log, in one channel of one signal, and the copy is diagnosed.  Sizes are multiples of
the threshold of the signal: of the preset or the configuration.  In a long log the first MOST_ROWS rows are used.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from typing import Any, Final, NamedTuple

import numpy as np

from rig.bench.diagnose.one_quantity import QuantityDiagnosis, diagnose_group
from rig.bench.diagnose.sensor_groups import Group, Samples
from rig.core.errors import BadInput
from rig.core.progress import tell
from rig.core.text import choices, quoted
from rig.log.recordings.stamps import Floats

MOST_ROWS: Final = 20_000
ONSET: Final = 0.4  # of the log
MULTIPLES: Final = {
    "step": (1.0, 3.0, 10.0),
    "freeze": (0.0,),
    "drift": (3.0, 10.0),  # at the end of the log
    "noise": (10.0,),  # standard deviation
}
ALL: Final = "all"
_EARLY_S: Final = 2.0  # before the onset: another fault was found


class _Trial(NamedTuple):
    """One fault: its kind, its size in SI units, its axis and its channel, both from 0."""

    kind: str
    size: float
    axis: int
    channel: int


def kinds_of(names: Sequence[str]) -> tuple[str, ...]:
    """Return the kinds of faults that are named, in their order.  BadInput: an unknown name."""
    for name in names:
        if name not in MULTIPLES and name != ALL:
            raise BadInput(f"--inject: unknown fault {quoted(name)}; {choices(name, [*MULTIPLES, ALL])}")
    return tuple(kind for kind in MULTIPLES if kind in names or ALL in names)


def trials(group: Group, healthy: QuantityDiagnosis, kinds: Sequence[str]) -> list[dict[str, Any]]:
    """Return a row for each signal, kind and size; a quantity with a fault has none."""
    if any(signal.verdict != "none" for signal in healthy.signals.values()):
        return []
    used = _first_rows(group)
    rows: list[dict[str, Any]] = []
    for a, (name, own) in enumerate(group.settings.items()):
        for kind in kinds:
            for multiple in MULTIPLES[kind]:
                tell(f"try {kind} on {name}")
                size = multiple * own.threshold
                outcomes = [_outcome(used, _Trial(kind, size, a, c)) for c in range(len(group.instances))]
                rows.append(_row(name, kind, float(own.shown(size)), own.unit or "", outcomes))
    return rows


def _row(signal: str, kind: str, size: float, unit: str, outcomes: list[tuple[str, float | None]]) -> dict[str, Any]:
    delays = [late for _, late in outcomes if late is not None]
    counts = {
        what: sum(outcome == what for outcome, _ in outcomes) for what in ("correct", "one_of", "missed", "wrong")
    }
    return {
        "signal": signal,
        "fault": kind,
        "size": None if kind == "freeze" else float(f"{size:.4g}"),
        "unit": unit,
        "tried": len(outcomes),
        **counts,
        "delay_s": round(median(delays), 3) if delays else None,
    }


def _outcome(group: Group, trial: _Trial) -> tuple[str, float | None]:
    """Return how the diagnosis of a copy with a fault ends, and by how much the fault is dated late."""
    onset_s = ONSET * float(group.time_s[-1] - group.time_s[0])
    found = diagnose_group(with_fault(group, trial), "", flown=False)
    told = [signal for signal in found.signals.values() if signal.since_s is not None]
    named = [signal for signal in told if signal.verdict == "channel"]
    if any(signal.channel != trial.channel + 1 for signal in named):
        return "wrong", None
    if not told:
        return "missed", None
    since_s = min(signal.since_s or 0.0 for signal in named or told)
    if since_s < onset_s - _EARLY_S:
        return ("wrong" if named else "missed"), None
    return ("one_of" if not named else "correct"), max(since_s - onset_s, 0.0)


def with_fault(group: Group, trial: _Trial) -> Group:
    """Return a copy of the group with one fault."""
    onset_s = float(group.time_s[0]) + ONSET * float(group.time_s[-1] - group.time_s[0])
    x = group.x.copy()
    x[trial.axis, trial.channel] = _faulty(group.time_s, x[trial.axis, trial.channel], trial, onset_s)
    own = [list(axis) for axis in group.own]
    recorded = own[trial.axis][trial.channel]
    own[trial.axis][trial.channel] = Samples(
        recorded.time_s, _faulty(recorded.time_s, recorded.values.copy(), trial, onset_s)
    )
    return Group(group.name, group.settings, group.instances, group.time_s, x, own)


def _faulty(time_s: Floats, values: Floats, trial: _Trial, onset_s: float) -> Floats:
    since = time_s >= onset_s
    if not since.any():
        return values
    if trial.kind == "step":
        values[since] += trial.size
    elif trial.kind == "freeze":
        values[since] = values[int(np.argmax(since))]
    elif trial.kind == "drift":
        values[since] += trial.size * (time_s[since] - onset_s) / max(float(time_s[-1]) - onset_s, 1e-9)
    else:
        values[since] += np.random.default_rng([trial.axis, trial.channel]).normal(0.0, trial.size, int(since.sum()))
    return values


def _first_rows(group: Group) -> Group:
    """Return the first MOST_ROWS rows of a group."""
    if len(group.time_s) <= MOST_ROWS:
        return group
    end_s = float(group.time_s[MOST_ROWS - 1])

    def cut(samples: Samples) -> Samples:
        end = int(np.searchsorted(samples.time_s, end_s, side="right"))
        return Samples(samples.time_s[:end], samples.values[:end])

    own = [[cut(samples) for samples in axis] for axis in group.own]
    x, time_s = group.x[..., :MOST_ROWS], group.time_s[:MOST_ROWS]
    return Group(group.name, group.settings, group.instances, time_s, x, own)


def injected(
    groups: Sequence[Group], healthy: dict[str, QuantityDiagnosis], kinds: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of all groups; a quantity in which a fault was found has none."""
    for group in groups:
        yield from trials(group, healthy[group.name], kinds)
