"""Shortcuts through numba: the same code with and without, in a process of their own, since they stay."""

import math
import os
import re
import subprocess
import sys
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rig.core.compile_shortcuts import take_shortcuts
from rig.core.kernel_library import InnerCompiler, compiler
from rig.core.kernels import Kernel, compile_inner, type_of

pytestmark = pytest.mark.skipif(
    bool(os.environ.get("NUMBA_DISABLE_JIT")) or compiler(inner=True) is not InnerCompiler,
    reason="kernels are interpreted, or not tested with this numba",
)


class Rule(IntEnum):
    NONE = 0
    FAR = 1


class Data(NamedTuple):
    rows: Any
    gain: Any


def nearest(values, x, n):
    found, least = -1, math.inf
    for k in range(n):
        if abs(values[k] - x) < least:
            found, least = k, abs(values[k] - x)
    return found, least


def step(row, data, k):
    """Records, views, tuples, an enum, a branch that is never taken, loops that leave early."""
    place, far = NEAREST(row["x"], data.gain[k % 2], len(row["x"]))
    held = data.rows[k]
    for c in range(3):
        if not np.isfinite(row["x"][c]):
            continue
        if held["on"] and c == place:
            break
        held["total"] += max(row["x"][c], 0.5) * (2 if k > 1 else 1) // 1
        row["seen"] |= 1 << c
    if data.gain is None:
        held["total"] = 0.0
    row["rule"] = Rule.FAR if far > 1.0 else Rule.NONE
    return far / max(1, place)


NEAREST: Any = Kernel(nearest)
ROW = np.dtype([("x", "f8", 3), ("seen", "i8"), ("rule", "i1")], align=True)
HELD = np.dtype([("total", "f8"), ("on", "?")], align=True)


def code() -> str:
    """Compile all again; return LLVM's code without the numbers that numba gives kernels and types."""
    global NEAREST
    NEAREST, stepped = Kernel(nearest), Kernel(step)
    arguments = np.zeros(1, ROW)[0], Data(np.zeros(4, HELD), (0.5, 2.0)), 3
    compile_inner(stepped, *arguments)
    made = stepped.inner.overloads[tuple(map(type_of, arguments))]
    text = re.sub(r"RecordILi\d+E|B\d+v\d+|\$\d+", "", made.library.get_llvm_str())
    return "\n".join(sorted(text.splitlines()))


@pytest.mark.long
def test_with_shortcuts_a_kernel_has_the_same_code(tmp_path: Path):
    ran = subprocess.run(
        [sys.executable, __file__],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
    )
    assert ran.stdout == "equal by fewer passes", ran.stderr


def test_with_another_numba_nothing_is_changed(monkeypatch: pytest.MonkeyPatch):
    from numba.core.types.functions import BaseFunction

    before: Any = BaseFunction.get_call_type
    monkeypatch.setattr("rig.core.compile_shortcuts.TESTED", frozenset())
    take_shortcuts()
    assert BaseFunction.get_call_type is before and "define_pipelines" not in vars(InnerCompiler)


if __name__ == "__main__":
    from rig.core import kernel_cache

    cache: Any = kernel_cache.KernelCache
    cache._read = lambda *_: None
    plain = code()
    assert "nearest" in plain and "double" in plain
    take_shortcuts()
    sys.stdout.write("equal " if code() == plain else "different ")
    sys.stdout.write("by fewer passes" if "define_pipelines" in vars(InnerCompiler) else "by the same passes")
