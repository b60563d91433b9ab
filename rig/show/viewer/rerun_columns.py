"""Rows of a block as Rerun columns, in the form in which Rerun's MCAP importer shows a log of the rig.

Entities, component names, struct fields and the timeline are the importer's, so that one blueprint serves the
stream and the opened log:

    /signal/<name>, /discrete/<name>   rig.Signal:message, rig.Discrete:message    one struct per frame
    /control, /autopilot_command, /flight         rig.Control:message, ...
    /pose, /position, /events          Transform3D, GeoPoints, TextLog
    /actuator/<surface>                rig.Actuator:message, of flights with servos
    /computer/<A to D>                 lists of numbers only: a message has 170

for the viewer only, the wall clock of a flight with a unit under test

    /timing                            rig.Timing:message, one struct per frame
    /timing/replies                    reply times per bin, from the begin of the flight to the cursor
    /timing/lateness                   the same for the lateness; of paced flights only

and the output of derived.py, state_strips.py, servo_series.py, lanes_view.py, matrix.py and scene.py.  The lists of
derived.py are one more component of the entity of their signal, because each entity costs the viewer a clock and a
name for every row.

Each field of FRAME has one place in one struct, so an added signal or command appears without a change here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from rig.core.event import Event
from rig.core.frame import Block, End, Table
from rig.flight.time_histogram import BINS, EDGES_US, binned
from rig.log.schema import BOOL, FRAME_TOPICS, MESSAGES, PART_MESSAGES, TOPICS_OF_ROWS, Field, Topic
from rig.show.viewer import derived, matrix
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer import state_strips as strips
from rig.show.viewer.facts import UNKNOWN, Facts
from rig.show.viewer.scene import Scene, time_column
from rig.show.viewer.style import OVER, PALETTE, VOTED, Color

_TIMED: Final = next(topic for topic in FRAME_TOPICS if topic not in TOPICS_OF_ROWS)
CLOCK, CLOCK_TYPE = _TIMED.name, _TIMED.message
BESIDE: Final = (servos.SHOWN, computers.SHOWN)
_BARE: Final = ("fault", "lane", "leading lane", "link", "back-up")  # events with texts that need the name
_LEVELS: Final = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class Bars(NamedTuple):
    """A histogram."""

    path: str
    field: str  # of TIMING
    name: str


REPLIES: Final = Bars(f"{CLOCK}/replies", "reply_us", "reply times: frames over log10 of µs")
LATENESS: Final = Bars(f"{CLOCK}/lateness", "late_us", "lateness: frames over log10 of µs")
# Positions of the bars: the middle of each bin, and half a decade beyond the last edge.
_ABSCISSA: Final = np.array(
    [np.log10(high) - 0.15 for high in EDGES_US] + [np.log10(EDGES_US[-1]) + 0.15], dtype=np.float64
)


class Times:
    """Sends the timing of one flight, block after block."""

    def __init__(self, send: Callable[[str, Any, Any], None]) -> None:
        """Begin to count; ``send``: path, time columns, columns."""
        self._send = send
        self._counts = {bars: np.zeros(BINS, np.int64) for bars in (REPLIES, LATENESS)}

    def send(self, timing: NDArray[Any], nanoseconds: NDArray[np.float64]) -> None:
        """Send ``timing`` (n,) of TIMING at these times of the flight, and histograms so far at the last of them."""
        self._send(CLOCK, [time_column(nanoseconds)], _message(CLOCK_TYPE, struct(timing, _TIMED)))
        for bars, counts in self._counts.items():
            counts += binned(timing[bars.field])
            if timing[bars.field].any():
                drawn = rr.BarChart.columns(values=[counts], abscissa=[_ABSCISSA], color=[PALETTE[0]])
                self._send(bars.path, [time_column(nanoseconds[-1:])], drawn)


class Columns:
    """Sends the rows of one flight to a recording, block after block, in order.

    root : before every path, empty unless several flights share a recording
    color : of the flight's figure and path
    Rerun reports errors of a sink in its own log, not as an exception.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        rate_hz: float,
        facts: Facts = UNKNOWN,
        root: str = "",
        color: Color = VOTED,
    ) -> None:
        self._recording = recording
        self._rate_hz = rate_hz
        self._facts = facts
        self._root = root
        self._before: Block | None = None
        self._last: Table | None = None  # frame
        self._derived = derived.Derived(facts)
        self._scene = Scene(recording, root, color)
        self._times = Times(self._columns) if facts.unit else None

    def send(self, table: Table, events: Sequence[Event] = ()) -> None:
        """Send every frame and its events, one batch per entity; timing if a unit is tested."""
        rows, timing = table.rows, table.timing
        if not len(rows):
            return
        nanoseconds = np.rint(rows["frame"] * (1e9 / self._rate_hz))
        time = [time_column(nanoseconds)]
        values = self._derived.values(rows)
        for topic in TOPICS_OF_ROWS:
            components = [_message(topic.message, struct(rows, topic))]
            if topic.message == "rig.Signal" and topic.item is not None:
                components.append(values_of(derived.VALUES, values[topic.item]))
            if topic.message == "rig.Control":
                components.append(values_of(derived.DEGREES, derived.degrees(rows)))
            self._columns(topic.name, time, [column for component in components for column in component])
        for change in strips.changes(rows, self._before, self._facts.faults):
            states = rr.StateChange.columns(state=change.states)
            self._columns(change.path, [time_column(nanoseconds[change.rows])], states)
        for of in BESIDE:
            if of.part in table.parts:
                self._draw_beside(of, table, nanoseconds)
        self._last = table[-1:].copy()
        self._matrix(rows, nanoseconds)
        self._scene.send(rows, nanoseconds)
        if self._times is not None and timing is not None:
            self._times.send(timing, nanoseconds)
        self._events(events)
        self._before = rows[-1:].copy()
        if rows["end"][-1] != End.FLYING:
            self._ends(End(rows["end"][-1]).name, rows["frame"][-1:])

    def _draw_beside(self, of: strips.Beside, table: Table, nanoseconds: NDArray[np.float64]) -> None:
        if self._last is None:
            rr.log(of.legend, matrix.strip(of.legend_lines), static=True, recording=self._recording)
        for entity in of.entities(table):
            components = [*values_of(entity.archetype, entity.values.astype(np.float32))]
            if entity.topic is not None:
                components += _message(entity.topic.message, struct(table.part(of.part), entity.topic))
            self._columns(entity.path, [time_column(nanoseconds)], components)
        for change in of.changes(table, self._last):
            states = rr.StateChange.columns(state=change.states)
            self._columns(change.path, [time_column(nanoseconds[change.rows])], states)

    def _matrix(self, rows: Block, nanoseconds: NDArray[np.float64]) -> None:
        if self._before is None:
            rr.log(self._root + matrix.NAMES, matrix.names(), static=True, recording=self._recording)
        changed = strips.moved(rows["state"], None if self._before is None else self._before["state"])
        if len(changed):
            self._columns(matrix.PATH, [time_column(nanoseconds[changed])], matrix.columns(rows, changed))

    def end(self) -> None:
        """End the strips of a flight that is over, while another one continues."""
        if self._before is not None and self._before["end"][0] == End.FLYING:
            self._ends(OVER, self._before["frame"])

    def _ends(self, how: str, frame: NDArray[Any]) -> None:
        time = [time_column(np.rint(frame * (1e9 / self._rate_hz)))]
        ends = list(strips.ends(how, self._facts.faults))
        ends += [
            (strip.path, how) for of in BESIDE if self._last and of.part in self._last.parts for strip in of.strips
        ]
        for path, state in ends:
            self._columns(path, time, rr.StateChange.columns(state=[state]))

    def _events(self, events: Sequence[Event]) -> None:
        if not events:
            return
        time = time_column(np.rint([event.frame * (1e9 / self._rate_hz) for event in events]))
        tag = f"{self._root[1:]}  " if self._root else ""
        text = rr.TextLog.columns(
            text=[tag + words(event) for event in events],
            level=[_LEVELS.get(event.level, "INFO") for event in events],
        )
        self._columns("/events", [time], text)

    def _columns(self, path: str, time: Sequence[rr.TimeColumn], columns: Any) -> None:
        rr.send_columns(self._root + path, time, columns, recording=self._recording)


