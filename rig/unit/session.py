"""A session with a unit: the configuration of the flight, and the check of answers."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, TypedDict

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.discrete_config import DISCRETE_PARAMS
from rig.computer.redundancy.manager_config import PARAMS, without_lanes
from rig.core.frame import D, S
from rig.unit.host import HEAD
from rig.unit.ready_message import UnitStopped, read_ready, sealed
from rig.unit.transport import SocketLink
from rig.unit.unit_records import (
    CONFIG,
    FROM_UNIT,
    HELLO,
    INTERFACE,
    MORE_THAN_HALF,
    OUTPUT,
    SETTINGS,
    TIE_BREAKS,
    TO_UNIT,
    Interface,
    Kind,
    Role,
    blank,
    place,
)

_TAIL: Final = struct.Struct("<II")
_BEGIN: Final = struct.Struct("<24sq")  # all of the head that a session keeps, and the frame
_STEPPED: Final = struct.Struct("<Q")
_STEPPED_AT: Final = place(OUTPUT, "stepped")[1]


def end_session(link: SocketLink, session: int) -> None:
    """Tell the unit that the flight is over."""
    link.send(sealed(blank(HELLO, TO_UNIT, Kind.END, session, link.interface or INTERFACE)))


def configuration(
    rate_hz: float,
    role: Role,
    params: NDArray[np.void],
    discretes: NDArray[np.void],
    boxes: NDArray[np.void],
    trim: NDArray[np.float64],
    limits: NDArray[np.float64],
    names: tuple[str, str],
) -> NDArray[Any]:
    """Return the (1,) CONFIG of a flight.

    params (S,) PARAMS, discretes (D,) DISCRETE_PARAMS, boxes (1,) BOXES : settings of the built-in manager
    trim (4,), limits (4, 2) : of the surfaces; names : of aircraft and flight point
    """
    config = blank(CONFIG, TO_UNIT, Kind.CONFIG)
    for part, key, records in _settings(params, discretes):
        config[0][part][key] = without_lanes(records[key])[:, :TIE_BREAKS] if key == "tie_break" else records[key]
    config["rate_hz"], config["role"] = rate_hz, role
    config["box_signals"], config["box_persistence"] = boxes["signals"][0], boxes["persistence"][0]
    config["trim_surface"], config["surface_low"], config["surface_high"] = trim, limits[:, 0], limits[:, 1]
    config["aircraft"], config["flight_point"] = (name.encode()[:63] for name in names)
    return config


def settings_of(config: NDArray[Any]) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return the settings of the built-in manager in a (1,) CONFIG: (S,) PARAMS, (D,) DISCRETE_PARAMS."""
    params, discretes = np.zeros(S, PARAMS), np.zeros(D, DISCRETE_PARAMS)
    for part, key, records in _settings(params, discretes):
        if key == "tie_break":
            records[key][:, :TIE_BREAKS] = config[0][part][key]
        else:
            records[key] = config[0][part][key]
    return params, discretes


class BoxRule(TypedDict):
    """Keywords of the built-in manager for the isolation of a box."""

    box_signals: int | None
    box_persistence: int


def box_rule(config: NDArray[Any]) -> BoxRule:
    """Return the rule of boxes in a (1,) CONFIG."""
    signals = int(config["box_signals"][0])
    needed = None if signals == MORE_THAN_HALF else signals
    return BoxRule(box_signals=needed, box_persistence=int(config["box_persistence"][0]))


def _settings(params: NDArray[np.void], discretes: NDArray[np.void]) -> Iterator[tuple[str, str, NDArray[np.void]]]:
    """Yield each setting of the rig in CONFIG: its part, its name, and the rig's records."""
    for part, keys in SETTINGS.items():
        for key in keys:
            yield part, key, discretes if part == "discrete" else params


# Frames -------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Counts:
    """Counts of the frames of a flight; all except ``answered`` count faults."""

    answered: int = 0  # counted by the port
    missed: int = 0  # frames without an answer by their deadline
    late: int = 0  # answers that came after it, and were not flown
    discarded: int = 0  # messages that were none: doubled, of another session, of another form
    refused: int = 0  # answers with a state out of its enum, or without what the role needs
    not_finite: int = 0  # surfaces, which stayed where they were
    requests_lost: int = 0  # of the missed frames: the unit has never stepped them
    replies_lost: int = 0  # of the missed frames: it has, and no answer ever came
    longest_run: int = 0  # of frames in a row without an answer that was flown
    restarts: int = 0
    dead_frame: int | None = None

    @property
    def reproducible(self) -> bool:
        """True if nothing depended on the wall clock: every frame flew the answer to it."""
        return self.missed == self.late == self.restarts == 0


@dataclass(slots=True)
class _Lost:
    """Counts of messages that seem lost between two answers."""

    requests: int
    replies: int


