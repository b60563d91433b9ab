"""From a row of the frame to the record that a unit reads, and from its answer to the row.

A frame does not depend on the transport: all transports move the bytes that this module writes and reads.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np
from numba.core import cgutils, types
from numba.core import config as numba_config
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numpy.typing import NDArray

from rig.computer.analytic.references import remember
from rig.computer.redundancy.assumed_states import level_of, state_of
from rig.computer.redundancy.discrete import vote_discretes
from rig.core.frame import CHANNELS, FLAT, SURFACES, Law, S, State, UnitStatus, to_frame
from rig.core.frame.fields import FIELD, FIELDS
from rig.core.kernels import kernel
from rig.unit.unit_records import (
    ANSWERS,
    FROM_UNIT,
    INPUT,
    INTERFACE,
    LAW_INPUT,
    OF_LAW,
    OUTPUT,
    REFERENCES,
    TO_UNIT,
    Interface,
    Kind,
    Role,
    Said,
    Status,
    blank,
    input_of,
    place,
    walk,
)

ON_DISCRETES, ON_SURFACES, ON_PATTERNS = int(Said.DISCRETES), int(Said.SURFACE), int(Said.PATTERN)
ON_VOTES, ON_STATES = int(Said.VOTED), int(Said.STATE)
_OWN_CONTROL: Final = ("surface", "law")  # the rig's in the redundancy role, whatever a unit says of them
Moves = NDArray[np.int64]  # (m, 4): group of Said or 0, first byte there, first byte here, bytes
PLAIN: Final[bool] = bool(numba_config.DISABLE_JIT)  # pyright: ignore[reportAttributeAccessIssue]
# Places in the records of an answer.
ACCEPTED, NOT_FINITE, STARTING, CHANGES = range(4)  # places in Inbound.counts
MOST_CHANGES: Final = 1000  # that are kept
# Just now; what stands for groups that are not filled, and beside votes; the oldest that was accepted.
RECEIVED, BLANK, ASSUMED, FLOWN = range(4)


class Outbound(NamedTuple):
    """The record to the unit."""

    sent: NDArray[Any]  # (1,) INPUT or LAW_INPUT
    sent_bytes: NDArray[np.uint8]  # the same
    rate_hz: float


class Inbound(NamedTuple):
    """Records from the unit, and records that wait to be flown."""

    records: NDArray[Any]  # (4 + latency_frames,) OUTPUT: RECEIVED, BLANK, ASSUMED, FLOWN and those that will be
    bytes: NDArray[np.uint8]  # the same, (records, bytes)
    counts: NDArray[np.int64]  # (4,): answers accepted, surfaces that were no finite number, frames in a row in which
    # it was starting, changes of what it says of itself
    changes: NDArray[np.int64]  # (MOST_CHANGES, 4): frame, status, fault word, output discretes a byte each
    start_frames: int  # that it may be starting
    role: int  # of Role
    needed: int  # groups that an answer must fill
    no_level: bool  # its group STATE is the states alone,
    no_state: bool  # or the levels alone


class Port(NamedTuple):
    """Both directions of a frame."""

    out: Outbound
    back: Inbound


def new_port(
    role: Role,
    session: int,
    latency_frames: int,
    trim: NDArray[np.float64],
    rate_hz: float,
    start_s: float = 0.0,
    interface: Interface = INTERFACE,
    fitted: NDArray[np.int64] | None = None,
    unsaid: Collection[str] = (),
) -> Port:
    """Return the port of one flight.

    trim : (4,) surface positions that are flown until the unit fills others
    fitted : (S,) channels of each signal, four if not given
    unsaid : which of ``state`` and ``level`` the unit does not fill in their group
    """
    sent = blank(input_of(role), TO_UNIT, Kind.FRAME, session, interface)
    records = np.repeat(blank(OUTPUT, FROM_UNIT, Kind.REPLY, session), 4 + latency_frames)
    records["voted"], records["state"], records["surface"], records["frame"] = np.nan, State.ABSENT, trim, -1
    records["law"], fitted = Law.EXTERNAL, np.full(S, CHANNELS) if fitted is None else fitted
    records["state"][ASSUMED][np.arange(CHANNELS) < fitted[:, None]] = State.OK
    records["level"][ASSUMED] = fitted
    needed = Said.VOTED if role is Role.REDUNDANCY else Said.SURFACE
    back = Inbound(
        records=records,
        bytes=records.view(np.uint8).reshape(len(records), -1),
        counts=np.zeros(4, np.int64),
        changes=np.zeros((MOST_CHANGES, 4), np.int64),
        start_frames=to_frame(start_s, rate_hz),
        role=int(role),
        needed=int(needed),
        no_level="level" in unsaid,
        no_state="state" in unsaid,
    )
    return Port(Outbound(sent, sent.view(np.uint8), rate_hz), back)


def _moves(groups: dict[str, Any], source: np.dtype[Any], target: np.dtype[Any]) -> Moves:
    """Return the moves of fields between two records; consecutive fields of a group are one move."""
    moves: list[list[int]] = []
    for field in walk(source):
        if field.name not in groups:
            continue
        group, to = int(groups[field.name]), place(target, field.name)[1]
        last = moves[-1] if moves else None
        if last and last[0] == group and last[1] + last[3] == field.offset and last[2] + last[3] == to:
            last[3] += field.size
        else:
            moves.append([group, field.offset, to, field.size])
    return np.array(moves, np.int64)


def _limits() -> NDArray[np.int64]:
    """Return the largest value that each field of one byte may have: group, first byte, bytes, value."""
    limits = []
    for name, group in ANSWERS.items():
        field, (dtype, first) = FIELD[name], place(OUTPUT, name)
        if field.kind not in ("number", "byte"):
            enum: type[IntEnum] | None = field.enum
            most = max(enum) if enum is not None else 1 if field.kind == "flag" or name == "discrete_voted" else 4
            limits.append([int(group), first, dtype.itemsize, int(most)])
    return np.array(limits, np.int64)


_READ: Final = (*REFERENCES, *(field.name for field in FIELDS if field.part == "bus"))
# Constants of the kernels.
_OUT: Final = _moves(dict.fromkeys(_READ, 0), FLAT, INPUT)
_OUT_TO_LAW: Final = _moves(dict.fromkeys(OF_LAW, 0), FLAT, LAW_INPUT)
_GROUPS: Final = _moves({**ANSWERS, "said": 0}, OUTPUT, OUTPUT)
_VOTES: Final = _moves({name: 0 for name in ANSWERS if name not in _OWN_CONTROL}, OUTPUT, FLAT)
_CONTROL: Final = _moves(dict.fromkeys(_OWN_CONTROL, 0), OUTPUT, FLAT)
_LIMITS: Final = _limits()
_EXTERNAL, _UNSAID_LAW = Law.EXTERNAL.value, Law.AUTOPILOT.value
_REDUNDANCY, _CONTROL_LAW = int(Role.REDUNDANCY), int(Role.CONTROL_LAW)
_SURFACES: Final = len(SURFACES)
_SELF_TEST, _LAST_STATUS = Status.SELF_TEST.value, max(Status).value
_OUTPUTS: Final = 8  # output discretes


@intrinsic
def _copy_bytes(typing: Any, target: Any, to: Any, source: Any, first: Any, count: Any) -> Any:
    """Copy between (n,) arrays of bytes without gaps, which do not overlap: a loop does not become memcpy."""
    if any(a.dtype != types.uint8 or a.ndim != 1 or a.layout != "C" for a in (target, source)):
        raise TypingError("bytes without gaps are copied")

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def pointer(array: int, index: int) -> Any:
            data = context.make_array(signature.args[array])(context, builder, arguments[array]).data
            return builder.gep(data, [arguments[index]])

        cgutils.raw_memcpy(builder, pointer(0, 1), pointer(2, 3), arguments[4], 1)
        return context.get_dummy_value()

    return types.void(target, types.int64, source, types.int64, types.int64), code


def _copy_bytes_plainly(target: Any, to: int, source: Any, first: int, count: int) -> None:
    target[to : to + count] = source[first : first + count]


copy_bytes: Any = _copy_bytes_plainly if PLAIN else _copy_bytes


@kernel
def move(source, target, moves):
    """Copy the bytes of ``moves`` (m, 4)."""
    for m in range(moves.shape[0]):
        copy_bytes(target, moves[m, 2], source, moves[m, 1], moves[m, 3])


@kernel
def fill(raw, k, frame, port):
    """Write row k of a block, raw (n, bytes), into the record for the unit; port : Outbound."""
    port.sent[0]["frame"], port.sent[0]["time_s"] = frame, frame / port.rate_hz
    move(raw[k], port.sent_bytes, _OUT)


@kernel
def fill_law(raw, k, frame, port):
    """Write row k, which has its votes, into the record for a control law; as ``fill``."""
    port.sent[0]["frame"], port.sent[0]["time_s"] = frame, frame / port.rate_hz
    move(raw[k], port.sent_bytes, _OUT_TO_LAW)


@kernel
def take(raw, k, port, status):
    """Write the flown values of frame k into its row: the new answer if its ``status`` and content allow it.

    Return the status of the frame: REFUSED in place of ANSWERED for an invalid answer.
    port : Inbound
    """
    answers = status == UnitStatus.ANSWERED or status == UnitStatus.RESTARTED
    if answers:
        note_status(port)
    if answers and port.counts[STARTING] > 0:
        status = status if port.counts[STARTING] <= port.start_frames else UnitStatus.REFUSED.value
    elif answers and not is_allowed(port):
        status = UnitStatus.REFUSED.value
    elif answers:
        accept(port)
    if port.role != _CONTROL_LAW:
        move(port.bytes[FLOWN], raw[k], _VOTES)
    if port.role != _REDUNDANCY:
        move(port.bytes[FLOWN], raw[k], _CONTROL)
    return status


@kernel
def fly_trim(fcc, trim):
    """Hold the surfaces at their first positions during the unit's self-test."""
    for i in range(len(trim)):
        fcc["surface"][i] = trim[i]
    fcc["law"] = _EXTERNAL


