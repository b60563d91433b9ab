"""Requirements over the blocks of a flight or recording: columns that reach as far as the longest window are kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.requirements.bound import formulas_of
from rig.assess.requirements.columns import Columns, TwinColumns
from rig.assess.requirements.formula import body
from rig.assess.requirements.instants import Instants, Least, Measured
from rig.assess.requirements.margins import decisive, frames_reach, values, values_at
from rig.assess.requirements.requirement import Requirement
from rig.assess.requirements.subject import Subject
from rig.errors import BadInput
from rig.frame import Block, End

Status = Literal["met", "violated", "not applicable"]
_ROOM: Final = 1024  # frames
BATCH: Final = 1000  # rows; a block of a second costs as many calls as ten


class Verdict(NamedTuple):
    """What became of a requirement on one signal; ``signal`` is empty where the formula is of none."""

    requirement: str
    signal: str
    status: Status
    margin: float  # NaN where it is not applicable
    instant_s: float  # whose numbers give the margin
    values: dict[str, tuple[float, str]]  # quantities of the formula at that instant, with their SI units


def not_applicable(requirement: str, signal: str = "") -> Verdict:
    """Return the verdict where nothing was there to decide on."""
    return Verdict(requirement, signal, "not applicable", np.nan, np.nan, {})


class RequirementsRecorder:
    """Measures requirements on rows that are given block after block: a recorder of ``rig.loop.fly``."""

    def __init__(
        self,
        requirements: Sequence[Requirement],
        subject: Subject,
        twin: Iterator[Block] | None = None,
        lines: bool = False,
    ) -> None:
        """BadInput: a requirement asks for what the subject does not have.

        twin : the rows of the same flight without faults; required where a formula names ``twin.``
        lines : keep the margin of each frame too, 8 bytes for each formula
        """
        self._lines = lines
        self.subject, self.requirements = subject, tuple(requirements)
        over, self.quantities, own = formulas_of(requirements, subject)
        leasts = {each.key: Least() for each in over}
        self.measured = [Measured(each, least=leasts[each.key]) for each in over]
        of_twin = self.quantities[own:]
        if of_twin and twin is None:
            raise BadInput(f"{of_twin[0].name}: {subject.called} has no twin here")
        self._own, self._columns = own, Columns(self.quantities[:own], subject)
        self._twin = None if twin is None or not of_twin else TwinColumns(twin, Columns(of_twin, subject))
        self._memory, self._start = np.empty((len(self.quantities), _ROOM)), 0
        self._batch: Block | None = None  # rows that are put together; how many
        self._batched = 0
        self._first = self._end = 0  # frames that are held
        self._back = max((formula.over.back for formula in self.measured), default=0)
        self._lost = False
        self._instants = Instants(self.measured, subject)

    @property
    def needs_twin(self) -> bool:
        """Return whether a formula names ``twin.``"""
        return any(q.parts.twin for q in self.quantities)

    def record(self, rows: Block, timing: Any = None, lanes: Any = None) -> None:
        """Take the next rows (n,), of a flight or of a bench; short blocks are put together to BATCH of them."""
        if not len(rows) or not self.measured:
            return
        if self._batch is None and len(rows) < BATCH:
            self._batch = np.empty(BATCH, rows.dtype)
        if self._batch is None or len(rows) >= BATCH:
            self._flush()
            self.take(rows)
            return
        if self._batched + len(rows) > BATCH:
            self._flush()
        part = self._batch[self._batched : self._batched + len(rows)]
        part.view(np.uint8)[:] = np.ascontiguousarray(rows).view(np.uint8)  # the bytes: not field by field
        self._batched += len(rows)

    def _flush(self) -> None:
        """Take the rows that were put together."""
        if self._batch is not None and self._batched:
            batched, self._batched = self._batched, 0
            self.take(self._batch[:batched])

    def take(self, rows: Block) -> None:
        """Measure the next rows (n,) at once: none may wait in a batch."""
        n = len(rows)
        if not n or not self.measured:
            return
        out = self._room(n)
        self._columns.fill(rows, out[: self._own])
        if self._twin is not None:
            self._twin.fill(n, out[self._own :])
        self._instants.find(rows, self._end)
        self._end += n
        self._lost = bool(rows["end"][-1] != End.FLYING)
        needed = self._end - self._back
        for formula in self.measured:
            back, ahead = formula.over.back, formula.over.ahead
            if formula.pending and formula.pending[0] + ahead < self._end:
                self._measure(formula, [k for k in formula.pending if k + ahead < self._end], (None, False))
            if self._lines:
                self._draw(formula, None, False)
                needed = min(needed, formula.drawn - back)
            if formula.pending:
                needed = min(needed, formula.pending[0] - back)
        self._start, self._first = self._start + max(needed - self._first, 0), max(self._first, needed)

    def finish(self) -> tuple[Verdict, ...]:
        """Return the verdicts: the flight is over, whatever windows reach beyond its end."""
        self._flush()
        for formula in self.measured:
            self._measure(formula, list(formula.pending), (self._end, self._lost))
            self._draw(formula, self._end, self._lost)
        verdicts = {each.id: list[Verdict]() for each in self.requirements}
        for (id_, _), formula in {formula.over.key: formula for formula in self.measured}.items():
            verdicts[id_].append(self._verdict(formula))
        return tuple(verdict for id_, all_of in verdicts.items() for verdict in all_of or [not_applicable(id_)])

    def _room(self, n: int) -> NDArray[np.float64]:
        """Return memory for the next ``n`` frames behind those that are held."""
        held = self._end - self._first
        if self._start + held + n > self._memory.shape[1]:
            kept = self._memory[:, self._start : self._start + held]
            if 2 * (held + n) > self._memory.shape[1]:
                self._memory = np.empty((len(self._memory), 2 * (held + n)))
            self._memory[:, :held] = kept.copy()
            self._start = 0
        begin = self._start + held
        return self._memory[:, begin : begin + n]

    def _measure(self, formula: Measured, instants: list[int], end: tuple[int | None, bool]) -> None:
        """Measure a formula at ``instants``, in order; end : frames flown, None while they go on, and whether lost."""
        if not instants:
            return
        formula.pending = (
            [k for k in formula.pending if k not in instants] if len(instants) < len(formula.pending) else []
        )
        columns = self._memory[:, self._start : self._start + self._end - self._first]
        held = formula.held(columns, self._first, self.subject.rate_hz, end)
        with np.errstate(all="ignore"):
            of, over, least_at = formula.least, formula.over, None
            measured = values_at(over.root, instants, len(over.names), held)
            for channel, (verdicts, margins) in enumerate(measured.transpose(1, 0, 2).tolist()):
                for k, verdict, margin in zip(instants, verdicts, margins, strict=True):
                    if (margin, verdict) < of.least:  # not where it is NaN
                        of.least, least_at = (margin, verdict), (channel, k)
            if least_at is None:
                return
            channel, k = least_at
            of.names, of.places = over.names[channel], over.places[channel]
            of.instant = decisive(over.root, k, held.on(channel))
        of.numbers = columns[of.places, of.instant - self._first].tolist()

    def _draw(self, formula: Measured, frames: int | None, lost: bool) -> None:
        """Add the margins of the frames that can be told: of what the formula says of each frame."""
        if not self._lines:
            return
        node = body(formula.over.root)
        end = self._end if frames is not None else self._end - frames_reach(node, self.subject.rate_hz)[1]
        if end > formula.drawn:
            columns = self._memory[:, self._start : self._start + self._end - self._first]
            held = formula.held(columns, self._first, self.subject.rate_hz, (frames, lost))
            with np.errstate(all="ignore"):
                formula.line.append(np.fmin.reduce(values(node, formula.drawn, end - 1, held)[1]))
            formula.drawn = end

    def lines(self) -> dict[tuple[str, str], NDArray[np.float64]]:
        """Return the margins (n,) of each frame by requirement and signal, once finished; of channels the least.

        They are of what a formula says of each frame, without the windows around it; NaN where nothing was flown.
        """
        lines: dict[tuple[str, str], NDArray[np.float64]] = {}
        for formula in self.measured:
            key, line = formula.over.key, np.concatenate([np.empty(0), *formula.line])
            lines[key] = np.fmin(lines[key], line) if key in lines else line
        return lines

    def _verdict(self, formula: Measured) -> Verdict:
        """Return what became of a formula."""
        (id_, signal), least = formula.over.key, formula.least
        margin, verdict = least.least
        if least.instant < 0:
            return not_applicable(id_, signal)
        numbers = {
            name: (value, self.quantities[place].unit)
            for name, place, value in zip(least.names, least.places, least.numbers, strict=True)
        }
        status: Status = "met" if verdict > 0.0 else "violated"
        at_s = least.instant / self.subject.rate_hz
        return Verdict(id_, signal, status, margin + 0.0, at_s, numbers)  # 0.0, never -0.0
