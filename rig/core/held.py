"""Data that a kernel is given once for many calls: with forty arrays, handing them over is a tenth of a frame.

``Held`` calls a kernel of (block, k, held), which takes its data out of ``held`` with ``data_of``.  With
``NUMBA_DISABLE_JIT=1`` the data is held as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.registry import cpu_target
from numba.core.typing.templates import signature
from numba.extending import NativeValue, intrinsic, register_model, unbox
from numpy.typing import NDArray

from rig.core.kernels import bind, compiles, entry_point, kernel, kind_of, type_of

_WORD: Final = 8  # bytes; no part of the data needs a greater alignment


class HeldType(types.Type):
    """The address of data in its compiled form; ``of`` is numba's type of the data."""

    def __init__(self, of: Any) -> None:
        self.of = of
        super().__init__(name=f"Held({of})")


@register_model(HeldType)
class _Address(PrimitiveModel):
    def __init__(self, manager: Any, kind: HeldType) -> None:
        super().__init__(manager, kind, ir.IntType(8).as_pointer())


@unbox(HeldType)
def _from_int(kind: HeldType, number: Any, c: Any) -> NativeValue:
    return NativeValue(c.pyapi.long_as_voidptr(number))


@intrinsic
def _put(context: Any, memory: Any, data: Any) -> Any:
    def code(target: Any, builder: Any, of: Any, given: Any) -> Any:
        place = target.make_array(memory)(target, builder, given[0]).data
        builder.store(given[1], builder.bitcast(place, given[1].type.as_pointer()), align=_WORD)
        return target.get_dummy_value()

    return signature(types.void, memory, data), code


@intrinsic
def _taken(context: Any, held: Any) -> Any:
    def code(target: Any, builder: Any, of: Any, given: Any) -> Any:
        place = target.get_value_type(of.return_type).as_pointer()
        return builder.load(builder.bitcast(given[0], place), align=_WORD)

    return signature(held.of, held), code


def _itself(held: Any) -> Any:
    return held


data_of: Any = _taken if compiles() else _itself  # of a kernel: the data that ``held`` stands for


@kernel
def _keep(memory, data):
    """Write ``data`` in its compiled form to ``memory``, words."""
    _put(memory, data)  # pyright: ignore[reportCallIssue] # numba gives it the context


_made: dict[Any, tuple[Callable[..., Any], int]] = {}  # entry point and words of data, by function and kinds


class Held:
    """A kernel of (block, k, held), called with the data that it was given last.

    entry : the kernel;  ``hold`` returns its third argument
    """

    def __init__(self, function: Callable[..., Any], block: Any, k: int, data: Any) -> None:
        """Compile ``function`` for the types of these arguments, as ``bind`` does; it is called with no others."""
        self.entry: Callable[..., Any] = function
        self._data: Any = None
        self._memory: NDArray[np.int64] | None = None
        if compiles():
            self.entry, words = _compiled(function, block, k, data)
            self._memory = np.zeros(words, np.int64)
            self._write: Callable[..., Any] = bind(_keep, self._memory, data)

    def hold(self, data: Any) -> Any:
        """Return what stands for ``data`` until other data is held; a tuple, whose arrays stay as they are."""
        if self._memory is None:
            return data
        if data is not self._data:
            self._write(self._memory, data)
            self._data = data  # its arrays live as long as their addresses are used
        return self._memory.ctypes.data

    def __call__(self, block: Any, k: int, data: Any) -> Any:
        """Call the kernel with ``data``."""
        return self.entry(block, k, self.hold(data))


def _compiled(function: Callable[..., Any], *arguments: Any) -> tuple[Callable[..., Any], int]:
    """Return the kernel compiled for block, k and the data, and how many words the data has."""
    key = function, kind_of(arguments)
    if key not in _made:
        block, k, data = map(type_of, arguments)
        target: Any = cpu_target.target_context
        size = target.get_abi_sizeof(target.get_value_type(data))
        _made[key] = entry_point(function, (block, k, HeldType(data))), size // _WORD + 1
    return _made[key]
