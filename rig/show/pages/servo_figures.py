"""The pictures of servo actuators in a report: measurements of the channels around a fault, and their limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from rig.core.frame import MOVED, Table
from rig.core.palette import CHANNELS, DASHES, INK, TRUTH
from rig.core.units.quantities import scale_shown, seconds
from rig.flight.stages import actuator_monitors
from rig.show.pages.course import Course, decisive_frames
from rig.show.pages.flight_figures import DOTTED, draw_line, mark_panels
from rig.show.pages.page import lay_out
from rig.show.pages.timeline import Span, eventful, spans_of
from rig.show.viewer.servo_series import of_surface
from rig.show.viewer.state_strips import acting
from rig.verdict.of_log import Scored
from rig.verdict.score_records import ActuatorScore
from rig.verdict.servo_words import bypass_text
from rig.world.faults.places import number, site

_HEIGHT: Final = 640
_LATEST_S: Final = 10.0  # later failures are not drawn
_DEG: Final = scale_shown("rad")
Array = NDArray[np.float64]


class Happened(NamedTuple):
    """The frames of one surface that are drawn, and the sentences about it."""

    surface: str
    begin: int
    end: int  # excluded
    said: list[str]


def happened(scored: Scored) -> list[Happened]:
    """Return the surfaces with a channel that was shut off, or with a fault on the actuator."""
    found, rate_hz, frames = [], scored.scenario.rate_hz, scored.score.flight.frames
    for name, one in scored.score.actuators.items():
        onsets = [
            fault.onset_frame
            for fault in scored.score.faults
            if fault.signal == f"actuator.{name}" and fault.onset_frame is not None
        ]
        first = min([*onsets, *(failure.frame for failure in one.failures)], default=one.bypassed_frame)
        if first is not None:
            decided = [failure.frame for failure in one.failures] + [one.bypassed_frame or first]
            last = max(frame for frame in decided if frame - first <= _LATEST_S * rate_hz)
            begin, end = decisive_frames(first, last if last > first else None, frames, rate_hz)
            found.append(Happened(name, begin, end, list(_said(one, frames, rate_hz))))
    return found


def _said(one: ActuatorScore, frames: int, rate_hz: float) -> Iterator[str]:
    for failure in one.failures:
        at = seconds(failure.frame, rate_hz)
        why = "" if failure.cause == "own fault" else f": {failure.cause}"
        yield f"channel {failure.channel} shut off at {at} by the {failure.monitor} monitor{why}"
    for channel, frame in one.valves_differ.items():
        yield f"the valve of channel {channel} differs from its command from {seconds(frame, rate_hz)} on"
    if text := bypass_text(one, frames, rate_hz):
        yield text
    if not one.failures:
        yield "no channel was shut off"


def states(course: Course, rate_hz: float) -> list[Span]:
    """Return the states of the channels of each surface with an event, and the number of channels that move it."""
    found = list[Span]()
    for surface in MOVED:
        of = [(strip, course.strips[strip.path]) for strip in of_surface(surface) if strip.path in course.strips]
        spans = [span for strip, change in of for span in spans_of(change, strip, course.frames, rate_hz)]
        found += spans if eventful(spans) else []
    return found


def of_actuator(kept: Table, scored: Scored, one: Happened) -> go.Figure:
    """Draw the actuator of a surface: positions, then the differences that its monitors compare, with thresholds.

    kept : the frames of ``one``, of a flight with servo actuators
    """
    i = MOVED.index(one.surface)
    rows, time_s = kept.servo[:, i], kept["frame"] / scored.scenario.rate_hz
    figure = make_subplots(rows=4, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    _positions(figure, rows, time_s)
    for panel, (title, values, limit) in enumerate(_compared(rows, i, scored), 2):
        for c, column in enumerate(values.T):
            held: dict[str, Any] = {"row": panel, "col": 1, "showlegend": False, "line_shape": "hv"}  # for its frame
            draw_line(figure, time_s, column, f"channel {c + 1}", (CHANNELS[c], 1.3, DASHES[c]), **held)
        for level in (-limit, limit):
            figure.add_hline(y=level, line=DOTTED, row=panel, col=1)  # pyright: ignore[reportArgumentType]
        figure.update_yaxes(title=title, row=panel, col=1)
    failed = [failure.frame for failure in scored.score.actuators[one.surface].failures]
    failed_s = [frame / scored.scenario.rate_hz for frame in failed if one.begin <= frame < one.end]
    mark_panels(figure, time_s, _acts(kept, scored, one.surface), failed_s)
    lay_out(figure, f"actuator of the {one.surface}", _HEIGHT)
    figure.update_xaxes(title="time, s", row=4, col=1)
    return figure


def _positions(figure: go.Figure, rows: NDArray[Any], time_s: Array) -> None:
    draw_line(figure, time_s, rows["asked"][:, 0] * _DEG, "commanded position", (INK, 1.4, "dot"), row=1, col=1)
    draw_line(figure, time_s, rows["ram"] * _DEG, "position of the ram", (TRUTH, 1.8, "solid"), row=1, col=1)
    for c, values in enumerate(rows["lvdt"].T.astype(float)):
        draw_line(figure, time_s, values * _DEG, f"channel {c + 1}", (CHANNELS[c], 1.3, DASHES[c]), row=1, col=1)
    figure.update_yaxes(title="position, deg", row=1, col=1)


def _compared(rows: NDArray[Any], i: int, scored: Scored) -> list[tuple[str, Array, float]]:
    """Return title, (n, 4) and threshold of each difference that the monitors of surface ``i`` compare."""
    designed, monitors = actuator_monitors(scored.scenario)
    limits, lvdt = monitors.limits[i], rows["lvdt"].astype(float)
    asked = np.clip(designed[i]["gain"] * (rows["asked"] - lvdt), -1.0, 1.0)  # as servo.asked_current
    out = np.vstack([rows["failed_by"][:1], rows["failed_by"][:-1]]) != 0
    compared = [
        ("current - command", rows["current"] - asked, float(limits["current"])),
        ("model - spool", rows["spool_model"].astype(float) - rows["spool"][:, None], float(limits["spool"])),
        ("model - LVDT, deg", (rows["ram_model"] - lvdt) * _DEG, float(limits["ram"]) * _DEG),
    ]
    return [(title, np.where(out, np.nan, values), limit) for title, values, limit in compared]


def _acts(kept: Table, scored: Scored, surface: str) -> NDArray[np.bool_]:
    """Return (n,) a fault on the actuator of the surface, or on the hydraulics, acts."""
    faults = scored.scenario.faults
    of = [
        i
        for i, fault in enumerate(faults)
        if (where := site(fault.signal)) == "hydraulics"
        or (where == "actuator" and number(fault.signal) == MOVED.index(surface))
    ]
    return np.asarray(acting(kept.rows, len(faults))[:, of].any(axis=1))
