"""The conformance test of a box at an address: it serves one rig, and is free after the end of its session."""

from __future__ import annotations

from collections.abc import Iterator
from time import sleep
from typing import Any, Final

from numpy.typing import NDArray

from rig.unit.ready_message import Ready, UnitStopped, read_ready, sealed
from rig.unit.running_unit import UnitUnderTest
from rig.unit.session import end_session
from rig.unit.transport import MOST_BYTES, SocketLink, clock
from rig.unit.unit_records import HELLO, TO_UNIT, Kind, blank
from rig.unit.vectors import ask

SILENCE_S: Final = 3.0  # after which a session is over, docs/how-to/fly-your-software.md
_ANSWER_S: Final = 1.0  # for one HELLO, which is repeated
_AGAIN_S: Final = 0.2
_MARGIN_S: Final = 0.5
_SESSION: Final = 12345  # of the second rig; flights draw theirs from 63 bits


def check(tested: UnitUnderTest, config: NDArray[Any], inputs: NDArray[Any]) -> Iterator[tuple[str, str]]:
    """Yield each requirement with its fault, "" if none; yield nothing for a unit that the rig has started.

    config : (1,) CONFIG; inputs : (n,) INPUT of its first frames
    """
    link = tested.link
    if not isinstance(link, SocketLink) or link.process is not None:
        return
    other = link.another()
    try:
        tested.begin(config.copy())
        yield "it refuses another rig as busy, without any change", _busy(tested, other, inputs)
        tested.end()
        yield "the end of a session frees it for another rig", _free(tested, other)
        tested.begin(config.copy())
        sleep(SILENCE_S + _MARGIN_S)
        yield "a silence of 3 s frees it for another rig", _free(tested, other)
    finally:
        other.close()


def _busy(tested: UnitUnderTest, other: SocketLink, inputs: NDArray[Any]) -> str:
    if not ask(tested, inputs[0], 0):
        return "no answer to frame 0"
    answer = _greet(tested, other)
    if answer is None:
        return "no answer to HELLO of another rig, must be REFUSED"
    if answer.kind != Kind.REFUSED:
        end_session(other, _SESSION)
        return "HELLO of another rig was answered READY, must be REFUSED"
    if not answer.text.startswith("busy with session "):
        return f"REFUSED has the text {answer.text!r}, must begin with 'busy with session'"
    return "" if ask(tested, inputs[1], 1) else "no answer to frame 1, after HELLO of another rig"


def _free(tested: UnitUnderTest, other: SocketLink) -> str:
    answer = _greet(tested, other)
    if answer is None or answer.kind != Kind.READY:
        return "no answer to HELLO of another rig" if answer is None else f"it refuses: {answer.text!r}"
    end_session(other, _SESSION)
    return ""


def _greet(tested: UnitUnderTest, other: SocketLink) -> Ready | None:
    """Return the answer to HELLO of a second rig, None for none."""
    hello = sealed(blank(HELLO, TO_UNIT, Kind.HELLO, _SESSION, tested.interface))
    into, until = memoryview(bytearray(MOST_BYTES)), clock() + _ANSWER_S
    while other.receive(into, clock()):  # answers to an earlier HELLO, which was repeated
        pass
    while clock() < until:
        other.send(hello)
        count = other.receive(into, clock() + _AGAIN_S)
        try:
            answer = read_ready(into[:count]) if count else None
        except UnitStopped:  # of another layout
            continue
        if answer is not None and not answer.wrong:
            return answer
    return None
