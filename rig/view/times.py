"""The wall clock of a flight with a unit under test: reply times and lateness, as lines and as histograms.

/timing               rig.Timing:message, one struct a frame
/timing/replies       how many reply times lie in each bin, from the begin of the flight to the cursor
/timing/lateness      the same of the lateness; of paced flights alone
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from rig.frame import TIMING
from rig.record.histogram import BINS, EDGES_US, binned
from rig.view.scene import time_column
from rig.view.style import PALETTE

PATH: Final = "/timing"
ARCHETYPE: Final = "rig.Timing"


class Bars(NamedTuple):
    """A histogram."""

    path: str
    field: str  # of TIMING
    name: str


REPLIES: Final = Bars(f"{PATH}/replies", "reply_us", "reply times: frames over log10 of µs")
LATENESS: Final = Bars(f"{PATH}/lateness", "late_us", "lateness: frames over log10 of µs")
# Where the bars stand: the middle of each bin, and half a decade beyond the last edge.
_ABSCISSA: Final = np.array(
    [np.log10(high) - 0.15 for high in EDGES_US] + [np.log10(EDGES_US[-1]) + 0.15], dtype=np.float64
)
Send = Callable[[str, Any, Any], None]


class Times:
    """Sends the timing of one flight, block after block."""

    def __init__(self, send: Send) -> None:
        """``send``: path, time columns, columns."""
        self._send = send
        self._counts = {bars: np.zeros(BINS, np.int64) for bars in (REPLIES, LATENESS)}

    def send(self, timing: NDArray[Any], nanoseconds: NDArray[np.float64]) -> None:
        """Send ``timing`` (n,) of TIMING at these times of the flight, and histograms so far at the last of them."""
        arrays = {name: pa.array(np.ascontiguousarray(timing[name])) for name in TIMING.names or ()}
        fields = [pa.field(name, pa.float64(), nullable=False) for name in arrays]
        structs = pa.StructArray.from_arrays(list(arrays.values()), fields=fields)
        columns = rr.DynamicArchetype.columns(archetype=ARCHETYPE, components={"message": structs})
        self._send(PATH, [time_column(nanoseconds)], columns)
        for bars, counts in self._counts.items():
            counts += binned(timing[bars.field])
            if timing[bars.field].any():
                drawn = rr.BarChart.columns(values=[counts], abscissa=[_ABSCISSA], color=[PALETTE[0]])
                self._send(bars.path, [time_column(nanoseconds[-1:])], drawn)
