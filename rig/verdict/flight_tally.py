"""The outcome of a flight or a recording, added up block by block while it is flown, or from its rows afterwards."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import manager_kind
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS, SIGNALS, Block, Table, new_block, stacked
from rig.flight.suspects import Suspect, count_suspects, new_counts, suspects
from rig.scenario.scenario import Scenario
from rig.verdict import law_tally
from rig.verdict.lane_tally import LaneOutcome
from rig.verdict.monitored_places import Monitored, fault_records, of_scenario
from rig.verdict.row_kernel import add_rows
from rig.verdict.score_records import COLUMNS, LawFinding
from rig.verdict.servo_tally import ActuatorOutcome, add_servos
from rig.verdict.signal_kernels import LEVELS, NEVER, VOTE
from rig.verdict.tally_records import EPISODE, FAILURE, FLIGHT, PATTERNS, ROOM, SPAN, Outcomes
from rig.verdict.unfaulted import ReferredAgain
from rig.verdict.words import Cause, FaultWord, fault_word
from rig.world.faults import CLEAN
from rig.world.faults.places import FLIGHT as FLIGHT_PLACES

NO_REFERENCES: Final = np.full((1, len(SIGNALS)), np.nan)  # no fault sits on one


class Outcome:
    """Outcomes of faults: records of tally_records.py, in bounded memory.

    window : frames after an onset, for which the load factor is looked at
    """

    def __init__(self, monitored: Monitored, faults: NDArray[Any], window: int = 0) -> None:
        count, room = len(monitored.signals), ROOM * (len(monitored.signals) + len(monitored.discretes))
        self._failures: list[NDArray[Any]] = []
        self._episodes: list[NDArray[Any]] = []
        self.params = monitored.params
        self.records = Outcomes(
            params=monitored.params,
            flight=_blank_flight(count, window),
            faults=faults,
            signals=monitored.signals,
            discretes=monitored.discretes,
            votes=np.zeros((count, 2), VOTE),
            spans=np.zeros(count + 2 * len(faults), SPAN),
            failures=np.zeros(room, FAILURE),
            episodes=np.zeros(room, EPISODE),
            going_on=np.zeros(count, EPISODE),
            patterns=np.zeros((count, PATTERNS, PATTERNS), np.int64),
            levels=np.zeros((count, LEVELS, LEVELS), np.int64),
        )
        self.records.signals["span"] = self.records.spans["signal"][:count] = np.arange(count)
        self.records.going_on["first"] = NEVER

    @property
    def frames(self) -> int:
        """Frames that were added."""
        return int(self.records.flight["frames"][0])

    def add(self, table: Table, references: NDArray[np.float64] = NO_REFERENCES) -> None:
        """Add the next frames, with their clean channels; references : as of ``add_rows``.

        Block-wise: a flight is assessed while it is flown.  BadInput when no fault can have made a sample that differs.
        """
        done = 0
        while done < len(table):
            done = int(add_rows(table.rows, table.clean, references, done, self.records))
            self._empty()

    def _empty(self) -> None:
        """Take the lists out of their arrays; refuse samples that the sensors cannot have given."""
        flight = self.records.flight[0]
        if flight["unexplained"] != NEVER:
            s, c = divmod(int(flight["unexplained"]), CHANNELS)
            raise BadInput(
                "the sensors of this version do not reproduce the recorded channels: first difference at "
                f"{SIGNALS[s].name} channel {c + 1} in frame {flight['frames']}; the flight cannot be scored"
            )
        if flight["failures"]:
            self._failures.append(self.records.failures[: flight["failures"]].copy())
        if flight["episodes"]:
            self._episodes.append(self.records.episodes[: flight["episodes"]].copy())
        flight["failures"] = flight["episodes"] = 0

    @property
    def failures(self) -> NDArray[Any]:
        """(n,) FAILURE in order of time."""
        return np.concatenate([self.records.failures[:0], *self._failures])

    @property
    def episodes(self) -> NDArray[Any]:
        """(n,) EPISODE in order of time, those that go on at the end too."""
        going_on = self.records.going_on[self.records.going_on["first"] != NEVER]
        listed = np.concatenate([*self._episodes, going_on])
        return listed[np.lexsort((listed["signal"], listed["first"]))]

    def wrong_isolations(self, fault: Any) -> NDArray[Any]:
        """Return the (n,) FAILURE of healthy channels that a fault isolated: up to the next onset on its signal.

        fault : a FAULT record; of one that never began, or of a discrete, to the end
        """
        failures, first, end = self.failures, 0, self.frames
        if fault["onset"] != NEVER and not fault["discrete"]:
            first, end = int(fault["onset"]), self.next_onset(fault)
        here = (failures["signal"] == fault["signal"]) & (failures["discrete"] == fault["discrete"])
        within = (first <= failures["frame"]) & (failures["frame"] < end)
        return failures[here & within & (failures["cause"] == Cause.WRONG_ISOLATION)]

    def next_onset(self, fault: Any) -> int:
        """Return the frame in which the next fault on the same signal begins, or the number of frames."""
        faults = self.records.faults
        onsets = faults["onset"][(faults["signal"] == fault["signal"]) & (faults["discrete"] == fault["discrete"])]
        return min((int(other) for other in onsets if other > fault["onset"]), default=self.frames)

    def word(self, fault: Any, kept: bool | None = None) -> FaultWord:
        """Return the outcome of a fault, a FAULT record.

        kept : the vote up to the next onset, which decides where a manager takes its failures back; None: it does not
        """
        wrong = len(self.wrong_isolations(fault)) > 0 if kept is None else not kept
        failed, exceeded = fault["failed_at"] != NEVER, fault["exceeded_at"] != NEVER
        return fault_word(bool(fault["executed"]), failed, exceeded, wrong)


class FlightOutcome(Outcome):
    """Outcomes of the faults of a scenario.

    window_s : after an onset, for which the load factor is looked at
    unit_lane : of several computers, the one whose software is a unit under test, A to D
    unit_votes : False if a unit under test replaces the control law alone
    """

    def __init__(
        self, scenario: Scenario, window_s: float, unit_lane: str | None = None, unit_votes: bool = True
    ) -> None:
        self.scenario, self.unit_votes, monitored = scenario, unit_votes, of_scenario(scenario)
        faults = fault_records(scenario.faults, monitored, FLIGHT_PLACES, scenario.redundancy)
        super().__init__(monitored, faults, round(window_s * scenario.rate_hz))
        on_signals = faults[(faults["signal"] >= 0) & (faults["discrete"] == 0)]
        compared = on_signals["signal"].tolist() if manager_kind(scenario.redundancy.manager).compares else ()
        self._kept: dict[int, list[tuple[int, NDArray[Any]]]] = {s: [] for s in compared}  # first frame, (n,) COLUMNS
        self._before: dict[int, NDArray[Any]] = {}  # the last row of these signals
        self._suspects = new_counts()
        self._referred = ReferredAgain(scenario) if (faults["reference"] != NEVER).any() else None
        self.actuators = ActuatorOutcome(scenario, self.records.faults, unit_lane) if scenario.has_servos else None
        self.computers = LaneOutcome(scenario, unit_lane) if scenario.computers.count > 1 else None
        self._law: list[Table] | None = [] if scenario.control.law == "fault-tolerant" else None
        add_rows(new_block(0), np.zeros(0, CLEAN), NO_REFERENCES, 0, self.records)  # compiles before the first frame

    def add(self, table: Table, references: NDArray[np.float64] = NO_REFERENCES) -> None:
        """Add the next frames, block by block, with their servos and lanes; keep what is to be kept of them."""
        rows, first = table.rows, self.frames
        if first == 0 and len(rows):
            faults = self.records.faults
            here = (faults["signal"] >= 0) & (faults["discrete"] == 0)
            faults["sample"][here] = rows["channels"][0][faults["signal"][here], faults["channel"][here]]
        super().add(table, references if self._referred is None else self._referred.of(rows))
        self._keep(rows, first)
        count_suspects(rows, self._suspects)
        if self._law is not None and len(news := law_tally.news(table, self._law[-1] if self._law else None)):
            self._law.append(news)
        if self.actuators is not None and table.servo is not None:
            add_servos(table, self.actuators.records)
        if self.computers is not None:
            self.computers.finder.find(table)

    def _keep(self, rows: Block, first: int) -> None:
        """Keep COLUMNS of the compared signals of ``rows``, from the frame before a fault acts until it is failed."""
        if not len(rows):
            return
        faults = self.records.faults
        unfailed = (faults["failed_at"] == NEVER) | (faults["failed_at"] >= first)
        going_on = faults["signal"][(faults["executed"] != 0) & unfailed & (faults["discrete"] == 0)]
        for s, parts in self._kept.items():
            if s in going_on:
                follows = bool(parts) and parts[-1][0] + len(parts[-1][1]) == first
                if not follows and s in self._before:
                    parts.append((first - 1, self._before[s]))
                parts.append((first, columns(rows, s)))
            self._before[s] = columns(rows[-1:], s)

    def kept(self, s: int, first: int, end: int) -> NDArray[Any]:
        """Return what was kept of a signal in the frames ``first`` to ``end`` (excluded), (n,) COLUMNS."""
        within = [part[max(first - start, 0) : max(end - start, 0)] for start, part in self._kept[s]]
        return np.concatenate([np.empty(0, COLUMNS), *within])

    @property
    def suspects(self) -> list[Suspect]:
        """Every channel that had a state, and in how many frames it was suspect."""
        return suspects(self._suspects, self.frames)

    @property
    def law(self) -> list[LawFinding]:
        """Return the findings of the fault-tolerant law."""
        return law_tally.findings(stacked(self._law), self.params) if self._law else []


def columns(rows: Block, s: int) -> NDArray[Any]:
    """Return (n,) COLUMNS of one signal of ``rows``."""
    kept = np.empty(len(rows), COLUMNS)
    for field in COLUMNS.names or ():
        kept[field] = rows[field][:, s]
    return kept


def _blank_flight(signals: int, window: int) -> NDArray[Any]:
    flight = np.zeros(1, FLIGHT)
    flight["spans"], flight["unexplained"], flight["acted_from"] = signals, NEVER, NEVER
    flight["window"] = window
    flight["low"], flight["high"] = np.inf, -np.inf
    return flight
