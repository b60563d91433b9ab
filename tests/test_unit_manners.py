"""Units of bad manners: each way of not starting has its own line, and no process of any is left behind."""

from __future__ import annotations

import os
import random
import signal
import socket
import struct
import subprocess
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from unit_files import build, compiled, needs_a_compiler, udp, written

import rig
from rig.core.errors import BadInput, RigError
from rig.unit.host import HEAD
from rig.unit.unit_file import Unit, read_unit
from rig.unit.unit_records import FROM_UNIT, LAYOUT, READY, VERSION, Kind

SHORT = ("duration_s=0.3", "faults=[]")
START_S = 0.5


def refused(out: Path, tested: Unit) -> str:
    with pytest.raises(BadInput) as error:
        rig.fly(overrides=SHORT, out=out, unit=tested)
    assert list(out.glob("*.mcap")) == []
    text = str(error.value)
    assert "\n" not in text and text.startswith(f"{out}/unit.toml: u")
    return text


def marked(mark: str) -> list[int]:
    """Processes whose command has ``mark`` in it."""
    found = []
    for name in (path.name for path in Path("/proc").iterdir() if path.name.isdecimal()):
        try:
            if mark in Path(f"/proc/{name}/cmdline").read_bytes().decode(errors="replace").split("\0"):
                found.append(int(name))
        except OSError:
            continue
    return [pid for pid in found if pid != os.getpid()]


# Boxes --------------------------------------------------------------------------------------------------------


class Box(threading.Thread):
    """A socket that answers each message by what ``manner`` makes of it."""

    def __init__(self, manner: Callable[[bytes], list[bytes]]) -> None:
        super().__init__(daemon=True)
        self.manner, self.heard = manner, list[int]()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.05)
        self.over = False
        self.start()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.socket.getsockname()[1]}"

    def run(self) -> None:
        while not self.over:
            try:
                message, sender = self.socket.recvfrom(4096)
            except TimeoutError:
                continue
            self.heard.append(message[6])
            for reply in self.manner(message):
                self.socket.sendto(reply, sender)

    def stop(self) -> None:
        self.over = True
        self.join()
        self.socket.close()


def ready(
    asked: bytes, kind: int = Kind.READY, session: int | None = 0, text: bytes = b"box", seal: bool = False, **head: int
) -> bytes:
    """READY with the session of ``asked`` if none is given; head : what is wrong in it."""
    named = {"magic": FROM_UNIT, "version": VERSION, "layout": LAYOUT, **head}
    session = HEAD.unpack_from(asked)[4] if session is None else session
    begin = HEAD.pack(named["magic"], named["version"], kind, named["layout"], session, 0, 0.0)
    body = begin + text.ljust(READY.itemsize - 48, b"\0")
    return body + struct.pack("<II", named.get("length", len(body)), named.get("crc", zlib.crc32(body) if seal else 0))


def swapped(message: bytes) -> bytes:
    """The same in the other byte order."""
    return struct.pack(">IHHQQqd", *HEAD.unpack_from(message)) + message[40:]


def greets_only(message: bytes) -> list[bytes]:
    return [ready(message)] if message[6] == Kind.HELLO else []


def refuses_config(message: bytes) -> list[bytes]:
    return [ready(message)] if message[6] == Kind.HELLO else [ready(message, Kind.REFUSED, None, b"no such aircraft")]


# Manner of the box, what the line says.
BOXES: dict[str, tuple[Callable[[bytes], list[bytes]], str]] = {
    "silent": (lambda m: [], "no message from 127.0.0.1:"),
    "empty": (lambda m: [b""], "empty message from 127.0.0.1:"),
    "a byte": (lambda m: [b"R"], "1 bytes without the magic RIGO"),
    "text": (lambda m: [b"hello, world"], "12 bytes without the magic RIGO"),
    "echo": (lambda m: [m], "with the magic RIGI of the rig"),
    "big-endian": (lambda m: [swapped(ready(m))], "big-endian byte order"),
    "head alone": (lambda m: [ready(m)[:20]], "20 bytes, fewer than the head"),
    "short": (lambda m: [ready(m)[:-9]], "READY of 231 bytes, must be 240"),
    "long": (lambda m: [ready(m) + b"\0" * 8], "READY of 248 bytes, must be 240"),
    "length": (lambda m: [ready(m, length=9)], "READY with length 9 before its checksum, must be 232"),
    "checksum": (lambda m: [ready(m, crc=1)], "READY with checksum 00000001, must be"),
    "another layout": (lambda m: [ready(m, layout=7)], "was built for layout 0000000000000007"),
    "another version": (lambda m: [ready(m, version=9)], f"version 9, this rig has {LAYOUT:016x}, version {VERSION}"),
    "another session": (lambda m: [ready(m, session=77)], "READY of session 77, this flight has"),
    "reply": (lambda m: [ready(m, Kind.REPLY)], "REPLY, which is neither READY nor REFUSED"),
    "unknown kind": (lambda m: [ready(m, 99)], "a message of kind 99, which is neither"),
    "refuses": (lambda m: [ready(m, Kind.REFUSED, None, b"on fire")], "refuses the flight: on fire"),
    "busy": (lambda m: [ready(m, Kind.REFUSED, None, b"busy with session 5")], "it is busy with session 5"),
    "greets only": (greets_only, "it has answered HELLO, but not CONFIG, sent 3 times"),
    "refuses CONFIG": (refuses_config, "refuses the flight: no such aircraft"),
}


