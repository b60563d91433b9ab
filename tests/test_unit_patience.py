"""How long rig and unit look for a message before they sleep: none where cores are wanted by others."""

import socket

import numpy as np
import pytest

from rig.core.frame import UnitStatus
from rig.unit import compiled_exchange as compiled
from rig.unit.host import LOOKS
from rig.unit.port import new_port
from rig.unit.transport import MOST_BYTES, UnitProcess
from rig.unit.unit_records import FROM_UNIT, OUTPUT, Kind, Role, blank


def test_no_process_looks_in_a_campaign_or_without_a_second_core(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(compiled, "cores", lambda: 2)
    assert compiled.patience(crowded=True) == (0, 0)
    alone = compiled.patience(crowded=False)
    assert alone.spin_ns > 0 and alone.looks > 0
    monkeypatch.setattr(compiled, "cores", lambda: 1)
    assert compiled.patience(crowded=False) == (0, 0)


@pytest.mark.parametrize("looks", [0, 7])
def test_what_the_rig_starts_is_told_how_often_to_look(looks: int):
    process = UnitProcess("exec", ["env"], looks=looks)
    assert process.how_it_ended(20.0) == "exited with status 0"
    assert f"{LOOKS}={looks}" in process.printed().splitlines()
    process.stop()
    process.forget()


@pytest.mark.parametrize(
    ("start_s", "rate_hz", "frames"), [(0.0, 100.0, 0), (0.07, 100.0, 7), (0.0166667, 60.0, 1), (0.0168, 60.0, 2)]
)
def test_a_unit_may_be_starting_for_the_frames_of_start_s_and_none_more(start_s: float, rate_hz: float, frames: int):
    assert new_port(Role.REDUNDANCY, 7, 0, np.zeros(4), rate_hz, start_s).back.start_frames == frames


@pytest.mark.parametrize(
    ("until_ns", "status", "left"),
    [(compiled.FOREVER_NS, UnitStatus.ANSWERED, 0), (1, compiled.PENDING, OUTPUT.itemsize)],
)
def test_an_answer_that_is_there_after_the_deadline_is_left_to_be_counted(until_ns: int, status: int, left: int):
    rig, unit = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with rig, unit:
        port = new_port(Role.REDUNDANCY, 7, 0, np.zeros(4), 100.0)
        there = compiled.new_exchange(port, 7, np.zeros(MOST_BYTES, np.uint8))
        compiled.to_socket(there, rig.fileno(), 10**9)
        unit.send(blank(OUTPUT, FROM_UNIT, Kind.REPLY, 7).tobytes())  # to frame 0
        assert compiled.try_exchange(port, there, until_ns) == status
        assert there.state["count"][0] == left
