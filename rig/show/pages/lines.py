"""The lines of the pictures of a flight: all points of a short one, the extremes of each part of a long one."""

from __future__ import annotations

from itertools import pairwise
from math import degrees
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import FLIGHT_INDEX, INDEX, SIGNALS, SURFACES, Table
from rig.core.units.angles import near
from rig.show.viewer.series import Series, limits, series

Array = NDArray[np.float64]
_TICKS: Final = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # of deviations, thresholds; beyond, the decades
MOST_POINTS: Final = 2000  # of one line; beyond that the smallest and largest of each part are drawn


class Line(NamedTuple):
    """The drawn points (n,) of a line, and its finite extremes; least > most: it has no number."""

    time_s: Array
    values: Array
    least: float
    most: float

    @property
    def drawn(self) -> bool:
        """True if the line has a number."""
        return self.least <= self.most


def line(time_s: Array, values: Array) -> Line:
    """Return the line of ``values`` (n,) at ``time_s`` (n,), s."""
    chosen, finite = thinned(values), values[np.isfinite(values)]
    return Line(time_s[chosen], values[chosen], float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf)))


def thinned(values: Array) -> NDArray[np.intp]:
    """Return the indices of ``values`` (n,) to draw: all, or the extremes of each of MOST_POINTS / 2 parts."""
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), MOST_POINTS // 2 + 1).astype(np.intp).tolist()
    low, high = np.nan_to_num(values, nan=np.inf), np.nan_to_num(values, nan=-np.inf)
    found = [[a + low[a:b].argmin(), a + high[a:b].argmax()] for a, b in pairwise(edges)]
    return np.unique(np.array(found, np.intp))


class SignalLines(NamedTuple):
    """A drawn signal, in display units; ends : of the axis."""

    voted: Line
    truth: Line
    channels: list[Line]
    ends: tuple[float, float]


def signal_lines(shown: Series, ends: tuple[float, float]) -> SignalLines:
    """Return the lines of a signal over some rows."""
    voted, truth, *channels = (line(shown.time_s, of) for of in (shown.voted, shown.truth, *shown.channels.T))
    return SignalLines(voted, truth, channels, ends)


def of_signal(flight: Table, rate_hz: float, name: str, limit: float) -> SignalLines:
    """Return a signal over a whole flight; limit : SI, the largest difference of a channel from the voted value."""
    shown = series(flight.rows, rate_hz, name)
    return signal_lines(shown, limits(shown, limit))


def errors(flight: Table, name: str) -> Array:
    """Return voted minus true value (n,) of a signal, SI, angles within half a turn; NaN if one is not a number."""
    voted, truth = flight["voted"][:, INDEX[name]], flight["truth"][:, INDEX[name]]
    with np.errstate(invalid="ignore"):
        return (near(voted, truth) if SIGNALS[INDEX[name]].wraps else voted) - truth


class SurfaceLines(NamedTuple):
    """A surface, degrees, or the throttle; changed : a fault changed the command on its way to the actuator."""

    command: Line
    actuated: Line
    position: Line
    changed: bool


def of_surface(flight: Table, rate_hz: float, i: int) -> SurfaceLines:
    """Return surface ``i`` over a whole flight."""
    scale, time_s = degrees(1.0) if SURFACES[i].endswith("_rad") else 1.0, flight["frame"] / rate_hz
    command, actuated = flight["surface"][:, i], flight["surface_command"][:, i]
    position = flight["flight"][:, FLIGHT_INDEX[SURFACES[i]]]
    lines = [line(time_s, values * scale) for values in (command, actuated, position)]
    return SurfaceLines(*lines, changed=not np.array_equal(command, actuated, equal_nan=True))


def squeezed(values: Array) -> Array:
    """Return deviations as the axis has them: linear up to one threshold, logarithmic beyond."""
    size = np.abs(values)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(size <= 1.0, values, np.sign(values) * (1.0 + np.log10(np.maximum(size, 1.0))))


def deviation_axis(reach: float) -> dict[str, Any]:
    """Return ticks and range of an axis of ``squeezed`` deviations, for the largest of them."""
    decades = [10.0**k for k in range(2, 1 + max(2, int(np.log10(max(reach, 1.0))) + 1))]
    sizes = [size for size in ((1.0, 10.0) if reach > 60.0 else _TICKS) if size <= max(reach, 2.0)]
    sizes += [size for size in decades if size <= reach]
    ticks = [*(-size for size in reversed(sizes)), 0.0, *sizes]
    end = 1.25 * float(squeezed(np.array([max(reach, 1.6)]))[0])  # with room for the marks
    return {
        "tickvals": squeezed(np.array(ticks)).tolist(),
        "ticktext": [f"{tick:g}" for tick in ticks],
        "range": [-end, end],
        "zeroline": False,
    }
