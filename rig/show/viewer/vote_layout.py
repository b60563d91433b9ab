"""The layout of the viewer for the votes on a recording: an overview as that of a flight, then all signals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import rerun.blueprint as rrb

from rig.core.errors import BadInput
from rig.core.text import choices, quoted
from rig.show.viewer import vote_columns as columns
from rig.show.viewer.derived import LIMIT
from rig.show.viewer.facts import Facts, Seen, Shown, Span
from rig.show.viewer.plots import (
    Axes,
    Line,
    about,
    events,
    legend,
    list_series,
    margin,
    over_time,
    status_view,
    strips_view,
)
from rig.show.viewer.scene import TIMELINE
from rig.show.viewer.style import CHANNEL_COLORS, THRESHOLD, VOTED, Color
from rig.show.votes.shown_signal import ShownSignal

OVERVIEW: Final = "overview"
_ROWS: Final = 4  # signals of a tab
_MARGIN: Final = 0.033  # of a column, left of its strips
_LEAST_S: Final = 1.0  # of the zoom, on either side of the first isolation
_LEAST_ROWS: Final = 30


def main(signals: Sequence[ShownSignal]) -> ShownSignal:
    """Return the signal of the overview: that of the first isolation, or with a suspect channel, or the first."""
    isolated = [shown for shown in signals if shown.isolations]
    if isolated:
        return min(isolated, key=lambda shown: shown.isolations[0].time_s)
    return next((shown for shown in signals if shown.noted), signals[0])


def zoom(shown: ShownSignal) -> Span:
    """Return the seconds around the first isolation of a signal; None: there is none."""
    if not shown.isolations:
        return None
    at_s, end_s = shown.isolations[0].time_s, float(shown.time_s[-1])
    half = max(_LEAST_S, _LEAST_ROWS * end_s / max(len(shown.time_s) - 1, 1))
    return max(0.0, at_s - half), min(end_s, at_s + half)


def shown_flight(title: str, signals: Sequence[ShownSignal]) -> Shown:
    """Return the recording as what the views draw: it ends with its last row."""
    return Shown(facts=Facts(title, seen=Seen(end_s=float(signals[0].time_s[-1]))))


def tabs(signals: Sequence[ShownSignal]) -> dict[str, Sequence[ShownSignal]]:
    """Return the signals of each tab by its name; the first is the overview."""
    found: dict[str, Sequence[ShownSignal]] = {OVERVIEW: signals}
    for first in range(0, len(signals), _ROWS):
        some = signals[first : first + _ROWS]
        found[some[0].name if len(some) == 1 else f"{some[0].name} to {some[-1].name}"] = some
    return found


def require_tab(signals: Sequence[ShownSignal], tab: str) -> None:
    """Raise BadInput if there is no such tab."""
    if tab not in tabs(signals):
        raise BadInput(f"no tab {quoted(tab)}; {choices(tab, tabs(signals))}")


def layout(signals: Sequence[ShownSignal], tab: str = OVERVIEW) -> rrb.Blueprint:
    """Build the layout, open at ``tab``; BadInput: no such tab."""
    require_tab(signals, tab)
    shown = [shown_flight("", signals)]
    made = {name: _tab(name, some, shown) for name, some in tabs(signals).items() if name != OVERVIEW}
    made = {OVERVIEW: _overview(signals, shown), **made}
    return rrb.Blueprint(
        rrb.Tabs(*made.values(), active_tab=list(made).index(tab)),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
        auto_layout=False,
    )


def _overview(signals: Sequence[ShownSignal], shown: Sequence[Shown]) -> rrb.Container:
    """Build the overview: the whole recording, and the seconds around the first isolation."""
    chief = main(signals)
    span = zoom(chief)
    status = status_view([columns.together(each) for each in signals], shown)
    whole = rrb.Vertical(
        *_plots(chief, shown),
        rrb.Horizontal(margin(), status, column_shares=[_MARGIN, 1.0 - _MARGIN]),
        row_shares=[*[2] * len(_plots(chief, shown)), 4],
    )
    parts: list[Any] = [whole]
    if span is not None:
        states = strips_view(f"{chief.name}: channels", columns.apart(chief), shown, span_s=span)
        near = _plots(chief, shown, span)
        parts.append(rrb.Vertical(*near, states, row_shares=[*[2] * len(near), 3]))
    below = rrb.Horizontal(*parts, events(shown), column_shares=[*[4] * len(parts), 2])
    return rrb.Vertical(about(shown), legend(columns.LEGEND), below, row_shares=[1.4, 0.4, 10], name=OVERVIEW)


def _tab(name: str, signals: Sequence[ShownSignal], shown: Sequence[Shown]) -> rrb.Container:
    rows = [
        rrb.Horizontal(*_plots(each, shown), strips_view(f"{each.name}: channels", columns.apart(each), shown))
        for each in signals
    ]
    return rrb.Vertical(legend(columns.LEGEND), *rows, row_shares=[0.15, *[1.0] * len(rows)], name=name)


def _plots(each: ShownSignal, shown: Sequence[Shown], span: Span = None) -> list[rrb.TimeSeriesView]:
    """Draw each channel minus the vote, if the channels are known, and the signal."""
    zoomed = "" if span is None else f"zoom {span[0]:.1f} to {span[1]:.1f} s: "
    names = columns.CHANNEL_LINES[: len(each.channels)]
    value_lines = [*_bounds(each, "low", "high"), _line(each, "voted", "vote", VOTED, 3.5)]
    value_lines += [_line(each, name, f"channel {c + 1}", CHANNEL_COLORS[c]) for c, name in enumerate(names)]
    values = over_time(
        f"{zoomed}{each.label}",
        list_series(columns.NAMES, value_lines, shown),
        shown,
        Axes(span, each.ends()),
    )
    if not names or each.discrete:
        return [values]
    apart = [*_bounds(each, "apart_low", "apart_high")]
    apart += [
        _line(each, columns.APART_LINES[c], f"channel {c + 1} minus vote", CHANNEL_COLORS[c]) for c in range(len(names))
    ]
    known = each.threshold is not None
    title = f"{each.name} minus vote, {f'in thresholds (clipped at {LIMIT:g})' if known else each.measure}"
    axes = Axes(span, (-LIMIT - 0.1, LIMIT + 0.1) if known else None)
    return [over_time(f"{zoomed}{title}", list_series(columns.NAMES, apart, shown), shown, axes), values]


def _bounds(each: ShownSignal, low: str, high: str) -> list[Line]:
    if each.threshold is None:
        return []
    return [_line(each, name, f"vote {sign} threshold", THRESHOLD, 1.0) for name, sign in ((low, "-"), (high, "+"))]


def _line(each: ShownSignal, field: str, label: str, color: Color, width: float = 1.5) -> Line:
    return Line(columns.values_path(each), columns.VALUES, field, f"{each.name}, {label}", color, width)
