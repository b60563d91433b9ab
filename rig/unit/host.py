"""The child process that runs a library: from messages of a socket to its three functions, and back.

    python -I guard.py PARENT host.py FD PATH BLANK NAME=SIZE ...   (processes.py starts it)

It imports only small modules, because a child must answer within 0.2 s.
"""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import struct
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

HEAD = struct.Struct("<IHHQQqd")  # magic, version, kind, layout, session, frame, time_s
USUAL_BYTES = 24  # magic to session: the same in all frames of a session
HELLO, CONFIG, FRAME, END, READY, REFUSED = range(1, 7)
AT_ONCE = getattr(socket, "MSG_DONTWAIT", 0)
LOOKS = "RIG_UNIT_LOOKS"  # in the environment of what the rig starts
_LAW_INPUT = "law_input"  # the size that says that the unit is a control law
LOOKS_PER_LOOK = 4  # what one of Python takes is as long as so many of compiled code
STEP, LAW = "rig_unit_step", "rig_unit_law"  # of a frame: the second of a control law


def looks() -> int:
    """Return the number of looks for a message before sleeping: waking takes longer, but others may need the core."""
    return int(os.environ.get(LOOKS, "0"))


class Refused(Exception):
    """Reason why a library cannot be flown."""


class Library:
    """The three functions of a shared library, and the number of frames since its opening."""

    kind = "library"  # its text about itself

    def __init__(self, path: str, layouts: Sequence[int], step: str = STEP) -> None:
        """Load a library.  Refused: none, missing functions, or records not in ``layouts`` (newest first).

        step : STEP or LAW
        """
        functions = ("rig_unit_open", step, "rig_unit_close")
        try:
            self._library = ctypes.CDLL(str(Path(path).resolve()))
        except OSError as error:
            raise Refused(f"{path} cannot be loaded as a library: {error}") from None
        missing = [name for name in functions if not hasattr(self._library, name)]
        if missing:
            whose = "a control law" if step == LAW else "a unit"
            raise Refused(f"{path} has no function {missing[0]}; {whose} needs {', '.join(functions)}")
        self.layout = layouts[0]
        with suppress(ValueError):  # not every language writes it
            self.layout = ctypes.c_uint64.in_dll(self._library, "rig_unit_layout").value
            if self.layout not in layouts:
                built, ours = f"{self.layout:016x}", f"{layouts[0]:016x}"
                again = "write the header again ('rig unit header') and rebuild"
                raise Refused(f"{path} was built for layout {built}, this rig has {ours}: {again}")
        self._open, self.step, self._close = (getattr(self._library, name) for name in functions)
        self._open.argtypes, self.step.argtypes = (ctypes.c_void_p,), (ctypes.c_void_p, ctypes.c_void_p)
        self._close.restype = None
        self._opened = False

    def open(self, config: int) -> None:
        """Start a session with the record at the address ``config``.  Refused: the unit refuses."""
        self.close()
        if code := self._open(config):
            raise Refused(f"rig_unit_open returned {code}")
        self._opened = True

    def close(self) -> None:
        """End the session."""
        if self._opened:
            self._opened = False
            self._close()


class ReplyChannel:
    """Sender of the child's replies, in records of the sizes that the rig has given."""

    def __init__(self, connection: socket.socket, blank: bytes, sizes: dict[str, int]) -> None:
        """Take ``blank``: an answer with only its head and length."""
        self.socket, self.blank, self.sizes = connection, blank, sizes
        self.step = LAW if _LAW_INPUT in sizes else STEP  # the function of a frame

    def reply(self, kind: int, request: bytes | memoryview, text: str, greeting: bool = False) -> None:
        """Send READY or REFUSED to ``request``; a greeting has no session, it only reports the unit."""
        magic, version, _, layout, *_ = HEAD.unpack_from(self.blank)
        *_, session, frame, time_s = HEAD.unpack_from(request)
        session = 0 if greeting else session
        head = HEAD.pack(magic, version, kind, layout, session, frame, time_s)
        body = text.encode()[: self.sizes["text"] - 1].ljust(self.sizes["text"], b"\0")
        self.socket.send(head + body + struct.pack("<II", len(head) + len(body), 0))


