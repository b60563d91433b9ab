"""The unit under test: one that runs, from flight to flight."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, overload

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput, RigError, UnitDead, UnitRefused
from rig.frame import Unit as Answer
from rig.kernels import bind
from rig.unit import fmu, links
from rig.unit.compiled_exchange import FOREVER_NS, Way, ask, clear, new_way, patience, to_library, to_socket
from rig.unit.host import Refused
from rig.unit.layout import Form
from rig.unit.links import MOST_BYTES, Called, Gone, Link, clock
from rig.unit.port import RECEIVED, Port, new_port
from rig.unit.reply_check import Counts, Watch
from rig.unit.session import Dead, end_session, open_session
from rig.unit.settings import Unit, read_unit
from rig.util.interrupt import Stop

_MOST_RESTARTS: Final = 10
_ANSWERED, _DEAD = Answer.ANSWERED.value, Answer.DEAD.value  # looked up in every frame
_FORMS: Final = {"redundancy": Form.REDUNDANCY, "flight-computer": Form.FLIGHT_COMPUTER}
_NO_FRAME: Final = -(2**63) - 1  # beyond what a message can hold: none answers it
_FOREVER: Final = float("inf")
Deadline = Callable[[int, float], float]  # the time of ``clock`` at which a share of a frame is over


class UnitUnderTest:
    """``begin`` a flight, ``exchange`` every frame of it, ``end`` it; ``close`` at last."""

    port: Port  # of the flight that has begun
    way: Way  # compiled code's, to the unit
    watch: Watch

    def __init__(self, unit: Unit, crowded: bool = False) -> None:
        """Start the unit, or find it.  BadInput: one line says what is wrong with it.

        crowded : other flights want the cores, on which nobody should then wait for a message
        """
        self.unit, self.form, self._patience = unit, _FORMS[unit.form], patience(crowded)
        self.said, self.printed = "", ""  # of itself; on its standard output, known when it is closed
        self._took_ns = memoryview(bytearray(8)).cast("q")  # of the last frame
        self.dead = False
        self._link: Link | Called = _reach(unit, self._patience.looks)
        self._message = np.zeros(MOST_BYTES, np.uint8)
        self._into = self._message.data

    def begin(self, config: NDArray[Any], deadline: Deadline | None = None, stop: Stop | None = None) -> None:
        """Bring it to its first frame, whatever it did before.  UnitRefused: it will not.

        config : (1,) CONFIG; deadline : of a paced flight, None in lockstep; stop : asks for the end of the flight
        """
        self.dead, self._deadline, self._stop, self._config = False, deadline, stop or Stop(), config
        config["session"] = secrets.randbits(63) + 1
        trim, rate_hz = config["trim_surface"][0], float(config["rate_hz"][0])
        self.port = new_port(self.form, self._session, self.unit.latency_frames, trim, rate_hz)
        self.watch = Watch(self._session, Counts())
        self.way = new_way(self.port, self._session, self._message)
        self._took_ns = self.way.at["took_ns"].data
        out, back = self.port
        self._sent, self._received = out.sent_bytes.data, back.bytes[RECEIVED].data
        try:
            self._open()
        except (Gone, Dead, Refused) as reason:
            raise UnitRefused(f"{self.unit.source} {self._explained(str(reason))}") from None

    @property
    def _session(self) -> int:
        return int(self._config["session"][0])

    def _open(self) -> None:
        if isinstance(self._link, Called):
            self._link.open(self._config)
            to_library(self.way, self._link.step)
            self._ask = bind(ask, self.port, self.way, 0)
            return
        to_socket(self.way, self._link.fd, self._patience.spin_ns)
        self.said = open_session(self._link, self._config, self.unit.start_s, lambda: self._stop.requested)

    def end(self) -> None:
        """The flight is over.  RigError: a library in this process has changed how it calculates."""
        if not isinstance(self._link, Called):
            end_session(self._link, self._session)
            return
        self._link.close()
        if self._link.environment.moved():
            raise RigError(f"{self.unit.source} changed the rounding of this process: its flight does not count")

    def close(self) -> None:
        """End the unit; no process of it is left behind."""
        process = self._link.process
        self._link.close()
        if process is not None:
            self.printed += process.printed()
            process.forget()

    @property
    def paced(self) -> bool:
        """Whether answers have a deadline."""
        return self._deadline is not None

    @property
    def reply_us(self) -> float:
        """How long the last frame's answer took: from its sending, or of the call of the library alone."""
        return self._took_ns[0] * 1e-3

    def until_ns(self, frame: int) -> int:
        """When the wait for the answer to ``frame`` is over, of ``clock``; not for the first of a flight."""
        return FOREVER_NS if self._deadline is None else int(self._deadline(frame, self.unit.deadline) * 1e9)

    def exchange(self, frame: int, row: int) -> int:
        """Hand ``port.out`` over and wait for the answer, or go on where ``way.ask`` left it; the frame's Unit so far.

        UnitDead when the unit file says that the flight ends with this; ``row`` of its block.
        """
        began, spent = clock(), self._took_ns[0] if self.way.at["sent"][0] else 0
        try:
            return _DEAD if self.dead else self._step(frame)
        except (Gone, Dead) as reason:
            return self._died(str(reason), frame, row)
        finally:
            self._took_ns[0] = spent + int((clock() - began) * 1e9)

    def send_foreign(self) -> None:
        """Send the last frame as one of another session, which no unit may step; of a library here, nothing."""
        if not isinstance(self._link, Called):
            sent = self.port.out.sent.copy()
            sent["session"] ^= 1
            self._link.send(sent.view("u1").data)

    def taken(self, status: int) -> None:
        """What the frame came to when its answer had been looked into, unless it and the one before were answered."""
        self.watch.flown(status in (Answer.ANSWERED, Answer.RESTARTED), status == Answer.REFUSED)

    def _step(self, frame: int) -> int:
        if self.watch.run >= self.unit.max_missed:
            raise Dead(f"gave no answer that can be flown for max_missed = {self.unit.max_missed} frames in a row")
        link, (at,) = self._link, self.way.at
        if isinstance(link, Called):
            return self._call(at)
        sent, count, last = at["sent"], int(at["count"]), (int(at["frame"]), int(at["stepped"]))
        clear(self.way)
        self.watch.catch_up(*last)
        if not sent:
            link.send(self._sent)
        until, into = self._until(frame), self._into
        while True:
            count = count or link.receive(into, until)
            if count and self._has_deadline and clock() >= until:  # the machine was late, or the unit: none can tell
                return self._missed(frame, into[:count])
            if count and self.watch.is_answer(into[:count], frame):
                self._received[:] = into[:count]
                return _ANSWERED
            if self._stop.requested:
                return Answer.HELD.value
            if not count and clock() >= until:
                return self._missed(frame)
            count = 0

    def _call(self, at: Any) -> int:
        """Step a library of this process, unless ``way.ask`` has; ``at`` : record of WAY."""
        if not at["sent"]:
            self._ask(self.port, self.way, 0)
        code = int(at["code"])
        clear(self.way)
        if code:
            raise Dead(f"failed: rig_unit_step returned {code}")
        return _ANSWERED

    @property
    def _has_deadline(self) -> bool:
        """Not the first frame of a flight, nor any in lockstep."""
        return self._deadline is not None and self.watch.last_frame >= 0

    def _until(self, frame: int) -> float:
        """When the wait is over.  The first answer has as long as in lockstep: there is none before it to be held."""
        if self._deadline is not None and self._has_deadline:
            return self._deadline(frame, self.unit.deadline)
        return clock() + (self.unit.timeout_s or _FOREVER)

    def _missed(self, frame: int, too_late: memoryview | None = None) -> int:
        """No answer by the deadline of ``frame``; ``too_late``: the message that came after it."""
        if not self._has_deadline:
            raise Dead(f"has not answered within timeout_s = {self.unit.timeout_s:g} s")
        self.watch.missed(frame)
        if too_late is not None:
            self.watch.is_answer(too_late, _NO_FRAME)
        if self.unit.on_miss == "end":
            raise Dead(f"missed its deadline, {self.unit.deadline:g} of the frame")
        return Answer.HELD.value

    def _died(self, reason: str, frame: int, row: int) -> int:
        """What the unit file says of a dead unit."""
        then, counts = self.unit.on_dead, self.watch.counts
        said = self._explained(reason)
        if then == "restart" and counts.restarts < _MOST_RESTARTS:
            try:
                return self._restart(frame)
            except (Gone, Dead, BadInput) as again:
                said += f"; started again it {again}"
        counts.dead_frame, self.dead = frame, True
        if then in ("end", "restart"):
            raise UnitDead(f"{self.unit.source}, frame {frame}: {said}", row, frame)
        return Answer.DEAD.value

    def _restart(self, frame: int) -> int:
        """A new process, CONFIG, and the present frame once more: the unit has lost its latches."""
        self.close()
        self.watch.counts.restarts += 1
        self._link = _reach(self.unit, self._patience.looks)
        self.watch.begin_again()
        self._open()
        status = self._step(frame)
        return Answer.RESTARTED.value if status == Answer.ANSWERED else status

    def _explained(self, reason: str) -> str:
        """``reason``, with the last line that its process printed."""
        said = "" if self._link.process is None else self._link.process.last_line()
        return f"{reason}; it printed: {said}" if said else reason

    def metadata(self) -> dict[str, str]:
        """Return what the log of a flight has of its unit."""
        return {"unit": json.dumps({**self.unit.about(), "said": self.said})}

    def result(self) -> dict[str, Any]:
        """Return what became of the exchanges of a flight."""
        counts = self.watch.counts
        counts.answered, counts.not_finite = map(int, self.port.back.counts)
        return {"said": self.said, **asdict(counts), "reproducible": counts.reproducible}


@overload
def running(unit: Unit | Path | str) -> AbstractContextManager[UnitUnderTest]: ...
@overload
def running(unit: None) -> AbstractContextManager[None]: ...
@overload
def running(unit: Unit | Path | str | None) -> AbstractContextManager[UnitUnderTest | None]: ...
@contextmanager
def running(unit: Unit | Path | str | None) -> Iterator[UnitUnderTest | None]:
    """The unit of a file, started or found; ended with the context.  BadInput."""
    found = read_unit(unit) if isinstance(unit, str | Path) else unit
    tested = None if found is None else UnitUnderTest(found)
    try:
        yield tested
    finally:
        if tested is not None:
            tested.close()


def _reach(unit: Unit, looks: int) -> Link | Called:
    if unit.carrier == "library":
        return links.child(unit, looks) if unit.isolate else Called(unit)
    if unit.carrier == "udp":
        return links.udp(unit, looks)
    if unit.carrier == "fmu":
        return fmu.child(unit, looks)
    raise BadInput(f"{unit.source}: carrier {unit.carrier} cannot be flown here")
