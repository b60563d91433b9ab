"""A frame to the unit and its answer back, in compiled code: the usual case.

The code calls a library of this process, or sends the record to a socket and waits some microseconds for the answer.
Python handles everything except the usual answer in that time: ``try_exchange`` returns PENDING, and stores its
progress.  It calls C functions by their addresses, so that one compiled kernel serves every library: an address is
data, not code.
"""

from __future__ import annotations

import ctypes
import socket
import time
from typing import Any, Final, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from rig.core.frame import UnitStatus
from rig.core.kernels import kernel
from rig.core.threads import cores
from rig.unit.port import PLAIN, RECEIVED, Port, copy_bytes
from rig.unit.unit_records import FROM_UNIT, INTERFACE, OUTPUT, Interface, Kind, blank, place, size_of

PENDING: Final = -1  # no status of frame.UnitStatus: Python goes on with this frame
FOREVER_NS: Final = np.iinfo(np.int64).max
_CLOCK: Final = getattr(time, "CLOCK_UPTIME_RAW", getattr(time, "CLOCK_MONOTONIC", 0))  # of perf_counter
_AT_ONCE: Final = int(getattr(socket, "MSG_DONTWAIT", 0))
_CRC: Final = 4  # bytes, the last ones of a record
_POLYNOMIAL, _ALL = 0xEDB88320, 0xFFFFFFFF
_WORD: Final = ir.IntType(64)
_HEAD: Final = place(OUTPUT, "frame")[1]  # what a session keeps of it, then the frame and its time
_FRAME_END: Final = place(OUTPUT, "time_s")[1]
_TIME_END: Final = _FRAME_END + 8
_TAIL: Final = 8

_NAMES: Final = (
    *("step", "send", "receive", "give_way", "clock"),  # addresses of functions; step is 0 for a socket
    *("sent_at", "received_at", "into_at", "into_bytes", "now_at"),  # addresses of records
    *("fd", "spin_ns", "sums"),  # sums: requests have a checksum
    *("sent_bytes", "answer_bytes", "known_bytes"),  # of the records, in the version of the unit
    *("now_s", "now_ns"),  # struct timespec
    *("sent", "code", "count"),  # of a PENDING frame: handed over, what step returned, bytes in ``into``
    *("frame", "stepped", "took_ns"),  # of the last answer through a socket; of the last frame
)
STATE: Final = np.dtype([(name, "i8") for name in _NAMES])


class Patience(NamedTuple):
    """Time for which both sides look for a message before they sleep: waking takes longer than most waits."""

    spin_ns: int  # of the rig, for an answer
    looks: int  # of the unit's process, for the next frame: about 0.2 ms, more than a frame of the loop and its log


def patience(crowded: bool) -> Patience:
    """Return no patience if the other side has no core to run on; ``crowded``: other flights use the cores."""
    return Patience(0, 0) if crowded or cores() < 2 else Patience(50_000, 400)


class CompiledExchange(NamedTuple):
    """Data with which compiled code reaches the unit."""

    state: NDArray[Any]  # (1,) STATE
    into: NDArray[np.uint8]  # where the next message goes
    template: NDArray[np.uint8]  # an answer with nothing in it but its head and length


def new_exchange(
    port: Port, session: int, into: NDArray[np.uint8], interface: Interface = INTERFACE
) -> CompiledExchange:
    """Return the exchange of one flight, for ``to_library`` or ``to_socket`` to complete."""
    state, library = np.zeros(1, STATE), ctypes.CDLL(None)
    functions = {"send": "send", "receive": "recv", "give_way": "sched_yield", "clock": "clock_gettime"}
    for name, called in functions.items():
        state[name] = _address(getattr(library, called))
    state["sent_at"], state["into_at"], state["into_bytes"] = port.out.sent.ctypes.data, into.ctypes.data, len(into)
    state["sent_bytes"], state["answer_bytes"] = size_of(port.out.sent.dtype, interface), interface.output_bytes
    state["known_bytes"] = interface.known_bytes
    state["received_at"] = port.back.bytes[RECEIVED].ctypes.data
    state["now_at"], state["frame"] = state.ctypes.data + place(STATE, "now_s")[1], -1
    return CompiledExchange(state, into, blank(OUTPUT, FROM_UNIT, Kind.REPLY, session, interface).view(np.uint8))


def to_library(exchange: CompiledExchange, step: Any) -> None:
    """Pass frames by a call of ``step``."""
    exchange.state["step"] = _address(step)


def to_socket(exchange: CompiledExchange, fd: int, spin_ns: int, sums: bool = False) -> None:
    """Pass frames through the socket ``fd``, from the first frame on or after a restart of the unit.

    sums : with a checksum
    """
    state = exchange.state
    state["sums"] = sums
    state["step"], state["fd"], state["frame"], state["stepped"], state["spin_ns"] = 0, fd, -1, 0, spin_ns
    clear(exchange)


def clear(exchange: CompiledExchange) -> None:
    """Clear the pending exchange."""
    exchange.state["sent"] = exchange.state["code"] = exchange.state["count"] = 0


def _by_address(builder: Any, arguments: Any, returns: ir.IntType) -> Any:
    """Emit the call itself: the first of ``arguments`` is the address, the others are words or pointers as words."""
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


def _int_of_two_plainly(address: int, first: int, second: int) -> int:
    return ctypes.CFUNCTYPE(ctypes.c_int, *(ctypes.c_void_p,) * 2)(int(address))(int(first), int(second))


