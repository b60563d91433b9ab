"""A flight by signal: the columns of its rows as arrays, for a notebook."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.frame import DISCRETE_INDEX, INDEX, Block


@dataclass(frozen=True, slots=True)
class SignalArrays:
    """One signal over a flight, unit as in frame.SIGNALS; views of the rows, not copies."""

    time_s: NDArray[np.float64]  # (frames,)
    channels: NDArray[np.float64]  # (frames, 4), NaN where a channel is not fitted
    voted: NDArray[np.float64]  # (frames,)
    truth: NDArray[np.float64]  # (frames,)
    reference: NDArray[np.float64]  # (frames,), NaN where there is none
    valid: NDArray[np.uint8]  # (frames, 4), 0: the sensor flags the sample
    ilm: NDArray[np.uint8]  # (frames, 4), frame.Ilm
    state: NDArray[np.uint8]  # (frames, 4), frame.State
    level: NDArray[np.uint8]  # (frames,) channels in use
    pattern: NDArray[np.uint8]  # (frames,), frame.Pattern
    resolver: NDArray[np.uint8]  # (frames,), frame.Resolver
    reference_usable: NDArray[np.uint8]  # (frames,)
    source: NDArray[np.uint8]  # (frames,), frame.Source


@dataclass(frozen=True, slots=True)
class DiscreteArrays:
    """One discrete over a flight; views of the rows, not copies."""

    time_s: NDArray[np.float64]  # (frames,)
    channels: NDArray[np.uint8]  # (frames, 4), 0 where a channel is not fitted
    voted: NDArray[np.uint8]  # (frames,)
    truth: NDArray[np.uint8]  # (frames,)
    valid: NDArray[np.uint8]  # (frames, 4), 0: the sensor flags the sample
    ilm: NDArray[np.uint8]  # (frames, 4), frame.Ilm
    state: NDArray[np.uint8]  # (frames, 4), frame.State
    level: NDArray[np.uint8]  # (frames,)


def of_signal(rows: Block, rate_hz: float, name: str) -> SignalArrays:
    """The arrays of the signal ``name``; KeyError when there is none."""
    return SignalArrays(rows["frame"] / rate_hz, *_columns(rows, SignalArrays, "", _place(INDEX, name, "signal")))


def of_discrete(rows: Block, rate_hz: float, name: str) -> DiscreteArrays:
    """The arrays of the discrete ``name``; KeyError when there is none."""
    place = _place(DISCRETE_INDEX, name, "discrete")
    return DiscreteArrays(rows["frame"] / rate_hz, *_columns(rows, DiscreteArrays, "discrete_", place))


def _place(index: dict[str, int], name: str, kind: str) -> int:
    if name not in index:
        raise KeyError(f"unknown {kind} {name!r}, allowed: {', '.join(index)}")
    return index[name]


def _columns(rows: Block, arrays: Any, prefix: str, place: int) -> list[NDArray[Any]]:
    """The fields of FRAME of the same names, in their order; time is not one of them."""
    return [rows[prefix + field.name][:, place] for field in fields(arrays)[1:]]
