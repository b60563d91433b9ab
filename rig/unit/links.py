"""How messages get to a unit and back: a socket to a child or a box, or calls into a library of this process.

Nothing here knows what a message means but its first bytes; reply_check.py tells what arrived.
"""

from __future__ import annotations

import ctypes
import os
import select
import socket
import struct
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from rig.errors import BadInput
from rig.unit.host import Library, Refused
from rig.unit.layout import (
    CONFIG,
    FROM_UNIT,
    INPUT,
    LAYOUT,
    OUTPUT,
    PART,
    PART_BYTES,
    READY,
    TEXT_BYTES,
    Kind,
    blank,
)
from rig.unit.processes import Started
from rig.unit.settings import Unit

LOOK_S: Final = 0.1  # how long a wait without a deadline lasts before the unit's process and Ctrl-C are looked at
MOST_BYTES: Final = max(PART.itemsize, INPUT.itemsize, READY.itemsize, OUTPUT.itemsize) + 8
clock = time.perf_counter


class Gone(Exception):
    """The unit is no longer there, and what is known of its end."""


class Link(Protocol):
    """A way to a unit."""

    process: Started | None
    fd: int  # of its socket
    reliable: bool  # no message is lost

    def send(self, message: memoryview) -> None:
        """Hand a message over."""
        ...

    def receive(self, into: memoryview, until_s: float) -> int:
        """The next message, its bytes; 0 when there was none until the time ``until_s`` of ``clock``.  Gone."""
        ...

    def close(self) -> None:
        """End it; a process that the rig has started is gone when this returns."""
        ...


class SocketLink:
    """Messages through a socket: to the host of a library, to a command that the rig has started, to a box."""

    def __init__(self, talk: socket.socket, process: Started | None) -> None:
        self._talk, self.process = talk, process
        self.fd, self.reliable = talk.fileno(), talk.type != socket.SOCK_DGRAM
        self._look(LOOK_S)

    def _look(self, seconds: float) -> None:
        """The system's own limit on a wait: cheaper than to ask before each message."""
        limit = struct.pack("@ll", int(seconds), int(seconds % 1 * 1e6))
        self._talk.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)

    def send(self, message: memoryview) -> None:
        """Hand a message over.  What nobody takes is lost; ``receive`` tells, after the unit's last words."""
        with suppress(OSError):
            self._talk.send(message)

    def receive(self, into: memoryview, until_s: float) -> int:
        """Wait no longer than LOOK_S at a time, and no longer than ``until_s``."""
        if until_s - clock() < LOOK_S and not self._ready(until_s):
            return 0
        try:
            count = self._talk.recv_into(into)
        except BlockingIOError:
            self._require()
            return 0
        except ConnectionResetError:  # told before what it has still said
            return self.receive(into, until_s)
        except OSError:  # nobody listens there now
            self._require(LOOK_S)
            return 0
        if count == 0 and self.reliable:
            self._require(2.0)
            raise Gone("its process has closed the connection")
        return count

    def _ready(self, until_s: float) -> bool:
        left = max(0.0, until_s - clock())
        return bool(select.select([self._talk], [], [], left)[0])

    def _require(self, wait_s: float = 0.0) -> None:
        ended = None if self.process is None else self.process.how_it_ended(wait_s)
        if ended is not None:
            raise Gone(ended)

    def close(self) -> None:
        """Close the socket and end the process, if it is the rig's."""
        self._talk.close()
        if self.process is not None:
            self.process.stop()


def child(unit: Unit, looks: int) -> SocketLink:
    """A library in a child process; BadInput when it cannot be started.  looks : as of processes.Started"""
    return SocketLink(*hosted("library", unit.file, unit.file.parent, looks))