@pytest.mark.parametrize("name", BOXES)
def test_a_box_that_does_not_start_has_its_own_line(tmp_path: Path, name: str):
    manner, said = BOXES[name]
    box = Box(manner)
    try:
        start_s = 2 * START_S if name == "refuses" else START_S  # it has been asked in every version, 0.2 s each
        tested = {"name": "u", "transport": "udp", "address": box.address, "start_s": start_s}
        assert said in refused(tmp_path, written(tmp_path, tested))
    finally:
        box.stop()


def test_all_these_lines_differ():
    assert len({said for _, said in BOXES.values()}) == len(BOXES)


# Commands -----------------------------------------------------------------------------------------------------


def script(folder: Path, text: str, mode: int = 0o755) -> str:
    path = folder / "program"
    path.write_text(text)
    path.chmod(mode)
    return "./program"


def python(text: str) -> list[str]:
    import sys

    return [sys.executable, "-c", text, "{address}"]


SEND = (
    "import socket,sys,time; h,p=sys.argv[1].split(':'); s=socket.socket(2,2); s.sendto({!r},(h,int(p))); time.sleep(9)"
)
NO_LAYOUT = ready(bytes(48), layout=7)
COMMANDS: dict[str, tuple[Callable[[Path], list[str]], str]] = {
    "no program": (lambda f: ["no-such-program"], "no-such-program: no such program beside the unit file or in PATH"),
    "no file": (lambda f: ["./none"], "./none: no such file"),
    "folder": (lambda f: ["."], "command: . is a folder"),
    "not executable": (lambda f: [script(f, "#!/bin/sh\n", 0o644)], "is not executable (chmod +x)"),
    "no interpreter": (
        lambda f: [script(f, "#!/no/such/sh\n")],
        "the interpreter that its first line names is missing",
    ),
    "no format": (lambda f: [script(f, "\x7fELF nothing")], "Exec format error"),
    "ends at once": (lambda f: ["sh", "-c", "exit 0"], "exited with status 0 before READY"),
    "ends with a word": (
        lambda f: ["sh", "-c", "echo no licence >&2; exit 4"],
        "exited with status 4 before READY; it printed: no licence",
    ),
    "is killed": (lambda f: ["sh", "-c", "kill -SEGV $$"], "killed by signal 11 (SIGSEGV) before READY"),
    "has no address": (lambda f: ["sleep", "60"], "its command lacks {address}, the address to send to"),
    "is silent": (
        lambda f: ["sh", "-c", "echo waiting; sleep 60", "{address}"],
        "it runs, but has sent nothing to 127.0.0.1:",
    ),
    "sends text": (lambda f: python(SEND.format(b"hello")), "5 bytes without the magic RIGO"),
    "was built for others": (lambda f: python(SEND.format(NO_LAYOUT)), "was built for layout 0000000000000007"),
    "says READY alone": (lambda f: python(SEND.format(ready(bytes(48)))), "no message from"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_does_not_start_has_its_own_line(tmp_path: Path, name: str):
    command, said = COMMANDS[name]
    tested = {"name": "u", "transport": "udp", "command": command(tmp_path), "start_s": START_S + 0.5}
    assert said in refused(tmp_path, written(tmp_path, tested))


FILES = {
    'transport = "udp"\ncommand = ["a\\u0000b"]\n': "command: must not contain the character NUL",
    'transport = "udp"\ncommand = [""]\n': "command: must not be empty",
    'path = "a\\u0000b"\n': "path: must not contain the character NUL",
    'path = "."\n': "path: .: is a folder, must be a library",
    'transport = "fmu"\npath = "."\n': "path: .: is a folder, must be an FMU, one file",
    'path = "none.so"\n': "path: none.so: no such file",
}


@pytest.mark.parametrize("text", FILES)
def test_a_file_that_names_nothing_to_run_is_one_line(tmp_path: Path, text: str):
    (tmp_path / "unit.toml").write_text('name = "u"\n' + text)
    with pytest.raises(BadInput) as error:
        read_unit(tmp_path / "unit.toml")
    assert FILES[text] in str(error.value) and "\n" not in str(error.value)


# Libraries ----------------------------------------------------------------------------------------------------

LIBRARY = """
#include <stdlib.h>
#include <signal.h>
#include <unistd.h>
#include "rig_unit.h"
{extra}
int rig_unit_open(const struct rig_config *c) {{ {open} return c->layout != RIG_UNIT_LAYOUT; }}
int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{{
    for (int s = 0; s < RIG_SIGNALS; s++) out->voted[s] = in->channels[s][0];
    out->said = RIG_SAID_VOTED;
    return 0;
}}
void rig_unit_close(void) {{ {close} }}
"""
LOADING = "__attribute__((constructor)) static void begin(void) {{ {} }}"
SLEEPS = "for (;;) pause();"
LEAVE = 'char *a[] = {{"sleep", "{}", 0}}; if (fork() == 0) {{ {} execvp("sleep", a); }}'
LIBRARIES = {
    "dies when loaded": ({"extra": LOADING.format("abort();")}, "killed by signal 6 (SIGABRT) during loading"),
    "exits when loaded": ({"extra": LOADING.format("_exit(9);")}, "exited with status 9 during loading"),
    "never loads": ({"extra": LOADING.format(SLEEPS)}, "s: it is still being loaded"),
    "dies in open": ({"open": "abort();"}, "killed by signal 6 (SIGABRT) at the start of the session"),
    "exits in open": ({"open": "exit(0);"}, "exited with status 0 at the start of the session"),
    "never opens": ({"open": SLEEPS}, "it is loaded, but has not started the session"),
    "returns a code": ({"open": "return -3;"}, "refuses the flight: rig_unit_open returned -3"),
}


def bad_library(folder: Path, **parts: str) -> Unit:
    source = folder / "bad.c"
    source.write_text(LIBRARY.format(**{"extra": "", "open": "", "close": "", **parts}))
    compiled([source], folder / "libbad.so", "-Wno-unused-result")
    return written(folder, {"name": "u", "path": "libbad.so", "start_s": 1.5})


@needs_a_compiler
@pytest.mark.parametrize("name", LIBRARIES)
def test_a_library_that_does_not_start_has_its_own_line(tmp_path: Path, name: str):
    parts, said = LIBRARIES[name]
    assert said in refused(tmp_path, bad_library(tmp_path, **parts))


# What is left behind ------------------------------------------------------------------------------------------

FORKS = {
    "forks": "",
    "begins a session": "setsid();",
    "forks twice": "setsid(); if (fork()) _exit(0);",
    "ignores SIGTERM": "signal(SIGTERM, SIG_IGN); signal(SIGHUP, SIG_IGN); setsid();",
}


@needs_a_compiler
@pytest.mark.parametrize("name", FORKS)
@pytest.mark.parametrize("then", ["", "abort();"])
def test_what_a_library_leaves_ends_with_the_flight(tmp_path: Path, name: str, then: str):
    mark = f"60{time.monotonic_ns()}"
    tested = bad_library(tmp_path, open=LEAVE.format(mark, FORKS[name]), close=then)
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
    assert marked(mark) == []
    assert ("SIGABRT" in flight.printed) == bool(then)


@pytest.mark.parametrize(
    "how", ["sleep {} & sleep 60", "setsid sleep {} & sleep 60", "trap '' TERM; setsid sleep {} & sleep 60"]
)
def test_what_a_command_leaves_ends_with_it(tmp_path: Path, how: str):
    mark = f"61{time.monotonic_ns()}"
    command = ["sh", "-c", how.format(mark), "{address}"]
    refused(tmp_path, written(tmp_path, {"name": "u", "transport": "udp", "command": command, "start_s": START_S}))
    assert marked(mark) == []


@pytest.mark.long
def test_what_a_command_leaves_ends_with_a_rig_that_is_killed(tmp_path: Path):
    import sys

    mark = f"62{time.monotonic_ns()}"
    written(tmp_path, {"name": "u", "transport": "udp", "command": ["sh", "-c", f"setsid sleep {mark} & sleep 60"]})
    flown = subprocess.Popen([sys.executable, "-m", "rig", "fly", "--unit", "unit.toml"], cwd=tmp_path)
    until(lambda: marked(mark), True)
    flown.send_signal(signal.SIGKILL)
    flown.wait()
    until(lambda: marked(mark), False)


def until(what: Callable[[], Any], wanted: bool) -> None:
    for _ in range(300):
        if bool(what()) == wanted:
            return
        time.sleep(0.1)
    pytest.fail(f"never {wanted}")


# Ends in close, in order of harm.
CLOSES = {
    "segv": ("*(volatile int *)0 = 0;", "killed by signal 11 (SIGSEGV) after the end of its session"),
    "exit": ("exit(5);", "exited with status 5 after the end of its session"),
    "hang": (SLEEPS, "did not end within 1 s and was killed after the end of its session"),
}


@needs_a_compiler
@pytest.mark.parametrize("name", CLOSES)
def test_a_library_that_goes_wrong_in_close_is_told(tmp_path: Path, name: str):
    close, said = CLOSES[name]
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=bad_library(tmp_path, close=close))
    assert flight.survived and said in flight.printed


# Start-up over a network that loses and repeats -----------------------------------------------------------------


@pytest.fixture(scope="module")
def listening() -> Iterator[tuple[str, int]]:
    """The address of a running monitor, and its process."""
    program = build("monitor_udp")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    process = subprocess.Popen([program, "--listen", address])
    yield address, process.pid
    process.kill()
    process.wait()


class Network(threading.Thread):
    """Between a rig and a box: of the start-up it loses a tenth and doubles a tenth, by its seed."""

    def __init__(self, box: str, seed: int) -> None:
        super().__init__(daemon=True)
        host, port = box.split(":")
        self.box, self.draw, self.over, self.worse = (host, int(port)), random.Random(seed), False, 0
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.near.bind(("127.0.0.1", 0))
        self.far.connect(self.box)
        self.start()

    def run(self) -> None:
        import select

        rig_at: Any = None
        while not self.over:
            for one in select.select([self.near, self.far], [], [], 0.05)[0]:
                message, sender = one.recvfrom(4096)
                rig_at = sender if one is self.near else rig_at
                for _ in range(self.copies(message)):
                    _ = self.far.send(message) if one is self.near else self.near.sendto(message, rig_at)

    def copies(self, message: bytes) -> int:
        """None, one or two of a message of the start-up, one of a frame and of its answer."""
        if message[6] in (Kind.FRAME, Kind.REPLY):
            return 1
        times = self.draw.choices([0, 1, 2], [1, 8, 1])[0]
        self.worse += times != 1
        return times

    def stop(self) -> None:
        self.over = True
        self.join()
        self.near.close()
        self.far.close()


@pytest.mark.long
@needs_a_compiler
def test_a_hundred_starts_over_a_network_that_loses_and_doubles_a_tenth(tmp_path: Path, listening: tuple[str, int]):
    from rig.bench.unit_check import load
    from rig.unit.running_unit import running
    from rig.unit.vectors import answers

    network, case = Network(listening[0], 1), load()[0]
    address = f"127.0.0.1:{network.near.getsockname()[1]}"
    tested = written(tmp_path, {"name": "u", "transport": "udp", "address": address})
    try:
        with running(tested) as box:
            flown = [answers(box, case.config, case.inputs[:2]) for _ in range(100)]
    finally:
        network.stop()
    assert network.worse > 100
    assert all((outputs["frame"] == [0, 1]).all() and (outputs["stepped"] == [1, 2]).all() for outputs in flown)


@needs_a_compiler
def test_a_second_rig_is_told_that_the_box_is_busy(tmp_path: Path, listening: tuple[str, int]):
    from rig.bench.unit_check import load
    from rig.unit.running_unit import running

    tested = written(tmp_path, {"name": "u", "transport": "udp", "address": listening[0]})
    with running(tested) as first:
        first.begin(load()[0].config.copy())  # waits where the end of an earlier session was lost
        assert "it is busy with session " in refused(tmp_path, tested.model_copy(update={"start_s": 0.6}))
        first.end()
    assert rig.fly(overrides=SHORT, out=tmp_path, unit=tested).survived


@needs_a_compiler
def test_a_box_that_restarts_is_dead_in_flight_and_greeted_again_between_flights(
    tmp_path: Path, listening: tuple[str, int]
):
    tested = written(tmp_path, {"name": "u", "transport": "udp", "address": listening[0]})
    frames: list[int] = []

    def watch(rows: Any, *_: Any) -> None:
        frames.append(len(rows))
        os.kill(listening[1], signal.SIGHUP)

    with pytest.raises(RigError, match="has restarted: it sends READY without a session"):
        rig.fly(overrides=("duration_s=5", "faults=[]"), out=tmp_path, unit=tested, watch=watch)
    assert frames
    assert rig.fly(overrides=SHORT, out=tmp_path, unit=tested).survived


@needs_a_compiler
def test_a_unit_that_starts_as_version_1_did_is_flown(tmp_path: Path):
    """READY of the session to HELLO, too."""
    assert rig.fly(overrides=SHORT, out=tmp_path, unit=udp(tmp_path, [["old start", -1, -1]])).survived
