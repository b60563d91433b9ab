"""An open-loop trial against the flight that it stands for: same faults and draws, the truth of the healthy flight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.bench.one_signal_trials import Trials
from rig.core.frame import INDEX, SIGNALS, Block, State, new_block
from rig.core.units.angles import differences
from rig.flight.loop import fly_rows
from rig.scenario.scenario import Scenario
from rig.studies.reliability.cell_trials import fly_trials, off_votes
from rig.studies.reliability.drawn import Cell
from rig.studies.reliability.one_signal import Recording, faults_of, of_rows, one_signal
from rig.studies.reliability.tally import SECOND, TESTED
from rig.verdict.monitored_places import allowed_frames, lingers
from rig.verdict.signal_kernels import NEVER
from rig.world.sensors import Sensors


class TrialVsFlight(NamedTuple):
    """First frame in which each channel of the signal was failed, or NEVER: (4,) in flight, and in the trial.

    Where the vote is not kept, what comes after does not count, and may differ.
    """

    flight: NDArray[np.int64]
    trial: NDArray[np.int64]
    flight_kept: bool  # whether the vote was, and no signal lost
    trial_kept: bool


def trial_vs_flight(scenario: Scenario) -> TrialVsFlight:
    """Fly a scenario whose faults sit on one signal, fly it healthy, and run the trial."""
    labels = [fault.label for fault in scenario.faults]
    tested = labels.index(TESTED)
    name = scenario.faults[tested].signal
    second = labels.index(SECOND) if SECOND in labels else None
    made = Cell(scenario, one_signal(scenario, name), faults_of(scenario, name), {}, tested, second, [])
    healthy = fly_rows(scenario.model_copy(update={"faults": []}).trusted(scenario.trust))
    trials = _as_flown(made, of_rows(healthy))
    results, _, _ = fly_trials(made, trials, lambda: None)
    rows, s = fly_rows(scenario), INDEX[name]
    kept = not (results["lost"][0] or off_votes(made, results)[0])
    return TrialVsFlight(_failed_at(rows, s), results["failed_at"][0], _kept(rows, s, trials), kept)


def _kept(rows: Block, s: int, trials: Trials) -> bool:
    """Return True if a flight kept its vote on signal ``s``, by what counts in a trial."""
    rows = rows[int(trials.counted_from[0]) :]
    error = differences(rows["voted"][:, s], rows["truth"][:, s], SIGNALS[s].wraps)
    off = ~(np.abs(error) <= trials.threshold)
    return not (off[-1] or off.sum() > trials.allowed or (rows["level"][:, s] == 0).any())


def _as_flown(made: Cell, recording: Recording) -> Trials:
    """Return the one trial with the draws of the flight."""
    scenario, s, frames = made.scenario, made.one.signal, len(recording.truth)
    block = new_block(frames)
    sensors = Sensors(scenario.sensors, scenario.rate_hz, scenario.streams()["sensors"])
    sensors.prepare(block)
    made.faults.prepare(block)
    onset = made.faults.schedule["first"][[made.tested]]
    delay = 0 if made.second is None else int(made.faults.schedule["delay"][made.second])
    return Trials(
        first=np.zeros(1, np.int64),
        onset=onset,
        counted_from=onset + delay,
        tested=made.tested,
        last=np.full(1, frames),
        early=0,
        linger=int(lingers(made.one.manager.params)[0]),
        threshold=made.one.threshold,
        allowed=allowed_frames(made.one.manager.params[0]),
        truth=np.ascontiguousarray(recording.truth[:, s]),
        reference=np.ascontiguousarray(recording.reference[:, s]),
        second=np.ascontiguousarray(recording.second_reference[:, s]),
        reference_step=np.zeros(1),
        reference_from=np.zeros(1, np.int64),
        sensors=made.one.params[None, :],
        noise=np.ascontiguousarray(sensors.data.noise[:frames, s : s + 1]),
        schedule=made.faults.schedule[None, :],
        targets=made.faults.targets[None, :],
        normal=np.ascontiguousarray(made.faults.data.normal[:frames]),
    )


def _failed_at(rows: Block, s: int) -> NDArray[np.int64]:
    failed = rows["state"][:, s] == State.FAILED
    return np.where(failed.any(axis=0), failed.argmax(axis=0), NEVER)
