"""Two publishers on one topic: told apart by their channel in the file, or noticed by their times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_AGAIN: Final = 0.01  # share of stamps with two values from which it is no accident
_IN_TURN: Final = 0.2  # of a step: by which steps differ at least that come in turn
_STEADY: Final = 0.3  # of that: by which the sum of two of them varies at most
_FEW: Final = 20  # rows in which no verdict is possible
_DECIMALS: Final = 9
_ROUNDED: Final = 1.5  # last decimals by which steps differ that are equal but for the rounding of stamps


def publishers(time_s: Floats) -> str:
    """Return why the messages at ``time_s`` (n,), in order, come from more than one publisher; "" if they may not."""
    steps = np.diff(time_s)
    if len(steps) < _FEW:
        return ""
    if (steps == 0).mean() > _AGAIN:
        return f"{int((steps == 0).sum())} stamps have two values: two publishers"
    return steps_in_turn(time_s)


def steps_in_turn(time_s: Floats) -> str:
    """Return how long and short steps of ``time_s`` (n,) alternate, as those of two publishers do; "": they do not."""
    steps = np.diff(time_s)
    if len(steps) < _FEW:
        return ""
    pairs = steps[1:] + steps[:-1]
    least = max(_IN_TURN * float(np.median(steps)), _ROUNDED * last_decimal(time_s))
    if _range(steps) > least and _range(pairs) < _STEADY * _range(steps):
        short, long = sorted((float(np.median(steps[::2])), float(np.median(steps[1::2]))))
        return f"steps of {short:.3g} and {long:.3g} s in turn: two publishers"
    return ""


def overlapping(channels: Sequence[int], time_s: Floats) -> list[int]:
    """Return the channels (n,) of the messages of one topic if these are on several at a time; none: one after another.

    A recorder that opens a topic again gives it a new channel, and leaves the old one.
    """
    of = np.asarray(channels)
    spans = sorted((float(time_s[of == c].min()), float(time_s[of == c].max()), int(c)) for c in np.unique(of))
    latest_s, found = -np.inf, set[int]()
    holder = 0
    for first_s, last_s, channel in spans:
        if first_s < latest_s:
            found |= {holder, channel}
        if last_s > latest_s:
            latest_s, holder = last_s, channel
    return sorted(found)


def names_of(topics: Iterable[tuple[int, str]]) -> dict[str, list[int]]:
    """Return the channels of each topic by its name, and each of several channels as ``topic#number``.

    topics : number and topic of each channel
    """
    of: dict[str, list[int]] = {}
    for number, topic in topics:
        of.setdefault(topic, []).append(number)
    single = {f"{topic}#{number}": [number] for topic, all_of in of.items() if len(all_of) > 1 for number in all_of}
    return {**single, **of}


def _range(values: Floats) -> float:
    """Return the distance of the lowest and the highest tenth."""
    low, high = np.quantile(values, (0.1, 0.9))
    return float(high - low)


def last_decimal(time_s: Floats) -> float:
    """Return the unit of the last decimal that any stamp has, s; 0: they are not rounded."""
    noise_s = float(np.spacing(np.abs(time_s).max()))
    for decimals in range(_DECIMALS + 1):
        if (np.abs(time_s - np.round(time_s, decimals)) <= noise_s).all():
            return 10.0**-decimals
    return 0.0
