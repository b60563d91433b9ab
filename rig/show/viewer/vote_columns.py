"""The votes on a recording as Rerun columns: signals of any name, two to four channels, time since the first row.

/signal/<name>        rig.Vote:values, the numbers of NAMES, one list a row
/<name>               the channels of a signal together; /<name>/channel_1 .., pattern, decided_by: strips
/events               isolations
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, DecidedBy, Pattern, State
from rig.show.viewer import matrix
from rig.show.viewer import state_strips as strips
from rig.show.viewer.derived import LIMIT
from rig.show.viewer.rerun_columns import values_of
from rig.show.viewer.scene import time_column
from rig.show.viewer.state_strips import Changes, Strip, changed
from rig.show.viewer.style import CHANNEL_NAMES, THRESHOLD, VOTED, attention
from rig.show.votes.shown_signal import ShownSignal

VALUES: Final = "rig.Vote"
LEGEND: Final = "/votes/legend"
CHANNEL_LINES: Final = tuple(f"ch_{c + 1}" for c in range(CHANNELS))
APART_LINES: Final = tuple(f"apart_{c + 1}" for c in range(CHANNELS))
NAMES: Final = ("low", "high", "voted", *CHANNEL_LINES, "apart_low", "apart_high", *APART_LINES)
BATCH: Final = 60_000  # rows
_ALIKE: Final = strips.STATUS[0]  # the channels of a signal together
_LOOKS: Final = {
    "pattern": (Pattern, attention(Pattern, Pattern.NORMAL)),
    "decided_by": (DecidedBy, attention(DecidedBy, DecidedBy.NONE)),
}


def values_path(shown: ShownSignal) -> str:
    """Return the entity of the numbers of a signal."""
    return f"/signal{home(shown)}"


def home(shown: ShownSignal) -> str:
    """Return the entity of the strips of a signal; its name may have any letters."""
    return f"/{rr.escape_entity_path_part(shown.name)}"


def together(shown: ShownSignal) -> Strip:
    """Return the strip of all channels of a signal."""
    return _ALIKE._replace(path=home(shown))


def apart(shown: ShownSignal) -> list[Strip]:
    """Return the strips of a signal: its channels, its pattern, the deciding rule."""
    found = [_channel(shown, c) for c in range(len(shown.states))]
    for name, (enum, looks) in _LOOKS.items():
        if getattr(shown, name) is not None:
            states = {int(member): member.name for member in enum}
            found.append(Strip(f"{home(shown)}/{name}", name, (), states, looks))
    return found


def _channel(shown: ShownSignal, c: int) -> Strip:
    a_channel = strips.STRIPS[0]
    return a_channel._replace(path=f"{home(shown)}/channel_{c + 1}")


def numbers(shown: ShownSignal) -> NDArray[np.float32]:
    """Return the numbers of NAMES in every row: (n, m), in single precision; differences in thresholds are clipped."""
    rows = np.full((len(shown.time_s), len(NAMES)), np.nan, np.float32)
    at = {name: i for i, name in enumerate(NAMES)}
    rows[:, at["voted"]] = shown.voted
    known = shown.threshold is not None
    if shown.threshold is not None:
        half = shown.threshold * shown.bound
        rows[:, at["low"]], rows[:, at["high"]] = shown.voted - half, shown.voted + half
        rows[:, at["apart_low"]], rows[:, at["apart_high"]] = -shown.bound, shown.bound
    for c, channel in enumerate(shown.channels):
        off = shown.apart(c)
        rows[:, at[CHANNEL_LINES[c]]] = channel
        rows[:, at[APART_LINES[c]]] = np.clip(off, -LIMIT, LIMIT) if known else off
    return rows


def send(recording: rr.RecordingStream, signals: Sequence[ShownSignal]) -> None:
    """Send all rows, strips and isolations of the signals of one recording."""
    most = max(len(shown.channels) for shown in signals)
    lines = (*CHANNEL_NAMES[:most], ("vote", VOTED), ("threshold", THRESHOLD))
    rr.log(LEGEND, matrix.strip(lines), static=True, recording=recording)
    for shown in signals:
        at_ns, rows = np.rint(shown.time_s * 1e9), numbers(shown)
        for first in range(0, len(at_ns), BATCH):
            part = slice(first, first + BATCH)
            _send(recording, values_path(shown), at_ns[part], values_of(VALUES, rows[part]))
        for change in _changes(shown):
            _send(recording, change.path, at_ns[change.rows], rr.StateChange.columns(state=change.states))
    _events(recording, signals)


def _send(recording: rr.RecordingStream, path: str, at_ns: NDArray[np.float64], columns: Any) -> None:
    rr.send_columns(path, [time_column(at_ns)], columns, recording=recording)


def _changes(shown: ShownSignal) -> Iterator[Changes]:
    """Yield the changes of every strip of a signal."""
    for strip in apart(shown):
        values = shown.states[_number(strip)] if strip.field == "state" else getattr(shown, strip.field)
        yield from changed(strip.path, strip.states, values, None)
    states = np.full((len(shown.time_s), 1, CHANNELS), State.ABSENT, np.uint8)
    for c, of in enumerate(shown.states):
        states[:, 0, c] = of
    yield from changed(home(shown), _ALIKE.states, strips.codes(states)[:, 0], None)


def _number(strip: Strip) -> int:
    return int(strip.path.rpartition("_")[2]) - 1


def _events(recording: rr.RecordingStream, signals: Sequence[ShownSignal]) -> None:
    told = sorted(
        (mark.time_s, f"{shown.name}, channel {mark.channel}: isolated")
        for shown in signals
        for mark in shown.isolations
    )
    if told:
        at_ns = np.rint(np.array([at_s for at_s, _ in told]) * 1e9)
        text = rr.TextLog.columns(text=[text for _, text in told], level=["WARN"] * len(told))
        _send(recording, "/events", at_ns, text)
