"""Open-loop trials: sensors, faults and manager of one signal, frame by frame over a recorded truth.

Nothing flies: the truth does not respond to the vote.  While two good channels remain and the vote is correct, the
response would be negligible; with fewer the aircraft follows the faulty ones.  Frames after a vote that is not correct
do not count.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.bench.drive import step
from rig.computer.redundancy.state import ManagerData
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel
from rig.core.units.angles import difference
from rig.verdict.signal_kernels import all_out, channel_bits, count_healthy, in_use, mark_failed, mark_wrong
from rig.world.faults import FaultData
from rig.world.faults.fault_records import FOREVER, Trigger
from rig.world.sensors import SensorData

RESULT: Final = np.dtype(
    [
        ("above", "i8"),  # frames from the last onset on in which the vote was off by more than its threshold
        ("off", "u1"),  # whether it was in the last frame
        ("lost", "u1"),  # whether the signal was at level 0 from the last onset on, its vote kept until then
        ("peak", "f8"),  # largest vote error from then on, unit of the signal
        ("frames", "i8"),
        ("good_before", "i8"),  # channels without a fault and not failed, in the frame before the tested onset
        ("in_use", "i8"),  # of the tested channels, those not failed then
        ("failed_at", "i8", (CHANNELS,)),  # first frame in which each channel was failed, or NEVER
    ],
    align=True,
)


class Trials(NamedTuple):
    """T trials on a recording of N frames; F faults on K channels in each.

    Draws are streams of R rows: a trial takes one row per frame, and the next trial continues after it.
    """

    first: NDArray[np.int64]  # (T,) frame of the recording in which a trial begins
    onset: NDArray[np.int64]  # (T,) of the tested fault
    counted_from: NDArray[np.int64]  # (T,) frame from which on it counts: the last onset
    tested: int  # number of the tested fault
    last: NDArray[np.int64]  # (T,) frame before which it ends
    early: int  # 1: ends when all faulty channels have been out for ``linger`` frames
    linger: int  # frames for which a fault that has ceased still counts
    threshold: float
    allowed: int  # frames for which a kept vote may be off
    truth: NDArray[np.float64]  # (N,) of the signal
    reference: NDArray[np.float64]  # (N,), as the healthy flight computed it
    second: NDArray[np.float64]  # (N,)
    reference_step: NDArray[np.float64]  # (T,) that the reference is off by, unit of the signal
    reference_from: NDArray[np.int64]  # (T,) from this frame on
    sensors: NDArray[Any]  # (T, 1) sensors.params.PARAMS
    noise: NDArray[np.float32]  # (R, 1, 4), of the sensors
    schedule: NDArray[Any]  # (T, F)
    targets: NDArray[Any]  # (T, K)
    normal: NDArray[np.float64]  # (R, N), of the faults


class Scratch(NamedTuple):
    """Initial records of every trial, and working records."""

    row: NDArray[Any]  # (1,) of one signal, nested
    blank_memory: NDArray[Any]  # (1,)
    memory: NDArray[Any]  # (1,)
    line: NDArray[np.float64]
    no_drift: NDArray[np.float64]  # (0, 0, 0)
    no_alarms: NDArray[np.uint8]  # (0, 0, 0)
    no_discretes: NDArray[np.int64]  # (0,)
    faults: FaultData
    blank_kept: NDArray[Any]  # (1,)
    manager: ManagerData
    blank_manager: NDArray[Any]  # (1,)
    signal: NDArray[Any]  # (1,) signal_kernels.SIGNAL
    blank_signal: NDArray[Any]  # (1,)


@kernel
def run_trials(trials, j, scratch, results, healthy, failed):
    """Run trials from j on while the draws last; return the first that was not run.

    results : (T,) RESULT, out; healthy, failed : (5,) frames and failures of healthy channels, by level
    """
    at = 0
    while j < len(trials.first) and at + trials.last[j] - trials.first[j] <= len(trials.noise):
        begin(trials, j, scratch, results[j])
        run_trial(trials, j, at, scratch, results[j], healthy, failed)
        at += results[j]["frames"]
        j += 1
    return j


@kernel
def begin(trials, j, scratch, result):
    """Blank records for trial j."""
    begin_trial(trials, j, scratch)
    result["above"], result["off"], result["lost"], result["frames"] = 0, 0, 0, 0
    result["peak"] = 0.0
    result["good_before"], result["in_use"] = 0, 0
    scratch.signal[0] = scratch.blank_signal[0]


@kernel
def begin_trial(trials, j, scratch):
    """Blank records of the stages for trial j."""
    scratch.memory[0] = scratch.blank_memory[0]
    scratch.manager.state[0] = scratch.blank_manager[0]
    state, schedule = scratch.faults.state, trials.schedule[j]
    for f in range(len(state)):
        at_a_time = schedule[f]["trigger"] == Trigger.TIME
        state[f]["onset"] = schedule[f]["first"] if at_a_time else FOREVER
        state[f]["held"] = state[f]["elapsed"] = state[f]["left"] = 0
        state[f]["acts"] = state[f]["fresh"] = 0
    for t in range(len(scratch.faults.kept)):
        scratch.faults.kept[t] = scratch.blank_kept[0]


@kernel
def run_trial(trials, j, at, scratch, result, healthy, failed):
    """Run trial j from its first frame to its end; its draws begin in row ``at``."""
    own, data = stages_of(trials, j, at, scratch)
    signal, wraps = scratch.signal[0], scratch.manager.params[0]["wraps"]
    level = np.int64(signal["fitted"])
    for k in range(trials.last[j] - trials.first[j]):
        frame = trials.first[j] + k
        before = np.int64(signal["failed"])
        fcc = scratch.row[0]["fcc"]
        run_frame(trials, j, k, scratch.row[0], own, data, scratch.manager)
        if frame == trials.onset[j]:
            stand_before(data, before, trials.tested, signal, result)
        mark_wrong(acting(data), frame, signal)
        became = mark_failed(channel_bits(fcc["state"][0]), frame, signal)
        # On one signal no box is failed, and a common mode answers no fault in such a row: none is by design.
        if frame - signal["disturbed"] > signal["linger"]:
            count_healthy(became, before, level, signal, healthy, failed)
        level = np.int64(fcc["level"][0])
        error = abs(difference(fcc["voted"][0], trials.truth[frame], wraps))
        off = not error <= trials.threshold
        if frame >= trials.counted_from[j]:
            result["above"] += off
            result["peak"] = error if error > result["peak"] else result["peak"]
            result["lost"] |= level == 0 and result["above"] <= trials.allowed
        result["off"], result["frames"] = off, k + 1
        if trials.early != 0 and frame >= trials.counted_from[j] and not off and all_out(frame, signal):
            break
    for c in range(CHANNELS):
        result["failed_at"][c] = signal["failed_at"][c]


@kernel
def stages_of(trials, j, at, scratch):
    """Return the stages of trial j before the manager, SensorData and FaultData; draws begin in row ``at``."""
    f = scratch.faults
    data = FaultData(
        param=f.param, schedule=trials.schedule[j], state=f.state, targets=trials.targets[j], kept=f.kept,
        program=f.program, stack=f.stack, times=f.times, memory=f.memory, seen=f.seen, uniform=f.uniform,
        normal=trials.normal[at:], clean=f.clean,
    )  # fmt: skip
    own = SensorData(
        params=trials.sensors[j], noise=trials.noise[at:], drift=scratch.no_drift, memory=scratch.memory,
        line=scratch.line, discretes=scratch.no_discretes, alarms=scratch.no_alarms,
    )  # fmt: skip
    return own, data


@kernel
def run_frame(trials, j, k, row, own, data, manager):
    """Run the stages over frame k of trial j; manager : None: no vote."""
    frame, fcc = trials.first[j] + k, row["fcc"]
    row["frame"] = frame
    row["truth"]["truth"][0] = trials.truth[frame]
    fcc["reference"][0], fcc["second_reference"][0] = trials.reference[frame], trials.second[frame]
    if frame >= trials.reference_from[j]:
        fcc["reference"][0] += trials.reference_step[j]
    step(row, row, k, own, data, None, manager, None)


@kernel
def record_trial(trials, j, at, scratch, samples, valid, ilm):
    """Write the input of a manager in trial j, (n, 4) each, without a vote."""
    own, data = stages_of(trials, j, at, scratch)
    for k in range(trials.last[j] - trials.first[j]):
        run_frame(trials, j, k, scratch.row[0], own, data, None)
        bus = scratch.row[0]["bus"]
        for c in range(CHANNELS):
            samples[k, c], valid[k, c] = bus["channels"][0, c], bus["valid"][0, c]
            ilm[k, c] = bus["ilm"][0, c]


@kernel
def stand_before(data, before, tested, signal, result):
    """Store the state of the signal before the tested fault; before : isolated channels, bits."""
    healthy, of_fault = ~np.int64(signal["faulty"]), 0
    for t in range(len(data.targets)):
        if data.targets[t]["fault"] == tested:
            of_fault |= 1 << data.targets[t]["column"]
    result["good_before"], result["in_use"] = in_use(signal, before, healthy), in_use(signal, before, of_fault)


@kernel
def acting(data):
    """Return the channels on which a fault acts, as bits."""
    bits = 0
    for t in range(len(data.targets)):
        if data.state[data.targets[t]["fault"]]["acts"] != 0:
            bits |= 1 << data.targets[t]["column"]
    return bits
