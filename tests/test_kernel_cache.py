"""Compiled kernels on disk: an edit compiles what it reaches and nothing else."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rig.kernel_cache import reach

_MODULE = """
from rig.kernels import kernel
import helper
from helper import inner

LIMIT = 2.0


@kernel
def outer(x):
    \"\"\"Docstring.\"\"\"
    # comment
    return inner(x) + LIMIT + helper.other(x)


@kernel
def apart(x):
    return x * 3.0
"""
_HELPER = """
from rig.kernels import kernel

GAIN = 4.0


@kernel
def inner(x):
    return x * GAIN


@kernel
def other(x):
    return x - GAIN
"""
_RUN = """
import json, sys
sys.path.insert(0, sys.argv[1])
import numba.core.event as event
import module
compiled = []
class Seen(event.Listener):
    def on_start(self, e): compiled.append(e.data["dispatcher"].py_func.__name__)
    def on_end(self, e): pass
with event.install_listener("numba:compile", Seen()):
    results = module.outer(1.0), module.apart(1.0)
print(json.dumps([results, compiled]))
"""


def _run(
    folder: Path, module: str = _MODULE, helper: str = _HELPER, **environment: str
) -> tuple[list[float], set[str]]:
    (folder / "module.py").write_text(module)
    (folder / "helper.py").write_text(helper)
    env = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    env.pop("NUMBA_DISABLE_JIT", None)
    command = [sys.executable, "-c", _RUN, str(folder)]
    results, compiled = json.loads(subprocess.run(command, env=env, capture_output=True, check=True).stdout)
    return results, set(compiled)


def test_an_edit_compiles_what_reaches_it_and_nothing_else(tmp_path: Path):
    assert _run(tmp_path) == ([3.0, 3.0], {"outer", "inner", "other", "apart"})
    assert _run(tmp_path, PYTHONHASHSEED="7") == ([3.0, 3.0], set())
    text = _MODULE.replace("Docstring.", "Another text.").replace("# comment", "# comment\n    # and one line more")
    assert _run(tmp_path, text) == ([3.0, 3.0], set())
    assert _run(tmp_path, _MODULE.replace("LIMIT = 2.0", "LIMIT = 5.0")) == ([6.0, 3.0], {"outer"})
    deep = _HELPER.replace("x - GAIN", "x - GAIN - 1.0")
    assert _run(tmp_path, helper=deep) == ([2.0, 3.0], {"outer", "other"})
    assert _run(tmp_path) == ([3.0, 3.0], set())  # both states are kept


def test_a_checkout_elsewhere_uses_what_is_equal(tmp_path: Path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    shared = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    _run(first, **shared)
    assert _run(second, **shared) == ([3.0, 3.0], set())


def test_a_file_that_is_cut_short_is_compiled_again(tmp_path: Path):
    _run(tmp_path)
    for path in (tmp_path / "cache").glob("*/apart-*"):
        path.write_bytes(path.read_bytes()[:100])
    assert _run(tmp_path) == ([3.0, 3.0], {"apart"})
    assert _run(tmp_path) == ([3.0, 3.0], set())


@pytest.mark.parametrize("constant", [1, 1.0, "one", (1, 2.0), None])
def test_the_key_holds_constants_with_their_types(constant: object):
    def function() -> object:
        return constant

    def other() -> object:
        return constant

    assert reach(function) != reach(other)  # by name
    assert len(reach(function)) == 64