@dataclass(slots=True)
class ReplyCheck:
    """Distinction between the answers of one session and other messages, with counts of both."""

    session: int
    counts: Counts
    interface: Interface = INTERFACE
    run: int = 0  # frames in a row without an answer that was flown
    last_frame: int = -1  # that was answered
    _reply: bytes = b""  # how an answer begins
    _tail: bytes = b""  # and ends
    _stepped: int = 0  # by the unit, as its last answer said
    restarted: bool = False  # it has said since its last answer that it is there, in no session
    _open: set[int] = field(default_factory=set)  # missed frames since the last answer
    _overtaken: dict[int, _Lost] = field(default_factory=dict)  # missed ones before it, whose answers may still come

    def __post_init__(self) -> None:
        """Compute the head of an answer of this session."""
        self._reply = HEAD.pack(
            FROM_UNIT, self.interface.version, Kind.REPLY, self.interface.layout, self.session, 0, 0.0
        )[:24]
        self._tail = _TAIL.pack(self.interface.output_bytes - _TAIL.size, 0)

    def is_answer(self, message: memoryview, frame: int) -> bool:
        """Return True if ``message`` answers ``frame``; count any other.  UnitStopped: the unit reports a failure."""
        usual = len(message) == self.interface.output_bytes and message[-_TAIL.size :] == self._tail
        if usual and _BEGIN.unpack_from(message) == (self._reply, frame):
            self._note_answer(message, frame)
            return True
        return self._is_unusual_answer(message, frame)

    def _is_unusual_answer(self, message: memoryview, frame: int) -> bool:
        if len(message) >= HEAD.size:
            magic, version, kind, layout, session, of_frame, _ = HEAD.unpack_from(message)
            ours = (magic, version, layout, session) == (FROM_UNIT, *self.interface[:2], self.session)
            if ours and kind == Kind.REPLY and _whole(message, self.interface):
                if of_frame == frame:
                    self._note_answer(message, frame)
                    return True
                if of_frame in self._open or of_frame in self._overtaken:
                    self._note_late(message, of_frame)
                    return False
            if (magic, version, layout, kind) == (FROM_UNIT, *self.interface[:2], Kind.READY):
                self.restarted |= session == 0  # or it answers a HELLO once more: then it goes on to answer frames
                if session in (0, self.session):
                    return False
            if ours and kind == Kind.REFUSED and of_frame == frame:
                raise UnitStopped(f"failed: {read_ready(message).text}")
        self.counts.discarded += 1
        return False

    def _note_answer(self, message: memoryview, frame: int) -> None:
        """Count lost requests and replies before this answer, by the steps that the unit has counted, if it does."""
        stepped = _STEPPED.unpack_from(message, _STEPPED_AT)[0]
        if self._open:
            unanswered, requested, lost = len(self._open), frame - self.last_frame, _Lost(0, 0)
            if stepped:
                lost.requests = min(unanswered, max(0, requested - (stepped - self._stepped)))
                lost.replies = unanswered - lost.requests
            self.counts.requests_lost += lost.requests
            self.counts.replies_lost += lost.replies
            self._overtaken |= dict.fromkeys(self._open, lost)
        self._open.clear()
        self._stepped, self.last_frame, self.restarted = stepped, frame, False

    def _note_late(self, message: memoryview, frame: int) -> None:
        """Count the answer to a missed frame; an answer that later ones have overtaken is not lost."""
        self.counts.late += 1
        self._open.discard(frame)
        lost = self._overtaken.pop(frame, None)
        if lost is None:
            return
        if lost.replies:
            lost.replies -= 1
            self.counts.replies_lost -= 1
        elif lost.requests:  # it was the request that others had overtaken
            lost.requests -= 1
            self.counts.requests_lost -= 1
        self._stepped = max(self._stepped, _STEPPED.unpack_from(message, _STEPPED_AT)[0])

    @property
    def awaits_late(self) -> bool:
        """Return True if answers to missed frames may still come."""
        return bool(self._open or self._overtaken)

    def catch_up(self, frame: int, stepped: int) -> None:
        """Note that compiled code received answers to all frames up to ``frame``."""
        if frame > self.last_frame:
            self.last_frame, self._stepped = frame, stepped

    def missed(self, frame: int) -> None:
        """Count a frame without an answer by its deadline."""
        self.counts.missed += 1
        self._open.add(frame)

    def flown(self, answered: bool, refused: bool) -> None:
        """Count the status of the frame."""
        if answered:
            self.run = 0
            return
        self.run += 1
        self.counts.longest_run = max(self.counts.longest_run, self.run)
        self.counts.refused += refused

    def begin_again(self) -> None:
        """Begin with a restarted unit."""
        self.run, self.last_frame, self._stepped, self.restarted = 0, -1, 0, False
        self._open.clear()
        self._overtaken.clear()


def _whole(message: memoryview, interface: Interface) -> bool:
    """Return True if an answer has its length, states it, and has the right checksum if it has one."""
    if len(message) != interface.output_bytes:
        return False
    length, crc = _TAIL.unpack_from(message, len(message) - _TAIL.size)
    return length == len(message) - _TAIL.size and crc in (0, zlib.crc32(message[:length]) if crc else 0)
