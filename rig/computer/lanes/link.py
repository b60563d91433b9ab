"""The data link between the lanes: what each lane's BUS has of the others' channels in a frame.

Each lane samples its own channel and tells it to the others (exchange.py).  A message that comes later than the
receiver reads is one of the frame before.  A missing sample is not valid in the receiver's BUS, and NaN; inertial
unit and the pilot's commands are common to all lanes.  While nothing is broken and all messages are in time each lane
has what was sampled, and nothing is exchanged one by one.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.lanes.computers_table import Config
from rig.computer.lanes.exchange import NO_LANE, Arrival, Said, arrival, exchange
from rig.core.frame import COMPUTERS, D, Ilm, LinkState, S
from rig.core.kernels import kernel
from rig.core.settings import in_frames
from rig.core.units.angles import limit
from rig.world.faults import break_links
from rig.world.faults.servo_parts import LinkPart, whole_links

_LANES: Final = len(COMPUTERS)
LINK: Final = np.dtype(
    [
        ("fitted", "i8"),
        ("rounds", "i8"),
        ("window", "f8"),  # frames
        ("most", "i8"),  # frames without a message for which the last counts
        ("failed_frames", "i8"),
        ("started", "u1"),
        ("quiet", "u1"),  # nothing was broken or late in the last frame
    ],
    align=True,
)
MESSAGE: Final = np.dtype(
    [
        ("sample", "f8", (S,)),
        ("valid", "u1", (S,)),
        ("ilm", "u1", (S,)),
        ("discrete", "u1", (D,)),
        ("discrete_valid", "u1", (D,)),
        ("discrete_ilm", "u1", (D,)),
    ],
    align=True,
)


class LinkData(NamedTuple):
    """The links of all lanes, (4, 4) receiver by sender."""

    link: NDArray[Any]  # (1,) LINK, in place
    signals: NDArray[Any]  # (S,) PARAMS of the signals' monitors: ranges and thresholds
    parts: NDArray[np.float64]  # (LinkPart, 4, 4) in this frame
    relays: NDArray[np.uint8]  # (4,) lanes whose relays count, for all: none of a lane that the others have failed
    now: NDArray[Any]  # (4,) MESSAGE of this frame, by sender
    before: NDArray[Any]  # (4,) of the frame before
    got: NDArray[Any]  # (4, 4) the last that came
    silent: NDArray[np.int64]  # (4, 4) frames since it came
    arrived: NDArray[np.uint8]  # (4, 4) Arrival
    told: NDArray[Any]  # (4, 4) MESSAGE of one sender, receiver by teller
    words: NDArray[np.int64]  # (4, 4) of these, equal where they are the same
    said: NDArray[np.uint8]  # (4, 4) Said of them
    held: NDArray[np.int64]  # (4,) whose telling each receiver holds
    state: NDArray[np.uint8]  # (4, 4) LinkState
    outvoted: NDArray[np.uint8]  # (4, 4) what came is not what the lane holds


def links(config: Config, rate_hz: float, signals: NDArray[Any]) -> LinkData:
    """Return the links at the first frame; signals : (S,) PARAMS of the signals' monitors."""
    link, square = np.zeros(1, LINK), (_LANES, _LANES)
    state = np.full(square, LinkState.ABSENT, np.uint8)
    state[: config.count, : config.count] = LinkState.FRESH
    np.fill_diagonal(state, LinkState.ABSENT)
    link["fitted"], link["rounds"] = config.count, config.exchange_rounds
    link["window"], link["most"] = config.exchange_window, config.max_age_frames
    link["failed_frames"], link["quiet"] = in_frames(1, config.link_persistence_s, rate_hz), 1
    return LinkData(
        link=link,
        signals=signals,
        parts=whole_links(),
        relays=np.ones(_LANES, np.uint8),
        now=np.zeros(_LANES, MESSAGE),
        before=np.zeros(_LANES, MESSAGE),
        got=np.zeros(square, MESSAGE),
        silent=np.zeros(square, np.int64),
        arrived=np.zeros(square, np.uint8),
        told=np.zeros(square, MESSAGE),
        words=np.zeros(square, np.int64),
        said=np.zeros(square, np.uint8),
        held=np.zeros(_LANES, np.int64),
        state=state,
        outvoted=np.zeros(square, np.uint8),
    )


