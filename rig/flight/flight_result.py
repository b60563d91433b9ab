"""The result of a flight, for a program and ``rig fly``; a notebook has more of it (rig/show/notebook/flight.py)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.core.ending import ending
from rig.core.event import Event, StreamReport
from rig.core.frame import Block
from rig.flight.conclusion_rows import Conclusion
from rig.flight.failures import failed_text
from rig.flight.pace import Jitter
from rig.flight.summary import Peaks
from rig.flight.suspects import Suspect, slow_faults_text
from rig.log import Log, SignalArrays, read_log
from rig.scenario.scenario import Scenario
from rig.scenario.scenario_notes import notes
from rig.unit.unit_facts import voter

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, repr=False)
class Flight:
    """The result of a flight; its frames are read from the log when they are first used."""

    log: Path  # file of the log
    scenario: Scenario  # scenario as flown
    frames: int  # frames flown
    digest: str  # SHA-256 of all rows: equal digests are equal flights
    survived: bool  # False: the aircraft was lost
    end_reason: str  # reason of the end
    failed: dict[str, list[int]]  # isolated channels at the end, from 1, by signal and discrete
    not_executed: list[str]  # faults that did not act: never triggered, or their channels were already isolated
    peaks: Peaks  # largest true excursions
    events: list[Event]  # events in order of time
    wall_s: float  # time taken, s
    us_per_frame: float  # time taken for a frame, us
    jitter: Jitter | None  # lateness of the frames; None: not paced
    stream: StreamReport | None  # live stream; None: there was none
    unit: dict[str, Any] | None  # counts of the exchanges with a unit under test; None: without one
    printed: str  # end of the output of the unit's process
    realtime: dict[str, str]  # real-time requests to the system and their results; empty: none
    conclusion: Conclusion | None  # outcome in at most ten lines; None: not assessed
    suspects: tuple[Suspect, ...] = ()  # channels that were suspect in at least one frame
    overrides: tuple[str, ...] = ()  # overrides of the scenario, ``key=value``
    unit_file: str = ""  # unit file of the unit under test
    # Servo channels that were shut off, by surface and channel from 1: time [s] and monitor.
    coils_failed: dict[str, dict[int, tuple[float, str]]] = field(default_factory=dict)
    lanes_failed: dict[str, float] = field(default_factory=dict)  # isolated lanes: time of the first isolation, s

    @property
    def duration_s(self) -> float:
        """Simulated time flown, s."""
        return self.frames / self.scenario.rate_hz

    @property
    def voter(self) -> str:
        """The manager or unit that voted: ``manager cross-channel``, or ``unit NAME``; the law too, if it is a unit."""
        return voter(self.scenario.redundancy.manager, self.unit)

    @property
    def notes(self) -> list[str]:
        """Notes on unlikely settings: a flight point without designed gains, a trigger condition that is never true."""
        return notes(self.scenario)

    @cached_property
    def recorded(self) -> Log:
        """The log, read at the first use."""
        return read_log(self.log)

    @property
    def rows(self) -> Block:
        """(frames,) rows of all frames, read from the log."""
        return self.recorded.rows

    def signal(self, name: str) -> SignalArrays:
        """Return the arrays of one signal; BadInput: unknown signal."""
        return self.recorded.signal(name)

    def to_polars(self, *owners: str) -> pl.DataFrame:
        """Return a table with a row for each frame and the columns of ``rig export``; ``owners`` as for Log."""
        return self.recorded.to_polars(*owners)

    def __repr__(self) -> str:
        """Return one line: scenario, end, isolated channels, log."""
        named = f"{self.scenario.title or self.scenario.aircraft} seed {self.scenario.seed}"
        verdict = ending(self.survived, self.end_reason, self.frames, self.scenario.rate_hz)
        told = f"isolated {failed_text(self.failed)}{slow_faults_text(self.suspects)}"
        return f"<Flight {named}: {verdict}; {told}, log {self.log}>"

    def summary(self) -> dict[str, Any]:
        """Return the flight as plain data, as ``rig fly --json`` prints it."""
        dt_s = 1.0 / self.scenario.rate_hz
        timing: dict[str, Any] = {
            "us_per_frame": self.us_per_frame,
            "realtime_factor": self.duration_s / self.wall_s,
        }
        if self.jitter is not None:
            timing["jitter"] = asdict(self.jitter)
        if self.realtime:
            timing["realtime"] = self.realtime
        return {
            "log": str(self.log),
            "frames": self.frames,
            "duration_s": self.duration_s,
            "seed": self.scenario.seed,
            "manager": self.scenario.redundancy.manager,
            "overrides": list(self.overrides),
            "digest": self.digest,
            "survived": self.survived,
            "end_reason": self.end_reason,
            "failed": self.failed,
            "suspects": [suspect.as_dict() for suspect in self.suspects],
            "not_executed": self.not_executed,
            "notes": self.notes,
            "peaks": asdict(self.peaks),
            "events": [{"time_s": event.frame * dt_s, **asdict(event)} for event in self.events],
            "timing": timing,
            "stream": None if self.stream is None else asdict(self.stream),
            **({"gains_below_requirement": below} if (below := self.scenario.gains.below) else {}),
            **({} if self.unit is None else {"unit": self.unit}),
            **({} if self.scenario.actuators.model == "lag" else {"coils_failed": self.coils_failed}),
            **({} if self.scenario.computers.count == 1 else {"lanes_failed": self.lanes_failed}),
        }
