"""What became of each fault: when it began, when its error left the threshold, when its channel was failed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.isolations import COMPARISON
from rig.assess.monitored import Bools, Monitored
from rig.assess.places import Place, channels_of, on_channels, references_of
from rig.assess.record import FaultScore, Outcome
from rig.assess.votes import difference
from rig.computer.redundancy.reference_monitor import reference_threshold
from rig.faults import Fault
from rig.faults.places import number as place_number
from rig.faults.places import site
from rig.frame import SIGNALS, Block, State
from rig.scenario import Scenario


def acts(rows: Block, faults: int) -> Bools:
    """(n, faults) whether each fault of the scenario acted in each frame."""
    return np.unpackbits(rows["acting"], axis=1, bitorder="little")[:, :faults].astype(bool)


def outcomes(
    scenario: Scenario,
    rows: Block,
    acting: Bools,
    params: NDArray[np.void],
    signals: Monitored,
    discretes: Monitored,
) -> list[FaultScore]:
    """One entry for each fault and channel, or for the fault where it sits on none, in the order of the scenario."""
    faults = scenario.faults
    scored = [
        _on_channel(place, acting[:, place.number], discretes if place.discrete else signals)
        for place in on_channels(faults)
    ]
    for number, fault in enumerate(faults):
        if not channels_of(fault):
            read = references_of(fault, scenario.redundancy)
            scored.append(_elsewhere(number, fault, read, rows, acting[:, number], params))
    return sorted(scored, key=lambda entry: entry.index)


def _on_channel(place: Place, acted: Bools, monitored: Monitored) -> FaultScore:
    s, c = place.signal, place.channel
    frames = np.flatnonzero(acted)
    before = monitored.state[np.maximum(frames - 1, 0), s, c]
    in_use = frames[(before != State.FAILED) | (frames == 0)]
    frames = frames[frames >= in_use[0]] if len(in_use) else frames
    errors = np.abs(monitored.error[frames, s, c]) if place.changes else np.zeros(len(frames))
    failed, resolver = monitored.failures.of(s, c, frames) if place.changes and len(in_use) else (None, None)
    found = _Found(place.number, place.fault, monitored.names[s], c + 1, frames, executed=len(in_use) > 0)
    return found.entry(errors, errors > monitored.threshold[s], monitored.persistence[s], failed, resolver)


def _elsewhere(
    number: int, fault: Fault, read: Sequence[int], rows: Block, acted: Bools, params: NDArray[np.void]
) -> FaultScore:
    """A fault on no channel: on a reference or the inertial unit the manager's monitor of references may see it.

    No monitor watches a surface; its error is what reaches the actuator less what was commanded.  Of several references
    that read one quantity the first one's error is told.
    """
    frames = np.flatnonzero(acted)
    errors, above = np.zeros(len(frames)), np.zeros(len(frames), bool)
    if site(fault.signal) == "surface":
        errors = np.abs(rows["actuator"] - rows["surface"])[frames, place_number(fault.signal)]
    failed: list[int] = []
    for s in read:
        off = np.abs(difference(rows["reference"][frames, s], rows["truth"][frames, s], SIGNALS[s].wraps))
        allowed = [reference_threshold(reference, params[s]) for reference in rows["reference"][frames, s]]
        errors, above = off if s == read[0] else errors, above | ~(off <= np.array(allowed))
        usable = rows["reference_usable"][:, s] != 0
        gone = np.flatnonzero(usable[:-1] & ~usable[1:]) + 1
        failed += gone[np.isin(gone, frames)].tolist()
    found = _Found(number, fault, fault.signal, None, frames, executed=len(frames) > 0)
    persistence = max((int(params[s]["persistence"]) for s in read), default=1)
    at = min(failed, default=None)
    return found.entry(errors, above, persistence, at, None if at is None else COMPARISON)


class _Found(NamedTuple):
    """A fault at one place; ``frames``: when it acted, from its onset."""

    number: int
    fault: Fault
    signal: str
    channel: int | None
    frames: NDArray[np.intp]
    executed: bool

    def entry(
        self,
        errors: NDArray[np.float64],
        above: Bools,
        persistence: int,
        failed: int | None,
        resolver: str | None,
    ) -> FaultScore:
        """The score; ``errors`` in ``frames``, NaN for a lost sample, and whether they were ``above`` the threshold."""
        onset = _first(self.frames)
        lost = np.isnan(errors)
        beyond = self.frames[above | lost] if self.executed else self.frames[:0]
        exceeded, run = _first(beyond), longest_run(beyond)
        outcome: Outcome = "not executed"
        if self.executed:
            outcome = "detected" if failed is not None else "missed" if exceeded is not None else "undetectable"
        return FaultScore(
            id=self.fault.label,
            signal=self.signal,
            channel=self.channel,
            kind=self.fault.kind,
            onset_frame=onset,
            exceeded_frame=exceeded,
            failed_frame=failed,
            outcome=outcome,
            delay_from_onset_frames=None if failed is None or onset is None else failed - onset,
            delay_from_exceeded_frames=None if failed is None or exceeded is None else failed - exceeded,
            resolver=resolver,
            peak_error=None if lost.all() else float(errors[~lost].max()),
            exceeded_run_frames=run,
            tolerated=outcome == "missed" and run < int(persistence),
            index=self.number,
        )


def _first(frames: NDArray[np.intp]) -> int | None:
    return int(frames[0]) if len(frames) else None


def longest_run(frames: NDArray[np.intp]) -> int:
    """The most consecutive numbers in a row in ``frames``, which rise."""
    if not len(frames):
        return 0
    breaks = np.flatnonzero(np.diff(frames) != 1)
    edges = np.concatenate([[-1], breaks, [len(frames) - 1]])
    return int(np.diff(edges).max())
