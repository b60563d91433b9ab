"""Messages to a unit and back: a socket to a child or a box, or calls into a library of this process.

Also the process that the rig starts for a unit, what it printed and how it ended; nothing is left behind.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.errors import BadInput
from rig.text import one_line
from rig.unit.host import LOOKS, Library, Refused
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
from rig.unit.settings import Unit

LOOK_S: Final = 0.1  # how long a wait without a deadline lasts before the unit's process and Ctrl-C are looked at
MOST_BYTES: Final = max(PART.itemsize, INPUT.itemsize, READY.itemsize, OUTPUT.itemsize) + 8
MOST_OUTPUT: Final = 4096  # bytes of what a process printed that are shown
END_S: Final = 1.0  # to end by itself when it is told that the session is over
_HOSTS: Final = {"library": "host.py", "exec": "host.py", "fmu": "fmu_host.py"}
clock = time.perf_counter


class Disconnected(Exception):
    """The unit is no longer there, and what is known of its end."""


class UnitProcess:
    """A process of the unit: the host of a library, or a command."""

    def __init__(
        self,
        kind: str,
        arguments: Iterable[str],
        fds: tuple[int, ...] = (),
        folder: Path | None = None,
        looks: int = 0,
    ) -> None:
        """Start the host of ``kind`` with ``arguments``; BadInput when the system cannot.

        fds : that it inherits; folder : in which it runs; looks : for a message, before it sleeps
        """
        self._is_command = kind == "exec"
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 # lives as long as the process
        host = str(Path(__file__).with_name(_HOSTS[kind]))
        command = [sys.executable, "-I", host, kind, str(os.getpid()), *arguments]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                pass_fds=fds,
                cwd=folder,
                env={**os.environ, LOOKS: str(looks)},
                start_new_session=True,  # a Ctrl-C is the rig's
            )
        except OSError as error:
            raise BadInput(f"the unit's process cannot be started: {error.strerror}") from None

    def how_it_ended(self, wait_s: float = 0.0) -> str | None:
        """Return how it ended, None while it runs."""
        try:
            code = self._process.wait(wait_s) if wait_s else self._process.poll()
        except subprocess.TimeoutExpired:
            return None
        if code is None:
            return None
        if code < 0:
            return f"killed by signal {-code} ({signal.Signals(-code).name})"
        return f"exited with status {code}"

    def stop(self) -> None:
        """End it, and all that it has started in its session.

        The host of a library sees that its socket is closed; a command that waits for a datagram does not.
        """
        if self._is_command:
            self._signal(signal.SIGTERM)
        self.how_it_ended(END_S)
        self._signal(signal.SIGKILL)
        self._process.wait()

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    def printed(self) -> str:
        """Return the end of what it has written to its standard output and error."""
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - MOST_OUTPUT))
        return self._output.read().decode(errors="replace")

    def forget(self) -> None:
        """Let go of what it printed."""
        self._output.close()

    def last_line(self) -> str:
        """Return the last line that it printed, for a message."""
        lines = [line for line in self.printed().splitlines() if line.strip()]
        return one_line(lines[-1]) if lines else ""


class SocketLink:
    """Messages through a socket: to the host of a library, to a command that the rig has started, to a box."""

    def __init__(self, talk: socket.socket, process: UnitProcess | None) -> None:
        self._talk, self.process = talk, process
        self.fd, self.reliable = talk.fileno(), talk.type != socket.SOCK_DGRAM  # reliable: no message is lost
        self._limit_wait(LOOK_S)

    def _limit_wait(self, seconds: float) -> None:
        """Set the system's own limit on a wait: cheaper than to ask before each message."""
        limit = struct.pack("@ll", int(seconds), int(seconds % 1 * 1e6))
        self._talk.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)

    def send(self, message: memoryview) -> None:
        """Hand a message over.  What nobody takes is lost; ``receive`` raises it, after the unit's last messages."""
        with suppress(OSError):
            self._talk.send(message)

    def receive(self, into: memoryview, until_s: float) -> int:
        """Return the bytes of the next message; 0: none for LOOK_S or until ``until_s`` of ``clock``.  Disconnected."""
        if until_s - clock() < LOOK_S and not self._ready(until_s):
            return 0
        try:
            count = self._talk.recv_into(into)
        except BlockingIOError:
            self._require()
            return 0
        except ConnectionResetError:  # comes before what it has still sent
            return self.receive(into, until_s)
        except OSError:  # nobody listens there now
            self._require(LOOK_S)
            return 0
        if count == 0 and self.reliable:
            self._require(2.0)
            raise Disconnected("its process has closed the connection")
        return count

    def _ready(self, until_s: float) -> bool:
        left = max(0.0, until_s - clock())
        return bool(select.select([self._talk], [], [], left)[0])

    def _require(self, wait_s: float = 0.0) -> None:
        ended = None if self.process is None else self.process.how_it_ended(wait_s)
        if ended is not None:
            raise Disconnected(ended)

    def close(self) -> None:
        """Close the socket and end the process, if it is the rig's."""
        self._talk.close()
        if self.process is not None:
            self.process.stop()


def child(unit: Unit, looks: int) -> SocketLink:
    """Start a library in a child process; BadInput when it cannot be started.  looks : as of UnitProcess"""
    return SocketLink(*hosted("library", unit.file, unit.file.parent, looks))


def hosted(kind: str, path: Path, folder: Path, looks: int) -> tuple[socket.socket, UnitProcess]:
    """Start the host of ``kind`` with what is at ``path``, in ``folder``; return a socket to it, too.  BadInput."""
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
        process = UnitProcess(kind, [str(fd), str(path), template, *arguments], (fd,), folder, looks)
    return ours, process


def udp(unit: Unit, looks: int) -> SocketLink:
    """Connect to a unit by UDP: started by the rig, or at its address.  BadInput.  looks : as ``child``"""
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
    process = UnitProcess("exec", command, folder=unit.folder, looks=looks)
    link = SocketLink(talk, process)
    try:
        _await_first(talk, process, unit)
    except BadInput:
        link.close()
        process.forget()
        raise
    return link


def _await_first(talk: socket.socket, process: UnitProcess, unit: Unit) -> None:
    """Wait for the unit's first message, from any port, and connect to its sender alone."""
    until = clock() + unit.start_s
    while clock() < until:
        ended = process.how_it_ended()
        if ended is not None:
            text = process.last_line()
            raise BadInput(f"{unit.source} {ended} before it was ready" + (f": {text}" if text else ""))
        if not select.select([talk], [], [], LOOK_S)[0]:
            continue
        message, sender = talk.recvfrom(MOST_BYTES)
        if len(message) == READY.itemsize and _is_from_unit(message):
            talk.connect(sender)
            return
    raise BadInput(f"{unit.source} did not send READY within start_s = {unit.start_s:g} s")


def _is_from_unit(message: bytes) -> bool:
    magic, _, kind = struct.unpack_from("<IHH", message)
    return magic == FROM_UNIT and kind in (Kind.READY, Kind.REFUSED)


class LibraryLink:
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
    """Rounding and traps of this process: a library that changes it would change our own results."""

    _SIZE: Final = 64  # at least fenv_t

    def __init__(self) -> None:
        self._math = ctypes.CDLL(None)
        self._at_first = self._read()

    def _read(self) -> bytes:
        held = (ctypes.c_ubyte * self._SIZE)()
        self._math.fegetenv(held)
        return bytes(held)

    def restored(self) -> bool:
        """Return True if it was another one than at first; it is then as at first again."""
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
