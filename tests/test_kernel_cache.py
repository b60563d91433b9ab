"""Compiled kernels on disk: an edit compiles what it reaches and nothing else."""

import hashlib
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from rig.core.kernel_cache import reach
from rig.core.kernel_locks import give_all_back, give_back, take

_MODULE = """
from rig.core.kernels import kernel
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
from rig.core.kernels import kernel

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


@pytest.mark.long
def test_an_edit_compiles_what_reaches_it_and_nothing_else(tmp_path: Path):
    assert _run(tmp_path) == ([3.0, 3.0], {"outer", "inner", "other", "apart"})
    assert _run(tmp_path, PYTHONHASHSEED="7") == ([3.0, 3.0], set())
    text = _MODULE.replace("Docstring.", "Another text.").replace("# comment", "# comment\n    # and one line more")
    assert _run(tmp_path, text) == ([3.0, 3.0], set())
    assert _run(tmp_path, _MODULE.replace("LIMIT = 2.0", "LIMIT = 5.0")) == ([6.0, 3.0], {"outer"})
    deep = _HELPER.replace("x - GAIN", "x - GAIN - 1.0")
    assert _run(tmp_path, helper=deep) == ([2.0, 3.0], {"outer", "other"})
    assert _run(tmp_path) == ([3.0, 3.0], set())  # both states are kept


@pytest.mark.long
def test_an_inlined_kernel_is_compiled_with_its_caller_alone_and_an_edit_of_it_compiles_that_again(tmp_path: Path):
    names = {"import kernel": "import inlined, kernel", "@kernel\ndef inner": "@inlined\ndef inner"}
    inlined = _HELPER
    for old, new in names.items():
        inlined = inlined.replace(old, new)
    assert _run(tmp_path, helper=inlined) == ([3.0, 3.0], {"outer", "other", "apart"})
    assert _run(tmp_path, helper=inlined) == ([3.0, 3.0], set())
    assert _run(tmp_path, helper=inlined.replace("x * GAIN", "x * GAIN + 1.0")) == ([4.0, 3.0], {"outer"})


@pytest.mark.long
def test_a_checkout_elsewhere_uses_what_is_equal(tmp_path: Path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    shared = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    _run(first, **shared)
    assert _run(second, **shared) == ([3.0, 3.0], set())


@pytest.mark.long
def test_a_file_that_is_cut_short_is_compiled_again(tmp_path: Path):
    _run(tmp_path)
    for path in (tmp_path / "cache").glob("*/apart-*"):
        path.write_bytes(path.read_bytes()[:100])
    assert _run(tmp_path) == ([3.0, 3.0], {"apart"})
    assert _run(tmp_path) == ([3.0, 3.0], set())


@pytest.mark.long
def test_a_file_that_is_damaged_in_any_way_is_compiled_again_and_never_run(tmp_path: Path):
    _run(tmp_path)
    (path,), (other,) = ([*(tmp_path / "cache").glob(f"*/{name}-*")] for name in ("apart", "other"))
    whole = path.read_bytes()
    rng = Random(1)
    flipped = bytearray(whole)
    flipped[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
    something_else = pickle.dumps([1, 2, 3])
    checked = hashlib.sha256(path.name.encode() + b"\0" + something_else).digest() + something_else
    for data in (bytes(flipped), bytes(len(whole)), b"", something_else, whole[32:], checked, other.read_bytes()):
        path.write_bytes(data)
        assert _run(tmp_path) == ([3.0, 3.0], {"apart"})
    assert _run(tmp_path) == ([3.0, 3.0], set())


@pytest.mark.long
def test_where_the_folder_cannot_be_written_kernels_are_compiled_with_a_note(tmp_path: Path):
    (tmp_path / "module.py").write_text(_MODULE)
    (tmp_path / "helper.py").write_text(_HELPER)
    (tmp_path / "cache").write_text("a file")
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache" / "below"), "PYTHONPATH": str(tmp_path)}
    env.pop("NUMBA_DISABLE_JIT", None)
    command = [sys.executable, "-c", "import module; print(module.outer(1.0), module.apart(1.0))"]
    done = subprocess.run(command, env=env, capture_output=True, check=True, text=True)
    assert done.stdout == "3.0 3.0\n" and done.stderr.count("\n") == 1
    assert "cannot be written" in done.stderr and "RIG_CACHE_DIR or XDG_CACHE_HOME" in done.stderr


@pytest.mark.long
def test_of_processes_that_need_the_same_kernels_each_is_compiled_by_one(tmp_path: Path):
    (tmp_path / "module.py").write_text(_MODULE)
    (tmp_path / "helper.py").write_text(_HELPER)
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    env.pop("NUMBA_DISABLE_JIT", None)
    command = [sys.executable, "-c", _RUN, str(tmp_path)]
    begun = [subprocess.Popen(command, env=env, stdout=subprocess.PIPE) for _ in range(3)]
    said = [json.loads(process.communicate(timeout=300)[0]) for process in begun]
    assert [results for results, _ in said] == [[3.0, 3.0]] * 3
    assert sorted(name for _, compiled in said for name in compiled) == ["apart", "inner", "other", "outer"]


@pytest.mark.long
def test_python_may_call_a_kernel_that_another_has_had_compiled(tmp_path: Path):
    calls = "import module, helper; print(module.outer(1.0), helper.inner(1.0), helper.inner(2), module.outer(2.0))"
    for _ in range(2):  # compiled, then loaded
        _run(tmp_path)
        env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
        said = subprocess.run([sys.executable, "-c", calls], env=env, capture_output=True, check=True, text=True)
        assert said.stdout.split() == ["3.0", "4.0", "8.0", "8.0"]


def test_a_lock_excludes_another_process_and_ends_with_its_own_however_that_ends(tmp_path: Path):
    code = "import sys; from pathlib import Path; from rig.core.kernel_locks import take; "
    code += "print(take(Path(sys.argv[1]), sys.argv[2], wait=False), flush=True); input()"

    def other(name: str) -> tuple[bool, subprocess.Popen[bytes]]:
        command = [sys.executable, "-c", code, str(tmp_path), name]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert process.stdout is not None
        return process.stdout.readline() == b"True\n", process

    taken, process = other("one")
    assert taken and not take(tmp_path, "one", wait=False) and take(tmp_path, "two", wait=False)
    process.kill()
    process.communicate()
    assert take(tmp_path, "one")
    for name, free in (("one", False), ("two", False), ("three", True)):
        taken, process = other(name)
        process.communicate(b"\n")
        assert taken == free
    give_back("one")
    taken, process = other("one")
    process.communicate(b"\n")
    assert taken
    give_all_back()


@pytest.mark.long
def test_what_does_not_compile_keeps_no_process_waiting(tmp_path: Path):
    bad = _MODULE.replace("x * 3.0", "x * 3.0 + len([x])")
    (tmp_path / "module.py").write_text(bad)
    (tmp_path / "helper.py").write_text(_HELPER)
    code = "import module\ntry:\n    module.apart(1.0)\nexcept Exception: pass\n"
    code += "from rig.core.kernel_locks import _held\nprint(len(_held))"
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    said = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True, text=True)
    assert said.stdout == "0\n"


@pytest.mark.parametrize("constant", [1, 1.0, "one", (1, 2.0), None])
def test_the_key_holds_constants_with_their_types(constant: object):
    def function() -> object:
        return constant

    def other() -> object:
        return constant

    assert reach(function) != reach(other)  # by name
    assert len(reach(function)) == 64