def _long_of_four_plainly(address: int, *passed: int) -> int:
    return ctypes.CFUNCTYPE(ctypes.c_ssize_t, *(ctypes.c_void_p,) * 4)(int(address))(*map(int, passed))


# Words stand for int, size_t and pointers: all go through the same registers on 64-bit machines.
int_of_two: Any = _int_of_two_plainly if PLAIN else _int_of_two
long_of_four: Any = _long_of_four_plainly if PLAIN else _long_of_four


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


@kernel
def try_exchange(port, exchange, until_ns):
    """Pass port.out to the unit; return ANSWERED when the answer is in port.back, or PENDING.

    until_ns : end of the wait, by the clock; Python handles a later answer
    """
    state = exchange.state[0]
    began = now(state)
    if state["step"] != 0:
        answered = call_step(port, exchange, state)
    else:
        answered = send(port.out, state) and await_answer(port, exchange, state, began + state["spin_ns"], until_ns)
    state["took_ns"] = now(state) - began
    return UnitStatus.ANSWERED.value if answered else PENDING


@kernel
def now(state):
    """Return the time of the clock, ns."""
    int_of_two(state["clock"], _CLOCK, state["now_at"])
    return state["now_s"] * 1_000_000_000 + state["now_ns"]


@kernel
def call_step(port, exchange, state):
    """Call the library between the two records."""
    received = port.back.bytes[RECEIVED]
    copy_bytes(received, 0, exchange.template, 0, state["answer_bytes"])
    copy_bytes(received, _HEAD, port.out.sent_bytes, _HEAD, _TIME_END - _HEAD)
    state["code"] = int_of_two(state["step"], state["sent_at"], state["received_at"])
    for i in range(state["known_bytes"], len(received)):  # the tail of an older version
        received[i] = 0
    state["sent"] = state["code"] != 0
    return state["code"] == 0


@kernel
def send(port, state):
    """Return True if the socket took the record; port : Outbound."""
    count = state["sent_bytes"]
    if state["sums"]:
        crc = crc32(port.sent_bytes, count - _TAIL)
        for i in range(_CRC):
            port.sent_bytes[count - _CRC + i] = crc >> (8 * i) & 0xFF
    state["sent"] = long_of_four(state["send"], state["fd"], state["sent_at"], count, _AT_ONCE) == count
    return state["sent"] != 0


@kernel
def await_answer(port, exchange, state, patient_ns, until_ns):
    """Wait for a message until then; return True for the usual answer to the frame in time, which is then copied."""
    end_ns = min(patient_ns, until_ns)
    count = long_of_four(state["receive"], state["fd"], state["into_at"], state["into_bytes"], _AT_ONCE)
    looked = 0  # times; now and then somebody else may have the core
    while count < 0 and now(state) < end_ns:
        looked += 1
        if looked % 8 == 0:
            int_of_two(state["give_way"], 0, 0)
        count = long_of_four(state["receive"], state["fd"], state["into_at"], state["into_bytes"], _AT_ONCE)
    in_time = until_ns == FOREVER_NS or now(state) < until_ns
    usual = count == state["answer_bytes"] and is_usual(exchange, port.out.sent_bytes, count)
    if not in_time or not usual:
        state["count"] = max(count, 0)
        return False
    copy_bytes(port.back.bytes[RECEIVED], 0, exchange.into, 0, state["known_bytes"])
    record = port.back.records[RECEIVED]
    state["frame"], state["stepped"], state["sent"] = record["frame"], record["stepped"], 0
    return True


@kernel
def is_usual(exchange, sent, count):
    """Return True if the message has head and tail of an answer of the session, and the frame that was sent."""
    message, template, usual = exchange.into, exchange.template, True
    for i in range(_HEAD):
        usual = usual and message[i] == template[i]
    for i in range(_HEAD, _FRAME_END):
        usual = usual and message[i] == sent[i]
    for i in range(count - _TAIL, count):
        usual = usual and message[i] == template[i]
    return usual


def _tables() -> NDArray[np.int64]:
    """Return (8, 256): the contribution of a byte to the sum, by the number of bytes behind it."""
    tables = np.zeros((8, 256), np.int64)
    tables[0] = np.arange(256)
    for _ in range(8):
        tables[0] = (tables[0] >> 1) ^ np.where(tables[0] & 1, _POLYNOMIAL, 0)
    for n in range(1, 8):
        tables[n] = (tables[n - 1] >> 8) ^ tables[0][tables[n - 1] & 0xFF]
    return tables


_TABLES: Final = _tables()


@kernel
def crc32(data, count):
    """Return the CRC-32 of the first ``count`` of ``data`` (n,) bytes, as zlib's; count : a multiple of eight"""
    crc = np.int64(_ALL)
    for i in range(0, count, 8):
        crc ^= np.int64(data[i]) | np.int64(data[i + 1]) << 8
        crc ^= np.int64(data[i + 2]) << 16 | np.int64(data[i + 3]) << 24
        after = _TABLES[7, crc & 0xFF] ^ _TABLES[6, crc >> 8 & 0xFF]
        after ^= _TABLES[5, crc >> 16 & 0xFF] ^ _TABLES[4, crc >> 24]
        for n in range(4):
            after ^= _TABLES[3 - n, data[i + 4 + n]]
        crc = after
    return crc ^ _ALL
