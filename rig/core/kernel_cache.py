"""Compiled kernels on disk, each under a key of everything that it reaches.

numba's cache checks the file of a kernel only, not the kernels that it calls from other files.  Here the key of
a kernel is a hash of its bytecode and constants and, recursively, of everything that its names lead to: other kernels,
constants, record types, enums.  An edit causes a new compilation of the kernels that reach it and of no others;
checkouts share equal kernels.  One file holds one kernel with one signature and replaces the old one as a whole (numba
keeps one index file for all signatures, which processes overwrite).  It begins with the SHA-256 of its name and bytes,
so that machine code damaged on the disk never runs.  If the folder cannot be written, each process compiles.  If
several processes need the same kernel, one compiles it and the others wait (kernel_locks.py).
"""

from __future__ import annotations

import hashlib
import pickle
import sys
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, Final

import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from rig.core.kernel_library import InnerResults
from rig.core.kernel_locks import give_back, take
from rig.core.notes import note

# Modules of which no edit is expected: their version, or that of Python, stands for them.
_FOREIGN: Final = frozenset({"numpy", "numba", "scipy", "llvmlite", *sys.stdlib_module_names})
_PLAIN: Final = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), range, slice)
_FORMAT: Final = "4"  # of the files
_DIGEST: Final = 32  # bytes
REMEDY: Final = "RIG_CACHE_DIR or XDG_CACHE_HOME can name another folder"
_BY_REPR: Final = ("numba.", "llvmlite.")


class KernelCache(FunctionCache):
    """The cache of one kernel, for the place of a dispatcher's ``_cache``."""

    def __init__(self, py_func: Callable[..., object], folder: Path, options: str, *, inner: bool) -> None:
        # Not numba's own: that looks for a folder to write beside the source, once for each kernel.
        self._name, self._py_func, self._cache_path = repr(py_func), py_func, str(folder)
        kind = InnerResults if inner else CompileResultCacheImpl
        self._impl = kind.__new__(kind)
        self._folder, self._options = folder, options
        self.enable()

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        if not self._enabled:
            return None
        path = self._path(sig, target_context.codegen())
        made = self._read(path, target_context)
        if made is None and (tell := _listener.get()) is not None:
            tell(self._py_func, path)
            made = self._read(path, target_context)
        if made is None and take(self._folder, path.name):
            made = self._read(path, target_context)  # of who had the lock before
            if made is not None:
                give_back(path.name)
        return made

    def _read(self, path: Path, target_context: Any) -> Any:
        try:
            held = path.read_bytes()
            if held[:_DIGEST] != _digest(path, view := memoryview(held)[_DIGEST:]):
                return None  # damaged, or of another kernel: it is compiled now
            return self._impl.rebuild(target_context, pickle.loads(view))
        except (OSError, EOFError, pickle.UnpicklingError, ImportError, AttributeError, TypeError, ValueError):
            return None  # not compiled yet, or of a type that has moved

    def _save_overload(self, sig: Any, data: Any) -> None:
        if not self._enabled:
            return
        path = self._path(sig, data.codegen)
        try:
            if not data.library.has_dynamic_globals and all(lifted.can_cache for lifted in data.lifted):
                _replace(path, dumps(self._impl.reduce(data)))  # else an address in it is of this process alone
        except OSError as error:
            note(f"{self._folder}: cannot be written ({error.strerror}): compiled code is not kept; {REMEDY}")
        finally:
            give_back(path.name)

    def _path(self, sig: Any, codegen: Any) -> Path:
        """Return the file of the kernel for a signature on this kind of processor."""
        parts = (_FORMAT, reach(self._py_func), str(sig), str(codegen.magic_tuple()), self._options)
        key = hashlib.sha256("\0".join(parts).encode()).hexdigest()
        return self._folder / key[:2] / f"{self._py_func.__name__}-{key[2:34]}"


def _digest(path: Path, data: bytes | memoryview) -> bytes:
    """Return the digest before the pickle of the kernel at ``path``."""
    digest = hashlib.sha256(path.name.encode() + b"\0")
    digest.update(data)
    return digest.digest()


