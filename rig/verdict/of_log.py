"""The score of a log: read, check that it is a whole flight of a scenario, fly its baseline, score."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.lib.recfunctions import repack_fields
from numpy.typing import NDArray

from rig.core.errors import BadInput, RigError
from rig.core.frame import Block, Table, UnitStatus
from rig.core.notes import note
from rig.core.progress import tell
from rig.core.runs import runs_where
from rig.core.trust import Trust
from rig.flight.conclusion_rows import Conclusion
from rig.flight.time_histogram import Times
from rig.log import Log, LogFile, scenario_of, unit_of
from rig.scenario.pressed_keys import pressed
from rig.scenario.scenario import Scenario, from_resolved
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_facts import differences, voter, votes
from rig.verdict.conclusion import conclusion, not_scored
from rig.verdict.flight_tally import FlightOutcome
from rig.verdict.score_records import Score, Yardstick
from rig.verdict.scoring import score_blocks, score_of
from rig.verdict.transients import Apart, Deviations, apart_from, baseline_blocks

BASELINE_FRAMES: Final = 30_000  # of a flight whose baseline is flown at once
_UNANSWERED: Final = (UnitStatus.HELD, UnitStatus.LATE, UnitStatus.DEAD, UnitStatus.REFUSED)


@dataclass(frozen=True, slots=True)
class Miss:
    """Consecutive frames, the last included, that were flown on an older reply."""

    first_frame: int
    last_frame: int
    status: str  # of the first of them: held, dead, refused


class Scored(NamedTuple):
    """The score of a flight."""

    log: Path  # file of the log
    scenario: Scenario  # scenario as flown
    digest: str  # digest of the flight
    score: Score  # all numbers; ``as_dict()`` has their keys
    unit: dict[str, Any] | None  # counts of the exchanges with a unit under test; None: without one
    times: dict[str, dict[str, int]]  # histograms of the wall clock
    misses: list[Miss]  # missed answers of a unit with ``on_miss = "fault"``
    conclusion: Conclusion  # outcome in at most ten lines
    voter: str  # the manager or the unit that voted

    def __repr__(self) -> str:
        """Return the conclusion, one sentence a line."""
        return "\n".join(self.conclusion)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, as ``rig score --json`` prints it."""
        identity = {"log": str(self.log), "seed": self.scenario.seed, "digest": self.digest}
        return {**identity, **self.score.as_dict(), "unit": self.unit, "times": self.times} | {
            "unit_faults": [asdict(miss) for miss in self.misses],
            "conclusion": [*self.conclusion],
        }


def score_log(
    path: Path,
    yardstick: Yardstick,
    baseline: bool = True,
    allow_code: bool = False,
    unit: UnitUnderTest | None = None,
    log: Log | LogFile | None = None,
) -> Scored:
    """Score the flight at ``path``; ``baseline`` flies it again without its faults to compare with.

    allow_code : a manager class that the log names may be run, in the flight of the baseline
    unit : under test, that flew it and flies the baseline
    log : what has been read from ``path`` already; otherwise it is gone through block by block
    BadInput, one line, when it is no log of a flight, has no verdict, or was flown with other sensors.
    """
    log = LogFile.open(path) if log is None else log
    scenario = _scenario(path, log, allow_code)
    if log.result is None:
        raise BadInput(f"{path}: the flight is not finished (cut off, recovered or still flying): not scored")
    if baseline:
        scenario.trust.require(scenario.redundancy.manager)
        if "unit" in log.metadata and unit is None:
            raise BadInput(f"{path}: a unit under test flew it; give --unit FILE to fly the baseline, or --no-baseline")
    unit_facts = unit_of(log.metadata)
    if unit is not None:
        unit.fly_as(unit_facts)
        for differs in differences(unit_facts, unit.unit.about()) if unit_facts else ():
            note(f"{path}: the unit that flies the baseline is not as in the flight: {differs}")
    times, answers = Times(), list[NDArray[Any]]()
    blocks, other = _gone_through(log, times, answers), _baseline(log, scenario, unit) if baseline else None
    try:
        scored = score_blocks(scenario, blocks, other, yardstick, unit_facts.get("lane"), votes(unit_facts))
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    exchanges = json.loads(log.result["unit"]) if "unit" in log.result else None
    concluded = conclusion(scenario, scored)
    digest = log.result.get("digest", "")
    voted_by = voter(scenario.redundancy.manager, unit_facts)
    missed = misses(np.concatenate(answers)) if unit_facts.get("on_miss") == "fault" else []
    return Scored(path, scenario, digest, scored, exchanges, times.as_dict(), missed, concluded, voted_by)