def hosted(kind: str, path: Path, folder: Path, looks: int) -> tuple[socket.socket, Started]:
    """The host of ``kind`` with what is at ``path``, in ``folder``, and a socket to it.  BadInput."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    sizes = {
        "config": CONFIG.itemsize,
        "part": PART_BYTES,
        "text": TEXT_BYTES,
        "input": INPUT.itemsize,
        "message": MOST_BYTES,
    }
    arguments = [f"{name}={size}" for name, size in sizes.items()]
    template = blank(OUTPUT, FROM_UNIT, Kind.REPLY).tobytes().hex()
    with theirs:
        fd = theirs.fileno()
        process = Started(kind, [str(fd), str(path), template, *arguments], (fd,), folder, looks)
    return ours, process


def udp(unit: Unit, looks: int) -> SocketLink:
    """A unit that speaks UDP: started by the rig and heard from, or at its address.  BadInput.  looks : as ``child``"""
    talk = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if unit.command is None:
        try:
            talk.connect(unit.host_and_port)
        except OSError as error:
            talk.close()
            raise BadInput(f"{unit.source}: address {unit.address}: {error.strerror or error}") from None
        return SocketLink(talk, None)
    talk.bind(("127.0.0.1", 0))
    host, port = talk.getsockname()
    program, *rest = unit.command
    named = [str(unit.file) if unit.file.is_file() else program, *rest]
    command = [part.replace("{address}", f"{host}:{port}") for part in named]
    process = Started("exec", command, folder=unit.folder, looks=looks)
    link = SocketLink(talk, process)
    try:
        _await_first(talk, process, unit)
    except BadInput:
        link.close()
        process.forget()
        raise
    return link


def _await_first(talk: socket.socket, process: Started, unit: Unit) -> None:
    """Wait until the unit speaks from wherever it is, and talk to it alone from then on."""
    until = clock() + unit.start_s
    while clock() < until:
        ended = process.how_it_ended()
        if ended is not None:
            said = process.last_line()
            raise BadInput(f"{unit.source} {ended} before it was ready" + (f": {said}" if said else ""))
        if not select.select([talk], [], [], LOOK_S)[0]:
            continue
        message, sender = talk.recvfrom(MOST_BYTES)
        if len(message) == READY.itemsize and _is_from_unit(message):
            talk.connect(sender)
            return
    raise BadInput(f"{unit.source} has not said READY within start_s = {unit.start_s:g} s")


def _is_from_unit(message: bytes) -> bool:
    magic, _, kind = struct.unpack_from("<IHH", message)
    return magic == FROM_UNIT and kind in (Kind.READY, Kind.REFUSED)


class Called:
    """A library in this process: no isolation, and no process of its own."""

    process = None

    def __init__(self, unit: Unit) -> None:
        """BadInput: no library, or not one of ours."""
        try:
            self._library = Library(str(unit.file), LAYOUT)
        except Refused as reason:
            raise BadInput(f"{unit.source}: {reason}") from None
        self.environment = Environment()

    @property
    def step(self) -> Any:
        """The library's rig_unit_step."""
        return self._library.step

    def open(self, config: np.ndarray[Any, Any]) -> None:
        """Begin a session; Refused."""
        self._library.open(config.ctypes.data)

    def close(self) -> None:
        """End the session."""
        self._library.close()


class Environment:
    """How this process rounds and what it traps: a library that changes it would change our own results."""

    _SIZE: Final = 64  # at least fenv_t

    def __init__(self) -> None:
        self._math = ctypes.CDLL(None)
        self._at_first = self._read()

    def _read(self) -> bytes:
        held = (ctypes.c_ubyte * self._SIZE)()
        self._math.fegetenv(held)
        return bytes(held)

    def moved(self) -> bool:
        """Whether it is another one than at first; it is then as at first again."""
        now = self._read()
        if self._control(now) == self._control(self._at_first):
            return False
        self._math.fesetenv((ctypes.c_ubyte * self._SIZE).from_buffer_copy(self._at_first))
        return True

    @staticmethod
    def _control(held: bytes) -> tuple[int, int]:
        """The control word of the old unit and MXCSR without its flags, which every division sets."""
        old, mxcsr = struct.unpack_from("<H26xI", held)
        return (old, mxcsr & ~0x3F) if os.uname().machine == "x86_64" else (struct.unpack_from("<I", held)[0], 0)
