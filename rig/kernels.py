"""How kernels are compiled: ``@kernel`` is numba's njit with a cache that notices every edit (kernel_cache.py).

With ``NUMBA_DISABLE_JIT=1`` kernels are plain Python.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core.types import BaseTuple, NamedTuple

from rig.kernel_cache import KernelCache, folder

F = TypeVar("F", bound=Callable[..., object])


def cache_root() -> Path:
    """Where generated files may be kept between flights; RIG_CACHE_DIR overrides it."""
    named = os.environ.get("RIG_CACHE_DIR")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jsbsim-rig"


def kernel(function: F) -> F:
    """Compile ``function`` for the frame loop: no Python objects, no exceptions on division, no allocation.

    Without numba's runtime an allocation does not compile, and views of a row's fields cost no counting.
    """
    return _compiled(function, nogil=False)


def long_kernel(function: F) -> F:
    """``kernel`` for a loop over many frames: other threads run meanwhile, for a tenth of a microsecond a call."""
    return _compiled(function, nogil=True)


def _compiled(function: F, *, nogil: bool) -> F:
    options: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "nogil": nogil}
    made: Any = numba.njit(**options)(function)
    if hasattr(made, "py_func"):
        made._cache = KernelCache(function, folder(cache_root()), repr(options))
    return made


def bind(function: F, *arguments: object) -> F:
    """Compile ``function`` for the types of ``arguments``, without numba's look-up of types at every call.

    That look-up costs more than most kernels.  The caller promises the same types ever after: a block of
    any length, the arrays that it keeps.  With ``NUMBA_DISABLE_JIT=1`` it is ``function`` itself.
    """
    if not hasattr(function, "overloads"):
        return function
    key = function, _kind(arguments)
    if key not in _bound:
        types = tuple(map(_typeof, arguments))
        dispatcher: Any = function
        dispatcher.compile(types)
        _bound[key] = dispatcher.overloads[types].entry_point
    return _bound[key]


_bound: dict[tuple[Any, Any], Any] = {}  # entry points, by function and kinds of arguments


def _kind(argument: Any) -> Any:
    """Return the key of an argument's type: numba's own answer costs a flight a millisecond."""
    if isinstance(argument, tuple):
        return type(argument), *map(_kind, argument)  # the class alone does not tell what a named tuple holds
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    return argument.dtype if isinstance(argument, np.void) else type(argument)


_records: dict[tuple[Any, ...], Any] = {}  # numba's types of structured arrays, by what decides them


def _typeof(argument: Any) -> Any:
    """``numba.typeof``, which works a structured dtype out again each time: half the cost of a flight's start."""
    if isinstance(argument, tuple):
        held = tuple(map(_typeof, argument))
        return NamedTuple(held, type(argument)) if hasattr(argument, "_fields") else BaseTuple.from_types(held)
    if not isinstance(argument, np.ndarray) or argument.dtype.names is None:
        return numba.typeof(argument)
    flags = argument.flags
    key = (argument.dtype, argument.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned)
    if key not in _records:
        _records[key] = numba.typeof(argument)
    return _records[key]