@kernel
def share_samples(row, each, lead, running, faults, data):
    """Write the BUS records of all lanes from what was sampled in ``row``, with the faults of links.

    each : (4,) BUS;  lead : (4,) frames by which each samples early;  running : (4,) lanes that transmit
    data : LinkData
    Return True if every lane has what was sampled.
    """
    link, bus = data.link[0], row["bus"]
    broken = break_links(row, data.parts, faults)
    broken |= silence(running, data.parts, link["fitted"])
    for i in range(link["fitted"]):
        each[i] = bus
        data.before[i] = data.now[i]
        pack(bus, i, data.now[i])
        if link["started"] == 0:
            data.before[i] = data.now[i]
    link["started"] = 1
    if not broken and in_time(lead, link):
        if link["quiet"] == 0:
            settle(data)
        return True
    if link["quiet"] != 0:
        for i in range(link["fitted"]):
            for j in range(link["fitted"]):
                data.got[i, j] = data.before[j]
        link["quiet"] = 0
    receive(lead, data)
    for j in range(link["fitted"]):
        tell(j, data)
        exchange(j, data.words, data.said, link["rounds"], data.held)
        hold(j, each, data)
    return False


@kernel
def silence(running, parts, fitted):
    """Let nothing come from lanes that are not ``running``; return True if there are some."""
    some = False
    for j in range(fitted):
        if running[j] == 0:
            parts[LinkPart.SILENT, :, j] = 1.0
            some = True
    return some


@kernel
def in_time(lead, link):
    """Return True if every lane reads the messages of all others in the frame in which they are sent."""
    first, last = lead[0], lead[0]
    for i in range(1, link["fitted"]):
        first, last = max(first, lead[i]), min(last, lead[i])
    return first - last <= link["window"]


@kernel
def settle(data):
    """Note that all messages are fresh."""
    data.link[0]["quiet"] = 1
    for i in range(data.link[0]["fitted"]):
        for j in range(data.link[0]["fitted"]):
            data.silent[i, j], data.outvoted[i, j] = 0, 0
            data.state[i, j] = LinkState.ABSENT.value if i == j else LinkState.FRESH.value


@kernel
def receive(lead, data):
    """Take in the messages of round 1."""
    link, silent = data.link[0], data.silent
    for i in range(link["fitted"]):
        for j in range(link["fitted"]):
            if i == j:
                continue
            ahead = lead[i] - lead[j]
            if comes(i, j, data):
                silent[i, j] = 0
                data.got[i, j] = data.before[j] if ahead > link["window"] else data.now[j]
                put_off(data.got[i, j], data.parts[LinkPart.OFFSET, i, j], data.signals)
            else:
                silent[i, j] += 1
            intact = data.parts[LinkPart.DAMAGED, i, j] == 0.0
            found = arrival(ahead, link["window"], intact, silent[i, j], link["most"])
            data.arrived[i, j], data.outvoted[i, j] = found, 0
            data.state[i, j] = state_of(found, silent[i, j], link)


@kernel
def comes(i, j, data):
    """Return True if a new message comes undamaged from lane j to lane i."""
    parts = data.parts
    return (
        parts[LinkPart.SILENT, i, j] == 0.0
        and parts[LinkPart.FROZEN, i, j] == 0.0
        and parts[LinkPart.DAMAGED, i, j] == 0.0
    )


@kernel
def state_of(found, silent, link):
    """Return the LinkState of a link on which an Arrival was ``found``."""
    if silent >= link["failed_frames"]:
        return LinkState.FAILED.value
    if found == Arrival.MISSING:
        return LinkState.MISSING.value
    return LinkState.FRESH.value if found == Arrival.FRESH else LinkState.OLD.value