class Host:
    """A host that answers the messages of the rig by calls of a library."""

    def __init__(self, channel: ReplyChannel, library: Library) -> None:
        self._channel, self._library = channel, library
        self._config = bytearray(channel.sizes["config"])
        self._message, self._output = bytearray(channel.sizes["message"]), bytearray(channel.blank)
        self._usual = bytearray(USUAL_BYTES)  # how a FRAME of the session begins
        self._from, self._to, self._with = map(_address, (self._message, self._output, self._config))
        self._state = (ctypes.c_int64 * 2)()  # frames stepped since CONFIG, code of the last step

    def serve(self) -> None:
        """Answer until the connection ends."""
        message = memoryview(self._message)
        while self._answer(message):
            self._handle(message)

    def _answer(self, message: memoryview) -> int:
        """Answer the frames of the session; return the bytes of another message, 0 when the connection has ended."""
        size = self._channel.sizes["input"]
        while (count := self._receive(message)) == size and message[:USUAL_BYTES] == self._usual:
            self._step(message)
        return count

    def _receive(self, message: memoryview) -> int:
        """Return the bytes of the next message: look for it some times, and only then sleep."""
        receive = self._channel.socket.recv_into
        for _ in range(looks() // LOOKS_PER_LOOK):
            with suppress(BlockingIOError):
                return receive(message, 0, AT_ONCE)
            os.sched_yield()
        return receive(message)

    def _handle(self, message: memoryview) -> None:
        kind = message[6] | message[7] << 8
        if kind == HELLO:
            self._channel.reply(READY, message, self._library.kind, greeting=True)
        elif kind == CONFIG:
            self._configure(message)
        elif kind == END:
            self._library.close()

    def _step(self, message: memoryview) -> None:
        output = self._output
        output[16:40] = message[16:40]  # session, frame, time_s
        code = self._library.step(self._from, self._to)
        if code:
            self._refuse(message, code)
            return
        self._state[0] += 1
        output[40:48] = self._state[0].to_bytes(8, "little")
        self._channel.socket.send(output)
        output[:] = self._channel.blank  # for the next one, while the rig works on this

    def _refuse(self, message: memoryview, code: int) -> None:
        self._output[:] = self._channel.blank
        self._channel.reply(REFUSED, message, f"{self._channel.step} returned {code}")

    def _configure(self, message: memoryview) -> None:
        """Keep a part of the configuration; the last one opens the library."""
        part, parts = struct.unpack_from("<II", message, HEAD.size)
        first, begin = part * self._channel.sizes["part"], HEAD.size + 8
        count = min(self._channel.sizes["part"], len(self._config) - first)
        self._config[first : first + count] = message[begin : begin + count]
        if part + 1 < parts:
            return
        self._output[:] = self._channel.blank
        try:
            self._usual[:] = bytes(message[:6]) + FRAME.to_bytes(2, "little") + bytes(message[8:USUAL_BYTES])
            self._library.open(self._with)
            self._state[0] = 0
            self._channel.reply(READY, message, self._library.kind)
        except Refused as reason:
            self._channel.reply(REFUSED, message, str(reason))


class LibraryHost(Host):
    """A host that steps a library in compiled code."""

    def __init__(self, channel: ReplyChannel, library: Library) -> None:
        super().__init__(channel, library)
        from rig.unit.exchange_llvm import compiled  # not by who imports this file for its records

        self._blank, system = bytearray(channel.blank), ctypes.CDLL(None)
        called = (library.step, system.recv, system.send, system.sched_yield)
        functions = [ctypes.cast(function, ctypes.c_void_p) for function in called]
        sizes, state = channel.sizes, ctypes.addressof(self._state)
        looking = AT_ONCE, looks()
        records = (self._from, sizes["message"], sizes["input"], _address(self._usual))
        reply = (self._to, _address(self._blank), len(self._blank), state)
        self._compiled = partial(compiled(), channel.socket.fileno(), *records, *reply, *functions, *looking)

    def _answer(self, message: memoryview) -> int:
        """Answer the frames, and a step that fails; a broken socket is left to Python."""
        while (count := self._compiled()) < 0 or self._state[1]:
            if count < 0:
                return super()._answer(message)
            self._refuse(message, self._state[1])
            self._state[1] = 0
        return count


def _address(buffer: bytearray) -> int:
    """Return where the bytes are; they stay there, as ctypes keeps the buffer from being resized."""
    held = (ctypes.c_char * len(buffer)).from_buffer(buffer)
    _held.append(held)
    return ctypes.addressof(held)


_held: list[object] = []


def serve(arguments: list[str], load: Callable[[str, Sequence[int], str], Library], host: type[Host] = Host) -> None:
    """Serve the unit that ``load`` returns for the path of ``arguments``, until the connection ends; also for FMUs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # one that the library raises is no Ctrl-C, which is the rig's
    fd, path, blank, *sizes = arguments
    named = {name: int(size) for name, _, size in (text.partition("=") for text in sizes)}
    blanks = {HEAD.unpack_from(one)[3]: one for one in map(bytes.fromhex, blank.split(","))}  # by layout
    channel = ReplyChannel(socket.socket(fileno=int(fd)), next(iter(blanks.values())), named)
    try:
        library = load(path, [*blanks], channel.step)
    except Refused as reason:
        channel.reply(REFUSED, channel.blank, str(reason))
        channel.socket.recv(1)  # wait until it has been read
        return
    channel.blank = blanks[library.layout]
    _, version, *_ = HEAD.unpack_from(channel.blank)
    named["input"] = named.get(_LAW_INPUT, named[f"input_{version}"])
    channel.reply(READY, channel.blank, library.kind)
    host(channel, library).serve()


if __name__ == "__main__":
    serve(sys.argv[1:], Library, LibraryHost)