@kernel
def conclude(bus, fcc, said, data):
    """Store the unit's votes for the next references, and vote the discretes unless the unit has filled them.

    Without patterns no monitor checks the references, so none is usable.  data : has references and discretes
    """
    remember(bus, fcc, data.references)
    if said & ON_PATTERNS == 0:
        for s in range(S):
            fcc["reference_usable"][s] = 0
    if said & ON_DISCRETES == 0:
        vote_discretes(bus, fcc, data.discretes)


@kernel
def is_starting(status):
    """Return True for a unit whose answers are not flown yet."""
    return _SELF_TEST <= status <= _LAST_STATUS


@kernel
def note_status(port):
    """Store a changed status of the unit, and count the frames of its start."""
    received, kept = port.records[RECEIVED], port.counts[CHANGES]
    last = port.changes[min(kept, MOST_CHANGES) - 1]  # all zero as long as there is none: ready
    outputs = np.int64(0)
    for i in range(_OUTPUTS):
        outputs |= np.int64(received["output_discretes"][i]) << (8 * i)
    if received["status"] != last[1] or received["fault_word"] != last[2] or outputs != last[3]:
        if kept < MOST_CHANGES:
            change = port.changes[kept]
            change[0], change[1] = received["frame"], received["status"]
            change[2], change[3] = received["fault_word"], outputs
        port.counts[CHANGES] += 1
    port.counts[STARTING] = port.counts[STARTING] + 1 if is_starting(received["status"]) else 0


