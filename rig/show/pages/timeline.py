"""The lanes of a flight: which state each channel, pattern, level and fault had when."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any, Final, NamedTuple

import plotly.graph_objects as go

from rig.core.frame import COMPUTERS, DISCRETES, INDEX
from rig.core.palette import BLUE, CHANNELS, INK, LIGHT_BLUE, MID_BLUE, ORANGE, QUIET, RED, SOFT, UNUSED, VIOLET, YELLOW
from rig.show.pages.course import Course, level_path
from rig.show.pages.page import lay_out
from rig.show.viewer.lanes_view import HEALTH
from rig.show.viewer.servo_series import LANES as SERVOS
from rig.show.viewer.state_strips import LANES, LAW, Changes, Lane, fault_path
from rig.show.viewer.style import STATE_LOOKS, plain

MOST_SPANS: Final = 6000  # that are drawn; of more, the shortest are left out
MOST_GROUPS: Final = 8  # of signals that are alike
_UNUSED: Final = "not used"  # a channel that is not failed, of a signal without a channel
_NAMES: Final = {"decided_by": "decided by"}
_QUIET: Final = ("ok", "normal", "none", "voted", "autopilot", "4 channels", "engaged", "fresh", "all channels")
_LABELS: Final = [label for lane in (*HEALTH, *SERVOS) for label, _ in lane.looks.values()]
_COLOURS: Final = {
    **dict.fromkeys(_QUIET, QUIET),
    **dict.fromkeys(("lost", "unresolved", "no channel", "back-up", "bypassed"), INK),
    **dict.fromkeys((label for label in _LABELS if label.startswith(("failed", "shut off"))), RED),
    **dict(zip(COMPUTERS, CHANNELS, strict=True)),  # the leading lane
    **{"missing": YELLOW, "a frame old": LIGHT_BLUE, "runs again, not engaged": MID_BLUE, "off by command": SOFT},
    _UNUSED: UNUSED,
    **{"suspect": YELLOW, "failed": RED, "acting": ORANGE, "isolated": LIGHT_BLUE},
    **{"3 channels": LIGHT_BLUE, "2 channels": MID_BLUE, "1 channel": BLUE},
}


class Span(NamedTuple):
    """One state of one lane."""

    lane: str
    begin_s: float
    end_s: float
    label: str


def groups(course: Course, names: Sequence[str]) -> list[list[str]]:
    """Return signals, or discretes, whose lanes are the same in every frame together, in the order of ``names``."""
    lanes, found = course.lanes, dict[object, list[str]]()
    for name in names:
        own = [change for path, change in lanes.items() if path == f"/{name}" or path.startswith(f"/{name}/")]
        key = [(each.path.removeprefix(f"/{name}"), each.rows.tolist(), each.states) for each in own]
        found.setdefault(repr(sorted(key)), []).append(name)
    return list(found.values())


def spans(
    course: Course, rate_hz: float, signals: Sequence[str], faults: Sequence[str], beside: Sequence[Span] = ()
) -> list[Span]:
    """Return the states of a flight lane by lane: faults, ``beside``, then signals, discretes and law with an event.

    faults : their labels, in the order of the scenario
    beside : of computers and actuators
    Of signals that are alike in every frame (``groups``) the first is drawn for all.
    """
    found = dict(_found(course, rate_hz, faults))
    kept = [span for i in range(len(faults)) for span in found.get(fault_path(i), []) if span.label]
    kept += beside
    for name, *others in groups(course, signals)[:MOST_GROUPS]:
        level = found[level_path(name)]
        of = [path for path in found if path.startswith(f"/{name}/") and path != level_path(name)]
        for path in of:
            if "/channel_" in path:
                kept += [_for_all(each, name, others) for span in found[path] for each in used(span, level)]
            elif eventful(found[path]):
                kept += [_for_all(span, name, others) for span in found[path]]
        kept += [_for_all(span, name, others) for span in level]
    for name, *others in groups(course, [discrete.name for discrete in DISCRETES]):
        of = [path for path in found if path.startswith(f"/{name}/") and eventful(found[path])]
        kept += [_for_all(span, name, others) for path in of for span in found[path] if span.label != "absent"]
    kept += found[LAW.path] if eventful(found[LAW.path]) else []
    return _most([span for span in kept if span.label])


def _found(course: Course, rate_hz: float, faults: Sequence[str]) -> Iterator[tuple[str, list[Span]]]:
    """Yield path and states of every lane of faults, signals, discretes and law."""
    lanes = {lane.path: lane for lane in LANES}
    named = {fault_path(i): f"fault {escape(label)}" for i, label in enumerate(faults)}  # plotly reads tags
    named |= {path: _named(path) for path in (*lanes, *map(level_path, INDEX))}
    for path, change in course.lanes.items():
        if path in named:  # and not the channels of a signal together
            yield path, list(_spans(named[path], change, lanes.get(path), course.frames, rate_hz))


def _for_all(span: Span, name: str, others: Sequence[str]) -> Span:
    """Return a state of ``name`` as that of all signals that are alike."""
    alike = f"{name} (and {len(others)} alike)" if others else name
    return span._replace(lane=f"{alike}{span.lane.removeprefix(name)}")


def used(span: Span, level: Sequence[Span]) -> Iterator[Span]:
    """Yield a channel's state, "not used" where it is ok and the signal's ``level`` has no channel."""
    lost = [each for each in level if each.label == "no channel" and span.label == "ok"]
    at = span.begin_s
    for each in lost:
        begin, end = max(each.begin_s, at), min(each.end_s, span.end_s)
        if begin < end:
            if at < begin:
                yield span._replace(begin_s=at, end_s=begin)
            yield span._replace(begin_s=begin, end_s=end, label=_UNUSED)
            at = end
    if at < span.end_s:
        yield span._replace(begin_s=at)


def _named(path: str) -> str:
    """Return a lane as people read it: ``pitch_rate channel 3``."""
    _, of, *lane = path.split("/")
    words = [_NAMES.get(part, plain(part)) for part in lane]
    return " ".join([of, *words]) if words else plain(of)


def spans_of(change: Changes, lane: Lane, frames: int, rate_hz: float) -> list[Span]:
    """Return the states of one lane over all frames, but those that are not drawn."""
    return [span for span in _spans(_named(lane.path), change, lane, frames, rate_hz) if span.label]


def _spans(name: str, change: Changes, lane: Lane | None, frames: int, rate_hz: float) -> Iterator[Span]:
    ends = [*change.rows[1:], frames]
    for row, end, state in zip(change.rows, ends, change.states, strict=True):
        yield Span(name, row / rate_hz, end / rate_hz, _label(state, lane))


def _label(state: str, lane: Lane | None) -> str:
    """Return a state in words; "" for what is not drawn: a fault that does not act, a channel that is not fitted."""
    if state == "ABSENT":
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


def timeline(found: Sequence[Span], end_s: float) -> go.Figure:
    """Draw spans, a lane a row, the first at the top, from the beginning of a flight to its end."""
    lanes, labels = list(dict.fromkeys(span.lane for span in found)), dict.fromkeys(span.label for span in found)
    figure = go.Figure()
    for label in labels:
        figure.add_bar(**_bars([span for span in found if span.label == label], label))
    lay_out(figure, "", 60 + 24 * len(lanes), barmode="overlay", bargap=0.25)
    figure.update_xaxes(title="time, s", range=[0.0, end_s])
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
