"""Messages to a unit and back: a socket to a child or a box, or calls into a library of this process."""

from __future__ import annotations

import ctypes
import os
import select
import shutil
import socket
import struct
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.core.errors import BadInput
from rig.core.files import is_file, is_folder
from rig.unit.host import LAW, STEP, Library, Refused
from rig.unit.older_versions import config_for
from rig.unit.processes import UnitProcess
from rig.unit.ready_message import UnitStopped, read_ready
from rig.unit.unit_file import Unit
from rig.unit.unit_records import (
    CONFIG,
    FROM_UNIT,
    INPUT,
    INTERFACES,
    LAW_INPUT,
    OUTPUT,
    PART,
    PART_BYTES,
    READY,
    TEXT_BYTES,
    Interface,
    Kind,
    blank,
)

LOOK_S: Final = 0.1  # how long a wait without a deadline lasts before the unit's process and Ctrl-C are looked at
MOST_BYTES: Final = max(PART.itemsize, INPUT.itemsize, READY.itemsize, OUTPUT.itemsize) + 8
clock = time.perf_counter


class Disconnected(Exception):
    """A unit that is no longer connected, and the known cause."""


class SocketLink:
    """Messages through a socket: to the host of a library, to a command that the rig has started, to a box."""

    opened = False  # a session, ever
    interface: Interface | None = None  # that the unit was built for, once it has said so
    trouble = ""  # of the last message
    unsaid: tuple[str, ...] = ()  # fields that it does not mean when it fills their group

    def __init__(self, talk: socket.socket, process: UnitProcess | None, peer: str = "") -> None:
        self._talk, self.process, self.peer = talk, process, peer
        self.fd, self.reliable = talk.fileno(), talk.type != socket.SOCK_DGRAM  # reliable: no message is lost
        # The system's own limit on a wait: cheaper than to ask before each message.
        talk.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("@ll", int(LOOK_S), int(LOOK_S % 1 * 1e6)))

    def send(self, message: memoryview) -> None:
        """Send a message.  If no process receives it, ``receive`` raises, after the unit's last messages."""
        try:
            self._talk.send(message)
        except OSError as error:
            self._note(error)

    def receive(self, into: memoryview, until_s: float) -> int:
        """Return the bytes of the next message; 0: none for LOOK_S or until ``until_s`` of ``clock``.  Disconnected."""
        left_s = until_s - clock()
        if left_s < LOOK_S and not select.select([self._talk], [], [], max(0.0, left_s))[0]:
            return 0
        try:
            count = self._talk.recv_into(into)
        except BlockingIOError:
            self._require()
            return 0
        except ConnectionResetError:  # comes before what it has still sent
            return self.receive(into, until_s)
        except OSError as error:  # no program listens there now
            self._note(error)
            self._require(LOOK_S)
            return 0
        if count == 0 and self.reliable:
            self._require(2.0)
            raise Disconnected("has closed the connection, but its process still runs")
        self.trouble = "" if count else f"empty message from {self.peer}"
        return count

    def _note(self, error: OSError) -> None:
        """Store the reason of a lost message; the system reports an unused port by ICMP, one message later."""
        unused = f"no program listens at {self.peer} (port unreachable)"
        self.trouble = unused if isinstance(error, ConnectionRefusedError) else f"{self.peer}: {error.strerror}"

    def _require(self, wait_s: float = 0.0) -> None:
        ended = None if self.process is None else self.process.how_it_ended(wait_s)
        if ended is not None:
            raise Disconnected(ended)

    def another(self) -> SocketLink:
        """Return the link of a second rig to a unit at an address."""
        talk = socket.socket(self._talk.family, socket.SOCK_DGRAM)
        talk.connect(self._talk.getpeername())
        return SocketLink(talk, None, self.peer)

    def close(self) -> str:
        """Close the socket and end the process, if the rig started it; return a fault of its end."""
        self._talk.close()
        return "" if self.process is None else self.process.stop()


def child(unit: Unit, looks: int) -> SocketLink:
    """Start a library in a child process.  BadInput: it cannot be started.  looks : as in UnitProcess"""
    return SocketLink(*hosted("library", unit, unit.file, looks))


