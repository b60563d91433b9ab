"""What a whole flight has shown: its headline, its decisive seconds, and the ranges that the plots are made for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from rig.frame import CHANNELS, INDEX, SIGNALS, Block, End, State
from rig.record.event import Event
from rig.units.angles import differences, unwrapped
from rig.view import charts, derived
from rig.view.facts import Facts, Seen
from rig.view.story import Story, zoom

_ROOM: Final = 2.0  # thresholds either side of vote and truth


def look(facts: Facts, rows: Block, events: Sequence[Event], rate_hz: float, ended: bool) -> tuple[Facts, str]:
    """``facts`` with what is seen of a whole flight, and its headline; ``ended``: its loop has ended it."""
    story = Story(facts, rate_hz)
    story.add(rows, events)
    lost = story.end != End.FLYING
    outcome = "SURVIVED" if ended else "NOT FINISHED"
    end_s, decisive = story.last / rate_hz, story.decisive
    found = charts.ranges(rows) | {signal.name: signal_range(facts, rows, i) for i, signal in enumerate(SIGNALS)}
    main, span, isolated = "", None, None
    if decisive is not None:
        main, onset, isolated = decisive
        span = zoom(onset, isolated, end_s)
        first, last = (int(np.searchsorted(rows["frame"], s * rate_hz)) for s in span)
        found["zoom"] = signal_range(facts, rows, INDEX[main], slice(first, last + 1))
    survived = not lost if ended or lost else None
    seen = Seen(survived, end_s, isolated, span, main, _noted(facts, rows), found)
    return replace(facts, seen=seen), story.headline(outcome)


def signal_range(facts: Facts, rows: Block, index: int, part: slice = slice(None)) -> tuple[float, float]:
    """What a plot of signal ``index`` shows: vote and truth with room, in the unit that people read.

    A channel that has run away leaves the picture; without a threshold, all of them are within.
    """
    signal, factor, threshold = SIGNALS[index], derived.scale(index), facts.threshold(index)
    truth = rows["truth"][:, index]
    base = unwrapped(truth)[part] if signal.wraps else truth[part]
    truth = truth[part]
    drawn = [rows["voted"][part, index]]
    if not np.isfinite(threshold):
        drawn += list(rows["channels"][part, index].T)
    around = [base, *(base + differences(one, truth, signal.wraps) for one in drawn)]
    room = _ROOM * threshold * factor if np.isfinite(threshold) else 0.0
    values = np.concatenate(around) * factor
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    room = max(room, 0.05 * (high - low)) or 1e-3
    return low - room, high + room


def _noted(facts: Facts, rows: Block) -> tuple[str, ...]:
    """Signals with a fault on them or a channel that was not ok."""
    told = (rows["state"] == State.SUSPECT) | (rows["state"] == State.FAILED)
    not_ok = told[:, :, :CHANNELS].any(axis=(0, 2))
    return tuple(one.name for i, one in enumerate(SIGNALS) if not_ok[i] or facts.faults_on(one.name))
