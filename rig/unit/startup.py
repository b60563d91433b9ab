"""Start of a session: HELLO until READY of session 0, CONFIG until READY of the session.

The rig repeats messages that may be lost, and both sides accept a repetition: HELLO goes with every repetition of
CONFIG, because a unit may have restarted.  Each cause of a failed start has its line, with the last received message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from numpy.typing import NDArray

from rig.unit.older_versions import config_for
from rig.unit.ready_message import Ready, UnitStopped, read_ready, sealed
from rig.unit.transport import MOST_BYTES, Disconnected, SocketLink, clock
from rig.unit.unit_records import HELLO, INTERFACES, PART, PART_BYTES, TO_UNIT, Interface, Kind, blank

_AGAIN_S: Final = 0.2  # after which an unanswered HELLO or CONFIG is repeated: a box may have lost it
_BUSY: Final = "busy"  # how REFUSED begins while another session is open: it ends with END, or after a silence


def open_session(link: SocketLink, config: NDArray[Any], start_s: float, stopped: Callable[[], bool]) -> str:
    """Send HELLO and CONFIG, each until it is answered; return the unit's text.  UnitStopped.

    config : (1,) CONFIG with its session; start_s : limit for each of them.  link.interface is then the unit's
    """
    session = int(config["session"][0])
    hellos = {
        interface: sealed(blank(HELLO, TO_UNIT, Kind.HELLO, session, interface)) for interface in INTERFACES.values()
    }
    asked = (
        hellos if link.interface is None else {link.interface: hellos[link.interface]}
    )  # who has said nothing may be an old one
    start = _Start(link, session, start_s, stopped)
    here = start.send_until_ready([[hello] for hello in asked.values()], (0, session), "during loading")
    link.interface = here.interface
    parts = _parts(config, session, here.interface)
    again = [hellos[here.interface], *parts] if here.session == 0 else parts  # once READY of the session was for both
    ready = start.send_until_ready([parts, again], (session,), "at the start of the session")
    link.opened = True
    return ready.text


class _Start:
    """The messages of one start, and the last received message that was no answer to them."""

    def __init__(self, link: SocketLink, session: int, start_s: float, stopped: Callable[[], bool]) -> None:
        self._link, self._session, self._start_s, self._stopped = link, session, start_s, stopped
        self._into = memoryview(bytearray(MOST_BYTES))
        self._heard, self._greeted, self._sent, self._may_refuse = "", False, 0, True

    def send_until_ready(self, messages: list[list[memoryview]], sessions: tuple[int, ...], when: str) -> Ready:
        """Send ``messages`` in turn until READY of one of ``sessions``.  UnitStopped.

        A reliable link gets them once, because a library may take long.  when : phase of its end, if it has ended
        """
        until = clock() + self._start_s
        self._sent = 0
        try:
            while clock() < until and not self._stopped():
                for message in messages[self._sent % len(messages)]:
                    self._link.send(message)
                self._sent += 1
                # Before that it may have been built for another version than was asked.
                self._may_refuse = self._greeted or self._link.reliable or self._sent >= len(messages)
                ready = self._await_ready(until if self._link.reliable else min(until, clock() + _AGAIN_S), sessions)
                if ready is not None:
                    self._greeted = True
                    return ready
        except Disconnected as ended:
            when = "after the previous flight" if self._link.opened else when if self._link.reliable else "before READY"
            raise UnitStopped(f"{ended} {when}") from None
        raise UnitStopped(f"did not send READY within start_s = {self._start_s:g} s: {self._cause()}")

    def _await_ready(self, until: float, sessions: tuple[int, ...]) -> Ready | None:
        while clock() < until and not self._stopped():
            count = self._link.receive(self._into, until)
            if not count:
                continue
            ready = read_ready(self._into[:count])
            if ready.kind == Kind.READY and ready.session in sessions:
                return ready
            self._note(ready)
        return None

    def _note(self, ready: Ready) -> None:
        """Store the cause that the message gives.  UnitStopped: the unit refuses."""
        if ready.wrong:
            self._heard = f"last received: {ready.wrong}"
        elif ready.kind == Kind.REFUSED and ready.session in (0, self._session):
            if not ready.text.startswith(_BUSY) and self._may_refuse:
                raise UnitStopped(f"refuses the flight: {ready.text}")
            self._heard = f"it refuses: {ready.text!r}" if not ready.text.startswith(_BUSY) else f"it is {ready.text}"
        elif ready.session not in (0, self._session):
            name = Kind(ready.kind).name
            self._heard = f"last received: {name} of session {ready.session}, this flight has {self._session}"

    def _cause(self) -> str:
        """Return the known cause of the missing READY."""
        reliable = self._link.reliable
        if self._heard or self._link.trouble:
            return self._heard or self._link.trouble
        if self._greeted and reliable:
            return "it is loaded, but has not started the session"
        if self._greeted:
            return f"it has answered HELLO, but not CONFIG, sent {self._sent} times"
        return "it is still being loaded" if reliable else f"no message from {self._link.peer}"


def _parts(config: NDArray[Any], session: int, interface: Interface) -> list[memoryview]:
    """Return CONFIG in messages that fit into an Ethernet frame."""
    whole = config_for(interface, config)
    count = -(-len(whole) // PART_BYTES)
    messages = []
    for i in range(count):
        part = blank(PART, TO_UNIT, Kind.CONFIG, session, interface)
        data = whole[i * PART_BYTES : (i + 1) * PART_BYTES]
        part["part"], part["parts"] = i, count
        part["bytes"][0, : len(data)] = data
        messages.append(sealed(part))
    return messages