def hosted(
    kind: str, unit: Unit, path: Path, looks: int, beside: tuple[Path, ...] = ()
) -> tuple[socket.socket, UnitProcess]:
    """Start the host of ``kind`` with the unit at ``path``; return it with a socket to it.  BadInput.

    beside : as in UnitProcess
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    sizes = {
        "config": CONFIG.itemsize,
        "part": PART_BYTES,
        "text": TEXT_BYTES,
        **{f"input_{interface.version}": interface.input_bytes for interface in INTERFACES.values()},
        "message": MOST_BYTES,
        **({"law_input": LAW_INPUT.itemsize} if unit.replaces_law else {}),
    }
    arguments = [f"{name}={size}" for name, size in sizes.items()]
    blanks = (
        (blank(OUTPUT, FROM_UNIT, Kind.REPLY, 0, interface), interface.output_bytes)
        for interface in INTERFACES.values()
    )
    templates = (record.tobytes()[:size].hex() for record, size in blanks)
    with theirs:
        fd = theirs.fileno()
        given = [str(fd), str(path), ",".join(templates), *arguments]
        process = UnitProcess(kind, given, (fd,), unit.file.parent, looks, unit=unit, beside=beside)
    return ours, process


def udp(unit: Unit, looks: int) -> SocketLink:
    """Connect to a unit by UDP: started by the rig, or at its address.  BadInput.  looks : as ``child``"""
    command = [] if unit.command is None else _command(unit)
    talk = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if unit.command is None:
        try:
            talk.connect(unit.host_and_port)
        except (OSError, TypeError, ValueError) as error:  # a host whose name cannot be encoded is one of the latter
            talk.close()
            cause = getattr(error, "strerror", None) or error
            raise BadInput(f"{unit.source}: address {unit.address}: {cause}") from None
        return SocketLink(talk, None, str(unit.address))
    talk.bind(("127.0.0.1", 0))
    own = "{}:{}".format(*talk.getsockname())
    named = [part.replace("{address}", own) for part in command]
    process = UnitProcess("exec", named, folder=unit.folder, looks=looks, unit=unit)
    link = SocketLink(talk, process, own)
    try:
        link.interface = _await_first(talk, process, unit)
    except BadInput:
        link.close()
        process.forget()
        raise
    return link


def _command(unit: Unit) -> list[str]:
    """Return the command with the path of its program.  BadInput: the program is missing or not executable."""
    program, *rest = unit.command or [""]
    where, found = unit.file, shutil.which(program)
    if is_file(where):
        if not os.access(where, os.X_OK):
            raise BadInput(f"{unit.source}: command: {program} is not executable (chmod +x)")
        return [str(where), *rest]
    if is_folder(where) or is_folder(unit.folder / program):
        raise BadInput(f"{unit.source}: command: {program} is a folder, must be a program")
    if found is None:
        place = "no such file" if "/" in program else "no such program beside the unit file or in PATH"
        raise BadInput(f"{unit.source}: command: {program}: {place}")
    return [program, *rest]


def _await_first(talk: socket.socket, process: UnitProcess, unit: Unit) -> Interface:
    """Wait for the unit's first message, from any port; connect to its sender only, and return its interface."""
    until, heard = clock() + unit.start_s, ""
    while clock() < until:
        ended = process.how_it_ended()
        if ended is not None:
            text = process.last_line()
            raise BadInput(f"{unit.source} {ended} before READY" + (f"; it printed: {text}" if text else ""))
        if not select.select([talk], [], [], LOOK_S)[0]:
            continue
        message, sender = talk.recvfrom(MOST_BYTES)
        try:
            ready = read_ready(message)
            heard = ready.wrong
        except UnitStopped as other:
            raise BadInput(f"{unit.source} {other}") from None
        if not heard:
            talk.connect(sender)
            return ready.interface
    own = "{}:{}".format(*talk.getsockname())
    cause = f"last received: {heard}" if heard else _silence(unit, process, own)
    raise BadInput(f"{unit.source} did not send READY within start_s = {unit.start_s:g} s: {cause}")


def _silence(unit: Unit, process: UnitProcess, own: str) -> str:
    """Return the known facts of a running program that sends nothing."""
    unsaid = not any("{address}" in part for part in unit.command or [])
    text = process.last_line()
    where = (
        "its command lacks {address}, the address to send to" if unsaid else f"it runs, but has sent nothing to {own}"
    )
    return where + (f"; it printed: {text}" if text else "")


class LibraryLink:
    """A library in this process, without isolation and without a separate process."""

    process, unsaid = None, ()

    def __init__(self, unit: Unit) -> None:
        """Load the library.  BadInput: no library, or not one of a unit."""
        try:
            self._function = LAW if unit.replaces_law else STEP
            self._library = Library(str(unit.file), [layout for _, layout in INTERFACES], self._function)
        except Refused as reason:
            raise BadInput(f"{unit.source}: {reason}") from None
        self.environment = Environment()
        self.interface = next(
            interface for interface in INTERFACES.values() if interface.layout == self._library.layout
        )
        self.step: Any = self._library.step

    def open(self, config: np.ndarray[Any, Any]) -> None:
        """Begin a session; Refused, UnitStopped."""
        self._config = config_for(self.interface, config)  # the library may keep its address
        self._library.open(self._config.ctypes.data)

    def failure(self, code: int) -> str:
        """Return the reason of a step that returned ``code``."""
        return f"{self._function} returned {code}"

    def close(self) -> str:
        """End the session; return no fault, because this process would not survive one."""
        self._library.close()
        return ""


class Environment:
    """Rounding and traps of this process: a library that changes them would change the rig's results."""

    _SIZE: Final = 64  # at least fenv_t

    def __init__(self) -> None:
        self._math = ctypes.CDLL(None)
        self._at_first = self._read()

    def _read(self) -> bytes:
        held = (ctypes.c_ubyte * self._SIZE)()
        self._math.fegetenv(held)
        return bytes(held)

    def restored(self) -> bool:
        """Restore the environment; return True if it had changed."""
        now = self._read()
        if self._control(now) == self._control(self._at_first):
            return False
        self._math.fesetenv((ctypes.c_ubyte * self._SIZE).from_buffer_copy(self._at_first))
        return True

    @staticmethod
    def _control(held: bytes) -> tuple[int, int]:
        """Return the control word of the old unit and MXCSR without its flags, which every division sets."""
        old, mxcsr = struct.unpack_from("<H26xI", held)
        return (old, mxcsr & ~0x3F) if os.uname().machine == "x86_64" else (struct.unpack_from("<I", held)[0], 0)
