"""Work on threads: in order, and over soon after an error, an interruption, or a reader who has enough."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from rig.core.threads import Ended, heed, on_threads


def until_told(begun: threading.Event, seen: list[int]):
    """Return work of which all but the first item goes on for seconds, and heeds."""

    def work(item: int) -> int:
        seen.append(item)
        if item:
            begun.set()
            try:
                ends = time.monotonic() + 3.0
                while time.monotonic() < ends:
                    heed()
                    time.sleep(0.001)
            except Ended:
                seen.append(-item)
                raise
        return item

    return work


@pytest.mark.parametrize("threads", [1, 3, 50])
def test_results_come_in_the_order_of_the_items(threads: int):
    def work(item: int) -> int:
        time.sleep(0.01 if item % 2 == 0 else 0.0)
        return item * item

    assert list(on_threads(range(7), work, threads)) == [item * item for item in range(7)]


def test_nothing_is_done_where_there_is_nothing_to_do():
    assert list(on_threads([], pytest.fail, 2)) == []


@pytest.mark.parametrize("end", [KeyboardInterrupt, SystemExit, ValueError])
def test_what_runs_ends_where_it_heeds_and_nothing_more_begins(
    end: type[BaseException], monkeypatch: pytest.MonkeyPatch
):
    def on_a_busy_machine(pool: ThreadPoolExecutor, **how: bool) -> None:
        time.sleep(0.05)
        shutdown(pool, **how)

    shutdown = ThreadPoolExecutor.shutdown
    monkeypatch.setattr(ThreadPoolExecutor, "shutdown", on_a_busy_machine)
    begun, seen = threading.Event(), list[int]()
    work = on_threads(range(100), until_told(begun, seen), 2)
    assert next(work) == 0
    assert begun.wait(10.0)
    with pytest.raises(end):
        work.throw(end())
    assert seen[0] == 0 and len(seen) <= 5 and {-item for item in seen if item > 0} == {i for i in seen if i < 0}


def test_an_error_of_one_ends_the_others():
    begun, seen = threading.Event(), list[int]()
    others = until_told(begun, seen)

    def work(item: int) -> int:
        if item == 0 and begun.wait(10.0):
            raise ValueError("the first")
        return others(item)

    with pytest.raises(ValueError, match="the first"):
        list(on_threads(range(100), work, 2))
    assert len(seen) <= 4 and min(seen) < 0


def test_elsewhere_no_listener_is_told():
    heed()
    assert list(on_threads([1, 2], lambda item: (heed(), item)[1], 2)) == [1, 2]
    heed()
