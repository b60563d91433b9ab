import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rig
from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.own import load_manager
from rig.core.frame import S, nested, new_block
from rig.core.interrupt import end_cleanly, interruptible
from rig.core.trust import Trust
from rig.log import read_log
from rig.studies.benchmark.own_class import HealthyData, designed
from rig.studies.campaign.worker import fly_run
from rig.studies.search.plants.plant_call import Call, simulate
from rig.unit.python_law import PythonLaw
from rig.unit.unit_records import CONFIG, LAW_INPUT, OUTPUT

TRUSTED = Trust(allow_code=True)
TERMINATIONS = [signal.SIGTERM, signal.SIGHUP]


@pytest.fixture(autouse=True)
def pythons_own() -> Iterator[None]:
    """A process that was started in the background ignores Ctrl-C from the first, and one by nohup a hang-up."""
    before = {number: signal.signal(number, signal.SIG_DFL) for number in TERMINATIONS}
    before[signal.SIGINT] = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_the_first_ctrl_c_asks_for_an_end_and_the_second_is_pythons_own():
    with interruptible() as stop:
        assert not stop.requested
        signal.raise_signal(signal.SIGINT)
        assert stop.requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_ctrl_c_is_as_before_when_nothing_is_under_way_any_more():
    before = signal.getsignal(signal.SIGINT)
    with interruptible():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_a_thread_flies_without_touching_ctrl_c():
    before, seen = signal.getsignal(signal.SIGINT), []

    def flies() -> None:
        with interruptible() as stop:
            seen.append((stop.requested, signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=flies)
    thread.start()
    thread.join()
    assert seen == [(False, before)]


@pytest.mark.parametrize("number", TERMINATIONS)
def test_every_termination_asks_for_an_end_and_none_tears_the_flight(number: signal.Signals):
    before = signal.getsignal(number)
    with interruptible() as stop:
        for _ in range(3):  # timeout(1) sends two, and so may a terminal that is closed
            signal.raise_signal(number)
        assert stop.requested and stop.signal == number and stop.terminated
        signal.raise_signal(signal.SIGINT)
        assert stop.signal == number and not stop.insisted
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", TERMINATIONS)
def test_what_is_ignored_from_the_first_stays_ignored(number: signal.Signals, monkeypatch: pytest.MonkeyPatch):
    before = signal.signal(number, signal.SIG_IGN)  # as nohup does
    try:
        with interruptible() as stop:
            signal.raise_signal(number)
            assert not stop.requested
        end_cleanly()
        signal.raise_signal(number)
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_where_a_second_ctrl_c_is_looked_for_the_third_is_pythons_own():
    with interruptible(again=True) as stop:
        signal.raise_signal(signal.SIGINT)
        assert stop.requested and not stop.insisted and not stop.terminated
        signal.raise_signal(signal.SIGINT)
        assert stop.insisted
        signal.raise_signal(signal.SIGTERM)
        assert stop.insisted and stop.signal == signal.SIGINT
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("number", TERMINATIONS)
def test_a_process_that_ends_cleanly_runs_its_finally_and_a_second_signal_does_not_cut_that_short(
    number: signal.Signals, tmp_path: Path
):
    code = (
        "import signal\nfrom pathlib import Path\nfrom rig.core.files import replaced\n"
        "from rig.core.interrupt import end_cleanly\nend_cleanly()\n"
        "with replaced(Path('o')) as made:\n    try:\n"
        f"        signal.raise_signal({int(number)})\n    finally:\n"
        f"        signal.raise_signal({int(number)})\n        Path('finally').touch()\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (128 + number, b"")
    assert [path.name for path in tmp_path.iterdir()] == ["finally"]


STRUCK = """
import signal

NUMBER = 0

def strike(*_, **__):
    signal.raise_signal(NUMBER)

class MadeFor:
    def __init__(self, of):
        strike()

class Steps:
    def __init__(self, of):
        pass

    def step(self, bus, fcc=None, k=0):
        strike()

class Designs(Steps):
    design = strike
"""


def of_managers_step() -> None:
    block = new_block(1)
    parts = nested(block)
    load_manager("struck:Steps", np.zeros(S, PARAMS), TRUSTED).step(block, parts["bus"], parts["fcc"], 0)


def of_manager_made() -> None:
    load_manager("struck:MadeFor", np.zeros(S, PARAMS), TRUSTED)


def of_design() -> None:
    designed("struck:Designs", HealthyData("pitch_rate", (), (), 100.0, 1.0, False, 0.0))


def of_law_made() -> None:
    law("struck:MadeFor")


def of_laws_step() -> None:
    made, asked, answer = law("struck:Steps"), np.zeros(1, LAW_INPUT), np.zeros(1, OUTPUT)
    made.failure(made.step(asked.ctypes.data, answer.ctypes.data))


def law(name: str) -> PythonLaw:
    unit: Any = SimpleNamespace(law=name, folder=Path(), source="unit.toml")
    made = PythonLaw(unit)
    made.open(np.zeros(1, CONFIG))
    return made


def of_plant() -> None:
    simulate(import_module("struck").strike, Call(seed=1, duration_s=1.0, rate_hz=10.0, inputs={}, shapes={}))


def of_run_of_campaign() -> None:
    run: Any = SimpleNamespace(number=0, data={"seed": 0}, aircraft="f16", scenario=import_module("struck").strike)
    orders: Any = SimpleNamespace(timeout_s=60.0, unit=None)
    fly_run(run, orders)


PLACES = [of_managers_step, of_manager_made, of_design, of_law_made, of_laws_step, of_plant, of_run_of_campaign]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("place", PLACES)
def test_a_signal_that_comes_in_the_code_of_a_user_ends_the_process_and_is_no_error_of_that_code(
    place: Callable[[], None], number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "struck.py").write_text(STRUCK.replace("NUMBER = 0", f"NUMBER = {int(number)}"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "struck", raising=False)
    end_cleanly()
    with pytest.raises(SystemExit if number == signal.SIGTERM else KeyboardInterrupt) as raised:
        place()
    assert number == signal.SIGINT or raised.value.args == (143,)


@pytest.mark.parametrize("number", [signal.SIGINT, *TERMINATIONS])
def test_a_flight_of_this_process_that_is_asked_to_end_leaves_a_finished_log(number: signal.Signals, tmp_path: Path):
    """Paced, so that it is under way; the signal comes when its log is there."""

    def strike() -> None:
        deadline = time.monotonic() + 50
        while not any(path.stat().st_size > 20_000 for path in tmp_path.glob("*.mcap")):
            if time.monotonic() > deadline:
                return
            time.sleep(0.02)
        os.kill(os.getpid(), number)

    hand = threading.Thread(target=strike)
    hand.start()
    flight = rig.fly(overrides=["duration_s=60"], out=tmp_path, realtime_factor=1.0)
    hand.join()
    log = read_log(flight.log)
    assert log.result is not None and log.result["end_reason"] == "interrupted" and flight.survived
    assert 0 < len(log.rows) == flight.frames < 6000


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, *TERMINATIONS])
def test_a_flight_that_is_asked_to_end_leaves_a_finished_log(number: signal.Signals, tmp_path: Path):
    """Paced, so that it is under way; the signal comes when its log is there."""
    command = [sys.executable, "-m", "rig", "fly", "--set", "duration_s=60", "--realtime-factor", "1", "--json"]
    begun = subprocess.Popen([*command, "--out", "logs"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 120
    while not any(path.stat().st_size > 20_000 for path in tmp_path.glob("logs/*.mcap")):
        assert begun.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    begun.send_signal(number)
    said, errors = begun.communicate(timeout=60)
    assert (begun.returncode, errors) == (0, b"")
    flown = json.loads(said)
    assert flown["end_reason"] == "interrupted" and flown["survived"]
    log = read_log(tmp_path / flown["log"])
    assert log.result is not None and log.result["end_reason"] == "interrupted"
    assert 0 < len(log.rows) == flown["frames"] < 6000
