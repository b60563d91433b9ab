"""Compilation of kernels: ``@kernel`` is numba's njit with a cache that detects every edit (kernel_cache.py).

With ``NUMBA_DISABLE_JIT=1`` kernels are plain Python.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import config
from numba.core.types import BaseTuple, NamedTuple

from rig.core.errors import RigError
from rig.core.kernel_cache import REMEDY, KernelCache
from rig.core.kernel_library import InnerCompiler, compiler
from rig.core.kernel_locks import give_all_back

_config: Any = config
F = TypeVar("F", bound=Callable[..., object])


def cache_root() -> Path:
    """Return the folder for files kept between flights; RIG_CACHE_DIR overrides it."""
    named = os.environ.get("RIG_CACHE_DIR")
    if named:
        return Path(named)
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jsbsim-rig"
    except RuntimeError:  # this user has none
        raise RigError(f"no home folder for files kept between flights; {REMEDY}") from None


def kernel_folder() -> Path:
    """Return the folder of compiled kernels; NUMBA_CACHE_DIR overrides it."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    return Path(named) if named else cache_root() / "kernels"


class Kernel:
    """A compiled function, in two forms, each with its cache.

    Kernels call the form without wrappers for Python and C, which would be an eighth of the work of compiling.
    Python calls the other form, which exists only for the few kernels that Python calls.
    """

    def __init__(self, function: Callable[..., object], *, nogil: bool = False, inlined: bool = False) -> None:
        update_wrapper(self, function)
        self.py_func: Any = function
        self._nogil = nogil
        self.targetoptions = {"inline": "always" if inlined else "never"}  # where numba looks for it in a call

    @property
    def _numba_type_(self) -> Any:
        """Return the type that numba gives this object if a kernel names it."""
        return self.inner._numba_type_

    @cached_property
    def inner(self) -> Any:
        """Dispatcher of the form that kernels call; Python must not call it."""
        return _dispatcher(self.py_func, inner=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)

    @cached_property
    def outer(self) -> Any:
        """Dispatcher of the form that Python calls."""
        return _dispatcher(self.py_func, inner=False, nogil=self._nogil, no_cfunc_wrapper=True)

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel from Python, compiled for the types of the arguments."""
        try:
            return self.outer(*arguments)
        except BaseException:  # it did not compile
            give_all_back()
            raise


def _dispatcher(function: Callable[..., object], *, inner: bool, **more: bool) -> Any:
    options: dict[str, Any] = {"error_model": "numpy", "_nrt": False, **more}
    how = compiler(inner)
    made: Any = numba.njit(pipeline_class=how, **options)(function)
    made._cache = KernelCache(function, kernel_folder(), repr(options), inner=how is InnerCompiler)
    return made


def kernel(function: F) -> F:
    """Compile ``function`` for the frame loop: no Python objects, no exceptions on division, no allocation.

    Without numba's runtime an allocation does not compile, and views of a row's fields cost no counting.
    """
    return _compiled(function)


def inlined(function: F) -> F:
    """Compile as ``kernel`` does, with the statements inlined in the caller.

    numba optimises every kernel with everything that it reaches, so one that only calls others costs as much as they do
    together.
    """
    return _compiled(function, inlined=True)


def long_kernel(function: F) -> F:
    """Compile as ``kernel`` does, for a loop over many frames: other threads may run, for 0.1 us per call."""
    return _compiled(function, nogil=True)


def _compiled(function: F, **how: bool) -> F:
    made: Any = function if _config.DISABLE_JIT else Kernel(function, **how)
    return made


@kernel
def clamp(x, low, high):
    """Return ``x`` within [low, high]."""
    if x < low:
        return low
    if x > high:
        return high
    return x


def bind(function: F, *arguments: object) -> F:
    """Compile ``function`` for the types of ``arguments``, without numba's look-up of types at every call.

    That look-up costs more than most kernels.  The caller must pass the same types in every call: a block of
    any length, the arrays that it keeps.  With ``NUMBA_DISABLE_JIT=1`` it is ``function`` itself.
    """
    dispatcher: Any = getattr(function, "outer", function)
    if not hasattr(dispatcher, "overloads"):
        return function
    key = function, kind_of(arguments)
    if key not in _bound:
        _bound[key] = _compile(dispatcher, tuple(map(type_of, arguments))).entry_point
    return _bound[key]


def entry_point(function: Callable[..., object], types: tuple[Any, ...]) -> Callable[..., Any]:
    """Return a kernel compiled for numba's ``types``, as ``bind`` does for arguments; for one that ``compiles``."""
    dispatcher: Any = getattr(function, "outer", function)
    return _compile(dispatcher, types).entry_point


def compiles() -> bool:
    """Return False if kernels are plain Python."""
    return not _config.DISABLE_JIT


def compile_inner(function: Callable[..., object], *arguments: object) -> None:
    """Compile the form of ``function`` that kernels call, for the types of ``arguments``."""
    if isinstance(function, Kernel):
        _compile(function.inner, tuple(map(type_of, arguments)))


def _compile(dispatcher: Any, types: tuple[Any, ...]) -> Any:
    try:
        dispatcher.compile(types)
    except BaseException:
        give_all_back()
        raise
    return dispatcher.overloads[types]


_bound: dict[tuple[Any, Any], Any] = {}  # entry points, by function and kinds of arguments


def kind_of(argument: Any) -> Any:
    """Return a key of an argument's type: numba's own answer costs a flight a millisecond."""
    if isinstance(argument, tuple):
        return type(argument), *map(kind_of, argument)  # the class alone does not tell what a named tuple holds
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    return argument.dtype if isinstance(argument, np.void) else type(argument)


_records: dict[tuple[Any, ...], Any] = {}  # numba's types of structured arrays, by what decides them


def type_of(argument: Any) -> Any:
    """Return ``numba.typeof``; that works a structured dtype out again each time, half the cost of a flight's start."""
    if isinstance(argument, tuple):
        held = tuple(map(type_of, argument))
        return NamedTuple(held, type(argument)) if hasattr(argument, "_fields") else BaseTuple.from_types(held)
    if not isinstance(argument, np.ndarray) or argument.dtype.names is None:
        return numba.typeof(argument)
    flags = argument.flags
    key = (argument.dtype, argument.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned)
    if key not in _records:
        _records[key] = numba.typeof(argument)
    return _records[key]