@kernel
def is_allowed(port):
    """Return True if the answer fills the groups of its role, and its states, levels and patterns are valid."""
    said, received = port.records[RECEIVED]["said"], port.bytes[RECEIVED]
    if is_starting(port.records[RECEIVED]["status"]):
        return True
    allowed = said & port.needed == port.needed and port.records[RECEIVED]["status"] <= _LAST_STATUS
    for n in range(_LIMITS.shape[0]):
        if said & _LIMITS[n, 0]:
            for i in range(_LIMITS[n, 2]):
                allowed = allowed and received[_LIMITS[n, 1] + i] <= _LIMITS[n, 3]
    return allowed


@kernel
def copy(records, source, target):
    """Copy one of the records (n, bytes) over another."""
    copy_bytes(records[target], 0, records[source], 0, records.shape[1])


@kernel
def complete(port):
    """Write default values for groups that the answer has not filled.

    With votes, all fitted channels are in use; without votes, states are unknown.  A unit may fill level or states
    alone.  Surfaces without a law of the rig (0 is such a law) have the unit's law.
    """
    received, assumed = port.records[RECEIVED], port.records[ASSUMED]
    said = received["said"]
    unsaid = port.bytes[BLANK] if said & ON_VOTES == 0 else port.bytes[ASSUMED]
    for m in range(_GROUPS.shape[0]):
        group, first = _GROUPS[m, 0], _GROUPS[m, 1]
        if said & group != group:
            copy_bytes(port.bytes[RECEIVED], first, unsaid, first, _GROUPS[m, 3])
    if received["law"] == _UNSAID_LAW:
        received["law"] = _EXTERNAL
    if said & ON_STATES != 0 and (port.no_level or port.no_state):
        for s in range(S):
            states, fitted = received["state"][s], assumed["level"][s]
            if port.no_level:
                received["level"][s] = level_of(states)
            for c in range(CHANNELS if port.no_state else 0):
                states[c] = state_of(c, received["level"][s], fitted)


@kernel
def accept(port):
    """Append the answer to those that wait to be flown; the first answer of a flight fills all places."""
    received, last = port.records[RECEIVED], port.records.shape[0] - 1
    for j in range(FLOWN, last):
        copy(port.bytes, j + 1, j)
    newest = port.records[last]
    for s in range(_SURFACES):
        if not np.isfinite(received["surface"][s]):  # that surface stays where it was
            port.counts[NOT_FINITE] += (received["said"] & ON_SURFACES) != 0
            received["surface"][s] = newest["surface"][s]
    complete(port)
    move(port.bytes[RECEIVED], port.bytes[last], _GROUPS)
    newest["frame"] = received["frame"]
    if port.counts[ACCEPTED] == 0:
        for j in range(FLOWN, last):
            copy(port.bytes, last, j)
    port.counts[ACCEPTED] += 1
