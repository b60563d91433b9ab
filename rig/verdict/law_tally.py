"""What the fault-tolerant law found: when it began to correct the pitch angle or called a rate biased, and for what."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import INDEX, SIGNALS, SensorFault, Table, Trust
from rig.core.units.angles import differences
from rig.verdict.score_records import FaultScore, LawFinding
from rig.verdict.words import fault_word

LAW: Final = "law"  # who found a fault: the fault-tolerant law
CORRECTED: Final = "pitch angle corrected"
BIASED: Final = "rate biased"
NAMES: Final = {
    SensorFault.EFFECTIVENESS: "effectiveness",
    SensorFault.OFFSET: "offset",
    SensorFault.BOTH: "effectiveness and offset",
}
_TESTED: Final = {CORRECTED: ("pitch_angle",), BIASED: ("pitch_rate", "yaw_rate", "roll_angle", "heading")}
_INNOVATION: Final = 5  # of frame.ESTIMATES
_SHARE: Final = 0.5  # of an innovation that faults must have caused, and of the largest effect on a rate
_NOTHING: Final = 1e-9


class LawOutcome:
    """The findings of the law, added up block by block; params : (S,) config.PARAMS."""

    def __init__(self, params: NDArray[np.void]) -> None:
        self._params = params
        self._trust, self._lie = int(Trust.NONE), int(SensorFault.NONE)  # in the row before
        self.findings: list[LawFinding] = []

    def add(self, table: Table) -> None:
        """Add the next frames, with their clean channels."""
        if not len(table):
            return
        rows, clean = table.rows, table.clean
        trust, lie = ([before, *rows[name].tolist()] for before, name in ((self._trust, "trust"), (self._lie, "lie")))
        news = np.flatnonzero((np.diff(trust) != 0) | (np.diff(lie) != 0)).tolist()
        for k in news:
            if trust[k + 1] != trust[k] and trust[k + 1] == Trust.CORRECTED:
                self.findings.append(self._found(CORRECTED, rows[k], clean[k]))
            if lie[k + 1] != lie[k] and lie[k + 1] == SensorFault.RATE_BIAS:
                self.findings.append(self._found(BIASED, rows[k], clean[k]))
            elif lie[k + 1] in NAMES:
                self._name(NAMES[SensorFault(lie[k + 1])], int(rows[k]["frame"]))
        self._trust, self._lie = trust[-1], lie[-1]

    def _name(self, named: str, frame: int) -> None:
        """Note what the law first named the fault that it corrects."""
        last = self.findings[-1] if self.findings else None
        if last is not None and last.finding == CORRECTED and last.named_frame is None:
            self.findings[-1] = replace(last, named=named, named_frame=frame)

    def _found(self, finding: str, row: Any, clean: Any) -> LawFinding:
        """Return a finding with the signals whose votes faults had moved enough to be its cause."""
        moved = {name: self._moved(INDEX[name], row, clean) for name in _TESTED[finding]}
        least = _SHARE * max(moved.values()) if finding == BIASED else _SHARE * abs(float(row["estimate"][_INNOVATION]))
        for_signals = tuple(name for name, size in moved.items() if size > _NOTHING and size >= least)
        return LawFinding(finding, int(row["frame"]), for_signals)

    def _moved(self, s: int, row: Any, clean: Any) -> float:
        """Return how far faults have moved a vote from that of the clean channels, in thresholds; of pitch in rad."""
        fitted, wraps, truth = int(self._params["fitted"][s]), SIGNALS[s].wraps, row["truth"][s]
        channels = clean["channels"][s][:fitted]
        of_clean = float(np.median(differences(channels, np.full(fitted, truth), wraps)))
        off = abs(float(differences(row["voted"][s], truth, wraps)) - of_clean)
        return off if s == INDEX["pitch_angle"] else off / float(self._params["threshold"][s])

    def completed(self, fault: FaultScore, acted_until: int) -> FaultScore:
        """Return what became of a fault on a channel: found, if the law found it; as it is otherwise.

        acted_until : the last frame in which it can be the cause of a finding
        """
        onset = fault.onset_frame
        if fault.channel is None or onset is None or fault.outcome == "not executed":
            return fault
        frames = [each.frame for each in self.findings if fault.signal in each.signals]
        found = next((frame for frame in frames if onset <= frame <= acted_until), None)
        if found is None or fault.failed_frame is not None:
            return replace(fault, law_frame=found)
        exceeded = fault.exceeded_frame
        return replace(
            fault,
            outcome="detected",
            word=fault_word(True, True, True, fault.word == "wrong channel"),
            law_frame=found,
            delay_from_onset_frames=found - onset,
            delay_from_exceeded_frames=None if exceeded is None else found - exceeded,
            resolver=LAW,
            tolerated=False,
        )
