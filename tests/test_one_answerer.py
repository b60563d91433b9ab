"""Each question has one room that answers it: who runs the computer over rows."""

import ast
from collections.abc import Iterator
from pathlib import Path

import rig

HOME = Path(rig.__file__).parent
# The kernels that decide on a row, and the files that may call them besides their own room.
DECIDES = {"vote_signals", "manage", "manage_signal"}
CALLERS = {
    "loop.py",  # a flight
    "bench/run.py",  # all rows that are not being flown
    "flight/frame_cost.py",  # times the stages of a flight one by one
}


def _calls(names: set[str]) -> Iterator[str]:
    for path in sorted(HOME.rglob("*.py")):
        room = path.relative_to(HOME).as_posix()
        if room.startswith("computer/redundancy/"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names:
                yield room


def test_the_managers_kernel_is_called_by_the_loop_and_the_bench_alone():
    called = list(_calls(DECIDES))
    assert set(called) == CALLERS
    assert called.count("bench/run.py") == called.count("loop.py") == 1


def test_all_drivers_of_the_bench_go_through_one_step():
    kernels = {
        path.relative_to(HOME).as_posix()
        for path in sorted(HOME.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == "rig.bench.run"
    }
    expected = {"bench/vote.py", "bench/inject.py", "bench/trials.py", "bench/splitting.py", "bench/unit_check.py"}
    assert expected | {"replay/vote_again.py", "thresholds/monitored.py"} <= kernels
