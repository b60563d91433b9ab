"""The outcome of a flight's computers: tests that detected faults of lanes, links and buses; healthy lanes lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from rig.core.frame import COMPUTERS
from rig.flight.lane_events import ComputerFinder, LaneFailure, test_name
from rig.scenario.scenario import Scenario
from rig.verdict.score_records import ComputersScore, FaultScore, Isolation, LaneFailed, LaneHistory
from rig.verdict.words import IsolationKind, fault_word
from rig.world.faults import Fault
from rig.world.faults.places import OF_LANES, lanes_of, senders, site

LINK: Final = "link"  # the receivers have had no message for long
UNIT: Final = "unit under test"  # why a lane, or what it drives, was failed: its software is that
RELAYS: Final = "relays"  # other lanes told another word than came directly


def on_lanes(fault: FaultScore) -> bool:
    """Return True if a fault sits on a computer, a link or a bus, and on no channel."""
    return fault.channel is None and site(fault.signal) in OF_LANES


def columns_of(fault: Fault) -> int:
    """Return the channels, bits, that a fault of a computer or of a link takes away from all signals for the others."""
    return sum(1 << lane for lane in senders(fault.signal)) if fault.takes_channels else 0


class LaneOutcome:
    """Outcomes of the faults of computers, links and buses, by the events of their rows: ``finder``.

    unit_lane : the lane whose software is a unit under test, A to D: it does not count as healthy when it is voted out
    """

    def __init__(self, scenario: Scenario, unit_lane: str | None = None) -> None:
        self.finder, self._unit_lane, self._of = ComputerFinder(scenario.rate_hz), unit_lane, scenario.faults

    def score(self, faults: list[FaultScore]) -> ComputersScore | None:
        """Return the outcome of computers and links; None: their rows were not seen.

        faults : of the score, whose onsets are known
        """
        finder, links = self.finder, dict[str, int]()
        if not finder.seen:
            return None
        for link in finder.links:
            links.setdefault(f"{COMPUTERS[link.sender]}-{COMPUTERS[link.receiver]}", link.frame)
        failures = [self._failed(failure, faults) for failure in finder.failures]
        return ComputersScore(failures, links, *(finder.backup or (None, "")))

    @property
    def history(self) -> LaneHistory:
        """Return the lanes that took over the lead, and those that were readmitted."""
        leads, back = self.finder.leading, self.finder.readmitted
        return LaneHistory(
            tuple((frame, COMPUTERS[lane]) for frame, lane in leads),
            tuple((frame, COMPUTERS[lane]) for frame, lane in back),
        )

    def _failed(self, failure: LaneFailure, faults: list[FaultScore]) -> LaneFailed:
        """Return a lane that was failed, with the lanes on which a fault had begun by then."""
        on = [(fault.onset_frame, self._of[fault.index].signal) for fault in faults]
        begun = [place for onset, place in on if onset is not None and onset <= failure.frame]
        faulty = {i for place in begun if site(place) in OF_LANES for i in senders(place)}
        name = COMPUTERS[failure.lane]
        cause = "wrong isolation" if faulty else "false alarm"
        if failure.lane in faulty:
            cause = "own fault"
        elif name == self._unit_lane:
            cause = UNIT
        return LaneFailed(
            name,
            failure.frame,
            test_name(failure.test),
            tuple(COMPUTERS[i] for i in failure.accusers),
            cause,
            tuple(COMPUTERS[i] for i in sorted(faulty)),
        )

    def completed(self, fault: FaultScore) -> FaultScore:
        """Return the outcome of a fault: as it is, unless it sits on a computer or a link and its rows were seen."""
        onset = fault.onset_frame
        if not on_lanes(fault) or onset is None or not self.finder.seen:
            return fault
        of_servo = [(fault.failed_frame, fault.decided_by or "")] if fault.failed_frame is not None else []
        detection = min([*self._found(fault.signal, onset), *of_servo], default=None)
        if detection is None:
            return replace(fault, outcome="missed", word=fault_word(True, False, True), peak_error=None)
        return replace(
            fault,
            outcome="detected",
            word=fault_word(True, True, True),
            failed_frame=detection[0],
            delay_from_onset_frames=detection[0] - onset,
            decided_by=detection[1],
            peak_error=None,
        )

    def _found(self, place: str, onset: int) -> Iterator[tuple[int, str]]:
        """Yield (frame, by whom) of all tests that detected a fault of a place from ``onset`` on."""
        suspects = senders(place)
        receivers = lanes_of(place)[1:] or [*range(len(COMPUTERS))]
        for failure in self.finder.failures:
            if failure.lane in suspects and failure.frame >= onset:
                yield failure.frame, test_name(failure.test)
        if site(place) != "ccdl":
            return
        for link in self.finder.links:
            if link.sender in suspects and link.receiver in receivers and link.frame >= onset:
                yield link.frame, LINK
        for (receiver, sender), frames in self.finder.outvoted.items():
            if sender in suspects and receiver in receivers:
                yield from ((frame, RELAYS) for frame in frames if frame >= onset)

    def isolations(self, kind: IsolationKind, faults: list[FaultScore]) -> list[Isolation]:
        """Return the lanes that were voted out without a fault on them, of one kind; each owns its channel.

        faults : of the score, whose onsets are known
        """
        scored = self.score(faults)
        return [
            Isolation(
                f"computer.{each.lane}",
                COMPUTERS.index(each.lane) + 1,
                each.frame,
                each.test,
                tuple(COMPUTERS.index(lane) + 1 for lane in each.faulty),
            )
            for each in (() if scored is None else scored.failures)
            if each.cause == kind
        ]