def _baseline(log: Log | LogFile, scenario: Scenario, unit: UnitUnderTest | None) -> Iterator[Block]:
    tell("flying the fault-free baseline")
    return baseline_blocks(scenario, log.frames, unit)


def _gone_through(log: Log | LogFile, times: Times, answers: list[NDArray[Any]]) -> Iterator[Table]:
    """Yield the blocks of a log; note its wall-clock times, and the replies of a unit."""
    done = 0
    for block in log.blocks():
        times.add(block.timing)
        answers.append(repack_fields(block.rows[["frame", "unit"]]))
        yield block
        done += len(block)
        tell("scoring", done, log.frames)


class FlightConclusion:
    """The conclusion of a flight, gathered while it is flown: ``outcome`` of ``rig.flight.fly.fly``.

    baseline : compare the aircraft with its fault-free baseline, which is flown when the flight is over; not where a
               unit under test or a manager of the user votes, nor for more than BASELINE_FRAMES frames
    It never raises.
    """

    def __init__(self, baseline: bool = False) -> None:
        self._outcome: FlightOutcome | None = None
        self._refused = "a flight is scored from its frame 0 on"
        self._baseline, self._truth = baseline, list[NDArray[Any]]()

    def begin(self, scenario: Scenario, unit_lane: str | None = None, unit_votes: bool = True) -> None:
        """Take the scenario as it is flown; unit_lane, unit_votes : as of FlightOutcome."""
        self._outcome = FlightOutcome(scenario, Yardstick().window_s, unit_lane, unit_votes)
        own = unit_lane is not None or ":" in scenario.redundancy.manager
        self._baseline &= bool(scenario.faults) and not own and scenario.frames <= BASELINE_FRAMES

    def add(self, table: Table) -> None:
        """Take the next frames, with their clean channels: block by block, while the flight is flown."""
        if self._outcome is None:
            return
        if self._baseline:
            self._truth.append(repack_fields(table.rows[["truth", "end", "unit"]]))
        try:
            self._outcome.add(table)
        except BadInput as error:
            self._outcome, self._refused = None, str(error)

    def conclusion(self, log: Path, frames: int) -> Conclusion:
        """Return the conclusion; log, frames : of the flight."""
        if self._outcome is None or not frames:
            return not_scored(f"{log}: {self._refused}")
        scenario = self._outcome.scenario
        try:
            return conclusion(scenario, score_of(self._outcome, self._deviations(scenario)))
        except RigError:  # the baseline cannot be flown, or is that of another flight
            return conclusion(scenario, score_of(self._outcome))

    def _deviations(self, scenario: Scenario) -> Deviations | None:
        """Fly the baseline; return how far the flight was from it, None without one."""
        if not self._baseline:
            return None
        flown = np.concatenate(self._truth)
        if (flown["unit"] != UnitStatus.NONE).any():
            return None
        tell("flying the fault-free baseline")
        apart, done = list[Apart](), 0
        for block in baseline_blocks(scenario, len(flown)):
            apart.append(apart_from(flown[done : done + len(block)], block))
            done += len(block)
        if done < len(flown):
            apart.append(apart_from(flown[done:], None))
        return Deviations.of(apart, Yardstick())


def conclude(log: Log) -> Conclusion:
    """Return the conclusion of a log that has been read, without a fault-free baseline; never raises."""
    try:
        return score_log(Path("log"), Yardstick(), baseline=False, log=log).conclusion
    except BadInput as error:
        return not_scored(str(error))


def _scenario(path: Path, log: Log | LogFile, allow_code: bool) -> Scenario:
    resolved = scenario_of(log.metadata, path)
    if not resolved:
        raise BadInput(f"{path}: no scenario, so no true state to score against; only logs of rig fly have one")
    scenario = from_resolved(resolved, f"{path}: scenario", Trust(str(path), allow_code))
    return pressed(scenario, log.result, str(path))


def misses(answers: NDArray[Any]) -> list[Miss]:
    """Return the frames without a reply of the unit, in order of time; answers : (n,) frame and unit of rows."""
    frames, status = answers["frame"], answers["unit"]
    return [
        Miss(int(frames[first]), int(frames[end - 1]), UnitStatus(status[first]).name.lower())
        for first, end in runs_where(np.isin(status, _UNANSWERED)).tolist()
    ]
