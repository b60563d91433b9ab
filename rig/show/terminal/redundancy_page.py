"""The redundancy page of one frame: signals by channels, level, pattern, who decided, the last events.

A channel is marked in words as well as in colour: ``?`` suspect, ``x`` failed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from rig.core.event import Event
from rig.core.frame import (
    CHANNELS,
    DISCRETES,
    MOVED,
    SIGNALS,
    ActuatorMonitor,
    End,
    Law,
    Pattern,
    Resolver,
    Source,
    State,
)
from rig.core.frame import Table as FlightTable
from rig.core.text import plain
from rig.core.units.angles import short_way
from rig.core.units.quantities import scale_shown, unit_shown
from rig.flight.servo_events import monitor_name
from rig.show.terminal import cells
from rig.show.terminal.lanes_page import computer_rows

EVENTS: Final = 6  # shown, of those so far
_LEVELS: Final = {"info": "", "warning": "yellow", "error": "bold red"}
_NUMBERS: Final = ("ch 1 ", "ch 2 ", "ch 3 ", "ch 4 ", "vote", "level")
_LEGEND: Final = "? suspect, x failed, - not fitted; by: who decided, or control's other source"


class Page:
    """Draws frames of one flight; remembers its last events."""

    def __init__(self, title: str = "") -> None:
        self._title = plain(title)
        self._events: deque[tuple[float, Event]] = deque(maxlen=EVENTS)

    def note(self, events: Sequence[Event], rate_hz: float) -> None:
        """Keep events for the foot of the page."""
        self._events.extend((event.frame / rate_hz, event) for event in events)

    def draw(self, frame: FlightTable, rate_hz: float) -> RenderableType:
        """Draw the page of one frame (1,)."""
        row, servo, lane = frame.rows[0], frame.servo, frame.lane
        table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
        table.add_column("signal")  # the one that a narrow terminal cuts
        table.add_column("unit", no_wrap=True, style="dim")
        for name in _NUMBERS:
            table.add_column(name, justify="right", no_wrap=True)
        for name in ("pattern", "by"):
            table.add_column(name, no_wrap=True)
        for s in range(len(SIGNALS)):
            table.add_row(*_signal(row, s))
        for d in range(len(DISCRETES)):
            table.add_row(*_discrete(row, d))
        for surface, one in zip(MOVED, servo[0], strict=True) if servo is not None else ():
            table.add_row(*_servo(surface, one))
        for cells_of_row in computer_rows(lane[0]) if lane is not None else ():
            table.add_row(*cells_of_row)
        lines = [event_line(time_s, event) for time_s, event in self._events]
        blank = [Text("")] * (EVENTS - len(lines))  # or the page would jump
        foot = [Text("events", style="dim"), *lines, *blank] if lines else []
        return Group(self._head(row, rate_hz), table, Text(_LEGEND, style="dim"), *foot)

    def _head(self, row: Any, rate_hz: float) -> Text:
        acting = int(np.unpackbits(row["acting"]).sum())
        head = Text(f"{self._title}  " if self._title else "", style="bold")
        head.append(f"{row['frame'] / rate_hz:9.2f} s  law {Law(row['law']).name.lower()}", style="not bold")
        if acting:
            head.append(f"  {acting} fault{'s' if acting > 1 else ''} acting", style="not bold yellow")
        if row["end"]:
            head.append(f"  {End(row['end']).label}", style="bold red")
        return head


def event_line(time_s: float, event: Event) -> Text:
    """Return an event as one line."""
    text = plain(f"{time_s:9.2f} s  {event.name:17} {event.text}")
    return Text(text, style=_LEVELS.get(event.level, ""), no_wrap=True)


def _signal(row: Any, s: int) -> list[RenderableType]:
    signal = SIGNALS[s]
    pattern = Pattern(row["pattern"][s])
    vote, states = float(row["voted"][s]), row["state"][s]
    values = np.append(row["channels"][s], vote)
    if signal.wraps:  # as one reads a heading: 0.3 beside 359.7 is 360.3
        turned = signal.low + (vote - signal.low) % (2.0 * np.pi)
        values = turned + np.append(short_way(row["channels"][s] - vote), 0.0)
    shown = values * scale_shown(signal.unit)
    return [
        cells.name(signal.name),
        unit_shown(signal.unit),
        *(cells.channel(shown[c], states[c], cells.number) for c in range(4)),
        Text(cells.number(shown[4])),
        cells.level(int(row["level"][s]), signal.channels),
        Text(pattern.label, style="dim" if pattern == Pattern.NORMAL else "bold yellow"),
        Text("; ".join(_notes(row, s)), style="yellow"),
    ]


def _notes(row: Any, s: int) -> Iterator[str]:
    """Yield who decided a pattern without a majority, and control's source where it is not the vote."""
    resolver, source = Resolver(row["resolver"][s]), Source(row["source"][s])
    if resolver != Resolver.NONE:
        yield resolver.name.lower()
    if source != Source.VOTED:
        yield f"control: {source.name.lower()}"


def _discrete(row: Any, d: int) -> list[RenderableType]:
    values, states = row["discrete_channels"][d], row["discrete_state"][d]
    return [
        cells.name(DISCRETES[d].name),
        "",
        *(cells.channel(values[c], states[c], lambda value: f"{int(value)}") for c in range(4)),
        Text(str(int(row["discrete_voted"][d]))),
        cells.level(int(row["discrete_level"][d]), DISCRETES[d].channels),
    ]


def _servo(surface: str, servo: Any) -> list[RenderableType]:
    """Return position sensors, ram, channels that move it, and who shut the others off."""
    scale, failed_by = scale_shown("rad"), servo["failed_by"]
    out = (failed_by != ActuatorMonitor.NONE) | (servo["valve"] != 0)  # by a monitor, or with its computer
    states = [State.FAILED if each else State.OK for each in out]
    notes = (f"{c + 1} {monitor_name(by) if by else 'computer'}" for c, by in enumerate(failed_by) if out[c])
    return [
        cells.name(f"{surface} servo"),
        unit_shown("rad"),
        *(cells.channel(servo["lvdt"][c] * scale, states[c], cells.number) for c in range(CHANNELS)),
        Text(cells.number(servo["ram"] * scale)),
        cells.level(states.count(State.OK), CHANNELS),
        Text("bypassed" if servo["bypassed"] else "", style="bold red"),
        Text("; ".join(notes), style="yellow"),
    ]
