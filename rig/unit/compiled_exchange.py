"""A frame over to the unit and its answer back, in compiled code: what a frame nearly always is.

A library of this process is called; to a socket the record is sent, and the answer awaited for some microseconds.
Whatever is not the usual answer in that time is left to Python: ``ask`` returns PENDING, and says how far it came.
"""

from __future__ import annotations

import ctypes
import os
import socket
import time
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.frame import Unit
from rig.kernels import kernel
from rig.unit.c_calls import address, copy_bytes, int_of_two, long_of_four
from rig.unit.layout import FROM_UNIT, INPUT, OUTPUT, Kind, blank, place
from rig.unit.port import RECEIVED, Port

PENDING: Final = -1  # no status of frame.Unit: Python goes on with this frame
FOREVER_NS: Final = np.iinfo(np.int64).max
_CLOCK: Final = getattr(time, "CLOCK_UPTIME_RAW", getattr(time, "CLOCK_MONOTONIC", 0))  # of perf_counter
_AT_ONCE: Final = int(getattr(socket, "MSG_DONTWAIT", 0))
_SENT_BYTES: Final = INPUT.itemsize
_BYTES: Final = OUTPUT.itemsize
_HEAD: Final = place(OUTPUT, "frame")[1]  # what a session keeps of it, then the frame and its time
_FRAME_END: Final = place(OUTPUT, "time_s")[1]
_TIME_END: Final = _FRAME_END + 8
_BODY: Final = place(OUTPUT, "length")[1]

_NAMES: Final = (
    *("step", "send", "receive", "give_way", "clock"),  # addresses of functions; step is 0 for a socket
    *("sent_at", "received_at", "into_at", "into_bytes", "now_at"),  # addresses of records
    *("fd", "spin_ns"),
    *("now_s", "now_ns"),  # struct timespec
    *("sent", "code", "count"),  # of a PENDING frame: handed over, what step returned, bytes in ``into``
    *("frame", "stepped", "took_ns"),  # of the last answer through a socket; of the last frame
)
WAY: Final = np.dtype([(name, "i8") for name in _NAMES])


class Patience(NamedTuple):
    """How long both sides look for a message before they sleep: to be woken takes longer than most waits."""

    spin_ns: int  # of the rig, for an answer
    looks: int  # of the unit's process, for the next frame: about 0.2 ms, more than a frame of the loop and its log


def patience(crowded: bool) -> Patience:
    """None where the other side has no core to run on meanwhile; ``crowded``: other flights want the cores too."""
    return Patience(0, 0) if crowded or cores() < 2 else Patience(50_000, 400)


class Way(NamedTuple):
    """How compiled code reaches the unit."""

    at: NDArray[Any]  # (1,) WAY
    into: NDArray[np.uint8]  # where the next message goes
    template: NDArray[np.uint8]  # an answer with nothing in it but its head and length


def new_way(port: Port, session: int, into: NDArray[np.uint8]) -> Way:
    """The way of one flight, for ``to_library`` or ``to_socket`` to complete."""
    at, library = np.zeros(1, WAY), ctypes.CDLL(None)
    functions = {"send": "send", "receive": "recv", "give_way": "sched_yield", "clock": "clock_gettime"}
    for name, called in functions.items():
        at[name] = address(getattr(library, called))
    at["sent_at"], at["into_at"], at["into_bytes"] = port.out.sent.ctypes.data, into.ctypes.data, len(into)
    at["received_at"] = port.back.bytes[RECEIVED].ctypes.data
    at["now_at"], at["frame"] = at.ctypes.data + place(WAY, "now_s")[1], -1
    return Way(at, into, blank(OUTPUT, FROM_UNIT, Kind.REPLY, session).view(np.uint8))


def to_library(way: Way, step: Any) -> None:
    """Over by a call of ``step``."""
    way.at["step"] = address(step)


def to_socket(way: Way, fd: int, spin_ns: int) -> None:
    """Over through the socket ``fd``, from the first frame on or after the unit was started again."""
    way.at["step"], way.at["fd"], way.at["frame"], way.at["stepped"] = 0, fd, -1, 0
    way.at["spin_ns"] = spin_ns
    clear(way)


def clear(way: Way) -> None:
    """Nothing is pending."""
    way.at["sent"] = way.at["code"] = way.at["count"] = 0


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@kernel
def ask(port, way, until_ns):
    """Hand port.out over; ANSWERED once the answer is in its place in port.back, else PENDING.

    until_ns : of the clock, when a wait ends; what is read later is left to Python, too
    """
    at = way.at[0]
    began = now(at)
    if at["step"] != 0:
        answered = call_step(port, way, at)
    else:
        answered = send(at) and await_answer(port, way, at, began + at["spin_ns"], until_ns)
    at["took_ns"] = now(at) - began
    return Unit.ANSWERED.value if answered else PENDING


@kernel
def now(at):
    """Nanoseconds."""
    int_of_two(at["clock"], _CLOCK, at["now_at"])
    return at["now_s"] * 1_000_000_000 + at["now_ns"]


@kernel
def call_step(port, way, at):
    """Call the library between the two records."""
    received = port.back.bytes[RECEIVED]
    copy_bytes(received, 0, way.template, 0, _BYTES)
    copy_bytes(received, _HEAD, port.out.sent_bytes, _HEAD, _TIME_END - _HEAD)
    at["code"] = int_of_two(at["step"], at["sent_at"], at["received_at"])
    at["sent"] = at["code"] != 0
    return at["code"] == 0


@kernel
def send(at):
    """Whether the socket took the record."""
    at["sent"] = long_of_four(at["send"], at["fd"], at["sent_at"], _SENT_BYTES, _AT_ONCE) == _SENT_BYTES
    return at["sent"] != 0


@kernel
def await_answer(port, way, at, patient_ns, until_ns):
    """Look for a message as long as that; whether it is in time and the usual answer to the frame: then copied."""
    end_ns = min(patient_ns, until_ns)
    count = long_of_four(at["receive"], at["fd"], at["into_at"], at["into_bytes"], _AT_ONCE)
    looked = 0  # times; now and then somebody else may have the core
    while count < 0 and now(at) < end_ns:
        looked += 1
        if looked % 8 == 0:
            int_of_two(at["give_way"], 0, 0)
        count = long_of_four(at["receive"], at["fd"], at["into_at"], at["into_bytes"], _AT_ONCE)
    in_time = until_ns == FOREVER_NS or now(at) < until_ns
    if count != _BYTES or not in_time or not is_usual(way.into, port.out.sent_bytes, way.template):
        at["count"] = max(count, 0)
        return False
    copy_bytes(port.back.bytes[RECEIVED], 0, way.into, 0, _BYTES)
    record = port.back.records[RECEIVED]
    at["frame"], at["stepped"], at["sent"] = record["frame"], record["stepped"], 0
    return True


@kernel
def is_usual(message, sent, template):
    """Whether it has the head and the tail of all answers of the session, and the frame that was sent."""
    usual = True
    for i in range(_HEAD):
        usual = usual and message[i] == template[i]
    for i in range(_HEAD, _FRAME_END):
        usual = usual and message[i] == sent[i]
    for i in range(_BODY, _BYTES):
        usual = usual and message[i] == template[i]
    return usual
