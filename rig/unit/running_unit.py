"""A running unit under test, from flight to flight."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, overload

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput, RigError, UnitDead, UnitRefused
from rig.core.frame import UnitStatus
from rig.core.interrupt import Stop
from rig.core.kernels import bind
from rig.unit.compiled_exchange import (
    FOREVER_NS,
    CompiledExchange,
    clear,
    new_exchange,
    patience,
    to_library,
    to_socket,
    try_exchange,
)
from rig.unit.connect import connect
from rig.unit.host import Refused
from rig.unit.news import News
from rig.unit.port import ACCEPTED, NOT_FINITE, RECEIVED, STARTING, Port, new_port
from rig.unit.ready_message import UnitStopped, summed
from rig.unit.session import Counts, ReplyCheck, end_session
from rig.unit.startup import open_session
from rig.unit.transport import MOST_BYTES, Disconnected, LibraryLink, SocketLink, clock
from rig.unit.unit_file import Unit, read_unit
from rig.unit.unit_records import INTERFACE, Interface, role_of, size_of

_MOST_RESTARTS: Final = 10
_MOST_LATE: Final = 1000  # messages that are read after the last frame
_ANSWERED, _HELD, _DEAD = UnitStatus.ANSWERED.value, UnitStatus.HELD.value, UnitStatus.DEAD.value  # used in every frame
_AFTER_RESTART_S: Final = 0.2  # in which an answer still shows that it has not restarted: its READY was old
_NO_FRAME: Final = -(2**63) - 1  # beyond what a message can hold: none answers it
_FOREVER: Final = float("inf")
Deadline = Callable[[int, float], float]  # the time of ``clock`` at which a share of a frame is over


class UnitUnderTest:
    """``prepare``, ``begin`` (the first starts the unit), ``exchange`` every frame, ``end`` a flight; ``close``."""

    port: Port  # of the flight that has begun
    compiled: CompiledExchange
    replies: ReplyCheck

    def __init__(self, unit: Unit, crowded: bool = False) -> None:
        """Hold the unit of a file, which does not run yet.

        crowded : other flights use the cores, so that neither side should poll for a message
        """
        self.unit, self.role, self._patience = unit, role_of(unit.role), patience(crowded)
        self.lane: str | None = unit.lane  # of several computers
        self.said, self.printed = "", ""  # its text about itself; its standard output, known when it is closed
        self.end_wrong, self._begun = "", False  # how it ended if not as it was told to, known then, too
        self._took_ns = memoryview(bytearray(8)).cast("q")  # of the last frame
        self.dead = False
        self.voter = None if unit.beside is None else UnitUnderTest(unit.beside, crowded)  # for a control law
        self._link: SocketLink | LibraryLink | None = None  # another one after a restart
        self._message = np.zeros(MOST_BYTES, np.uint8)
        self._into = self._message.data

    @property
    def link(self) -> SocketLink | LibraryLink:
        """The unit, which is started or connected to if it is not yet.  BadInput."""
        if self._link is None:
            self._link = connect(self.unit, self._patience.looks)
        return self._link

    def prepare(self, config: NDArray[Any]) -> bool:
        """Make the port of a flight before the unit runs, to compile the frame; return False if it runs already."""
        if self._link is not None:
            return False
        self._deadline, self._config = None, config
        self._make_port(INTERFACE, ())
        return True

    def begin(self, config: NDArray[Any], deadline: Deadline | None = None, stop: Stop | None = None) -> None:
        """Bring the unit to its first frame, from any state.  BadInput, UnitRefused.

        config : (1,) CONFIG; deadline : of a paced flight, None in lockstep; stop : requests the end of the flight
        """
        self.dead, self._deadline, self._stop, self._config = False, deadline, stop or Stop(), config
        config["session"] = secrets.randbits(63) + 1
        try:
            self._make_port(self._open(), self.link.unsaid)
            self._connect()
            self._begun = True
        except (Disconnected, UnitStopped, Refused) as reason:
            raise UnitRefused(f"{self.unit.source} {self._explained(str(reason))}") from None

    def _make_port(self, interface: Interface, unsaid: tuple[str, ...]) -> None:
        """Make port and exchange of a flight; interface : the unit's version of the records; unsaid : as of a link."""
        config, unit = self._config[0], self.unit
        trim, rate_hz, fitted = config["trim_surface"], float(config["rate_hz"]), config["signal"]["fitted"]
        known = self.role, self._session, unit.latency_frames, trim, rate_hz
        self.port = new_port(*known, unit.start_s, interface, fitted, unsaid)
        self.replies = ReplyCheck(self._session, Counts(), interface)
        self.compiled = new_exchange(self.port, self._session, self._message, interface)
        self._took_ns, self.news = self.compiled.state["took_ns"].data, News(self.port.back)
        out, back = self.port
        self._sent = out.sent_bytes.data[: size_of(out.sent.dtype, interface)]
        self._received = back.bytes[RECEIVED].data[: interface.known_bytes]

    @property
    def _session(self) -> int:
        return int(self._config["session"][0])

    def _open(self) -> Interface:
        """Begin the session; return the unit's version of the records."""
        if isinstance(self.link, LibraryLink):
            self.link.open(self._config)
            return self.interface
        self.said = open_session(self.link, self._config, self.unit.start_s, lambda: self._stop.requested)
        return self.interface

    def _connect(self) -> None:
        """Connect compiled code with the unit."""
        if isinstance(self.link, LibraryLink):
            to_library(self.compiled, self.link.step)
            self._try = bind(try_exchange, self.port, self.compiled, 0)
        else:
            to_socket(self.compiled, self.link.fd, self._patience.spin_ns, sums=not self.link.reliable)

    def end(self) -> None:
        """End the session.  RigError: a library in this process has changed its floating-point rounding."""
        if self.voter is not None and self.voter._begun:
            self.voter.end()
        if not isinstance(self.link, LibraryLink):
            self._count_late(self.link)
            end_session(self.link, self._session)
            return
        self.link.close()
        if self.link.environment.restored():
            raise RigError(
                f"{self.unit.source} changed the floating-point rounding of this process: the flight is not valid"
            )

    def _count_late(self, link: SocketLink) -> None:
        """Count the answers after the last frame as late, not lost."""
        with suppress(Disconnected):
            for _ in range(_MOST_LATE if self.replies.awaits_late and not self.dead else 0):
                if not (count := link.receive(self._into, clock())):
                    return
                self.replies.is_answer(self._into[:count], _NO_FRAME)

    def close(self) -> None:
        """End the unit and all its processes; append a fault of its end to its output."""
        if self.voter is not None:
            self.voter.close()
            self.printed += self.voter.printed
        if self._link is None:
            return
        process = self._link.process
        self.end_wrong = self._link.close()
        if process is not None:
            self.printed += process.printed()
            process.forget()
        if self.end_wrong and not self.dead and self._begun:
            self.printed += f"\n(the unit {self.end_wrong} after the end of its session)\n"

    @property
    def interface(self) -> Interface:
        """The unit's version of the records, after the start of a session."""
        return (self._link and self._link.interface) or INTERFACE

    @property
    def paced(self) -> bool:
        """True if answers have a deadline."""
        return self._deadline is not None

    @property
    def reply_us(self) -> float:
        """Reply time of the last frame: from sending it, or of the library's call."""
        return self._took_ns[0] * 1e-3 + (0.0 if self.voter is None else self.voter.reply_us)

    def until_ns(self, frame: int) -> int:
        """Return the end of the wait for the answer to ``frame``, by ``clock``; not for the first frame of a flight."""
        return FOREVER_NS if self._deadline is None else int(self._deadline(frame, self.unit.deadline) * 1e9)

    def exchange(self, frame: int, row: int) -> int:
        """Pass ``port.out`` and wait for the answer, or continue after ``try_exchange``; return the status.

        UnitDead: the unit file ends the flight here; ``row`` of its block.
        """
        began, spent = clock(), self._took_ns[0] if self.compiled.state["sent"][0] else 0
        try:
            return _DEAD if self.dead else self._step(frame)
        except (Disconnected, UnitStopped) as reason:
            return self._after_stop(str(reason), frame, row)
        finally:
            self._took_ns[0] = spent + int((clock() - began) * 1e9)

    def send_foreign(self) -> None:
        """Send the last frame with another session, which no unit may step; not to a library in this process."""
        if not isinstance(self.link, LibraryLink):
            sent = self.port.out.sent.copy()
            sent["session"] ^= 1
            self.link.send(summed(sent.view("u1").data[: len(self._sent)]))

    def count_status(self, status: int) -> None:
        """Count the status of a frame; not needed if it and the one before were answered."""
        self.replies.flown(status in (UnitStatus.ANSWERED, UnitStatus.RESTARTED), status == UnitStatus.REFUSED)

    def _step(self, frame: int) -> int:
        if self.replies.run >= self.unit.max_missed:
            raise UnitStopped(
                self.news.still_starting(self.unit.start_s)
                or (f"sent no valid answer for max_missed = {self.unit.max_missed} consecutive frames")
            )
        link, (state,) = self.link, self.compiled.state
        if isinstance(link, LibraryLink):
            return self._call(link, state)
        sent, count, last = state["sent"], int(state["count"]), (int(state["frame"]), int(state["stepped"]))
        clear(self.compiled)
        self.replies.catch_up(*last)
        if not sent:
            link.send(self._sent if link.reliable else summed(self._sent))
        until, into = self._until(frame), self._into
        while True:
            count = count or link.receive(into, until)
            if count and self._has_deadline and clock() >= until:  # the machine was late, or the unit
                return self._missed(frame, into[:count])
            if count and self.replies.is_answer(into[:count], frame):
                self._received[:] = into[: len(self._received)]
                return _ANSWERED
            if self._stop.requested:
                return _HELD
            if not count and clock() >= until:
                return self._missed(frame)
            if self.replies.restarted and not self._has_deadline:
                until = min(until, clock() + _AFTER_RESTART_S) if count else until
            count = 0

    def _call(self, link: LibraryLink, state: Any) -> int:
        """Step a library of this process, unless ``try_exchange`` has; state : of the compiled exchange."""
        if not state["sent"]:
            self._try(self.port, self.compiled, 0)
        code = int(state["code"])
        clear(self.compiled)
        if code:
            raise UnitStopped(f"failed: {link.failure(code)}")
        return _ANSWERED

    @property
    def _has_deadline(self) -> bool:
        """Return True for a frame with a deadline: not the first one, and none in lockstep."""
        return self._deadline is not None and self.replies.last_frame >= 0

    def _until(self, frame: int) -> float:
        """Return the end of the wait; the first answer has no deadline, because there is no earlier one to hold."""
        if self._deadline is not None and self._has_deadline:
            return self._deadline(frame, self.unit.deadline)
        return clock() + (self.unit.timeout_s or _FOREVER)

    def _missed(self, frame: int, too_late: memoryview | None = None) -> int:
        """Count a missed deadline of ``frame``; return the status.  too_late : the message that came after it"""
        if self.replies.restarted:
            raise UnitStopped("has restarted: it sends READY without a session, and answers no frame")
        if not self._has_deadline:
            trouble = "" if isinstance(self.link, LibraryLink) or not self.link.trouble else f": {self.link.trouble}"
            raise UnitStopped(f"has not answered within timeout_s = {self.unit.timeout_s:g} s{trouble}")
        self.replies.missed(frame)
        if too_late is not None:
            self.replies.is_answer(too_late, _NO_FRAME)
        if self.unit.on_miss == "end":
            raise UnitStopped(f"missed its deadline of {self.unit.deadline:g} frame")
        return _HELD

    def _after_stop(self, reason: str, frame: int, row: int) -> int:
        """Handle a stopped unit by ``on_dead`` of its file; return the frame's status.  UnitDead."""
        action, counts, text = self.unit.on_dead, self.replies.counts, self._explained(reason)
        if action == "restart" and counts.restarts < _MOST_RESTARTS:
            try:
                return self._restart(frame)
            except (Disconnected, UnitStopped, BadInput) as failure:
                text += f"; after a restart: {failure}"
        counts.dead_frame, self.dead = frame, True
        if action in ("end", "restart"):
            raise UnitDead(f"{self.unit.source}, frame {frame}: {text}", row, frame)
        return _DEAD

    def _restart(self, frame: int) -> int:
        """Start a new process with CONFIG and the present frame; the unit has lost its latches."""
        self.close()
        self.replies.counts.restarts += 1
        self._link = connect(self.unit, self._patience.looks)
        self.replies.begin_again()
        if self._open() != self.replies.interface:
            raise UnitStopped("has another version of the records")
        self.port.back.counts[STARTING] = 0
        self._connect()
        status = self._step(frame)
        return UnitStatus.RESTARTED.value if status == UnitStatus.ANSWERED else status

    def _explained(self, reason: str) -> str:
        """Return ``reason`` with the last line that its process printed."""
        line = "" if self.link.process is None else self.link.process.last_line()
        return f"{reason}; it printed: {line}" if line else reason

    def metadata(self) -> dict[str, str]:
        """Return the metadata of the unit for the log of a flight."""
        return {"unit": json.dumps({**self.unit.about(), "said": self.said})}

    def fly_as(self, metadata: Mapping[str, Any]) -> None:
        """Take the lane of a log's unit, which an option may have chosen; metadata : of the log, on the unit."""
        self.lane = metadata.get("lane")

    def result(self) -> dict[str, Any]:
        """Return the counts and times of the exchanges of a flight."""
        counts = self.replies.counts
        counts.answered, counts.not_finite = map(int, self.port.back.counts[[ACCEPTED, NOT_FINITE]])
        of_itself = self.news.result()
        found = {"said": self.said, **asdict(counts), **of_itself, "reproducible": counts.reproducible}
        if self.voter is not None:
            found["voter"] = {"name": self.voter.unit.name, **self.voter.result()}
            found["reproducible"] &= found["voter"]["reproducible"]
        return found


@overload
def running(unit: Unit | Path | str) -> AbstractContextManager[UnitUnderTest]: ...
@overload
def running(unit: None) -> AbstractContextManager[None]: ...
@overload
def running(unit: Unit | Path | str | None) -> AbstractContextManager[UnitUnderTest | None]: ...
@contextmanager
def running(unit: Unit | Path | str | None) -> Iterator[UnitUnderTest | None]:
    """Hold the unit of a file, which starts with its first session; end it with the context.  BadInput."""
    settings = read_unit(unit) if isinstance(unit, str | Path) else unit
    tested = None if settings is None else UnitUnderTest(settings)
    try:
        yield tested
    finally:
        if tested is not None:
            tested.close()
