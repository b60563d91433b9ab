"""Rows of a conclusion about voted values against the true ones, and about the aircraft."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rig.core.frame import DISCRETE_INDEX, INDEX, SIGNALS
from rig.core.units.quantities import quantity, scale_shown, unit_shown
from rig.flight.conclusion_rows import Row
from rig.verdict.context import Context, named

_SMALL, _LARGE = 1e-4, 10.0  # between them a value is shown with two digits
_LEAST: Final = 0.001  # g; a smaller difference is shown as this
_MOST: Final = 3  # signals that have a row of their own; of more the rest share one


def voted_rows(context: Context) -> Iterator[Row]:
    """Yield a row for the voted value of each signal with a fault or beyond its error limit, or one for all."""
    score = context.score
    faulty = list(dict.fromkeys(fault.signal for fault in score.faults if fault.window is not None))
    beyond = [name for name, error in score.vote_error.items() if error.above_threshold_s > 0]
    lost = [name for name, signal in score.signals.items() if signal.lost_s > 0]
    asked = [name for name in dict.fromkeys((*faulty, *beyond, *lost)) if not context.silent(name)]
    shown = sorted(asked, key=lambda name: (name not in lost, -_excess(name, context)))
    if len(shown) > _MOST and not {*beyond, *lost} & {*shown}:
        shown = []
    for name in shown[: _MOST if len(shown) <= _MOST else _MOST - 1]:
        yield Row(f"voted {named(name)}", (_voted(name, context),))
    if len(shown) > _MOST:
        yield Row("voted values", (_rest(shown[_MOST - 1 :], context),))
    yield from _discretes(context)
    if not shown and not context.score.evidence.silent:
        yield Row("voted values", (f"all {len(SIGNALS)} within their error limits",))


def _excess(name: str, context: Context) -> float:
    """Return the largest error of a voted value in its error limits."""
    return _error(name, context) / float(context.params[INDEX[name]]["threshold"])


def _error(name: str, context: Context) -> float:
    """Return the largest error of a voted value from the first fault on its signal on, else of the whole flight."""
    windows = [fault.window for fault in context.score.faults if fault.signal == name and fault.window is not None]
    vote = context.score.vote_error[name]
    if not windows or vote.above_threshold_s:
        return vote.peak
    return max(window.error_max for window in windows)


def _voted(name: str, context: Context) -> str:
    score, unit = context.score, SIGNALS[INDEX[name]].unit
    off, lost_s = _short(_error(name, context), unit), score.signals[name].lost_s
    above_s = score.vote_error[name].above_threshold_s
    limit = quantity(float(context.params[INDEX[name]]["threshold"]), unit)
    text = f"at most {off} from the true value"
    if above_s and _excess(name, context) <= 1.0:
        text = f"no number for {above_s:g} s, otherwise {text}"
    elif above_s:
        text = f"up to {off} from the true value, beyond the error limit of {limit} for {above_s:g} s"
    return f"no channel left for {lost_s:g} s; {text}" if lost_s else text


def _rest(names: list[str], context: Context) -> str:
    """Return how the voted values of several signals were."""
    score = context.score
    beyond = [named(name) for name in names if score.vote_error[name].above_threshold_s > 0]
    lost = [named(name) for name in names if score.signals[name].lost_s > 0]
    within = len(names) - len({*beyond, *lost})
    parts = [
        f"{len(some)} more {text}"
        for some, text in ((lost, "without a channel"), (beyond, "beyond their error limits"))
        if some
    ]
    return ", ".join([*parts, *([f"{within} more within their error limits"] if within else [])])


def _discretes(context: Context) -> Iterator[Row]:
    """Yield a row for each discrete with a fault, or whose voted value was wrong."""
    places = {fault.signal for fault in context.score.faults}
    faulty = {name for name in places if name in DISCRETE_INDEX} if len(places) <= _MOST else ()
    for name, wrong_s in context.score.wrong_votes_s.items():
        if wrong_s > 0 or name in faulty:
            yield Row(f"voted {named(name)}", (f"wrong for {wrong_s:g} s" if wrong_s else "correct at all times",))


def aircraft_row(context: Context) -> Row:
    """Return the row of the aircraft: its load factor against the fault-free baseline, or its range alone."""
    flight = context.score.flight
    acted = sum(fault.onset_frame is not None and fault.outcome != "not executed" for fault in context.score.faults)
    if flight.transients is None or not acted:
        text = f"load factor {flight.load_factor_min:.2f} to {flight.load_factor_max:.2f} g"
        return Row("aircraft", (f"{text}, not compared with a fault-free flight" if acted else text,))
    off = flight.transients.overall.load_factor
    fault = "faults" if acted > 1 else "fault"
    without, beyond_s = f"the flight without the {fault}", flight.transients.out_of_limits_s
    if beyond_s:
        text = f"load factor up to {off:.2f} g from {without}, beyond the transient limits for {beyond_s:g} s"
    else:
        text = f"load factor within {max(off, _LEAST):.3f} g of {without}"
    return Row("aircraft", (text,))


def _short(value: float, unit: str) -> str:
    """Return a quantity with two digits below 10: ``0.23 deg/s``."""
    shown = value * scale_shown(unit)
    if not _SMALL <= shown < _LARGE:
        return quantity(value, unit)
    return f"{shown:.2g} {unit_shown(unit)}".rstrip()