def _replace(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
    try:
        draft.write_bytes(_digest(path, data) + data)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


Missing = Callable[[Callable[..., object], Path], None]  # a function, the file that it is not in
_listener: ContextVar[Missing | None] = ContextVar("listener", default=None)


@contextmanager
def before_compiling(tell: Missing) -> Iterator[None]:
    """Call ``tell`` with each function before its compilation and with its missing file, which it may make."""
    before = _listener.set(tell)
    try:
        yield
    finally:
        _listener.reset(before)


@cache
def reach(function: Callable[..., object]) -> str:
    """Return a hash of a function and of everything that it reaches, identical in every process."""
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__} {sys.version_info[:2]}".encode())
    for part in reached(function):
        for line in _own_parts(part)[0]:
            digest.update(line.encode() + b"\0")
    return digest.hexdigest()


def reached(function: Any) -> list[Any]:
    """Return ``function`` and every function that it reaches, each once, in order of appearance."""
    met = {function: None}
    queue = list(met)
    for some in queue:
        fresh = [other for other in dict.fromkeys(_own_parts(some)[1]) if other not in met]
        met.update(dict.fromkeys(fresh))
        queue.extend(fresh)
    return queue


@cache
def _own_parts(function: Any) -> tuple[tuple[str, ...], tuple[Any, ...]]:
    """Describe a function without the functions that it calls; return its parts, and these functions."""
    described: list[str] = [function.__module__, function.__qualname__, repr(function.__defaults__)]
    called: list[Any] = []
    codes = [function.__code__]
    for code in codes:
        consts = code.co_consts
        if code is function.__code__ and consts and function.__doc__ is not None and consts[0] == function.__doc__:
            consts = consts[1:]  # text is not compiled
        codes.extend(const for const in consts if isinstance(const, CodeType))
        plain = [_words(const) for const in consts if not isinstance(const, CodeType)]
        described.append(f"{code.co_code.hex()} {plain} {code.co_names} {code.co_varnames} {code.co_freevars}")
        for name in code.co_names:
            if name in function.__globals__:
                _describe(name, function.__globals__[name], code.co_names, described, called)
    for cell in function.__closure__ or ():
        _describe("", cell.cell_contents, (), described, called)
    return tuple(described), tuple(called)


def _describe(name: str, value: Any, names: tuple[str, ...], described: list[str], called: list[Any]) -> None:
    """Add the object of a name: a function to ``called``, any other as text to ``described``."""
    value = getattr(value, "py_func", value)  # of a compiled kernel
    value = getattr(value, "_defn", value)  # of numba's intrinsics
    value = value.__wrapped__ if hasattr(value, "cache_parameters") else value  # of functools.cache
    described.append(f"{name} = {_words(value)}")
    if isinstance(value, FunctionType):
        called.append(value)
    elif isinstance(value, ModuleType) and value.__name__.partition(".")[0] not in _FOREIGN:
        for part in names:  # module.part: more than is used, if an attribute of something else has the same name
            if hasattr(value, part):
                _describe(f"{name}.{part}", getattr(value, part), names, described, called)


def _words(value: Any) -> str:
    """Return a value as text that is the same in every process."""
    if isinstance(value, _PLAIN):
        return f"{type(value).__qualname__} {value!r}"
    if isinstance(value, FunctionType | BuiltinFunctionType | ModuleType | np.ufunc):
        return getattr(value, "__qualname__", "") or value.__name__
    if isinstance(value, type) and issubclass(value, Enum):
        return f"{value.__qualname__} {[(member.name, member.value) for member in value]}"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype.str} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, tuple | list):
        return f"{type(value).__qualname__} ({', '.join(map(_words, value))})"
    if isinstance(value, frozenset):
        return f"frozenset {sorted(map(_words, value))}"
    if isinstance(value, dict):
        return f"dict {[(_words(key), _words(held)) for key, held in value.items()]}"
    if isinstance(value, np.dtype | np.generic) or is_dataclass(value) or type(value).__module__.startswith(_BY_REPR):
        return repr(value)
    return f"{type(value).__qualname__} {_all_sources()}"  # unknown to us: as careful as can be


@cache
def _all_sources() -> str:
    """Return a hash of all sources of the rig."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
