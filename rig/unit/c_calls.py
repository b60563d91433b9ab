"""What kernels need of the machine: C functions called by their addresses, bytes copied as a block.

One compiled kernel serves every library: an address is a number among its data, not a part of its code.
"""

from __future__ import annotations

import ctypes
from typing import Any, Final

from llvmlite import ir
from numba.core import cgutils, types
from numba.core import config as numba_config
from numba.core.errors import TypingError
from numba.extending import intrinsic

_WORD: Final = ir.IntType(64)


def _by_address(builder: Any, arguments: Any, returns: ir.IntType) -> Any:
    """The call itself: the first of ``arguments`` is the address, the others are words or pointers as words."""
    address, *passed = arguments
    kind = ir.FunctionType(returns, [_WORD] * len(passed))
    return builder.call(builder.inttoptr(address, kind.as_pointer()), passed)


@intrinsic
def _int_of_two(typing: Any, address: Any, first: Any, second: Any) -> Any:
    """``int f(a, b)``."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _by_address(builder, arguments, ir.IntType(32))

    return types.int32(types.int64, types.int64, types.int64), code


@intrinsic
def _long_of_four(typing: Any, address: Any, first: Any, second: Any, third: Any, fourth: Any) -> Any:
    """``ssize_t f(a, b, c, d)``."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _by_address(builder, arguments, _WORD)

    return types.int64(*(types.int64,) * 5), code


@intrinsic
def _copy_bytes(typing: Any, target: Any, to: Any, source: Any, first: Any, count: Any) -> Any:
    """memcpy between (n,) arrays of bytes without gaps: a loop does not become one, as arrays may overlap."""
    if any(one.dtype != types.uint8 or one.ndim != 1 or one.layout != "C" for one in (target, source)):
        raise TypingError("bytes without gaps are copied")

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def at(array: int, index: int) -> Any:
            data = context.make_array(signature.args[array])(context, builder, arguments[array]).data
            return builder.gep(data, [arguments[index]])

        cgutils.raw_memcpy(builder, at(0, 1), at(2, 3), arguments[4], 1)
        return context.get_dummy_value()

    return types.void(target, types.int64, source, types.int64, types.int64), code


def _copy_bytes_plainly(target: Any, to: int, source: Any, first: int, count: int) -> None:
    target[to : to + count] = source[first : first + count]


def _int_of_two_plainly(address: int, first: int, second: int) -> int:
    return ctypes.CFUNCTYPE(ctypes.c_int, *(ctypes.c_void_p,) * 2)(int(address))(int(first), int(second))


def _long_of_four_plainly(address: int, *passed: int) -> int:
    return ctypes.CFUNCTYPE(ctypes.c_ssize_t, *(ctypes.c_void_p,) * 4)(int(address))(*map(int, passed))


# In kernels: ``copy_bytes(target, to, source, first, count)``, of arrays that do not overlap.
# Words stand for int, size_t and pointers: all go through the same registers on 64-bit machines.
_PLAIN: Final[bool] = bool(numba_config.DISABLE_JIT)  # pyright: ignore[reportAttributeAccessIssue]
int_of_two: Any = _int_of_two_plainly if _PLAIN else _int_of_two
copy_bytes: Any = _copy_bytes_plainly if _PLAIN else _copy_bytes
long_of_four: Any = _long_of_four_plainly if _PLAIN else _long_of_four


def address(function: Any) -> int:
    """Where a function that ctypes has found begins; 0 for None."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0
