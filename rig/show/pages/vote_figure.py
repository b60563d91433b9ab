"""A voted signal on a page: channels and vote above, what each channel is from the vote below, marks at isolations.

rig/show/votes/shown_signal.py has the numbers; ``rig.vote(...).plot()`` draws the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.core.palette import CHANNELS, DASHES, INK, RED, SOFT, VOTE
from rig.show.pages.flight_figures import Look, draw
from rig.show.pages.lines import Array, deviation_axis, line, squeezed
from rig.show.pages.page import lay_out
from rig.show.votes.shown_signal import SINCE, Mark, ShownSignal

HEIGHT: Final = 480
_ABOVE: Final = 0.54  # of the height: where the upper panel begins
_BELOW: Final = 0.46  # where the lower one ends
_VOTE: Final[Look] = (VOTE, 2.6, "solid")
_BOUND: Final[Look] = (SOFT, 1.0, "dot")
_MOST_MARKS: Final = 40


def of_vote(shown: ShownSignal, marks: Sequence[Mark] | None = None, names: Sequence[str] = ()) -> go.Figure:
    """Draw a voted signal; its axis of differences is linear up to one threshold and logarithmic beyond.

    marks : channels and times to mark; None: the isolations of the vote
    names : of the channels, if they have others than "channel 1"
    """
    figure = go.Figure()
    told = shown.isolations if marks is None else list(marks)
    called = [escape(name) for name in names] or [f"channel {c + 1}" for c in range(len(shown.channels))]
    draw(figure, line(shown.time_s, shown.voted), "voted value", _VOTE)
    for c, channel in enumerate(shown.channels):
        draw(figure, line(shown.time_s, channel), called[c], (CHANNELS[c], 1.4, DASHES[c]))
    lay_out(figure, escape(shown.name), HEIGHT)
    figure.update_xaxes(title=SINCE, range=[0.0, float(shown.time_s[-1])])
    figure.update_yaxes(title=escape(shown.label), range=list(shown.ends()))
    if shown.channels and not shown.discrete:
        _differences(figure, shown, called)
    _isolations(figure, told, called)
    figure.update_layout(meta={"alternative": _alternative(shown, told, called)})
    return figure


def _differences(figure: go.Figure, shown: ShownSignal, called: Sequence[str]) -> None:
    """Draw, below, each channel minus the vote."""
    known, reach = shown.threshold is not None, 0.0
    for c in range(len(shown.channels)):
        apart = shown.apart(c)
        sizes = np.abs(apart[np.isfinite(apart)])
        reach = max(reach, float(sizes.max(initial=0.0)))
        _difference(figure, shown.time_s, apart, (CHANNELS[c], 1.4, DASHES[c]), called[c], shown)
    if known:
        for sign in (1.0, -1.0):
            bound = squeezed(sign * shown.bound)
            draw(figure, line(shown.time_s, bound), "limit of agreement", _BOUND, yaxis="y2", showlegend=False)
    axis = deviation_axis(reach) if known else {"zeroline": True}
    below = {"domain": [0.0, _BELOW], "anchor": "x", "title": f"minus the vote, {escape(shown.measure)}", **axis}
    figure.update_layout(yaxis={"domain": [_ABOVE, 1.0]}, yaxis2=below, xaxis={"anchor": "y2"})


def _difference(figure: go.Figure, time_s: Array, apart: Array, look: Look, name: str, shown: ShownSignal) -> None:
    drawn, known = line(time_s, apart), shown.threshold is not None
    text = [f"{value:.3g}" for value in drawn.values]
    about = {"text": text, "hovertemplate": f"%{{x:.3f}} s: %{{text}} {escape(shown.measure)}<extra>{name}</extra>"}
    values = squeezed(drawn.values) if known else drawn.values
    draw(figure, drawn._replace(values=values), name, look, yaxis="y2", showlegend=False, **about)


def _isolations(figure: go.Figure, marks: Sequence[Mark], called: Sequence[str]) -> None:
    """Mark the first isolations in both panels."""
    for mark in marks[:_MOST_MARKS]:
        shape: dict[str, Any] = {"type": "line", "xref": "x", "yref": "paper", "y0": 0, "y1": 1}
        figure.add_shape(**shape, x0=mark.time_s, x1=mark.time_s, line={"color": RED, "width": 1.2, "dash": "dash"})
    for mark in marks[:3]:
        figure.add_annotation(
            text=f" {called[mark.channel - 1]} isolated at {mark.time_s:.2f} s",
            **{"x": mark.time_s, "xref": "x", "y": 1.0, "yref": "paper", "yanchor": "bottom", "xanchor": "left"},
            showarrow=False,
            font={"size": 12, "color": INK},
        )


def _alternative(shown: ShownSignal, marks: Sequence[Mark], called: Sequence[str]) -> str:
    """Return the picture as text."""
    told = [f"{called[mark.channel - 1]} isolated at {mark.time_s:.2f} s" for mark in marks[:_MOST_MARKS]]
    head = f"Channels and vote of {shown.label} over {shown.time_s[-1]:.1f} s"
    below = f", and each channel minus the vote in {shown.measure}" if shown.channels else ""
    return f"{head}{below}. {'; '.join(told) or 'No channel isolated'}."
