"""What a unit says of itself: status, fault word, outputs, and its power-up."""

from __future__ import annotations

import os
import signal
import zlib
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from test_unit_manners import Network
from unit_files import build, library, listening, needs_a_compiler, written

import rig
from rig.core.errors import RigError
from rig.core.frame import SIGNALS, Law, State, UnitStatus
from rig.unit.compiled_exchange import crc32
from rig.unit.running_unit import UnitUnderTest
from rig.unit.transport import SocketLink
from rig.unit.unit_file import Unit
from rig.unit.unit_records import Kind

pytestmark = needs_a_compiler
SHORT = ("duration_s=2", "faults.0.start_s=1")
START_FRAMES = 50  # of docs/examples/unit/box.c at 100 Hz: 20 of power-up, 30 of self-test
REBOOT = 120
AN_OFF_PITCH_RATE = 1  # its fault word


def box() -> Path:
    return build("box_udp")


def as_box(folder: Path, **keys: Any) -> Unit:
    return written(folder, {"name": "box", "transport": "udp", "command": [str(box()), "--rig", "{address}"], **keys})


def as_library(folder: Path, **keys: Any) -> Unit:
    return written(folder, {"name": "box", "path": str(library("box")), **keys})


# Status ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("transport", [as_box, as_library])
def test_trim_is_flown_until_the_box_is_ready_and_its_fault_word_is_told(tmp_path: Path, transport: Any):
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=transport(tmp_path))
    rows, found = flight.rows, flight.unit
    starting, flown = rows[:START_FRAMES], rows[START_FRAMES:]
    assert (rows["unit"] == UnitStatus.ANSWERED).all() and found is not None
    assert (starting["law"] == Law.EXTERNAL).all() and np.ptp(starting["surface"], axis=0).max() == 0.0
    assert np.isnan(starting["voted"]).all() and (starting["unit_age"] == np.arange(1, START_FRAMES + 1)).all()
    plain = [not signal.wraps for signal in SIGNALS]
    assert np.array_equal(flown["voted"][:, plain], np.median(flown["channels"], axis=2)[:, plain])
    assert (starting["state"] == State.ABSENT).all() and (flown["level"] == 4).all()
    assert not {"level", "signal lost", "source"} & {event.name for event in flight.events}
    assert (flown["law"] == Law.AUTOPILOT).all() and (flown["unit_age"] == 0).all() and flight.survived
    news = [(event.frame, event.name, event.text) for event in flight.events if event.name.startswith("unit")]
    assert news[:3] == [
        (0, "unit status", "power-up"),
        (20, "unit status", "power-up to self-test"),
        (50, "unit status", "self-test to ready"),
    ]
    off = next(frame for frame, name, _ in news if name == "unit fault word")
    spread = np.ptp(rows["channels"][:, 0], axis=1)
    assert spread[off] > spread[50:off].max() and off >= 100
    assert [text for frame, _, text in news if frame == off] == [
        "ready to degraded",
        "0x00000000 to 0x00000001",
        "0 0 0 0 0 0 0 0 to 1 0 0 0 0 0 0 0",
    ]
    assert (found["status"], found["fault_word"], found["status_changes"]) == ("degraded", AN_OFF_PITCH_RATE, 4)
    assert found["output_discretes"] == [1, 0, 0, 0, 0, 0, 0, 0]


def test_a_box_that_tests_itself_for_longer_than_start_s_is_dead(tmp_path: Path):
    with pytest.raises(RigError, match=r"box, frame 40: is in self-test after start_s = 0\.3 s"):
        rig.fly(overrides=SHORT, out=tmp_path, unit=as_library(tmp_path, start_s=0.3))


def test_a_box_that_is_rebooted_in_flight_starts_again_and_trim_is_flown(tmp_path: Path, monkeypatch):
    """By SIGHUP: it says READY in no session, and the rig starts it again."""
    step = UnitUnderTest._step

    def rebooted(self: UnitUnderTest, frame: int) -> int:
        if frame == REBOOT and not self.replies.counts.restarts:
            process = cast("SocketLink", self.link).process
            assert process is not None
            os.kill(int(process.last_line()), signal.SIGHUP)
        return step(self, frame)

    monkeypatch.setattr(UnitUnderTest, "_step", rebooted)
    monkeypatch.setattr("rig.flight.unit_exchange.FOREVER_NS", 0)  # every frame goes by _step
    command = ["sh", "-c", f"echo $$; exec {build('box_udp')} --rig {{address}}"]
    tested = written(tmp_path, {"name": "box", "transport": "udp", "command": command, "on_dead": "restart"})
    flight = rig.fly(overrides=("duration_s=2", "faults=[]"), out=tmp_path, unit=tested)
    rows = flight.rows
    assert flight.unit is not None and flight.unit["restarts"] == 1 and flight.survived
    (again,) = np.flatnonzero(rows["unit"] == UnitStatus.RESTARTED).tolist()
    assert again - REBOOT in (0, 1), "the signal may come after the answer"
    starting = rows[again : again + START_FRAMES]
    assert (starting["surface"] == rows["surface"][0]).all() and (starting["law"] == Law.EXTERNAL).all()
    assert (rows["law"][again + START_FRAMES :] == Law.AUTOPILOT).all()
    news = [event.text for event in flight.events if event.frame == again and event.name == "unit status"]
    assert news == ["ready to power-up"]


def test_the_checksum_of_compiled_code_is_that_of_zlib():
    draw = np.random.default_rng(0)
    for size in (8, 104, 1104, 1232):
        data = draw.integers(0, 256, size, np.uint8)
        assert crc32(data, size) == zlib.crc32(data.tobytes())


class Ear(Network):
    """Loses nothing and keeps all frames."""

    frames: list[bytes]

    def copies(self, message: bytes) -> int:
        if message[6] == Kind.FRAME:
            self.frames.append(message)
        return 1


def test_every_request_of_a_flight_has_its_checksum(tmp_path: Path):
    Ear.frames = []
    with listening(box()) as address:
        network = Ear(address, 0)
        near = f"127.0.0.1:{network.near.getsockname()[1]}"
        try:
            rig.fly(
                overrides=SHORT,
                out=tmp_path,
                unit=written(tmp_path, {"name": "u", "transport": "udp", "address": near}),
            )
        finally:
            network.stop()
    sums = [int.from_bytes(message[-4:], "little") for message in Ear.frames]
    assert len(sums) == 200 and sums == [zlib.crc32(message[:-8]) for message in Ear.frames]
