"""The clean samples: what sensors and inertial unit gave before any fault, kept in flight or computed again from the
recorded truth; and the references that the recorded votes give without a fault on a reference.

All are deterministic in the scenario's seed, so what they give for the recorded truth is, bit for bit, what they gave
in flight; the recorded samples less these are the injected errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.analytic.references import References, refer, remember
from rig.computer.lanes.lane_clock import sample_early
from rig.computer.redundancy.managers import manager_kind
from rig.computer.redundancy.median_vote import mean
from rig.core.frame import CHANNELS, FLAT, Block, Table, nested, new_block
from rig.core.kernels import kernel
from rig.core.units.angles import difference, limit
from rig.scenario.scenario import Scenario
from rig.world.faults import CLEAN
from rig.world.sensors import Sensors, measure
from rig.world.sensors.inertial import Inertial, sense

ROWS: Final = 256  # of the clean block: half a megabyte, which stays in the cache


class MeasuredAgain:
    """Sensors and inertial unit of a flight, over the recorded truth of its rows, which are given in their order."""

    def __init__(self, scenario: Scenario) -> None:
        streams, rate_hz = scenario.streams(), scenario.rate_hz
        self._sensors = Sensors(scenario.sensors, rate_hz, streams["sensors"])
        self._inertial = Inertial(scenario.inertial, rate_hz, streams["inertial"])
        self._skew = self._sensors.params["skew"].copy()
        self._block, self._kept = new_block(ROWS), np.zeros(ROWS, CLEAN)

    def of(self, table: Table) -> Iterator[Table]:
        """Yield the next frames part by part with their clean channels, sampled at the times of the lanes' clocks."""
        rows, lead = table.rows, np.zeros((len(table), CHANNELS))
        if table.lane is not None:
            lead[:] = table.lane["clock_lead"]
        for first in range(0, len(rows), ROWS):
            part = table[first : first + ROWS]
            recorded = part.rows
            again, clean = self._block[: len(recorded)], self._kept[: len(recorded)]
            again.view(np.uint8)[:] = recorded.view(np.uint8)
            self._sensors.prepare(again)
            self._inertial.prepare(again)
            measure_again(nested(again), self._sensors.data, self._inertial.data, self._skew, lead[first:])
            for field in CLEAN.names or ():
                clean[field] = again[field]
            part.clean = clean
            yield part


def laid_out(rows: Block) -> Block:
    """Return ``rows`` in memory in the layout of FLAT."""
    if rows.dtype == FLAT and rows.flags.c_contiguous and rows.flags.aligned and rows.flags.writeable:
        return rows
    whole: NDArray[Any] = np.zeros(len(rows), FLAT)
    whole[:] = rows
    return whole


class ReferredAgain:
    """The references of a flight by its recorded votes, no fault on them, of rows that are given in their order."""

    def __init__(self, scenario: Scenario) -> None:
        config, monitored = scenario.redundancy, manager_kind(scenario.redundancy.manager).refers
        self._references = References(config.references, scenario.references, scenario.rate_hz, monitored)

    def of(self, rows: Block) -> NDArray[np.float64]:
        """Return the (n, S) references of the next ``rows`` (n,) FLAT."""
        again = rows.copy()
        refer_again(nested(again), self._references.data)
        return np.ascontiguousarray(again["reference"])


@kernel
def refer_again(rows, data):
    """Write the references of ``rows`` (n,) FRAME again; data : ReferenceData."""
    for k in range(len(rows)):
        refer(rows[k]["bus"], rows[k]["fcc"], data)
        remember(rows[k]["bus"], rows[k]["fcc"], data)


@kernel
def measure_again(clean, data, unit, skew, lead):
    """Fill channels and inertial unit of ``clean`` (n,) FRAME from its truth; the rest as of ``sample_early``.

    data : SensorData; unit : InertialData; lead : (n, 4)
    """
    for k in range(len(clean)):
        sample_early(data.params, skew, lead[k])
        measure(clean[k]["truth"], clean[k]["bus"], k, data)
        sense(clean[k]["truth"], clean[k]["bus"], k, unit)


@kernel
def same(a, b):
    """Return whether two (S, 4) arrays are equal, element by element; a NaN is equal to nothing."""
    different = 0
    for s in range(a.shape[0]):
        for c in range(a.shape[1]):
            different |= a[s, c] != b[s, c]
    return different == 0


@kernel
def injected(row, clean, s, c, wraps):
    """Return the recorded less the clean sample; NaN for a sample that a fault has taken away."""
    if row["valid"][s, c] == 0 and clean["valid"][s, c] != 0:
        return np.nan
    faulted, unfaulted = row["channels"][s, c], clean["channels"][s, c]
    if faulted == unfaulted or unfaulted != unfaulted:
        return 0.0
    return difference(faulted, unfaulted, wraps)


@kernel
def middle(channels, near, p):
    """Return the median of the fitted ``channels`` (4,), the mean of the middle two when their number is even.

    Angles are taken ``near`` to the truth.  NaN where truth or a channel is no number.
    """
    n, wraps = p["fitted"], p["wraps"]
    a, b = around(channels[0], near, wraps), around(channels[1], near, wraps)
    c = around(channels[2], near, wraps) if n > 2 else a
    d = around(channels[3], near, wraps) if n > 3 else b
    # Of four: the larger of the pairs' smaller ones and the smaller of their larger ones. Of two: each counts twice.
    one, other = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    if n == 3:
        one = other = max(min(a, b), min(max(a, b), c))
    if a + b + c + d != a + b + c + d:
        return np.nan
    return limit(mean(min(one, other), max(one, other), 0.5), p["low"], p["high"], wraps)


@kernel
def around(sample, near, wraps):
    """Return an angle as a number ``near`` another, anything else as it is."""
    return near + difference(sample, near, 1) if wraps != 0 else sample
