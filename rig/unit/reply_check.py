"""What arrived and what did not: which message is the answer to a frame, and how many were none."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Final

from rig.unit.host import HEAD
from rig.unit.layout import FROM_UNIT, LAYOUT, OUTPUT, VERSION, Kind, place
from rig.unit.session import Dead, answer

_TAIL: Final = struct.Struct("<II")
_BODY: Final = OUTPUT.itemsize - _TAIL.size
_USUAL_TAIL: Final = _TAIL.pack(_BODY, 0)
_BEGIN: Final = struct.Struct("<24sq")  # all of the head that a session keeps, and the frame
_STEPPED: Final = struct.Struct("<Q")
_STEPPED_AT: Final = place(OUTPUT, "stepped")[1]


@dataclass(slots=True)
class Counts:
    """What became of the frames of a flight; all but ``answered`` are counts of what went wrong."""

    answered: int = 0  # counted by the port
    missed: int = 0  # frames without an answer by their deadline
    late: int = 0  # answers that came after it, and were not flown
    discarded: int = 0  # messages that were none: doubled, of another session, of another form
    refused: int = 0  # answers with a state out of its enum, or without what the form needs
    not_finite: int = 0  # surfaces, which stayed where they were
    requests_lost: int = 0  # of the missed frames: the unit has never stepped them
    replies_lost: int = 0  # of the missed frames: it has, and no answer ever came
    longest_run: int = 0  # of frames in a row without an answer that was flown
    restarts: int = 0
    dead_frame: int | None = None

    @property
    def reproducible(self) -> bool:
        """Whether nothing depended on the wall clock: every frame flew its own answer."""
        return self.missed == self.late == self.restarts == 0


@dataclass(slots=True)
class Watch:
    """Tells the answers of one session from other messages, and counts both."""

    session: int
    counts: Counts
    run: int = 0  # frames in a row without an answer that was flown
    last_frame: int = -1  # that was answered
    _reply: bytes = b""  # how an answer begins
    _stepped: int = 0  # by the unit, as its last answer said
    _open: set[int] = field(default_factory=set)  # missed frames whose answer may still come

    def __post_init__(self) -> None:
        """Know how an answer of this session begins."""
        self._reply = HEAD.pack(FROM_UNIT, VERSION, Kind.REPLY, LAYOUT, self.session, 0, 0.0)[:24]

    def is_answer(self, message: memoryview, frame: int) -> bool:
        """Whether ``message`` answers ``frame``; any other is counted.  Dead: the unit says that it has failed."""
        usual = len(message) == OUTPUT.itemsize and message[_BODY:] == _USUAL_TAIL
        if usual and _BEGIN.unpack_from(message) == (self._reply, frame):
            self._heard(message, frame)
            return True
        return self._is_unusual_answer(message, frame)

    def _is_unusual_answer(self, message: memoryview, frame: int) -> bool:
        if len(message) >= HEAD.size:
            magic, version, kind, layout, session, of, _ = HEAD.unpack_from(message)
            ours = (magic, version, layout, session) == (FROM_UNIT, VERSION, LAYOUT, self.session)
            if ours and kind == Kind.REPLY and _whole(message):
                if of == frame:
                    self._heard(message, frame)
                    return True
                if of in self._open:
                    self._open.discard(of)
                    self.counts.late += 1
                    return False
            if ours and kind == Kind.REFUSED and of == frame:
                raise Dead(f"failed: {answer(message, self.session)[1]}")
        self.counts.discarded += 1
        return False

    def _heard(self, message: memoryview, frame: int) -> None:
        """Keep what the answer says of the frames before it; a unit that does not count its steps says nothing."""
        stepped = _STEPPED.unpack_from(message, _STEPPED_AT)[0]
        if self._open and stepped:
            unheard, asked = len(self._open), frame - self.last_frame
            lost = min(unheard, max(0, asked - (stepped - self._stepped)))
            self.counts.requests_lost += lost
            self.counts.replies_lost += unheard - lost
        self._open.clear()
        self._stepped, self.last_frame = stepped, frame

    def catch_up(self, frame: int, stepped: int) -> None:
        """Frames up to ``frame`` were answered, without one that was not, while compiled code looked."""
        if frame > self.last_frame:
            self.last_frame, self._stepped = frame, stepped

    def missed(self, frame: int) -> None:
        """No answer to ``frame`` by its deadline."""
        self.counts.missed += 1
        self._open.add(frame)

    def flown(self, answered: bool, refused: bool) -> None:
        """What the frame came to."""
        if answered:
            self.run = 0
            return
        self.run += 1
        self.counts.longest_run = max(self.counts.longest_run, self.run)
        self.counts.refused += refused

    def begin_again(self) -> None:
        """The unit has been started again."""
        self.run, self.last_frame, self._stepped = 0, -1, 0
        self._open.clear()


def _whole(message: memoryview) -> bool:
    """Whether an answer has its length, says so, and has the right checksum if it has one."""
    if len(message) != OUTPUT.itemsize:
        return False
    length, crc = _TAIL.unpack_from(message, _BODY)
    return length == _BODY and crc in (0, zlib.crc32(message[:length]) if crc else 0)
