"""The picture of a decision: each channel minus the voted value, in thresholds, over the miscompare count."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from rig.core.frame import INDEX, SIGNALS, Block, Pattern, Source, State
from rig.core.palette import CHANNELS, DASHES, INK, REFERENCE, TRUTH, faint
from rig.core.runs import runs_where
from rig.show.pages.course import Limit, Moment
from rig.show.pages.flight_figures import DOTTED, Look, draw, draw_line, reference, shade
from rig.show.pages.lines import Array, deviation_axis, line, squeezed
from rig.show.pages.page import lay_out
from rig.show.viewer.series import Series, series
from rig.verdict.patterns import SPLITS

_BAND: Final = faint(INK, 0.1)
_HEIGHT: Final = 500
_COUNTS: Final = 0.24  # of the height
_LABELLED: Final = 3.0  # thresholds: a channel that went further has its peak in the picture
_CHANNEL: Final = "channel minus voted value"
_OTHER: Final = "also minus voted value"
_COUNT: Final = "consecutive frames"


class Peak(NamedTuple):
    """The largest deviation of a channel in a picture, thresholds, and where it is first reached."""

    channel: int  # from 1
    time_s: float
    value: float


def of_moment(
    rows: Block, rate_hz: float, moment: Moment, limit: Limit, acts: NDArray[np.bool_], waits: Mapping[str, int]
) -> go.Figure:
    """Draw a signal while it was decided: deviations and the threshold above, counts of frames and their limit below.

    rows : (n,) of the moment; acts : (n,) a fault on the signal acts; waits : persistences, frames, by name
    Without a threshold of the manager there is no band, and without anything counted no lower panel.
    """
    shown, figure = series(rows, rate_hz, moment.signal), go.Figure()
    off = limit.value * shown.scale
    deviations = (shown.channels - shown.voted[:, None]) / off
    if limit.isolates:
        figure.add_hrect(y0=-1.0, y1=1.0, fillcolor=_BAND, line_width=0, layer="below", yref="y")
    figure.add_shape(type="line", xref="paper", x0=0, x1=1, yref="y", y0=0, y1=0, line={"color": INK, "width": 1.5})
    for c, values in enumerate(deviations.T):
        _deviation(figure, shown.time_s, values, f"channel {c + 1}", (CHANNELS[c], 1.6, DASHES[c]), _CHANNEL)
    _others(figure, rows, shown, moment.signal, off)
    _peaks(figure, list(peaks(shown, deviations)))
    unit_text = f"± {limit.text}" if limit.isolates else f"1 {limit.name}: {limit.figure}"
    _note(figure, unit_text, x=1.0, y=-1.0, yref="y", xanchor="right", yanchor="top")
    reach = float(np.nanmax(np.abs(deviations), initial=1.0, where=np.isfinite(deviations)))
    lay_out(figure, f"{moment.signal}: deviation from the voted value", _HEIGHT)
    figure.update_yaxes(title=f"{limit.name}s", **deviation_axis(reach))
    figure.update_xaxes(title="time, s", range=[float(shown.time_s[0]), float(shown.time_s[-1])])
    _counts(figure, rows, shown.time_s, INDEX[moment.signal], waits)
    _marks(figure, rows, rate_hz, moment, acts)
    figure.update_layout(meta={"alternative": _alternative(moment, rate_hz, limit, list(peaks(shown, deviations)))})
    return figure


def _deviation(figure: go.Figure, time_s: Array, values: Array, name: str, look: Look, heading: str) -> None:
    if np.isfinite(values).any():
        drawn = line(time_s, values)
        hover = f"%{{x:.2f}} s: %{{text}} thresholds<extra>{name}</extra>"
        about = {"legendgrouptitle": {"text": heading}, "text": [f"{value:.3g}" for value in drawn.values]}
        draw(figure, drawn._replace(values=squeezed(drawn.values)), name, look, **about, hovertemplate=hover)


def _others(figure: go.Figure, rows: Block, shown: Series, name: str, off: float) -> None:
    """Draw the true value, and the reference where it may have decided."""
    s = INDEX[name]
    states, patterns = rows["state"][:, s], rows["pattern"][:, s]
    asked = np.isin(patterns, SPLITS).any() or (rows["source"][:, s] != Source.VOTED).any()
    if asked or not np.isin(states, (State.SUSPECT, State.FAILED)).any():
        values = (reference(rows, name) * shown.scale - shown.voted) / off
        _deviation(figure, shown.time_s, values, "reference", (REFERENCE, 1.0, "solid"), _OTHER)
    truth = (shown.truth - shown.voted) / off
    _deviation(figure, shown.time_s, truth, "true value", (TRUTH, 1.4, "solid"), _OTHER)


def peaks(shown: Series, deviations: Array) -> Iterator[Peak]:
    """Yield the peak of each channel that went further than a few thresholds."""
    for c, values in enumerate(deviations.T):
        sizes = np.nan_to_num(np.abs(values), nan=0.0, posinf=0.0)
        k = int((sizes >= 0.98 * sizes.max(initial=0.0)).argmax())
        if sizes.max(initial=0.0) > _LABELLED:
            yield Peak(c + 1, float(shown.time_s[k]), float(values[int(sizes.argmax())]))


def _peaks(figure: go.Figure, found: list[Peak]) -> None:
    """Write the peaks at the right end, one above the other."""
    for sign in (1.0, -1.0):
        beyond = sorted((one for one in found if one.value * sign > 0), key=lambda one: one.value * sign)
        if beyond:
            alike: dict[str, list[int]] = {}
            for one in beyond:
                alike.setdefault(f"{one.value:+.3g}", []).append(one.channel)
            named = [
                f"channel{'s' * (len(of) > 1)} {', '.join(map(str, sorted(of)))}: {value}"
                for value, of in alike.items()
            ]
            text = ("; " if len(named) < 3 else ";<br>").join(named)
            height = float(squeezed(np.array([beyond[-1].value]))[0])
            place: dict[str, Any] = {"yanchor": "bottom" if sign > 0 else "top", "xanchor": "right"}
            _note(figure, f"peak of {text}", x=1.0, y=height, yref="y", **place)


def _note(figure: go.Figure, text: str, *, xref: str = "paper", **place: Any) -> None:
    figure.add_annotation(text=text, xref=xref, showarrow=False, font={"size": 12}, **place)


def _counts(figure: go.Figure, rows: Block, time_s: Array, s: int, waits: Mapping[str, int]) -> None:
    """Draw, below, for how many frames in a row a channel miscompared or a split existed, and the limit of each."""
    in_split = np.isin(rows["pattern"][:, s], SPLITS)
    patterns = np.where(in_split, rows["pattern"][:, s], Pattern.NORMAL)
    splits = {f"split {Pattern(int(p)).label}": patterns == p for p in np.unique(patterns[in_split])}
    found: dict[str, tuple[NDArray[np.bool_], Look]] = {
        name: (mask, (INK, 1.8, "solid")) for name, mask in splits.items()
    }
    for c, states in enumerate(rows["state"][:, s, : SIGNALS[s].channels].T):
        failed = states == State.FAILED
        suspect = ((states == State.SUSPECT) | (failed & ~np.roll(failed, 1))) & ~in_split
        if suspect.any() and (waits or (states == State.SUSPECT).any()):
            found[f"miscompares of channel {c + 1}"] = suspect, (CHANNELS[c], 1.8, DASHES[c])
    most = 1.0
    for name, (mask, look) in found.items():
        lasted = in_a_row(mask)
        most = max(most, float(lasted.max()))
        heading = {"legendgrouptitle": {"text": _COUNT}}
        draw_line(figure, time_s, lasted, name, look, yaxis="y2", line_shape="hv", **heading)
    limits = _limits(waits, split=bool(splits), single=len(found) > len(splits) or not found)
    if not found and not limits:
        figure.update_layout(height=(1.0 - _COUNTS) * _HEIGHT)
        return
    for side, (name, frames) in zip(("right", "left"), limits.items(), strict=False):
        anchor = "top" if frames < max(limits.values()) else "bottom"  # away from the other line
        figure.add_shape(type="line", xref="paper", x0=0, x1=1, yref="y2", y0=frames, y1=frames, line=DOTTED)
        place: dict[str, Any] = {"xanchor": side, "x": float(side == "right"), "yref": "y2"}
        _note(figure, f"limit ({name}): {frames}", **place, y=frames, yanchor=anchor)
    end = 1.5 * max(most if most < 100.0 else 0.0, *limits.values(), 2)
    below = {"domain": [0.0, _COUNTS - 0.05], "anchor": "x", "title": "frames", "range": [0.0, end], "nticks": 4}
    figure.update_layout(yaxis={"domain": [_COUNTS, 1.0]}, yaxis2=below, xaxis={"anchor": "y2"})


def _limits(waits: Mapping[str, int], *, split: bool, single: bool) -> dict[str, int]:
    """Return the limits that belong to what is counted: that of splits, that of single channels."""
    return {name: frames for name, frames in waits.items() if (split if name.startswith("split") else single)}


def in_a_row(mask: NDArray[np.bool_]) -> Array:
    """Return (n,) for how many rows ``mask`` (n,) has held up to each, that one included; 0 where it does not."""
    rows = np.arange(len(mask))
    return (rows - np.maximum.accumulate(np.where(mask, -1, rows))).astype(float)


def _marks(figure: go.Figure, rows: Block, rate_hz: float, moment: Moment, acts: NDArray[np.bool_]) -> None:
    """Shade the time in which a fault acts, and mark beginning and isolation."""
    stretches = runs_where(acts) + moment.begin
    shade(figure, stretches, rate_hz)
    if len(stretches):
        end = {"yref": "y domain", "y": 0.0, "yanchor": "bottom", "xanchor": "right", "x": 1.0}
        first, last = int(stretches[0, 0]), int(stretches[-1, 1])
        _note(figure, f"fault active: {first / rate_hz:.2f} to {(last - 1) / rate_hz:.2f} s", **end)
    if moment.isolated != moment.first:
        _mark(figure, moment.first / rate_hz, f"{began(rows, moment)} at", "right")
    if moment.isolated is not None:
        _mark(figure, moment.isolated / rate_hz, "isolated at", "left")


def began(rows: Block, moment: Moment) -> str:
    """Return with what the decision began; rows : of the moment."""
    k, s = moment.first - moment.begin, INDEX[moment.signal]
    if rows["pattern"][k, s] in SPLITS:
        return "no majority"
    return "first miscompare" if State.SUSPECT in rows["state"][k, s] else "start"


def _mark(figure: go.Figure, at_s: float, text: str, side: str) -> None:
    shape: dict[str, Any] = {"type": "line", "xref": "x", "yref": "paper", "x0": at_s, "x1": at_s, "y0": 0, "y1": 1}
    figure.add_shape(**shape, line={"color": INK, "width": 1.2, "dash": "dash"})
    about: dict[str, Any] = {"xref": "x", "x": at_s, "xanchor": side, "yref": "y domain", "y": 1.0, "yanchor": "top"}
    _note(figure, f" {text} {at_s:.2f} s ", **about)


def _alternative(moment: Moment, rate_hz: float, limit: Limit, found: list[Peak]) -> str:
    """Return the picture as text."""
    isolated = "no channel isolated"
    if moment.isolated is not None:
        isolated = f"isolation at {moment.isolated / rate_hz:.2f} s"
    beyond = "; ".join(f"channel {one.channel} {one.value:+.3g} thresholds" for one in found)
    head = f"Deviation of each channel of {moment.signal} from the voted value, in units of the {limit.text}"
    return (
        f"{head}. Start at {moment.first / rate_hz:.2f} s, {isolated}. {f'Peaks: {beyond}.' if beyond else ''}".strip()
    )
