"""Cases on several processes: in their order, and an interruption does not wait for all of them."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor
from typing import Any

import pytest

from rig.studies.campaign.pool import by_workers, each

SLOW = """
import sys, time
from pathlib import Path
from rig.core.interrupt import end_cleanly
from rig.studies.campaign.pool import each

def fly(case):
    Path("begun").touch()
    time.sleep(0.2)
    return case

end_cleanly()
list(each(fly, range(1000), 2))
"""


def double(case: int) -> int:
    return 2 * case


def test_results_come_in_the_order_of_the_cases():
    assert list(each(double, range(20), 2)) == [2 * case for case in range(20)]


class Adds:
    made = 0

    def __init__(self, more: int) -> None:
        self.more = more
        Adds.made += 1

    def __call__(self, case: int) -> tuple[int, int, int]:
        return case + self.more, Adds.made, os.getpid()


def test_a_worker_is_made_once_in_each_process_and_a_single_one_in_this():
    sums, made, processes = zip(*by_workers(Adds, (100,), range(20), 2, 3), strict=True)
    assert sums == tuple(range(100, 120)) and set(made) == {1} and os.getpid() not in processes
    assert list(by_workers(Adds, (1,), [1, 2], 1)) == [(2, 1, os.getpid()), (3, 1, os.getpid())]


def test_a_termination_does_not_wait_for_the_cases_that_have_not_begun(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", SLOW], cwd=tmp_path, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 30
    while not (tmp_path / "begun").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGTERM)
    assert process.wait(timeout=20) == 128 + signal.SIGTERM


DEAD = """
import os, signal, time
from concurrent.futures import BrokenExecutor
from rig.studies.campaign.pool import each

def fly(case):
    if case == 5:
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(60.0 if case == 4 else 0.0)
    return case

try:
    list(each(fly, range(1000), 2))
except BrokenExecutor:
    raise SystemExit(7) from None
"""


def test_a_worker_that_is_killed_ends_the_others_and_is_told(tmp_path):
    """The executor ends those that are left by SIGTERM, which workers must not leave to their parent."""
    process = subprocess.Popen([sys.executable, "-c", DEAD], cwd=tmp_path)
    try:
        assert process.wait(timeout=20) == 7
    finally:
        process.kill()


def test_ctrl_c_while_cases_are_handed_out_is_heeded_after_it_and_python_has_its_handler_back(
    monkeypatch: pytest.MonkeyPatch,
):
    """One that lands within the executor leaves the lock of its queue held: the process never ended."""
    submit, handed = ProcessPoolExecutor.submit, []

    def pressed(executor: ProcessPoolExecutor, *task: Any) -> Future[Any]:
        if len(handed) == 5:
            signal.raise_signal(signal.SIGINT)
        handed.append(task)
        return submit(executor, *task)

    monkeypatch.setattr(ProcessPoolExecutor, "submit", pressed)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        list(each(double, range(20), 2))
    assert signal.getsignal(signal.SIGINT) is before and 5 < len(handed) < 20