@kernel
def tell(sender, data):
    """Write what each lane is told of the message of ``sender``: directly, and by relays of round 2."""
    link, told, said, words = data.link[0], data.told, data.said, data.words
    for i in range(link["fitted"]):
        for k in range(len(data.held)):
            said[i, k], words[i, k] = Said.NOTHING.value, k
            if i in (sender, k) or k >= link["fitted"]:
                continue
            if k != sender and (data.relays[k] == 0 or data.arrived[i, k] != Arrival.FRESH):
                continue  # its relay does not arrive either
            if data.arrived[k if k != sender else i, sender] == Arrival.MISSING:
                said[i, k] = Said.MISSING.value
                continue
            said[i, k] = Said.WORD.value
            told[i, k] = data.got[i, sender] if k == sender else data.got[k, sender]
            if k != sender:
                put_off(told[i, k], data.parts[LinkPart.OFFSET, i, k], data.signals)
            for other in range(k):
                if said[i, other] == Said.WORD and same(told[i, other], told[i, k]):
                    words[i, k] = words[i, other]


@kernel
def hold(sender, each, data):
    """Write what the other lanes hold of the message of ``sender`` into their BUS records, (4,) ``each``."""
    for i in range(data.link[0]["fitted"]):
        if i == sender:
            continue
        teller = data.held[i]
        if teller == NO_LANE:
            miss(each[i], sender)
        else:
            unpack(data.told[i, teller], each[i], sender)
        if data.said[i, sender] == Said.WORD:
            data.outvoted[i, sender] = teller == NO_LANE or data.words[i, teller] != data.words[i, sender]


@kernel
def pack(bus, c, message):
    """Write channel c of a BUS record into a MESSAGE."""
    for s in range(S):
        message["sample"][s], message["valid"][s], message["ilm"][s] = (
            bus["channels"][s, c], bus["valid"][s, c], bus["ilm"][s, c]
        )  # fmt: skip
    for d in range(D):
        message["discrete"][d], message["discrete_valid"][d], message["discrete_ilm"][d] = (
            bus["discrete_channels"][d, c], bus["discrete_valid"][d, c], bus["discrete_ilm"][d, c]
        )  # fmt: skip


@kernel
def unpack(message, bus, c):
    """Write a MESSAGE into channel c of a BUS record."""
    for s in range(S):
        bus["channels"][s, c], bus["valid"][s, c], bus["ilm"][s, c] = (
            message["sample"][s], message["valid"][s], message["ilm"][s]
        )  # fmt: skip
    for d in range(D):
        bus["discrete_channels"][d, c], bus["discrete_valid"][d, c], bus["discrete_ilm"][d, c] = (
            message["discrete"][d], message["discrete_valid"][d], message["discrete_ilm"][d]
        )  # fmt: skip


@kernel
def miss(bus, c):
    """Mark all samples of channel c missing; results of their in-line monitors are missing too."""
    for s in range(S):
        if bus["ilm"][s, c] != Ilm.ABSENT:
            bus["channels"][s, c], bus["valid"][s, c], bus["ilm"][s, c] = np.nan, 0, Ilm.BAD
    for d in range(D):
        if bus["discrete_ilm"][d, c] != Ilm.ABSENT:
            bus["discrete_channels"][d, c], bus["discrete_valid"][d, c], bus["discrete_ilm"][d, c] = 0, 0, Ilm.BAD


@kernel
def put_off(message, thresholds, signals):
    """Add ``thresholds`` of its signal's monitor to every sample of a MESSAGE; signals : (S,) PARAMS."""
    if thresholds == 0.0:
        return
    for s in range(S):
        p = signals[s]
        x = message["sample"][s] + thresholds * p["threshold"]
        message["sample"][s] = limit(x, p["low"], p["high"], p["wraps"])


@kernel
def same(one, other):
    """Return True if two MESSAGEs are equal, bit for bit; NaN equals NaN."""
    for s in range(S):
        x, y = one["sample"][s], other["sample"][s]
        if not (x == y or (x != x and y != y)):
            return False
        if one["valid"][s] != other["valid"][s] or one["ilm"][s] != other["ilm"][s]:
            return False
    for d in range(D):
        if (
            one["discrete"][d] != other["discrete"][d]
            or one["discrete_valid"][d] != other["discrete_valid"][d]
            or one["discrete_ilm"][d] != other["discrete_ilm"][d]
        ):
            return False
    return True
