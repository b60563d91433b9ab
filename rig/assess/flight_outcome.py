"""The outcome of one flight, added up block by block while it is flown, or from its rows afterwards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.monitored import discrete_records, fault_records, monitor, signal_records
from rig.assess.outcome import LEVELS, NEVER, VOTE
from rig.assess.outcome_records import EPISODE, FAILURE, FLIGHT, PATTERNS, ROOM, SPAN, Outcomes
from rig.assess.outcome_rows import add_rows
from rig.errors import BadInput
from rig.faults import CLEAN
from rig.frame import CHANNELS, SIGNALS, Block, S, new_block
from rig.scenario import Scenario

# One signal's fields that a sentence looks at again, frame by frame.
COLUMNS: Final = np.dtype([("channels", "f8", (CHANNELS,)), ("valid", "u1", (CHANNELS,)), ("state", "u1", (CHANNELS,))])
Columns = Callable[[int], NDArray[Any]]  # (n,) COLUMNS of a signal


class FlightOutcome:
    """What became of the faults of a scenario: records of outcome_records.py, in bounded memory.

    window_s : after an onset, for which the load factor is looked at
    keep : whether the channels of the signals with a fault are kept, 40 bytes a frame
    """

    def __init__(self, scenario: Scenario, window_s: float, *, keep: bool = False) -> None:
        self.scenario, self.params = scenario, monitor(scenario)
        self._failures: list[NDArray[Any]] = []
        self._episodes: list[NDArray[Any]] = []
        signals, discretes = signal_records(self.params), discrete_records(scenario)
        faults = fault_records(scenario, signals, discretes)
        self.records = Outcomes(
            params=self.params,
            flight=_blank_flight(scenario, window_s),
            faults=faults,
            signals=signals,
            discretes=discretes,
            votes=np.zeros((S, 2), VOTE),
            spans=np.zeros(S + 2 * len(faults), SPAN),
            failures=np.zeros(ROOM, FAILURE),
            episodes=np.zeros(ROOM, EPISODE),
            going_on=np.zeros(S, EPISODE),
            patterns=np.zeros((S, PATTERNS, PATTERNS), np.int64),
            levels=np.zeros((S, LEVELS, LEVELS), np.int64),
        )
        self.records.signals["span"] = self.records.spans["signal"][:S] = np.arange(S)
        self.records.going_on["first"] = NEVER
        on_signals = faults[(faults["signal"] >= 0) & (faults["discrete"] == 0)]
        self._kept: dict[int, list[NDArray[Any]]] = {s: [] for s in on_signals["signal"].tolist() if keep}
        self.add(new_block(0), np.zeros(0, CLEAN))  # compiles before the first frame

    @property
    def frames(self) -> int:
        """Frames that were added."""
        return int(self.records.flight["frames"][0])

    def add(self, rows: Block, clean: NDArray[Any]) -> None:
        """Add the next rows; clean : (n,) CLEAN.  BadInput when no fault can have made a sample that differs."""
        if self.frames == 0 and len(rows):
            on = self.records.faults["signal"], self.records.faults["channel"]
            here = (on[0] >= 0) & (self.records.faults["discrete"] == 0)
            self.records.faults["sample"][here] = rows["channels"][0][on[0][here], on[1][here]]
        done = 0
        while done < len(rows):
            done = int(add_rows(rows, clean, done, self.records))
            self._empty()
        if not len(rows):
            add_rows(rows, clean, 0, self.records)
        for s, kept in self._kept.items():
            kept.append(columns(rows, s))

    def _empty(self) -> None:
        """Take the lists out of their arrays; refuse samples that the sensors cannot have given."""
        flight = self.records.flight[0]
        if flight["unexplained"] != NEVER:
            s, c = divmod(int(flight["unexplained"]), CHANNELS)
            raise BadInput(
                "the sensors of this version do not give the recorded channels again: first "
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

    def columns(self, s: int) -> NDArray[Any]:
        """Return what was kept of a signal with a fault, (frames,) COLUMNS."""
        return np.concatenate(self._kept[s])


def columns(rows: Block, s: int) -> NDArray[Any]:
    """Return (n,) COLUMNS of one signal of ``rows``."""
    kept = np.empty(len(rows), COLUMNS)
    for field in COLUMNS.names or ():
        kept[field] = rows[field][:, s]
    return kept


def _blank_flight(scenario: Scenario, window_s: float) -> NDArray[Any]:
    flight = np.zeros(1, FLIGHT)
    flight["spans"], flight["unexplained"], flight["acted_from"] = S, NEVER, NEVER
    flight["box_signals"], flight["window"] = scenario.redundancy.box_signals, round(window_s * scenario.rate_hz)
    flight["low"], flight["high"] = np.inf, -np.inf
    return flight
