"""The outcome of a flight's servo actuators, added up beside that of its signals."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.lanes.health import shut_off
from rig.core.frame import CHANNELS, COMPUTERS, MOVED, Table, new_block, second_rows
from rig.flight.servo_events import monitor_name
from rig.flight.stages import actuator_monitors
from rig.scenario.scenario import Scenario
from rig.verdict.lane_tally import UNIT
from rig.verdict.monitored_places import MARGIN, channels_of
from rig.verdict.score_records import ActuatorFailure, ActuatorScore, FaultScore, Isolation
from rig.verdict.servo_kernels import MONITORS, PLACED, SERVO, VALVE, ActuatorOutcomes, add_lanes
from rig.verdict.signal_kernels import LONG_AGO, NEVER
from rig.verdict.words import Cause, IsolationKind
from rig.world.faults import Fault
from rig.world.faults.places import OF_SERVOS, number, site
from rig.world.faults.servo_parts import Part

_ALL: Final = (1 << len(MOVED)) - 1
_FRAMES: Final = ("failed_at", "differs_at", "bypassed_at")


class ActuatorOutcome:
    """Outcomes of the faults of servos and of their channels: records of servo_kernels.py, in bounded memory.

    faults : (F,) outcome_records.FAULT of the flight, in which what was found of those on servos is noted too
    unit_lane : of several computers, the one whose software is a unit under test, A to D
    """

    def __init__(self, scenario: Scenario, faults: NDArray[Any], unit_lane: str | None = None) -> None:
        designed, monitors = actuator_monitors(scenario)
        limits = monitors.limits
        waits = [limits[name] for name in limits.dtype.names or () if name.endswith("_frames")]
        self.persistence = int(max(np.max(waits), monitors.params["persistence"].max()))
        self.records = ActuatorOutcomes(
            faults=faults,
            placed=_placed(scenario.faults),
            servos=_blank_servos(),
            designed=designed,
            monitors=monitors,
            linger=np.array([self.persistence + MARGIN]),
        )
        self._of_unit = NEVER if unit_lane is None else COMPUTERS.index(unit_lane)  # its channel
        blank = Table(new_block(2), second_rows(2, scenario.row_parts))  # fewer rows would be another layout
        add_servos(blank, deepcopy(self.records))  # compiles before the first frame

    def completed(self, n: int, fault: FaultScore) -> FaultScore:
        """Return the outcome of the fault of the ``n``-th FAULT record: as it is, unless it sits on servos."""
        for placed in self.records.placed[self.records.placed["fault"] == n]:
            wrong, surfaces = self._wrongly_failed(fault.onset_frame, int(placed["surfaces"])), int(placed["bypassed"])
            unseen = surfaces != 0 and fault.outcome == "undetectable"  # who loses a surface has something to find
            outcome, word = ("missed", "missed") if unseen else (fault.outcome, fault.word)
            return replace(
                fault,
                outcome=outcome,
                peak_error=None,
                tolerated=fault.outcome == "missed" and fault.exceeded_run_frames < self.persistence,
                word="wrong channel" if wrong else word,
                bypassed=tuple(_named(surfaces)),
                bypassed_frame=int(placed["bypassed_at"]) if surfaces else None,
            )
        return fault

    def _wrongly_failed(self, onset: int | None, surfaces: int) -> bool:
        """Return whether a healthy channel of the ``surfaces``, bits, was failed for another's fault since."""
        scores = self.scores()
        failures = [failure for name in _named(surfaces) if name in scores for failure in scores[name].failures]
        return onset is not None and any(
            failure.cause == "wrong isolation" and failure.frame >= onset for failure in failures
        )

    def scores(self) -> dict[str, ActuatorScore]:
        """Return the outcome of every surface that a servo moves; of none, when no rows of servos were added."""
        servos = zip(MOVED, self.records.servos, strict=True)
        return {name: _score(servo, self._of_unit) for name, servo in servos if servo["frames"]}

    def isolations(self, kind: IsolationKind) -> list[Isolation]:
        """Return the healthy channels that were isolated, of one kind."""
        return [
            Isolation(f"actuator.{name}", failure.channel, failure.frame, failure.monitor, failure.faulty)
            for name, score in self.scores().items()
            for failure in score.failures
            if failure.cause == kind
        ]


def add_servos(table: Table, records: ActuatorOutcomes) -> None:
    """Add the next frames to the records."""
    add_lanes(table.rows, table.servo, table.copy().servo, shut_off(table), records)


def finder(code: int) -> str:
    """Return which monitor found a fault, as the kernel writes it: from MONITORS on."""
    return "valve" if code == VALVE else monitor_name(code - MONITORS)


def _named(surfaces: int) -> list[str]:
    return [name for i, name in enumerate(MOVED) if surfaces >> i & 1]


def _score(servo: Any, of_unit: int) -> ActuatorScore:
    failed, differs = (np.flatnonzero(servo[name] != NEVER).tolist() for name in ("failed_at", "differs_at"))
    failures = [
        ActuatorFailure(
            c + 1,
            int(servo["failed_at"][c]),
            monitor_name(servo["failed_by"][c]),
            _cause(servo, c, of_unit),
            tuple(other + 1 for other in range(CHANNELS) if int(servo["faulty"][c]) >> other & 1),
        )
        for c in sorted(failed, key=lambda c: (servo["failed_at"][c], c))
    ]
    bypassed = int(servo["bypassed_at"])
    return ActuatorScore(
        failures=failures,
        valves_differ={c + 1: int(servo["differs_at"][c]) for c in differs},
        bypassed_frame=None if bypassed == NEVER else bypassed,
        bypassed_frames=int(servo["bypassed"]),
    )


def _cause(servo: Any, c: int, of_unit: int) -> str:
    """Return why a channel was failed; one that the lane of a unit under test drives is not healthy."""
    kind = Cause(servo["cause"][c]).kind
    return "own fault" if kind is None else UNIT if c == of_unit else kind


def _placed(faults: list[Fault]) -> NDArray[Any]:
    """Return (A,) PLACED of the faults on servos: each of its channels, or once on what they share.

    One of a lane's output converter sits on the channel that it drives.
    """
    on = [(i, fault, channel) for i, fault in enumerate(faults) for _, channel in channels_of(fault) or [("", 0)]]
    records = np.zeros(len(on), PLACED)
    records["channel"] = records["bypassed_at"] = NEVER
    records["acted_at"] = LONG_AGO
    for n, (record, (i, fault, channel)) in enumerate(zip(records, on, strict=True)):
        record["fault"], record["number"] = n, i
        place, here = fault.signal, site(fault.signal) == "actuator"
        if fault.drives is not None:
            place, channel, here = f"actuator.{fault.drives[0]}", fault.drives[1], True
        record["valve"] = site(fault.signal) in OF_SERVOS and fault.effect.part == Part.VALVE_STUCK
        record["surfaces"] = 1 << number(place) if here else _ALL
        record["channel"] = channel - 1 if here and channel else NEVER
    return records[[site(fault.signal) in OF_SERVOS or fault.drives is not None for _, fault, _ in on]]


def _blank_servos() -> NDArray[Any]:
    servos = np.zeros(len(MOVED), SERVO)
    servos["acted_at"] = servos["shared_at"] = LONG_AGO
    for name in _FRAMES:
        servos[name] = NEVER
    return servos
