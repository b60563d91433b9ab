"""A row of the frame into the record that a unit reads, and its answer into the row.

What a frame means does not depend on the carrier: all of them move the bytes that are written and read here.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.external.layout import (
    ANSWERS,
    FROM_UNIT,
    INPUT,
    OUTPUT,
    REFERENCES,
    TO_UNIT,
    Form,
    Kind,
    Said,
    place,
)
from rig.computer.external.layout import blank as blank_record
from rig.frame import FLAT, SURFACES, State, Unit
from rig.frame.fields import FIELD, FIELDS
from rig.kernels import kernel

ON_DISCRETES, ON_SURFACES = int(Said.DISCRETES), int(Said.SURFACE)
_OWN_CONTROL: Final = ("surface", "law")  # the rig's in the redundancy form, whatever a unit says of them
Moves = NDArray[np.int64]  # (m, 4): group of Said or 0, first byte there, first byte here, bytes


class Port(NamedTuple):
    """What goes over in a frame, and how its bytes lie."""

    sent: NDArray[Any]  # (1,) INPUT
    received: NDArray[Any]  # (1,) OUTPUT
    slots: NDArray[Any]  # (latency_frames + 1,) OUTPUT: accepted answers, the first is flown
    blank: NDArray[Any]  # (1,) OUTPUT: what is flown of groups that are not said
    sent_bytes: NDArray[np.uint8]  # the same four as bytes
    received_bytes: NDArray[np.uint8]
    slot_bytes: NDArray[np.uint8]  # (slots, bytes)
    blank_bytes: NDArray[np.uint8]
    out: Moves  # row to ``sent``
    groups: Moves  # ``received`` to a slot
    back: Moves  # slot to row
    limits: NDArray[np.int64]  # (n, 4): group, first byte, bytes, largest value of an enum
    rate_hz: float
    form: int  # of Form
    needed: int  # groups that an answer must fill
    counts: NDArray[np.int64]  # (2,): answers accepted, surfaces that were no finite number


def new_port(form: Form, session: int, latency_frames: int, trim: NDArray[np.float64], rate_hz: float) -> Port:
    """The port of one flight; trim : (4,) surfaces that are flown until the unit has said others."""
    sent, received = blank_record(INPUT, TO_UNIT, Kind.FRAME, session), np.zeros(1, OUTPUT)
    blank = blank_record(OUTPUT, FROM_UNIT, Kind.REPLY, session)
    blank["voted"], blank["state"], blank["surface"], blank["frame"] = np.nan, State.ABSENT, trim, -1
    slots = np.repeat(blank, latency_frames + 1)
    surfaces = form is Form.FLIGHT_COMPUTER
    return Port(
        sent,
        received,
        slots,
        blank,
        sent.view(np.uint8),
        received.view(np.uint8),
        slots.view(np.uint8).reshape(len(slots), -1),
        blank.view(np.uint8),
        _moves(dict.fromkeys(_READ, 0), FLAT, INPUT),
        _moves({**ANSWERS, "said": 0}, OUTPUT, OUTPUT),
        _moves({name: 0 for name in ANSWERS if surfaces or name not in _OWN_CONTROL}, OUTPUT, FLAT),
        _limits(),
        rate_hz,
        int(form),
        int(Said.SURFACE if surfaces else Said.VOTED),
        np.zeros(2, np.int64),
    )


_READ: Final = (*REFERENCES, *(field.name for field in FIELDS if field.part == "bus"))


def _moves(groups: dict[str, Any], source: np.dtype[Any], target: np.dtype[Any]) -> Moves:
    """How fields get from a record to another; those of a group that follow each other in both are one move."""
    found: list[list[int]] = []
    for name in sorted(groups, key=lambda name: place(source, name)[1]):
        dtype, first = place(source, name)
        group, to = int(groups[name]), place(target, name)[1]
        last = found[-1] if found else None
        if last and last[0] == group and last[1] + last[3] == first and last[2] + last[3] == to:
            last[3] += dtype.itemsize
        else:
            found.append([group, first, to, dtype.itemsize])
    return np.array(found, np.int64)


def _limits() -> NDArray[np.int64]:
    """The largest value that each field of one byte may have."""
    found = []
    for name, group in ANSWERS.items():
        field, (dtype, first) = FIELD[name], place(OUTPUT, name)
        if field.kind not in ("number", "byte"):
            enum: type[IntEnum] | None = field.enum
            most = max(enum) if enum is not None else 1 if field.kind == "flag" or name == "discrete_voted" else 4
            found.append([int(group), first, dtype.itemsize, int(most)])
    return np.array(found, np.int64)


@kernel
def fill(raw, k, frame, port):
    """Write row k of a block into ``port.sent``.

    raw : (n, bytes) of the block
    """
    sent, moves = port.sent_bytes, port.out
    port.sent[0]["frame"], port.sent[0]["time_s"] = frame, frame / port.rate_hz
    for m in range(moves.shape[0]):
        first, to = moves[m, 1], moves[m, 2]
        for i in range(moves[m, 3]):
            sent[to + i] = raw[k, first + i]


@kernel
def take(raw, k, port, status):
    """Write what is flown in frame k into its row: the answer just received if ``status`` says so and it may be one.

    Returns the status that the frame comes to: REFUSED in place of ANSWERED for an answer that no unit may give.
    """
    answers = status == Unit.ANSWERED or status == Unit.RESTARTED
    if answers and not may_be(port):
        status = Unit.REFUSED.value
    elif answers:
        accept(port)
    slot, moves = port.slot_bytes, port.back
    for m in range(moves.shape[0]):
        first, to = moves[m, 1], moves[m, 2]
        for i in range(moves[m, 3]):
            raw[k, to + i] = slot[0, first + i]
    return status


@kernel
def may_be(port):
    """Whether the answer fills what its form needs, and every state, level and pattern of it is one."""
    said, received, limits = port.received[0]["said"], port.received_bytes, port.limits
    allowed = said & port.needed == port.needed
    for n in range(limits.shape[0]):
        if said & limits[n, 0]:
            for i in range(limits[n, 2]):
                allowed = allowed and received[limits[n, 1] + i] <= limits[n, 3]
    return allowed


@kernel
def accept(port):
    """Take the answer in behind those that still wait to be flown; the first one of a flight fills all places."""
    slots, last = port.slot_bytes, port.slots.shape[0] - 1
    first = port.counts[0] == 0
    for j in range(last):
        for i in range(slots.shape[1]):
            slots[j, i] = slots[j + 1, i]
    newest = port.slots[last]
    for s in range(_SURFACES):
        value = port.received[0]["surface"][s]
        if not np.isfinite(value):  # that surface stays where it was
            port.counts[1] += (port.received[0]["said"] & ON_SURFACES) != 0
            port.received[0]["surface"][s] = newest["surface"][s]
    said, moves = port.received[0]["said"], port.groups
    for m in range(moves.shape[0]):
        from_unit = moves[m, 0] == 0 or said & moves[m, 0] != 0
        at = moves[m, 1]
        for i in range(at, at + moves[m, 3]):
            slots[last, i] = port.received_bytes[i] if from_unit else port.blank_bytes[i]
    newest["frame"] = port.received[0]["frame"]
    if first:
        for j in range(last):
            for i in range(slots.shape[1]):
                slots[j, i] = slots[last, i]
    port.counts[0] += 1


_SURFACES: Final = len(SURFACES)
