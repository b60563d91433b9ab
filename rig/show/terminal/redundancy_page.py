"""The redundancy page of one frame: channels of each signal, level, pattern, deciding rule, the last events.

Marks repeat the colours: ``?`` suspect, ``x`` failed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from rig.core.event import Event
from rig.core.frame import (
    CHANNELS,
    COMPUTERS,
    DISCRETES,
    LINKS,
    MOVED,
    SIGNALS,
    SURFACES,
    ActuatorMonitor,
    DecidedBy,
    End,
    Health,
    Law,
    LinkState,
    Pattern,
    Source,
    State,
)
from rig.core.frame import Table as FlightTable
from rig.core.text import plain
from rig.core.units.angles import short_way
from rig.core.units.quantities import scale_shown, unit_of_name, unit_shown
from rig.flight.lane_events import test_name
from rig.flight.servo_events import monitor_name

EVENTS: Final = 6  # shown: the last ones
_LEVELS: Final = {"info": "", "warning": "yellow", "error": "bold red"}
_NUMBERS: Final = ("ch 1 ", "ch 2 ", "ch 3 ", "ch 4 ", "vote", "level")
_LEGEND: Final = "? suspect, x failed, - not fitted; by: rule that decided, or other source of the control law"
# Style and mark of each state of a channel.
_LOOKS: Final = {
    State.OK: ("green", " "),
    State.SUSPECT: ("bold yellow", "?"),
    State.FAILED: ("bold red", "x"),
    State.ABSENT: ("dim", " "),
}
_NO_LANE: Final = -1
_MOST_LINKS: Final = 2  # named in the row of messages
# State of a lane as that of a channel; any other health is failed.
_LANE_STATES: Final = {Health.ABSENT: State.ABSENT, Health.ENGAGED: State.OK, Health.SUSPECT: State.SUSPECT}
_NOTES: Final = {Health.RESTARTING: "restarting", Health.OFF: "off by command"}


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
        table.add_column("signal")  # a narrow terminal cuts this column
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
        for cells_of_row in _computers(lane[0]) if lane is not None else ():
            table.add_row(*cells_of_row)
        lines = [event_line(time_s, event) for time_s, event in self._events]
        blank = [Text("")] * (EVENTS - len(lines))  # keeps the height of the page
        foot = [Text("events", style="dim"), *lines, *blank] if lines else []
        return Group(self._head(row, rate_hz), table, Text(_LEGEND, style="dim"), *foot)

    def _head(self, row: Any, rate_hz: float) -> Text:
        acting = int(np.unpackbits(row["acting"]).sum())
        head = Text(f"{self._title}  " if self._title else "", style="bold")
        head.append(f"{row['frame'] / rate_hz:9.2f} s  law {Law(row['law']).name.lower()}", style="not bold")
        if acting:
            head.append(f"  {acting} fault{'s' if acting > 1 else ''} acting", style="not bold yellow")
        if row["end"]:
            head.append(f"  {End(row['end']).cause}", style="bold red")
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
    if signal.wraps:  # as a heading is read: 0.3 beside 359.7 is 360.3
        turned = signal.low + (vote - signal.low) % (2.0 * np.pi)
        values = turned + np.append(short_way(row["channels"][s] - vote), 0.0)
    shown = values * scale_shown(signal.unit)
    return [
        _name(signal.name),
        unit_shown(signal.unit),
        *(_channel(shown[c], states[c], _number) for c in range(4)),
        Text(_number(shown[4])),
        _level(int(row["level"][s]), signal.channels),
        Text(pattern.label, style="dim" if pattern == Pattern.NORMAL else "bold yellow"),
        Text("; ".join(_notes(row, s)), style="yellow"),
    ]


def _notes(row: Any, s: int) -> Iterator[str]:
    """Yield the rule that decided a split, and the source of the control law if it is not the vote."""
    decided_by, source = DecidedBy(row["decided_by"][s]), Source(row["source"][s])
    if decided_by != DecidedBy.NONE:
        yield decided_by.name.lower()
    if source != Source.VOTED:
        yield f"control: {source.name.lower()}"


def _discrete(row: Any, d: int) -> list[RenderableType]:
    values, states = row["discrete_channels"][d], row["discrete_state"][d]
    return [
        _name(DISCRETES[d].name),
        "",
        *(_channel(values[c], states[c], lambda value: f"{int(value)}") for c in range(4)),
        Text(str(int(row["discrete_voted"][d]))),
        _level(int(row["discrete_level"][d]), DISCRETES[d].channels),
    ]


def _servo(surface: str, servo: Any) -> list[RenderableType]:
    """Return position sensors, ram, channels that move it, and the monitors that shut off the others."""
    scale, failed_by = scale_shown("rad"), servo["failed_by"]
    out = (failed_by != ActuatorMonitor.NONE) | (servo["valve"] != 0)  # by a monitor, or with its computer
    states = [State.FAILED if each else State.OK for each in out]
    notes = (f"{c + 1} {monitor_name(by) if by else 'computer'}" for c, by in enumerate(failed_by) if out[c])
    return [
        _name(f"{surface} servo"),
        unit_shown("rad"),
        *(_channel(servo["lvdt"][c] * scale, states[c], _number) for c in range(CHANNELS)),
        Text(_number(servo["ram"] * scale)),
        _level(states.count(State.OK), CHANNELS),
        Text("bypassed" if servo["bypassed"] else "", style="bold red"),
        Text("; ".join(notes), style="yellow"),
    ]


def _computers(lanes: Any) -> Iterator[list[RenderableType]]:
    """Yield the cells of the rows of several computers; lanes : (4,) COMPUTER."""
    leads = int(lanes["leads"].argmax()) if lanes["leads"].any() else _NO_LANE
    states = [_LANE_STATES.get(Health(health), State.FAILED) for health in lanes["health"]]
    yield [
        _name("computers"),
        "",
        *(_channel(name, state, str) for name, state in zip(COMPUTERS, states, strict=True)),
        Text(COMPUTERS[leads]) if leads != _NO_LANE else Text("none", style="bold red"),
        _engaged(states),
        Text("") if leads != _NO_LANE else Text("back-up", style="bold red"),
        Text("; ".join(_whys(lanes)), style="yellow"),
    ]
    yield _links(lanes)
    for s, name in enumerate(SURFACES):
        yield _command(name, lanes, s, states, leads)


def _engaged(states: list[State]) -> Text:
    out, absent = states.count(State.FAILED), states.count(State.ABSENT)
    return _level(len(states) - absent - out, len(states) - absent)


def _whys(lanes: Any) -> Iterator[str]:
    """Yield the lanes that do not fly, with the reason."""
    for name, lane in zip(COMPUTERS, lanes, strict=True):
        health = Health(lane["health"])
        if health == Health.FAILED:
            yield f"{name} {test_name(lane['failed_for'])}"
        elif health in _NOTES:
            yield f"{name} {_NOTES[health]}"


def _links(lanes: Any) -> list[RenderableType]:
    """Return how many lanes received the message of each lane in this frame, and the links that failed."""
    links = lanes["link"]
    fitted = int((lanes["health"] != Health.ABSENT).sum())
    good = (links == LinkState.FRESH).sum(axis=0)
    states = [
        State.ABSENT if j >= fitted else State.FAILED if (links[:, j] == LinkState.FAILED).any()
        else State.OK if good[j] == fitted - 1 else State.SUSPECT
        for j in range(len(COMPUTERS))
    ]  # fmt: skip
    failed = [
        f"{COMPUTERS[sender]} to {COMPUTERS[receiver]} {LinkState(links[receiver, sender]).name.lower()}"
        for sender, receiver in LINKS
        if links[receiver, sender] > LinkState.FRESH
    ]
    more = f" and {len(failed) - _MOST_LINKS} more" if len(failed) > _MOST_LINKS else ""
    return [
        _name("messages received"),
        "",
        *(_channel(count, state, str) for count, state in zip(good, states, strict=True)),
        "",
        "",
        "",
        Text(", ".join(failed[:_MOST_LINKS]) + more, style="yellow"),
    ]


def _command(name: str, lanes: Any, s: int, states: list[State], leads: int) -> list[RenderableType]:
    """Return the command of each lane for a surface, and the voted output of the leading lane."""
    unit, whose = unit_of_name(name), lanes[max(leads, 0)]
    pattern, decided_by = Pattern(whose["command_pattern"][s]), DecidedBy(whose["command_decided_by"][s])
    scale, each = scale_shown(unit), zip(lanes, states, strict=True)
    quiet = pattern == Pattern.NORMAL or leads == _NO_LANE
    return [
        _name(f"{name.removesuffix('_rad')} command"),
        unit_shown(unit),
        *(_channel(lane["surface"][s] * scale, state, _number) for lane, state in each),
        Text("" if leads == _NO_LANE else _number(whose["output"][s] * scale)),
        _engaged(states),
        Text(pattern.label if leads != _NO_LANE else "", style="dim" if quiet else "bold yellow"),
        Text(decided_by.name.lower() if leads != _NO_LANE and decided_by != DecidedBy.NONE else "", style="yellow"),
    ]


def _name(text: str) -> Text:
    return Text(text, no_wrap=True, overflow="ellipsis")


def _channel(value: Any, state: Any, write: Callable[[Any], str]) -> Text:
    """Return a channel's value with the mark of its state."""
    style, mark = _LOOKS[State(state)]
    return Text("-" if state == State.ABSENT else write(value) + mark, style=style)


def _number(value: float) -> str:
    """Return a number with the resolution of the sensors: three decimals below 100, none above 10,000."""
    if not np.isfinite(value):
        return "nan"
    return f"{value:.{0 if abs(value) >= 10_000 else 1 if abs(value) >= 1_000 else 2 if abs(value) >= 100 else 3}f}"


def _level(left: int, channels: int) -> Text:
    """Return the number of channels that are ``left``, coloured by how many of ``channels`` are lost."""
    style = "" if left == channels else "bold red" if left == 0 else "yellow"
    return Text(str(left), style=style)
