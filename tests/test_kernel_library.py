"""Kernels that only kernels call: no machine code of their own, the same values in the kernel that Python calls."""

import math
from typing import Any

import numpy as np
import pytest
from numba.core import config

from rig.core.kernel_library import InnerCompiler, InnerLibrary, OuterLibrary, compiler
from rig.core.kernels import compile_inner, kernel

jit: Any = config
pytestmark = pytest.mark.skipif(bool(jit.DISABLE_JIT), reason="kernels are interpreted")
with_insides = pytest.mark.skipif(compiler(inner=True) is not InnerCompiler, reason="not tested with this numba")


@kernel
def rate(x, gain):
    return math.sin(x) * gain


@kernel
def summed(values, gain):
    total = 0.0
    for k in range(len(values)):
        total += rate(values[k], gain)
    return total


@pytest.fixture(autouse=True)
def own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """Kernels are compiled here, and kept nowhere else."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))


def compiled(function: Any, form: str) -> Any:
    (made,) = getattr(function, form).overloads.values()
    return made


@with_insides
def test_a_kernel_that_python_calls_has_machine_code_and_those_that_it_calls_have_none():
    values = np.linspace(-3.0, 3.0, 101)
    expected = 0.0
    for x in values:
        expected += math.sin(x) * 0.7
    assert summed(values, 0.7) == expected
    made = compiled(rate, "inner")
    inner, outer = made.library, compiled(summed, "outer").library
    assert isinstance(inner, InnerLibrary) and not isinstance(outer, InnerLibrary)
    assert inner.get_pointer_to_function(made.fndesc.llvm_func_name) == 0
    assert made.fndesc.llvm_func_name in {function.name for function in inner.get_defined_functions()}


@with_insides
def test_what_a_cache_keeps_of_it_is_code_that_llvm_reads_and_no_machine_code():
    compile_inner(rate, 1.0, 2.0)
    name, kind, code = compiled(rate, "inner").library.serialize_using_object_code()
    assert (name, kind) == ("rate", "bitcode") and code.startswith(b"BC\xc0\xde")


@with_insides
def test_of_a_kernel_that_python_calls_no_kernel_in_it_is_seen_from_outside():
    assert summed(np.ones(3), 0.5) == 3 * (math.sin(1.0) * 0.5)
    made = compiled(summed, "outer")
    seen = {function.name for function in made.library.get_defined_functions() if function.linkage.name != "internal"}
    assert made.fndesc.llvm_func_name in seen and not any("rate" in name for name in seen)


def test_with_another_numba_every_kernel_is_compiled_like_all(monkeypatch: pytest.MonkeyPatch):
    @kernel
    def doubled(x):
        return 2.0 * x

    monkeypatch.setattr("rig.core.kernel_library.TESTED", frozenset())
    compile_inner(doubled, 1.0)
    assert doubled(2.0) == 4.0
    assert not isinstance(compiled(doubled, "inner").library, InnerLibrary)
    assert not isinstance(compiled(doubled, "outer").library, OuterLibrary)
