"""The start of a unit: when all that takes long has been done, so that its first frame follows at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from unit_files import needs_a_compiler, unit

from rig.unit.running_unit import running

LATE = """
import json, sys
import rig
from rig.core.kernel_cache import KernelCache
from rig.unit.running_unit import UnitUnderTest

asked, started = [], []
load, begin = KernelCache._load_overload, UnitUnderTest.begin


def noted(self, *arguments):
    asked.append((self._name, bool(started)))
    return load(self, *arguments)


def begins(self, *arguments):
    started.append(self._link is None)
    return begin(self, *arguments)


KernelCache._load_overload, UnitUnderTest.begin = noted, begins
rig.fly(overrides=json.loads(sys.argv[2]), out=".", unit=sys.argv[1], lane=sys.argv[3] or None)
print(json.dumps([started, len(asked), [name for name, late in asked if late]]))
"""
CASES = {
    "alone": (["duration_s=2"], ""),
    "one of four, with servos": (["duration_s=2", "computers.count=4", "actuators.model=servo"], "B"),
}


@needs_a_compiler
@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
@pytest.mark.parametrize("case", [pytest.param("alone", marks=pytest.mark.long), "one of four, with servos"])
def test_no_kernel_is_compiled_or_loaded_once_the_unit_runs(tmp_path: Path, case: str):
    sets, lane = CASES[case]
    path = os.pathsep.join(filter(None, sys.path))
    command = [sys.executable, "-c", LATE, unit(tmp_path).unit_file, json.dumps(sets), lane]
    env = {**os.environ, "PYTHONPATH": path}
    out = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=900, check=True)
    started, kernels, late = json.loads(out.stdout.splitlines()[-1])
    assert started == [True] and kernels > 5 and late == []


@needs_a_compiler
def test_a_unit_that_is_not_flown_is_not_started(tmp_path: Path, monkeypatch):
    def started(*_: object) -> None:
        raise AssertionError("started")

    monkeypatch.setattr("rig.unit.transport.UnitProcess", started)
    with running(unit(tmp_path)) as tested:
        assert tested.printed == ""
