"""How far each channel and the vote are from the truth: the picture in which four good channels can be told apart.

On the scale of the signal itself they lie on one another, and one hardover squeezes the rest flat.  So what the
monitor suspects or has failed is left out, and the plot's scale fits the channels in good standing.
Derived for the viewer only, from live rows and from a log's structs alike; not part of the log.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rig.frame import SIGNALS, TWO_PI, Block, Signal, State

ARCHETYPE: Final = "rig.Deviation"


def path(signal: Signal) -> str:
    """Where the viewer finds the deviation of ``signal``."""
    return f"/deviation/{signal.name}"


def from_rows(rows: Block, index: int) -> pa.StructArray:
    """The deviations of signal ``index`` in every row."""
    values, truth = rows["channels"][:, index], rows["truth"][:, index]
    trusted = rows["state"][:, index] == State.OK
    return _struct(SIGNALS[index], values, rows["voted"][:, index], truth, trusted)


def from_structs(message: pa.StructArray, index: int) -> pa.StructArray:
    """The same from the structs ``rig.Signal:message`` of a log."""

    def of(field: str, *more: str) -> NDArray[Any]:
        array: Any = message.field(field)
        return (array.field(more[0]) if more else array).to_numpy(zero_copy_only=False)

    numbers = range(1, SIGNALS[index].channels + 1)
    values = np.column_stack([of(f"ch_{i}") for i in numbers])
    trusted = np.column_stack([of(f"st_{i}", "value") for i in numbers]) == State.OK
    return _struct(SIGNALS[index], values, of("voted"), of("truth"), trusted)


def _struct(
    signal: Signal,
    values: NDArray[np.float64],
    voted: NDArray[np.float64],
    truth: NDArray[np.float64],
    trusted: NDArray[np.bool_],
) -> pa.StructArray:
    """Fields ch_1 .. and voted, NaN where a channel is not trusted; values and trusted are (n, channels)."""
    shown = np.column_stack([np.where(trusted, values, np.nan)[:, : signal.channels], voted]) - truth[:, None]
    if signal.wraps:
        shown -= TWO_PI * np.rint(shown / TWO_PI)  # the short way round
    names = [*(f"ch_{i + 1}" for i in range(signal.channels)), "voted"]
    return pa.StructArray.from_arrays([pa.array(column) for column in np.ascontiguousarray(shown.T)], names=names)
