"""How a session with a unit begins: HELLO, what the flight is flown with, READY."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.unit.host import HEAD
from rig.unit.layout import (
    CONFIG,
    FROM_UNIT,
    HELLO,
    LAYOUT,
    PART,
    PART_BYTES,
    READY,
    TO_UNIT,
    VERSION,
    Form,
    Kind,
    blank,
    place,
)
from rig.unit.links import MOST_BYTES, Link, clock

_AGAIN_S: Final = 0.5  # after which an unanswered HELLO or CONFIG is repeated: a box may have lost it


class Dead(Exception):
    """The unit will not answer, and why."""


def open_session(link: Link, config: NDArray[Any], start_s: float, stopped: Callable[[], bool]) -> str:
    """HELLO and CONFIG, each until it is answered; what the unit says of itself.  Dead, Gone.

    config : (1,) CONFIG with its session; start_s : for each of both
    """
    session = int(config["session"][0])
    hello = blank(HELLO, TO_UNIT, Kind.HELLO, session)
    _ask(link, [hello.view(np.uint8).data], session, start_s, stopped)
    return _ask(link, _parts(config, session), session, start_s, stopped)


def _ask(link: Link, messages: list[memoryview], session: int, start_s: float, stopped: Callable[[], bool]) -> str:
    """Send until READY to the last one of ``messages``.

    What cannot be lost is sent once: the READY to a second HELLO would be taken for that to CONFIG.
    """
    until, into = clock() + start_s, memoryview(bytearray(MOST_BYTES))
    while clock() < until and not stopped():
        for message in messages:
            link.send(message)
        again = until if link.reliable else min(until, clock() + _AGAIN_S)
        while clock() < again and not stopped():
            if link.receive(into, again) != READY.itemsize:
                continue
            kind, text = answer(into, session)
            if kind == Kind.REFUSED:
                raise Dead(f"refuses the flight: {text}")
            if kind == Kind.READY:
                return text
    raise Dead(f"has not said READY within start_s = {start_s:g} s")


def answer(message: memoryview, session: int) -> tuple[int, str]:
    """Kind and text of a READY or REFUSED of this session; 0 for any other.  Dead: of other records than ours.

    A unit that cannot be flown at all says REFUSED before it has heard of a session.
    """
    magic, version, kind, layout, of, *_ = HEAD.unpack_from(message)
    if magic != FROM_UNIT or kind not in (Kind.READY, Kind.REFUSED):
        return 0, ""
    if version != VERSION or layout != LAYOUT:
        built = f"layout {layout:016x}, version {version}"
        raise Dead(f"was built for {built}, this rig has {LAYOUT:016x}, version {VERSION}: {REBUILD}")
    if of != session and not (of == 0 and kind == Kind.REFUSED):
        return 0, ""
    first = place(READY, "text")[1]
    return kind, bytes(message[first : READY.itemsize - 8]).split(b"\0")[0].decode(errors="replace")


REBUILD: Final = "write the header again ('rig unit header') and rebuild"


def end_session(link: Link, session: int) -> None:
    """Tell the unit that the flight is over."""
    link.send(blank(HELLO, TO_UNIT, Kind.END, session).view(np.uint8).data)


def _parts(config: NDArray[Any], session: int) -> list[memoryview]:
    """CONFIG in messages that fit into an Ethernet frame."""
    whole = config.view(np.uint8)
    count = -(-len(whole) // PART_BYTES)
    found = []
    for i in range(count):
        part = blank(PART, TO_UNIT, Kind.CONFIG, session)
        data = whole[i * PART_BYTES : (i + 1) * PART_BYTES]
        part["part"], part["parts"] = i, count
        part["bytes"][0, : len(data)] = data
        found.append(part.view(np.uint8).data)
    return found


def configuration(
    rate_hz: float,
    form: Form,
    params: NDArray[np.void],
    discretes: NDArray[np.void],
    boxes: NDArray[np.void],
    trim: NDArray[np.float64],
    limits: NDArray[np.float64],
    names: tuple[str, str],
) -> NDArray[Any]:
    """The (1,) CONFIG of a flight.

    params (S,) PARAMS, discretes (D,) DISCRETE_PARAMS, boxes (1,) BOXES : what our own manager is made with
    trim (4,), limits (4, 2) : of the surfaces; names : of aircraft and flight point
    """
    config = blank(CONFIG, TO_UNIT, Kind.CONFIG)
    for field, records in (("signal", params), ("discrete", discretes)):
        for name in records.dtype.names or ():
            config[0][field][name] = records[name]
    config["rate_hz"], config["form"] = rate_hz, form
    config["box_signals"], config["box_persistence"] = boxes["signals"][0], boxes["persistence"][0]
    config["trim_surface"], config["surface_low"], config["surface_high"] = trim, limits[:, 0], limits[:, 1]
    config["aircraft"], config["flight_point"] = (name.encode()[:63] for name in names)
    return config
