"""Keys in flight: what they do, in which frame, and that the log flies again without them."""

from __future__ import annotations

import os
import pty
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rig
from rig.core.errors import BadInput
from rig.core.frame import INDEX, State
from rig.flight.loop import fly_rows
from rig.flight.operator_keys import Keys
from rig.log.recordings.flown_log import recorded
from rig.scenario.pressed_keys import pressed
from rig.scenario.scenario import load
from rig.show.terminal.keyboard import pressing
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick

Q, P = INDEX["pitch_rate"], INDEX["roll_rate"]
SCENARIO = """
duration_s = 4.0
seed = 5
[redundancy.signals.pitch_rate]
readmit_frames = 20
[[live]]
key = "h"
fault = { kind = "hardover", signal = "pitch_rate", channels = [3] }
[[live]]
key = "n"
fault = { kind = "noise", id = "noisy", signal = "roll_rate", channels = [1], std = 0.01, duration_s = 0.5 }
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "live.toml"
    path.write_text(SCENARIO)
    return path


class Plan:
    """Presses keys when their frames are due: no other presses between two frames."""

    def __init__(self, plan: dict[int, str]) -> None:
        self.plan = plan

    @contextmanager
    def __call__(self, keys: Keys) -> Iterator[None]:
        waiting, before_row = {frame: list(said) for frame, said in self.plan.items()}, keys.before_row

        def with_plan(flown: Any, block: Any, k: int) -> None:
            for key in waiting.pop(int(block["frame"][k]), []):
                keys.press(key)
            before_row(flown, block, k)

        keys.before_row = with_plan  # type: ignore[method-assign]
        yield


def fly(path: Path, plan: dict[int, str], **more: Any) -> rig.Flight:
    return rig.fly(path, out=path.parent, live=Plan(plan), **more)


def test_a_key_begins_its_fault_in_its_frame_and_ends_it(scenario: Path):
    flight = fly(scenario, {100: "h", 150: "n", 250: "h", 300: "r"})
    rows = flight.rows
    acting = np.unpackbits(rows["acting"], axis=1, bitorder="little")
    assert np.flatnonzero(acting[:, 0])[[0, -1]].tolist() == [100, 249]
    assert np.flatnonzero(acting[:, 1])[[0, -1]].tolist() == [150, 199]
    failed = np.flatnonzero(rows["state"][:, Q, 2] == State.FAILED)
    assert failed[0] == 107 and failed[-1] == 299, "the reset readmits it"
    assert (rows["reset"][300] == 15).all() and rows["reset"].any(axis=1).sum() == 1
    keys = [(event.frame, event.text) for event in flight.events if event.name == "key"]
    assert keys == [
        (100, "h: hardover pitch_rate.3 begins"),
        (150, "n: noisy begins"),
        (250, "h: hardover pitch_rate.3 ends"),
        (300, "r: all channels are commanded to be readmitted"),
    ]
    assert flight.not_executed == []


def test_the_log_alone_flies_again_to_the_same_digest(scenario: Path):
    import hashlib

    flight = fly(scenario, {100: "h", 150: "n", 250: "h", 300: "r"})
    again = recorded(flight.log)
    rows = fly_rows(again.scenario)
    assert hashlib.sha256(rows.view(np.uint8).data).hexdigest() == flight.digest
    scored = score_log(flight.log, Yardstick())
    assert [fault.outcome for fault in scored.score.faults] == ["detected", "undetectable"]
    assert scored.score.faults[0].onset_frame == 100


def test_a_flight_without_a_key_is_that_of_the_scenario(scenario: Path):
    assert fly(scenario, {}).digest == rig.fly(scenario, out=scenario.parent).digest


def test_a_key_may_end_the_flight(scenario: Path):
    flight = fly(scenario, {120: "q"})
    assert flight.frames == 121 and flight.end_reason == "interrupted"
    assert rig.read_log(flight.log).result is not None


def test_a_fault_that_is_over_does_not_begin_again(scenario: Path):
    flight = fly(scenario, {50: "h", 60: "hh", 70: "h"})
    texts = [event.text for event in flight.events if event.name == "key"]
    assert texts == [
        "h: hardover pitch_rate.3 begins",
        "h: hardover pitch_rate.3 ends",
        "h: hardover pitch_rate.3 has already ended",
        "h: hardover pitch_rate.3 has already ended",
    ]


def test_a_pause_moves_the_clock_and_nothing_else(scenario: Path):
    @contextmanager
    def live(keys: Keys) -> Iterator[None]:
        before_row = keys.before_row

        def pause(flown: Any, block: Any, k: int) -> None:
            if block["frame"][k] == 200:
                keys.press("p")
                threading.Timer(1.5, keys.press, ["p"]).start()
            before_row(flown, block, k)

        keys.before_row = pause  # type: ignore[method-assign]
        yield

    flight = rig.fly(scenario, out=scenario.parent, live=live, realtime_factor=4.0)
    assert flight.digest == rig.fly(scenario, out=scenario.parent).digest
    assert flight.wall_s > 2.3, "one second of flight and 1.5 s of pause; 2.1 s if it caught up"
    assert flight.jitter is not None
    assert [e.text for e in flight.events if e.name == "key"] == ["p: paused", "p: resumed"]


def test_ctrl_c_ends_a_flight_that_is_paused(scenario: Path):
    """Keys other than p and q wait for the end of the pause; the stop that Ctrl-C asks for does not."""

    @contextmanager
    def live(found: Keys) -> Iterator[None]:
        timer = threading.Timer(0.5, lambda: [found.press("p"), time.sleep(0.3), os.kill(os.getpid(), signal.SIGINT)])
        timer.start()
        yield
        timer.join()

    flight = rig.fly(scenario, out=scenario.parent, live=live, realtime_factor=4.0)
    assert flight.end_reason == "interrupted" and flight.frames < 400


WRONG = {
    'key = "q"\nfault = { kind = "hardover", signal = "pitch_rate", channels = [3] }': "a letter or digit except r",
    'key = "hh"\nfault = { kind = "hardover", signal = "pitch_rate", channels = [3] }': "a letter or digit except",
    'key = "x"\nfault = { kind = "hardover", signal = "pitch_rate", channels = [3], start_s = 3 }': "fault.start_s: ",
    'key = "x"\nfault = { kind = "hardover", signal = "pitch", channels = [3] }': "unknown signal",
    'key = "h"\nfault = { kind = "offset", signal = "roll_rate", channels = [3], offset = 1 }': "the key 'h' is given",
}


@pytest.mark.parametrize("entry", WRONG)
def test_a_wrong_entry_is_one_line(scenario: Path, entry: str):
    scenario.write_text(f"{SCENARIO}[[live]]\n{entry}\n")
    with pytest.raises(BadInput) as error:
        load(scenario)
    assert str(error.value).startswith(f"{scenario}: live") and WRONG[entry] in str(error.value)


def test_what_keys_did_may_be_damaged(scenario: Path):
    with pytest.raises(BadInput, match="log: the record of its keys is damaged"):
        pressed(load(scenario), {"keys": "{}"}, "log")


def test_a_terminal_gives_its_keys_at_once_and_is_left_as_it_was(monkeypatch):
    import termios

    ours, theirs = pty.openpty()
    found: list[str] = []

    class Pressable:
        def press(self, key: str) -> None:
            found.append(key)

    before = termios.tcgetattr(theirs)
    with open(theirs, closefd=False) as terminal:  # a file descriptor
        monkeypatch.setattr("sys.stdin", terminal)
        with pressing(Pressable()):
            os.write(ours, b"hq")
            until = time.monotonic() + 5.0
            while len(found) < 2 and time.monotonic() < until:
                time.sleep(0.01)
    assert found == ["h", "q"] and termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)
