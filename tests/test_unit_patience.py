"""How long rig and unit look for a message before they sleep: nobody where cores are wanted by others."""

import socket

import numpy as np
import pytest

from rig.frame import Unit
from rig.unit import compiled_exchange as way
from rig.unit.host import LOOKS
from rig.unit.layout import FROM_UNIT, OUTPUT, Form, Kind, blank
from rig.unit.links import MOST_BYTES
from rig.unit.port import new_port
from rig.unit.processes import Started


def test_nobody_looks_in_a_campaign_or_without_a_second_core(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(way, "cores", lambda: 2)
    assert way.patience(crowded=True) == (0, 0)
    alone = way.patience(crowded=False)
    assert alone.spin_ns > 0 and alone.looks > 0
    monkeypatch.setattr(way, "cores", lambda: 1)
    assert way.patience(crowded=False) == (0, 0)


@pytest.mark.parametrize("looks", [0, 7])
def test_what_the_rig_starts_is_told_how_often_to_look(looks: int):
    process = Started("exec", ["env"], looks=looks)
    assert process.how_it_ended(20.0) == "exited with status 0"
    assert f"{LOOKS}={looks}" in process.printed().splitlines()
    process.stop()
    process.forget()


@pytest.mark.parametrize(
    ("until_ns", "status", "left"), [(way.FOREVER_NS, Unit.ANSWERED, 0), (1, way.PENDING, OUTPUT.itemsize)]
)
def test_an_answer_that_is_there_after_the_deadline_is_left_to_be_counted(until_ns: int, status: int, left: int):
    rig, unit = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with rig, unit:
        port = new_port(Form.REDUNDANCY, 7, 0, np.zeros(4), 100.0)
        there = way.new_way(port, 7, np.zeros(MOST_BYTES, np.uint8))
        way.to_socket(there, rig.fileno(), 10**9)
        unit.send(blank(OUTPUT, FROM_UNIT, Kind.REPLY, 7).tobytes())  # to frame 0
        assert way.ask(port, there, until_ns) == status
        assert there.at["count"][0] == left
