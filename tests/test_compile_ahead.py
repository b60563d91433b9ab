"""A flight's kernels compiled by processes of their own: which, when, and that they end with who asked for them."""

import hashlib
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from rig.computer.lanes.think import follow_votes
from rig.computer.redundancy.compare import sort
from rig.core import kernel_cache, kernel_locks
from rig.studies.campaign import compile_ahead
from rig.studies.campaign.compile_ahead import PARTS, Ahead

pytestmark = pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Parts for which a process is started, which are not compiled."""
    parts: list[str] = []

    @contextmanager
    def child(part: str, told: int) -> Iterator[None]:
        parts.append(part)
        os.write(told, b"rig.computer.lanes.think:follow_votes\nnobody:nothing\n")
        yield

    monkeypatch.setattr(compile_ahead, "_child", child)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return parts


@pytest.mark.parametrize(("count", "parts"), [(1, PARTS[:1]), (2, PARTS), (64, PARTS)])
def test_two_processes_compile_where_there_are_two_cores(
    count: int, parts: tuple[str, ...], started: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setattr(compile_ahead, "cores", lambda: count)
    ahead = Ahead(lambda done, total: None)
    for _ in range(2):  # what they leave out is compiled here
        ahead.compile_missing(follow_votes.py_func, tmp_path / "none")  # pyright: ignore
    assert tuple(started) == parts


def test_what_is_no_part_of_a_flight_starts_none(started: list[str], tmp_path: Path):
    Ahead(lambda done, total: None).compile_missing(test_what_is_no_part_of_a_flight_starts_none, tmp_path / "none")
    assert started == []


def test_what_another_pair_has_made_meanwhile_starts_none(started: list[str], tmp_path: Path):
    (tmp_path / "made").touch()
    Ahead(lambda done, total: None).compile_missing(sort.py_func, tmp_path / "made")  # pyright: ignore
    assert started == []


def test_a_kernel_that_is_compiled_counts_with_all_that_it_reaches(started: list[str], tmp_path: Path):
    shown: list[tuple[int, int]] = []
    Ahead(lambda done, total: shown.append((done, total))).compile_missing(follow_votes.py_func, tmp_path / "none")  # pyright: ignore
    count = len(kernel_cache.reached(follow_votes.py_func))  # pyright: ignore
    assert shown[0][0] == 0 and shown[1][0] == count and 100 < count < shown[1][1] == len(compile_ahead._of_flight())


def test_processes_that_fail_leave_the_work_to_the_caller(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(compile_ahead, "_CHILD", "raise SystemExit(1)")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    Ahead(lambda done, total: None).compile_missing(follow_votes.py_func, tmp_path / "none")  # pyright: ignore
    assert [path.name for path in tmp_path.iterdir()] == ["locks"] and not kernel_locks._held


def test_nothing_but_what_a_flights_kernels_reach_decides_their_keys(monkeypatch: pytest.MonkeyPatch):
    """So the help text of a command, or any text, compiles nothing."""

    def never() -> str:
        raise AssertionError

    monkeypatch.setattr(kernel_cache, "_all_sources", never)
    kernel_cache._own_parts.cache_clear()
    for function in compile_ahead._of_flight().values():
        kernel_cache.reach.__wrapped__(function)
        assert not function.__module__.startswith("rig.cli")
    assert len(compile_ahead._of_flight()) > 200


_HEEDS = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored from the first
from rig.cli.main import main
main()
"""


@pytest.mark.long
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_an_interruption_ends_the_first_flight_at_once(number: signal.Signals, code: int, tmp_path: Path):
    """With an empty cache, and nothing damaged in it afterwards."""
    env = {**os.environ, "RIG_CACHE_DIR": str(tmp_path / "cache")}
    env.pop("NUMBA_CACHE_DIR", None)
    begun = subprocess.Popen(
        [sys.executable, "-c", _HEEDS, "fly", "--set", "duration_s=1"],
        cwd=tmp_path,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 120
    kernels = lambda: [path for path in tmp_path.glob("cache/kernels/*/*") if path.suffix == ""]  # noqa: E731
    while len(kernels()) < 3:
        assert begun.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    children = psutil.Process(begun.pid).children(recursive=True)
    begun.send_signal(number)
    said, errors = begun.communicate(timeout=20)
    assert (begun.returncode, said) == (code, b"") and errors.count(b"\n") == 1
    assert len(children) == len(PARTS[: compile_ahead.cores()]) and psutil.wait_procs(children, timeout=20)[1] == []
    for path in kernels():
        digest, kept = path.read_bytes()[:32], path.read_bytes()[32:]
        assert digest == hashlib.sha256(path.name.encode() + b"\0" + kept).digest() and pickle.loads(kept)
    assert not list(tmp_path.glob("logs/*"))