def _message(archetype: str, structs: pa.StructArray) -> rr.ComponentColumnList:
    """Return one struct per row as the component <archetype>:message."""
    return rr.DynamicArchetype.columns(archetype=archetype, components={"message": structs})


def values_of(archetype: str, values: NDArray[Any]) -> rr.ComponentColumnList:
    """Return one list per row, from ``values`` (n, m), as the component <archetype>:values."""
    flat = pa.array(np.ascontiguousarray(values).ravel())
    columns = rr.DynamicArchetype.columns(archetype=archetype, components={"values": flat})
    return columns.partition(np.full(len(values), values.shape[1]))


def words(event: Event) -> str:
    """Return an event in words; the text of some events needs their name before it."""
    return f"{event.name}: {event.text}" if event.name.startswith(_BARE) else event.text


def struct(rows: Block, topic: Topic) -> pa.StructArray:
    """Return the fields of a topic's message in every row, one struct each."""
    message = {**MESSAGES, **PART_MESSAGES}[topic.message]
    arrays = {field.name: _array(field, rows[field.source][(slice(None), *topic.at(field))]) for field in message}
    fields = [pa.field(name, array.type, nullable=False) for name, array in arrays.items()]
    return pa.StructArray.from_arrays(list(arrays.values()), fields=fields)


def _array(field: Field, values: NDArray[Any]) -> pa.Array:
    values = np.ascontiguousarray(values)
    if field.enum is not None:
        return _members(field.enum, values)
    if field.kind == BOOL:
        return pa.array(values != 0)
    return pa.array(values if values.dtype.kind == "f" else values.astype(np.uint32))


def _members(enum: type[IntEnum], values: NDArray[np.uint8]) -> pa.StructArray:
    if len(values) and (values == values[0]).all():  # nearly always, and ten times as fast
        return _unchanging(enum, int(values[0]), len(values))
    return _enum_table(enum).take(pa.array(values))


@lru_cache(maxsize=256)
def _unchanging(enum: type[IntEnum], value: int, rows: int) -> pa.StructArray:
    return _enum_table(enum).take(pa.array([value] * rows))


@cache
def _enum_table(enum: type[IntEnum]) -> pa.StructArray:
    """Return the importer's struct of each of the 256 values of a u1; no name where the enum has none."""
    names = {member.value: member.name for member in enum}
    return pa.StructArray.from_arrays(
        [pa.array([names.get(i) for i in range(256)]), pa.array(range(256), pa.int32())], names=["name", "value"]
    )
