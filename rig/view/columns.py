"""Rows of a block as Rerun columns, in the form in which Rerun's MCAP importer shows our log.

Entities, component names, struct fields and the timeline are the importer's, so one blueprint serves
the stream and the opened log:

    /signal/<name>, /discrete/<name>   rig.Signal:message, rig.Discrete:message    one struct a frame
    /control, /demand, /flight         rig.Control:message, ...
    /pose, /position, /events          Transform3D, GeoPoints, TextLog

and, for the viewer alone, /deviation/<name> (see deviation.py) and the figure of an aircraft.

Each field of FRAME has one place in one struct, so a signal or a command added there appears by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from rig.frame import DISCRETES, FLIGHT_INDEX, SIGNALS, Block
from rig.names import ENUMS, FLAGS, places
from rig.view import deviation

TIMELINE: Final = "message_log_time"  # the importer's name for the log time of a message
WORLD: Final = "world"
AIRCRAFT: Final = "aircraft"

_LEVELS: Final = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class EventLike(Protocol):
    """What is shown of an event; rig.events.Event is one."""

    @property
    def frame(self) -> int: ...  # noqa: D102
    @property
    def level(self) -> str: ...  # noqa: D102
    @property
    def text(self) -> str: ...  # noqa: D102


class Entity(NamedTuple):
    """One entity with one struct; ``item`` is its row in the arrays of FRAME, None where there are no rows."""

    path: str
    archetype: str
    item: int | None


ENTITIES: Final = (
    *(Entity(signal.topic, "rig.Signal", i) for i, signal in enumerate(SIGNALS)),
    *(Entity(discrete.topic, "rig.Discrete", i) for i, discrete in enumerate(DISCRETES)),
    Entity("/control", "rig.Control", None),
    Entity("/demand", "rig.Demand", None),
    Entity("/inertial", "rig.Inertial", None),
    Entity("/flight", "rig.Flight", None),
)


def send_block(recording: rr.RecordingStream, rows: Block, rate_hz: float, events: Sequence[EventLike] = ()) -> None:
    """Send every row of ``rows`` and the events among them, one batch an entity.

    Measured with blocks of 100 frames: see docs/viewer.md.  Rerun reports trouble with a sink in its own
    log, not as an exception.
    """
    time = [time_column(np.rint(rows["frame"] * (1e9 / rate_hz)))]
    for entity in ENTITIES:
        send_structs(recording, entity.path, entity.archetype, time, struct(rows, entity))
    for i, signal in enumerate(SIGNALS):
        shown = deviation.from_rows(rows, i)
        send_structs(recording, deviation.path(signal), deviation.ARCHETYPE, time, shown)
    _send_place(recording, rows, time)
    if events:
        _send_events(recording, events, rate_hz)


def send_structs(
    recording: rr.RecordingStream,
    path: str,
    archetype: str,
    time: Sequence[rr.TimeColumn],
    structs: pa.StructArray,
) -> None:
    """One batch of structs as the component <archetype>:message of the entity ``path``."""
    columns = rr.DynamicArchetype.columns(archetype=archetype, components={"message": structs})
    rr.send_columns(path, time, columns, recording=recording)


def send_aircraft(recording: rr.RecordingStream) -> None:
    """A stick figure of an aircraft, 15 m long, which follows /pose; x forward, y left, z up."""
    strips = [
        [[8, 0, 0], [-7, 0, 0]],  # fuselage
        [[-2, 5, 0], [1, 0, 0], [-2, -5, 0]],  # wing
        [[-7, 2.5, 0], [-5, 0, 0], [-7, -2.5, 0]],  # tailplane
        [[-5, 0, 0], [-7, 0, 3], [-7, 0, 0]],  # fin
    ]
    colors = [(230, 230, 230), (86, 180, 233), (86, 180, 233), (230, 159, 0)]
    shape = rr.LineStrips3D(strips, colors=colors, radii=0.15)
    rr.log("/aircraft", shape, rr.CoordinateFrame(AIRCRAFT), static=True, recording=recording)


def struct(rows: Block, entity: Entity) -> pa.StructArray:
    """The fields of ``entity`` in every row, one struct each."""
    item = () if entity.item is None else (entity.item,)
    shown = places(entity.archetype)
    arrays = [_array(place.field, rows[place.field][(slice(None), *item, *place.index)]) for place in shown]
    fields = [pa.field(p.name, array.type, nullable=False) for p, array in zip(shown, arrays, strict=True)]
    return pa.StructArray.from_arrays(arrays, fields=fields)


def _array(source: str, values: NDArray[Any]) -> pa.Array:
    values = np.ascontiguousarray(values)
    if source in ENUMS:
        return _members(ENUMS[source], values)
    if source in FLAGS:
        return pa.array(values != 0)
    return pa.array(values if values.dtype == np.float64 else values.astype(np.uint32))


def _members(enum: type[IntEnum], values: NDArray[np.uint8]) -> pa.StructArray:
    if len(values) and (values == values[0]).all():  # nearly always, and ten times as fast
        return _unchanging(enum, int(values[0]), len(values))
    return _enum_table(enum).take(pa.array(values))


@lru_cache(maxsize=256)
def _unchanging(enum: type[IntEnum], value: int, rows: int) -> pa.StructArray:
    return _enum_table(enum).take(pa.array([value] * rows))


@cache
def _enum_table(enum: type[IntEnum]) -> pa.StructArray:
    """What the importer makes of each of the 256 values that a u1 can hold; no name where the enum has none."""
    names = {member.value: member.name for member in enum}
    return pa.StructArray.from_arrays(
        [pa.array([names.get(i) for i in range(256)]), pa.array(range(256), pa.int32())], names=["name", "value"]
    )


def time_column(nanoseconds: NDArray[Any]) -> rr.TimeColumn:
    """Simulation time, as the log has it."""
    return rr.TimeColumn(TIMELINE, duration=nanoseconds.astype("timedelta64[ns]"))


def _send_place(recording: rr.RecordingStream, rows: Block, time: list[rr.TimeColumn]) -> None:
    """Pose, in a world of x east, y north, z up with the aircraft's x forward, y left, z up; and position."""

    def of(*names: str) -> NDArray[np.float64]:
        return rows["flight"][:, [FLIGHT_INDEX[name] for name in names]]

    pose = rr.Transform3D.columns(
        translation=of("east_m", "north_m", "altitude_m"),
        quaternion=east_north_up(of("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")),
        parent_frame=[WORLD] * len(rows),
        child_frame=[AIRCRAFT] * len(rows),
    )
    rr.send_columns("/pose", time, pose, recording=recording)
    position = rr.GeoPoints.columns(positions=np.degrees(of("latitude_rad", "longitude_rad")))
    rr.send_columns("/position", time, position, recording=recording)


def east_north_up(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Attitude of an aircraft with forward-left-up axes in an east-north-up world, (n, 4) as x, y, z, w.

        q_enu_flu = q_enu_ned * q_ned_frd * q_frd_flu,  q_enu_ned = (0, 1, 1, 0)/sqrt 2,  q_frd_flu = (0, 1, 0, 0)

    quaternion : (n, 4) as w, x, y, z, from forward-right-down to north-east-down.  The sign is free.
    """
    w, x, y, z = quaternion.T
    return np.sqrt(0.5) * np.column_stack([x + y, x - y, w - z, w + z])


def _send_events(recording: rr.RecordingStream, events: Sequence[EventLike], rate_hz: float) -> None:
    time = time_column(np.rint([event.frame * (1e9 / rate_hz) for event in events]))
    text = rr.TextLog.columns(
        text=[event.text for event in events], level=[_LEVELS.get(event.level, "INFO") for event in events]
    )
    rr.send_columns("/events", [time], text, recording=recording)
