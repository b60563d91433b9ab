"""Several computers in a report: failures of lanes with their causes, and the commands of the lanes around them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from rig.core.event import Event
from rig.core.frame import COMPUTERS, SURFACES, Table
from rig.core.palette import CHANNELS, DASHES, VOTE
from rig.core.units.quantities import scale_shown, seconds, unit_of_name, unit_shown
from rig.flight import lane_events as lanes
from rig.show.pages.course import Course, decisive_frames
from rig.show.pages.flight_figures import DOTTED, draw_line, mark_panels
from rig.show.pages.page import lay_out
from rig.show.pages.timeline import Span, eventful, spans_of
from rig.show.viewer import lanes_view as computers
from rig.show.viewer.state_strips import acting
from rig.verdict.of_log import Scored
from rig.world.faults.places import OF_LANES, site

_HEIGHT: Final = 720
_FAILURES: Final = (lanes.FAILED, lanes.LINK_FAILED, lanes.BACKUP)
_TOLD: Final = (
    *_FAILURES,
    *(lanes.DISENGAGED, lanes.RESTARTING, lanes.READMITTED, lanes.REFUSED, lanes.LEADING, lanes.LINK_BACK),
)


class Happened(NamedTuple):
    """The sentences about the computers, and the frames around the first failure, end excluded."""

    said: list[str]
    begin: int
    end: int


def happened(scored: Scored, events: Sequence[Event]) -> Happened | None:
    """Return the failures of the computers; None: nothing failed, and no fault acted on them."""
    rate_hz, frames = scored.scenario.rate_hz, scored.score.flight.frames
    onsets = [
        fault.onset_frame
        for fault in scored.score.faults
        if site(scored.scenario.faults[fault.index].signal) in OF_LANES and fault.onset_frame is not None
    ]
    failed = [event.frame for event in events if event.name in _FAILURES]
    if not onsets and not failed:
        return None
    decided = min(failed, default=None)
    first = max((onset for onset in onsets if decided is None or onset <= decided), default=decided or 0)
    told = [f"{seconds(e.frame, rate_hz)}: {e.name}, {e.text}" for e in events if e.name in _TOLD]
    return Happened(told or ["no lane and no link failed"], *decisive_frames(first, decided, frames, rate_hz))


def states(course: Course, rate_hz: float, count: int) -> list[Span]:
    """Return the health of each lane, the leading lane, and the votes of commands and links with an event."""
    of, found = [*computers.HEALTH[:count], computers.LEADING], list[Span]()
    for strip in (*of, *computers.VOTES, *computers.fitted(computers.OF_LINKS, count)):
        if (change := course.strips.get(strip.path)) is not None:
            spans = spans_of(change, strip, course.frames, rate_hz)
            found += spans if strip in of or eventful(spans) else []
    return found


def commands(kept: Table, scored: Scored, one: Happened) -> go.Figure:
    """Draw the commands of each lane, and the vote of the leading lane with the threshold around it.

    kept : the frames of ``one``, of a flight with several computers
    """
    rows, time_s = kept.lane, kept["frame"] / scored.scenario.rate_hz
    figure = make_subplots(rows=len(SURFACES), cols=1, shared_xaxes=True, vertical_spacing=0.03)
    voted, config = _voted(kept), scored.scenario.computers
    for s, (name, (low, high)) in enumerate(zip(SURFACES, scored.scenario.airframe.surface_limits, strict=True)):
        scale, panel = scale_shown(unit_of_name(name)), {"row": s + 1, "col": 1, "showlegend": s == 0}
        for i in range(config.count):
            look = CHANNELS[i], 1.3, DASHES[i]
            draw_line(figure, time_s, rows["surface"][:, i, s] * scale, f"lane {COMPUTERS[i]}", look, **panel)
        draw_line(figure, time_s, voted[:, s] * scale, "vote of the leading lane", (VOTE, 2.2, "solid"), **panel)
        for sign in (-1, 1):
            limit = (voted[:, s] + sign * config.command_threshold * (high - low)) * scale
            figure.add_scatter(x=time_s, y=limit, mode="lines", line=DOTTED, row=s + 1, col=1, showlegend=False)
        unit = unit_shown(unit_of_name(name))
        figure.update_yaxes(title=f"{name.removesuffix('_rad')}{unit and f', {unit}'}", row=s + 1, col=1)
    _mark(figure, kept, scored)
    lay_out(figure, "commands of the lanes", _HEIGHT)
    figure.update_xaxes(title="time, s", row=len(SURFACES), col=1)
    return figure


def _voted(table: Table) -> Any:
    """Return (n, 4) the output of the leading lane; NaN while the back-up flies."""
    leading = computers.leading(table)
    whose = np.minimum(leading, len(COMPUTERS) - 1)
    output = table.lane["output"][np.arange(len(table)), whose]
    return np.where((leading == computers.BACKUP)[:, None], np.nan, output)


def _mark(figure: go.Figure, kept: Table, scored: Scored) -> None:
    """Shade the time in which a fault of computers or links is active, and mark each failure of a lane."""
    faults, rate_hz = scored.scenario.faults, scored.scenario.rate_hz
    of = [i for i, fault in enumerate(faults) if site(fault.signal) in OF_LANES]
    acts = np.asarray(acting(kept.rows, len(faults))[:, of].any(axis=1))
    finder = lanes.ComputerFinder(rate_hz)
    finder.find(kept)
    failed = [failure.frame for failure in finder.failures if failure.frame > kept["frame"][0]]
    mark_panels(figure, kept["frame"] / rate_hz, acts, [frame / rate_hz for frame in failed])
