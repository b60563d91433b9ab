"""The units of docs/examples/unit as processes: udp_main.c over loopback."""

import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_unit_monitor import quiet, random_flight
from unit_files import COMPILER, build, differing, inputs

from rig.unit.unit_records import (
    CONFIG,
    FROM_UNIT,
    HELLO,
    LAYOUT,
    OUTPUT,
    PART,
    PART_BYTES,
    READY,
    TO_UNIT,
    VERSION,
    Kind,
    place,
)

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler is installed")
SESSION = 4711
LIMIT_S = 10.0


@pytest.fixture(scope="module")
def program() -> Path:
    return build("monitor_udp")


class Peer:
    """The rig's side of the socket."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(LIMIT_S)
        self.address: Any = None

    def head(self, record: np.ndarray, kind: Kind, **other: int) -> np.ndarray:
        values = {"magic": TO_UNIT, "version": VERSION, "kind": kind, "layout": LAYOUT, "session": SESSION}
        values["length"] = place(record.dtype, "length")[1]
        for name, value in {**values, **other}.items():
            record[name] = value
        return record

    def send(self, record: np.ndarray) -> None:
        self.socket.sendto(record.tobytes(), self.address)

    def receive(self, dtype: np.dtype[Any]) -> Any:
        data, self.address = self.socket.recvfrom(4096)
        (record,) = np.frombuffer(data, dtype)
        assert (record["magic"], record["layout"]) == (FROM_UNIT, LAYOUT)
        assert record["length"] == place(dtype, "length")[1]
        return record

    def greet(self, session: int = SESSION) -> Any:
        self.send(self.head(np.zeros(1, HELLO), Kind.HELLO, session=session))
        return self.receive(READY)

    def configure(self, record: np.ndarray, order: tuple[int, ...] = ()) -> Any:
        """Send CONFIG out of order and one part of it twice."""
        data = self.head(record, Kind.CONFIG).tobytes()
        parts = -(-CONFIG.itemsize // PART_BYTES)
        for i in order or (*range(2, parts), 0, 0, 1):
            part = self.head(np.zeros(1, PART), Kind.CONFIG, part=i, parts=parts)
            slice_ = np.frombuffer(data[i * PART_BYTES : (i + 1) * PART_BYTES], "u1")
            part["bytes"][0, : len(slice_)] = slice_
            self.send(part)
        return self.receive(READY)


@pytest.fixture
def peer(program: Path) -> Iterator[Peer]:
    peer = Peer()
    port = peer.socket.getsockname()[1]
    unit = subprocess.Popen([program, "--rig", f"127.0.0.1:{port}"])
    try:
        first = peer.receive(READY)
        assert (first["kind"], first["session"], first["text"]) == (Kind.READY, 0, b"monitor")
        yield peer
    finally:
        unit.kill()
        unit.wait()
        peer.socket.close()


def test_a_flight_over_udp_has_the_same_bits(peer: Peer):
    for flight in range(2):  # one process, two sessions
        record, rows = random_flight((7, flight))
        assert peer.greet()["session"] == 0
        assert peer.configure(record)["kind"] == Kind.READY
        outputs = np.zeros(len(rows), OUTPUT)
        for k, frame in enumerate(inputs(rows)):
            peer.send(peer.head(frame.reshape(1), Kind.FRAME))
            outputs[k] = peer.receive(OUTPUT)
        assert differing(outputs, rows) == {}
        assert set(outputs["kind"]) == {Kind.REPLY} and set(outputs["session"]) == {SESSION}
        assert (outputs["frame"] == rows["frame"]).all() and outputs["stepped"][-1] == len(rows)
        peer.send(peer.head(np.zeros(1, HELLO), Kind.END))


def test_a_request_with_a_wrong_checksum_is_not_stepped(peer: Peer):
    record, rows = random_flight((7, 0))
    peer.greet()
    peer.configure(record)
    (frame, *_) = inputs(rows)
    for crc in (1, 0):
        peer.send(peer.head(frame.reshape(1), Kind.FRAME, crc=crc))
    assert peer.receive(OUTPUT)["stepped"] == 1


def test_a_configuration_that_cannot_be_flown_is_refused_with_a_reason(peer: Peer):
    record, _ = quiet(1)
    record["signal"]["fitted"] = 9
    peer.greet()
    answer = peer.configure(record)
    assert answer["kind"] == Kind.REFUSED and b"CONFIG" in answer["text"]


@pytest.mark.parametrize("wrong", ["magic", "layout", "session", "length"])
def test_a_frame_that_is_not_of_this_session_and_layout_is_not_answered(peer: Peer, wrong: str):
    record, rows = quiet(2)
    peer.greet()
    peer.configure(record)
    first, second = (peer.head(frame.reshape(1), Kind.FRAME) for frame in inputs(rows))
    first[wrong] += 1
    peer.send(first)
    peer.socket.sendto(second.tobytes()[:-8], peer.address)
    second["frame"] = 5
    peer.send(second)
    answer = peer.receive(OUTPUT)
    assert (answer["frame"], answer["stepped"]) == (5, 1)


def test_a_frame_after_the_end_is_not_stepped(peer: Peer):
    record, rows = quiet(1)
    peer.greet()
    peer.configure(record)
    peer.send(peer.head(np.zeros(1, HELLO), Kind.END))
    peer.send(peer.head(inputs(rows), Kind.FRAME))
    said = peer.receive(READY)
    assert (said["kind"], said["session"]) == (Kind.READY, 0)


def test_hello_and_config_that_come_again_change_nothing(peer: Peer):
    record, rows = quiet(3)
    peer.greet()
    peer.configure(record)
    peer.send(peer.head(inputs(rows)[:1], Kind.FRAME))
    assert peer.receive(OUTPUT)["stepped"] == 1
    assert peer.greet()["session"] == 0
    assert peer.configure(record, order=(2,))["session"] == SESSION
    peer.send(peer.head(inputs(rows)[1:2], Kind.FRAME))
    assert peer.receive(OUTPUT)["stepped"] == 2


def test_a_unit_that_is_restarted_says_so(program: Path):
    peer = Peer()
    unit = subprocess.Popen([program, "--rig", f"127.0.0.1:{peer.socket.getsockname()[1]}"])
    try:
        peer.receive(READY)
        peer.greet()
        unit.send_signal(signal.SIGHUP)
        said = peer.receive(READY)
        assert (said["kind"], said["session"]) == (Kind.READY, 0)
    finally:
        unit.kill()
        unit.wait()
        peer.socket.close()


def test_a_unit_ends_when_its_rig_is_gone(program: Path):
    peer = Peer()
    unit = subprocess.Popen([program, "--rig", f"127.0.0.1:{peer.socket.getsockname()[1]}"])
    try:
        peer.receive(READY)
        peer.greet()
        unit.send_signal(signal.SIGSTOP)
        peer.send(peer.head(np.zeros(1, HELLO), Kind.HELLO))
        peer.socket.close()
        unit.send_signal(signal.SIGCONT)  # its answer finds no receiver
        assert unit.wait(LIMIT_S) == 0
    finally:
        unit.kill()
        unit.wait()


def test_a_listening_unit_serves_one_rig_until_its_end_or_silence(program: Path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    unit = subprocess.Popen([program, "--listen", f"127.0.0.1:{port}"])
    try:
        first, second = Peer(), Peer()
        for peer in (first, second):
            peer.address = ("127.0.0.1", port)
            peer.socket.settimeout(0.2)
        assert until_it_listens(first)["text"] == b"monitor"
        refused = second.greet(SESSION + 1)
        assert (refused["kind"], refused["session"]) == (Kind.REFUSED, SESSION + 1)
        assert refused["text"] == b"busy with session %d" % SESSION
        first.send(first.head(np.zeros(1, HELLO), Kind.END))
        assert second.greet(SESSION + 1)["kind"] == Kind.READY
        second.socket.close()
        time.sleep(4.1)  # in which the second is silent
        assert first.greet()["kind"] == Kind.READY
        first.socket.close()
    finally:
        unit.kill()
        unit.wait()


def until_it_listens(peer: Peer) -> Any:
    for _ in range(50):
        try:
            return peer.greet()
        except (TimeoutError, ConnectionRefusedError):
            continue
    pytest.fail("the unit does not listen")
