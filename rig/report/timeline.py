"""The lanes of a flight: which state each channel, pattern, level and fault had when."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any, Final, NamedTuple

import plotly.graph_objects as go

from rig.frame import COMPUTERS, INDEX
from rig.report.course import Course, level_path
from rig.report.page import lay_out
from rig.util.palette import BLUE, CHANNELS, INK, LIGHT_BLUE, MID_BLUE, ORANGE, QUIET, RED, SOFT, VIOLET, YELLOW
from rig.view.computers import HEALTH
from rig.view.lanes import LANES, Changes, Lane, fault_path
from rig.view.style import STATE_LOOKS

MOST_SPANS: Final = 6000  # that are drawn; of more, the shortest are left out
_NAMES: Final = {"resolver": "decided by"}
_QUIET: Final = ("ok", "normal", "none", "voted", "autopilot", "4 channels", "engaged", "fresh")
_COLOURS: Final = {
    **dict.fromkeys(_QUIET, QUIET),
    **dict.fromkeys(("lost", "unresolved", "no channel", "back-up"), INK),
    **dict.fromkeys((label for lane in HEALTH for label, _ in lane.looks.values() if label.startswith("failed")), RED),
    **dict(zip(COMPUTERS, CHANNELS, strict=True)),  # the leading lane
    **{"missing": YELLOW, "a frame old": LIGHT_BLUE, "runs again, not engaged": MID_BLUE, "off by command": SOFT},
    **{"suspect": YELLOW, "failed": RED, "acting": ORANGE, "isolated": LIGHT_BLUE},
    **{"3 channels": LIGHT_BLUE, "2 channels": MID_BLUE, "1 channel": BLUE},
}


class Span(NamedTuple):
    """One state of one lane."""

    lane: str
    begin_s: float
    end_s: float
    label: str


def spans(course: Course, rate_hz: float, signals: Sequence[str], faults: Sequence[str]) -> list[Span]:
    """Return the states of a flight lane by lane: faults, then the signals, discretes and law with an event.

    faults : their labels, in the order of the scenario
    """
    lanes = {lane.path: lane for lane in LANES}
    found: dict[str, list[Span]] = {}
    named = {fault_path(i): f"fault {escape(label)}" for i, label in enumerate(faults)}  # plotly reads tags
    named |= {path: _named(path) for path in (*lanes, *map(level_path, signals))}
    for path, change in course.lanes().items():
        if path in named:  # and not the channels of a signal together
            found[path] = list(_spans(named[path], change, lanes.get(path), course.frames, rate_hz))
    kept = [span for i in range(len(faults)) for span in found.get(fault_path(i), []) if span.label]
    for name in signals:
        level = level_path(name)
        of = [path for path in found if path.startswith(f"/{name}/") and path != level]
        kept += [span for path in of if "/channel_" in path or eventful(found[path]) for span in found[path]]
        kept += found[level]
    others = [lane.path for lane in LANES if lane.path.split("/")[1] not in INDEX]
    kept += [span for path in others if eventful(found[path]) for span in found[path] if span.label != "absent"]
    return _most([span for span in kept if span.label])


def _named(path: str) -> str:
    """Return a lane as people read it: ``pitch_rate channel 3``."""
    _, of, *lane = path.split("/")
    return (
        " ".join([of, *(_NAMES.get(part, part.replace("_", " ")) for part in lane)]) if lane else of.replace("_", " ")
    )


def spans_of(change: Changes, lane: Lane, frames: int, rate_hz: float) -> list[Span]:
    """Return the states of one lane over all frames, but those that are not drawn."""
    return [span for span in _spans(_named(lane.path), change, lane, frames, rate_hz) if span.label]


def _spans(name: str, change: Changes, lane: Lane | None, frames: int, rate_hz: float) -> Iterator[Span]:
    ends = [*change.rows[1:], frames]
    for row, end, state in zip(change.rows, ends, change.states, strict=True):
        yield Span(name, row / rate_hz, end / rate_hz, _label(state, lane))


def _label(state: str | None, lane: Lane | None) -> str:
    """Return a state in words; "" for what is not drawn: a fault that does not act, a channel that is not fitted."""
    if state is None or state == "ABSENT":
        return ""
    looks = STATE_LOOKS if state in STATE_LOOKS or lane is None else lane.looks
    return looks[state][0] if state in looks else state.lower()


def eventful(of: Sequence[Span]) -> bool:
    """Return True if a state needs attention."""
    return any(span.label and span.label not in _QUIET for span in of)


def _most(found: list[Span]) -> list[Span]:
    if len(found) <= MOST_SPANS:
        return found
    shortest = sorted(span.end_s - span.begin_s for span in found)[len(found) - MOST_SPANS]
    return [span for span in found if span.end_s - span.begin_s >= shortest][:MOST_SPANS]


def timeline(found: Sequence[Span]) -> go.Figure:
    """Draw spans, a lane a row, the first at the top."""
    lanes, labels = list(dict.fromkeys(span.lane for span in found)), dict.fromkeys(span.label for span in found)
    figure = go.Figure()
    for label in labels:
        figure.add_bar(**_bars([span for span in found if span.label == label], label))
    lay_out(figure, "", 60 + 24 * len(lanes), barmode="overlay", bargap=0.25)
    figure.update_xaxes(title="time, s")
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=lanes, autorange="reversed", dtick=1)
    return figure


def _bars(found: Sequence[Span], label: str) -> dict[str, Any]:
    colour, quiet = _COLOURS.get(label, VIOLET), label in _QUIET
    return {
        "x": [span.end_s - span.begin_s for span in found],
        "base": [span.begin_s for span in found],
        "y": [span.lane for span in found],
        "orientation": "h",
        "name": label,
        "marker": {"color": colour, "line": {"color": colour, "width": 0 if quiet else 1}},  # never thinner than that
        "customdata": [f"{span.begin_s:.2f} to {span.end_s:.2f} s" for span in found],
        "hovertemplate": f"%{{y}}: {label}<br>%{{customdata}}<extra></extra>",
    }
