"""A signal over a flight for pictures: degrees, unwrapped angles, axis limits that ignore a hardover."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS, Block, State
from rig.core.text import choices, quoted
from rig.core.units.angles import near, unwrapped
from rig.core.units.quantities import scale_shown, unit_shown

ROOM: Final = 3.0  # thresholds above and below vote and truth
NEAR: Final = 15.0  # thresholds: a channel in use within this distance of the vote is in the picture
Array = NDArray[np.float64]


class Series(NamedTuple):
    """One signal in display units, angles unwrapped along the truth; NaN: no number."""

    name: str
    unit: str  # displayed
    scale: float  # shown units in one of the signal's SI unit
    time_s: Array  # (n,)
    channels: Array  # (n, channels)
    used: NDArray[np.bool_]  # (n, channels) not failed
    voted: Array  # (n,)
    truth: Array  # (n,)


def series(rows: Block, rate_hz: float, name: str) -> Series:
    """Return the signal ``name`` of ``rows`` (n,); BadInput: unknown signal."""
    if name not in INDEX:
        raise BadInput(f"unknown signal {quoted(name)}, {choices(name, INDEX, 'rig signals')}")
    signal, s = SIGNALS[INDEX[name]], INDEX[name]
    truth, voted, channels = rows["truth"][:, s], rows["voted"][:, s], rows["channels"][:, s, : signal.channels]
    scale = scale_shown(signal.unit)
    if signal.wraps:
        truth = unwrapped(truth)
        voted, channels = near(voted, truth), near(channels, truth[:, None])
    values = (channels * scale, rows["state"][:, s, : signal.channels] != State.FAILED, voted * scale, truth * scale)
    return Series(name, unit_shown(signal.unit), scale, rows["frame"] / rate_hz, *values)


def limits(shown: Series, threshold: float) -> tuple[float, float]:
    """Return the lowest and highest value to draw: vote and truth with ROOM thresholds (SI), near channels in use.

    A hardover leaves the picture and does not flatten the other channels.
    """
    unit = threshold * shown.scale
    with np.errstate(invalid="ignore"):
        close = shown.used & (np.abs(shown.channels - shown.voted[:, None]) <= NEAR * unit)
    drawn = [shown.voted - ROOM * unit, shown.voted + ROOM * unit, shown.truth - ROOM * unit, shown.truth + ROOM * unit]
    values = np.concatenate([*drawn, shown.channels[close] - unit, shown.channels[close] + unit])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (-1.0, 1.0)


def threshold(resolved: Mapping[str, Any], name: str) -> float:
    """Return the largest allowed difference of a channel from the vote, SI; resolved : scenario; KeyError: none."""
    return float(resolved["redundancy"]["signals"][name]["threshold"])
