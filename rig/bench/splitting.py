"""Healthy channels, sensors and manager of one signal, frame by frame, from many copied states: for splitting.

The level of a state is its largest count of miscompares.  While a tie-break rule points to a channel in a split, the
level is at least the duration of the split, as a share of the duration that isolates a channel.  Level ``persistence``
is an isolation.  An excursion begins in the frame in which the level leaves 0, and ends at level 0 or at an isolation.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.bench.drive import step as bench_step
from rig.computer.redundancy.compare import is_split
from rig.computer.redundancy.state import ManagerData
from rig.core.frame import CHANNELS, Pattern
from rig.core.kernels import kernel
from rig.world.sensors import SensorData

LONGEST: Final = 1000  # frames of an excursion that are followed
RUNS, REACHED, ENDED, CUT = range(4)  # outcomes of a particle


class Held(NamedTuple):
    """Data that all particles share, and the errors of E flights."""

    truth: NDArray[np.float64]  # (N,) of the signal; behind its end it stays
    reference: NDArray[np.float64]  # (N,)
    second: NDArray[np.float64]  # (N,)
    sensors: NDArray[Any]  # (E, 1) sensors.params.PARAMS
    manager: ManagerData  # its state is not used
    row: NDArray[Any]  # (1,) of one signal, nested
    blank_manager: NDArray[Any]  # (1,) manager.STATE
    blank_memory: NDArray[Any]  # (1,) sensors.kernel.MEMORY
    no_drift: NDArray[np.float64]  # (0, 0, 0)
    no_alarms: NDArray[np.uint8]  # (0, 0, 0)
    no_discretes: NDArray[np.int64]  # (0,)


class Particles(NamedTuple):
    """P states, in place."""

    memory: NDArray[Any]  # (P,) sensors.kernel.MEMORY
    line: NDArray[np.float64]  # (P, 1, 4, frames) the latency's ring
    manager: NDArray[Any]  # (P,) manager.STATE
    flight: NDArray[np.int64]  # (P,) whose errors
    frame: NDArray[np.int64]  # (P,) of the recording, the next
    level: NDArray[np.int64]  # (P,)
    failed: NDArray[np.int64]  # (P,) channels failed

    def taken(self, places: NDArray[np.int64] | slice) -> Particles:
        """Return some of them, or some several times; copies, except for a slice."""
        return Particles._make(of[places] for of in self)


class Windows(NamedTuple):
    """The first frames of E flights: their starts, and their counts."""

    first: NDArray[np.int64]  # (E,) frame of the recording
    run_in: int  # frames that are not counted
    counted: int  # frames that are
    at_start: NDArray[np.int64]  # (E,) out: channels failed in the run-in
    apart: NDArray[np.int64]  # (E,) out: counted frames in which somebody disagreed


@kernel
def step(held, p, j, k, noise):
    """Move particle j by a frame; its noise is row k of ``noise`` (R, 1, 4)."""
    row, m = held.row[0], held.manager
    truth, fcc = row["truth"], row["fcc"]
    frame = min(p.frame[j], len(held.truth) - 1)
    row["frame"] = frame
    truth["truth"][0] = held.truth[frame]
    sensors = SensorData(
        params=held.sensors[p.flight[j]], noise=noise[k:], drift=held.no_drift, memory=p.memory[j : j + 1],
        line=p.line[j], discretes=held.no_discretes, alarms=held.no_alarms,
    )  # fmt: skip
    fcc["reference"][0], fcc["second_reference"][0] = held.reference[frame], held.second[frame]
    bench_step(
        row,
        row,
        0,
        sensors,
        None,
        None,
        ManagerData(m.choice, m.params, p.manager[j : j + 1], m.boxes, m.lanes, m.baseline),
        None,
    )
    p.frame[j] += 1
    params = m.params[0]
    p.failed[j] = failures(p.manager[j], params["fitted"])
    p.level[j] = params["persistence"] if p.failed[j] > 0 else level(p.manager[j], params)


@kernel
def failures(st, fitted):
    """Return the number of isolated channels."""
    count = 0
    for c in range(fitted):
        count += st["failed"][c] != 0
    return count


@kernel
def level(st, params):
    """Return the level of a state without an isolation, 0 to ``persistence`` - 1."""
    progress, blamed = 0, False
    for c in range(params["fitted"]):
        progress = max(progress, st["count"][c])
        blamed = blamed or st["blamed"][c] != 0
    if blamed and is_split(st["pattern"]):
        progress = max(progress, st["pattern_frames"] * params["persistence"] // params["split_persistence"])
    return min(progress, params["persistence"] - 1)


@kernel
def run_windows(held, p, j, windows, noise, out, n):
    """Run windows from j on, in particle 0 of ``p``, while noise and places last; return the next window, and ``n``.

    A manager that has isolated a channel restarts with all of them.
    out : Particles; the states in which excursions begin are copied to it from place ``n`` on
    """
    at, frames = 0, windows.run_in + windows.counted
    while j < len(windows.first) and at + frames <= len(noise) and n + windows.counted <= len(out.level):
        p.memory[0], p.manager[0] = held.blank_memory[0], held.blank_manager[0]
        p.flight[0], p.frame[0], p.level[0] = j, windows.first[j], 0
        for k in range(frames):
            before = p.level[0]
            step(held, p, 0, at, noise)
            at += 1
            if k >= windows.run_in:
                windows.apart[j] += p.level[0] > 0 or p.manager[0]["pattern"] != Pattern.NORMAL
                if before == 0 and p.level[0] > 0:
                    copy(p, 0, out, n)
                    n += 1
            if p.failed[0] > 0:
                windows.at_start[j] += p.failed[0] if k < windows.run_in else 0
                p.manager[0], p.level[0] = held.blank_manager[0], 0
        j += 1
    return j, n


@kernel
def copy(p, i, out, j):
    """Copy particle i of ``p`` to place j of ``out``."""
    out.memory[j], out.manager[j] = p.memory[i], p.manager[i]
    ring, line = out.line[j], p.line[i]
    for c in range(CHANNELS):
        for t in range(ring.shape[2]):
            ring[0, c, t] = line[0, c, t]
    out.flight[j], out.frame[j], out.level[j], out.failed[j] = p.flight[i], p.frame[i], p.level[i], p.failed[i]


@kernel
def run_excursions(held, p, j, goal, noise, outcome, age):
    """Run particles from j on to level ``goal`` or back to 0, while the noise lasts; return the first unfinished one.

    outcome : (P,) out, REACHED, ENDED or CUT after LONGEST frames; age : (P,) frames run, in place
    """
    at = 0
    while j < len(outcome):
        while outcome[j] == RUNS:
            if p.level[j] >= goal:
                outcome[j] = REACHED
            elif p.level[j] == 0:
                outcome[j] = ENDED
            elif age[j] >= LONGEST:
                outcome[j] = CUT
            elif at == len(noise):
                return j
            else:
                step(held, p, j, at, noise)
                at, age[j] = at + 1, age[j] + 1
        j += 1
    return j
