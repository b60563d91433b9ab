"""The timeline of a flight: a row for each fault, computer, channel, pattern and level, with its states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any, Final, NamedTuple

import plotly.graph_objects as go

from rig.core.frame import DISCRETES, INDEX
from rig.show.pages.course import Course, level_path
from rig.show.pages.page import lay_out
from rig.show.pages.timeline_looks import CHANNEL, UNUSED_STATE, bar, quiet, variable
from rig.show.viewer.state_strips import LAW, STRIPS, Changes, Strip, fault_path
from rig.show.viewer.style import STATE_LOOKS, plain

MOST_SPANS: Final = 6000  # drawn; the shortest beyond that are left out
MOST_GROUPS: Final = 8  # of signals with equal states
MOST_TOLD: Final = 40  # rows, and states of a row, in the text alternative
MOST_TEXTS: Final = 600  # bars; with more, no label is written into them
_NAMES: Final = {"decided_by": "decided by"}


class Span(NamedTuple):
    """One state in one row of the timeline; variable : what the row shows, as the legend names it."""

    row: str
    begin_s: float
    end_s: float
    label: str
    variable: str = CHANNEL


def groups(course: Course, names: Sequence[str]) -> list[list[str]]:
    """Return signals, or discretes, whose states are equal in every frame together, in the order of ``names``."""
    strips, found = course.strips, dict[object, list[str]]()
    for name in names:
        own = [change for path, change in strips.items() if path == f"/{name}" or path.startswith(f"/{name}/")]
        key = [(each.path.removeprefix(f"/{name}"), each.rows.tolist(), each.states) for each in own]
        found.setdefault(repr(sorted(key)), []).append(name)
    return list(found.values())


def spans(
    course: Course, rate_hz: float, signals: Sequence[str], faults: Sequence[str], beside: Sequence[Span] = ()
) -> list[Span]:
    """Return the states of a flight row by row: faults, ``beside``, then signals, discretes and law with an event.

    faults : their labels, in the order of the scenario
    beside : of computers and actuators
    The first of several signals with equal states (``groups``) is drawn for all of them.
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
    """Yield path and states of every row of faults, signals, discretes and law."""
    strips = {strip.path: strip for strip in STRIPS}
    named = {fault_path(i): f"fault {escape(label)}" for i, label in enumerate(faults)}  # plotly reads tags
    named |= {path: _named(path) for path in (*strips, *map(level_path, INDEX))}
    for path, change in course.strips.items():
        if path in named:  # and not the channels of a signal together
            yield path, list(_spans(named[path], change, strips.get(path), course.frames, rate_hz))


def _for_all(span: Span, name: str, others: Sequence[str]) -> Span:
    """Return a state of ``name`` as that of all signals with equal states."""
    alike = f"{name} (and {len(others)} alike)" if others else name
    return span._replace(row=f"{alike}{span.row.removeprefix(name)}")


def used(span: Span, level: Sequence[Span]) -> Iterator[Span]:
    """Yield a channel's state, "not used" where it is ok and the signal's ``level`` has no channel."""
    lost = [each for each in level if each.label == "no channel" and span.label == "ok"]
    at = span.begin_s
    for each in lost:
        begin, end = max(each.begin_s, at), min(each.end_s, span.end_s)
        if begin < end:
            if at < begin:
                yield span._replace(begin_s=at, end_s=begin)
            yield span._replace(begin_s=begin, end_s=end, label=UNUSED_STATE)
            at = end
    if at < span.end_s:
        yield span._replace(begin_s=at)


def _named(path: str) -> str:
    """Return the name of a row as people read it: ``pitch_rate channel 3``."""
    _, of, *parts = path.split("/")
    words = [_NAMES.get(part, plain(part)) for part in parts]
    return " ".join([of, *words]) if words else plain(of)


def spans_of(change: Changes, strip: Strip, frames: int, rate_hz: float) -> list[Span]:
    """Return the states of one row over all frames, except those that are not drawn."""
    return [span for span in _spans(_named(strip.path), change, strip, frames, rate_hz) if span.label]


def _spans(name: str, change: Changes, strip: Strip | None, frames: int, rate_hz: float) -> Iterator[Span]:
    ends = [*change.rows[1:], frames]
    for row, end, state in zip(change.rows, ends, change.states, strict=True):
        yield Span(name, row / rate_hz, end / rate_hz, _label(state, strip), variable(change.path))


def _label(state: str, strip: Strip | None) -> str:
    """Return a state in words; "" for an inactive fault or an absent channel, which are not drawn."""
    if state == "ABSENT":
        return ""
    looks = STATE_LOOKS if state in STATE_LOOKS or strip is None else strip.looks
    return looks[state][0] if state in looks else state.lower()


def eventful(of: Sequence[Span]) -> bool:
    """Return True if a state needs attention."""
    return any(span.label and not quiet(span.label) for span in of)


def _most(found: list[Span]) -> list[Span]:
    if len(found) <= MOST_SPANS:
        return found
    shortest = sorted(span.end_s - span.begin_s for span in found)[len(found) - MOST_SPANS]
    return [span for span in found if span.end_s - span.begin_s >= shortest][:MOST_SPANS]


def timeline(found: Sequence[Span], end_s: float) -> go.Figure:
    """Draw the rows of a flight, the first at the top, from its beginning to its end."""
    rows = list(dict.fromkeys(span.row for span in found))
    figure = go.Figure()
    for of, label in dict.fromkeys((span.variable, span.label) for span in found):
        of_label = [span for span in found if (span.variable, span.label) == (of, label)]
        figure.add_bar(**_bars(of_label, label, written=len(found) <= MOST_TEXTS), **bar(of, label))
    lay_out(figure, "", 60 + 26 * len(rows), barmode="overlay", bargap=0.15)
    figure.update_layout(uniformtext={"mode": "hide", "minsize": 9}, meta={"alternative": _alternative(found, rows)})
    figure.update_xaxes(title="time, s", range=[0.0, end_s])
    figure.update_yaxes(type="category", categoryorder="array", categoryarray=rows, autorange="reversed", dtick=1)
    return figure


def _bars(found: Sequence[Span], label: str, *, written: bool) -> dict[str, Any]:
    texts = {"text": [label] * len(found), "textposition": "inside", "insidetextanchor": "middle", "textangle": 0}
    return {
        "x": [span.end_s - span.begin_s for span in found],
        "base": [span.begin_s for span in found],
        "y": [span.row for span in found],
        "orientation": "h",
        "customdata": [f"{span.begin_s:.2f} to {span.end_s:.2f} s" for span in found],
        "hovertemplate": f"%{{y}}: {label}<br>%{{customdata}}<extra></extra>",
        **(texts if written and not quiet(label) else {}),
    }


def _alternative(found: Sequence[Span], rows: Sequence[str]) -> str:
    """Return the timeline as text: the states of each row that need attention, of the first rows."""
    told = []
    for row in rows[:MOST_TOLD]:
        of_row = [span for span in found if span.row == row and not quiet(span.label)]
        states = [f"{span.label} from {span.begin_s:.2f} to {span.end_s:.2f} s" for span in of_row[:MOST_TOLD]]
        told += [f"{row}: {', '.join(states)}"] if states else []
    return f"Timeline. {'. '.join(told) or 'No state needs attention'}."
