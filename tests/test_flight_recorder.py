import hashlib
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from rig import fly
from rig.core.errors import RigError
from rig.core.frame import TIMING, Table, new_block
from rig.flight import fly as assembly
from rig.flight.recorder import RecordingThread

STEADY = {"duration_s": 5, "faults": []}


class Slow:
    """Notes the first frame of each block when its gate is open; raises at block ``fails``."""

    def __init__(self, fails: int | None = None) -> None:
        self.begun, self.done, self._gate, self._fails = list[int](), list[int](), threading.Event(), fails

    def open(self) -> None:
        self._gate.set()

    def record(self, table):
        self.begun.append(int(table["frame"][0]))
        assert self._gate.wait(10)
        if self.begun[-1] == self._fails:
            raise RigError("disk full")
        self.done.append(self.begun[-1])


def block(first: int):
    rows = new_block(2)
    rows["frame"] = first, first + 1
    return Table(rows, timing=np.zeros(2, TIMING))


def test_the_next_block_is_flown_while_one_is_recorded_and_waits_before_it_is_recorded_itself():
    slow = Slow()
    with RecordingThread(slow) as thread:
        thread.record(block(0))  # returns although nothing is recorded yet
        second = threading.Thread(target=thread.record, args=(block(2),))
        second.start()
        second.join(0.1)
        assert second.is_alive() and slow.done == [] and slow.begun in ([], [0])
        slow.open()
        second.join(10)
    assert slow.done == [0, 2]


def test_what_the_recorder_raises_is_raised_with_the_next_block():
    slow = Slow(fails=2)
    slow.open()
    with RecordingThread(slow) as thread:
        thread.record(block(0))
        thread.record(block(2))
        with pytest.raises(RigError, match="disk full"):
            thread.record(block(4))
    assert slow.begun == [0, 2] and slow.done == [0]


def test_what_the_recorder_raises_on_the_last_block_is_raised_at_the_end_and_the_interpreter_is_as_before():
    slow, before = Slow(fails=2), sys.getswitchinterval()
    slow.open()
    with pytest.raises(RigError, match="disk full"), RecordingThread(slow) as thread:
        thread.record(block(0))
        assert sys.getswitchinterval() < before
        thread.record(block(2))
    assert sys.getswitchinterval() == before


@pytest.mark.parametrize(("cores", "threads"), [(1, 1), (2, 2)])
def test_a_flight_that_is_not_paced_is_recorded_beside_its_frames_only_where_there_is_a_second_core(
    cores: int, threads: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(assembly, "cores", lambda: cores)
    used = {threading.get_ident()}
    flight = fly(STEADY, out=tmp_path, watch=lambda *_: used.add(threading.get_ident()))
    assert len(used) == threads and flight.digest == fly(STEADY, out=tmp_path).digest


def test_rows_stay_as_they_are_while_those_who_watch_a_flight_that_is_not_paced_see_them(tmp_path: Path):
    seen = list[bytes]()
    flight = fly(STEADY, out=tmp_path, watch=lambda table, rate_hz, events: seen.append(table.rows.tobytes()))
    assert len(seen) == 5 and hashlib.sha256(b"".join(seen)).hexdigest() == flight.digest
