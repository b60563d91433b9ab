"""What is worked out for the viewer from the rows, and is not in the log: deviations and threshold bands.

    rig.Band       low, high: vote -+ threshold; fault: the vote while a fault on the signal acts
    rig.Deviation  the vote and channels 1 .. 4, all less truth, as a list: the viewer draws it as one

On the scale of the signal itself four good channels lie on one another, and one hardover squeezes the rest flat;
as deviations they can be told apart.  There, what the monitor suspects or has failed is left out, and what is
further from the vote than the threshold, and the plot's scale fits the channels in good standing.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rig.frame import SIGNALS, TWO_PI, Block, Signal, State
from rig.view.facts import Facts
from rig.view.lanes import acting

BAND: Final = "rig.Band"
DEVIATION: Final = "rig.Deviation"


def fault_acts(rows: Block, facts: Facts) -> dict[str, NDArray[np.bool_]]:
    """For each signal with faults on it, whether one acts: (n,) by the signal's name."""
    acts = acting(rows, len(facts.faults))
    on = {signal.name: facts.faults_on(signal.name) for signal in SIGNALS}
    return {name: np.asarray(acts[:, numbers].any(axis=1)) for name, numbers in on.items() if numbers}


def band(rows: Block, index: int, threshold: float, acts: NDArray[np.bool_] | None) -> pa.StructArray:
    """Fields low, high and fault of signal ``index`` in every row; NaN where there is none."""
    voted = np.ascontiguousarray(rows["voted"][:, index])
    fault = np.full(len(rows), np.nan) if acts is None else np.where(acts, voted, np.nan)
    columns = [pa.array(column) for column in (voted - threshold, voted + threshold, fault)]
    return pa.StructArray.from_arrays(columns, names=["low", "high", "fault"])


def deviation(rows: Block, index: int, threshold: float) -> NDArray[np.float64]:
    """Vote and channels of signal ``index``, less truth: (n, 1 + channels); NaN where a channel is not trusted."""
    signal = SIGNALS[index]
    truth, voted = rows["truth"][:, index, None], rows["voted"][:, index, None]
    shown = _apart(signal, np.column_stack([voted, rows["channels"][:, index, : signal.channels]]), truth)
    with np.errstate(invalid="ignore"):  # a flight that ends not finite
        far = np.abs(_apart(signal, shown[:, 1:], shown[:, :1])) > threshold
    trusted = (rows["state"][:, index, : signal.channels] == State.OK) & ~far
    shown[:, 1:] = np.where(trusted, shown[:, 1:], np.nan)
    return shown


def _apart(signal: Signal, values: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """``values`` (n, m) less ``base`` (n, 1), the short way round where the signal wraps."""
    with np.errstate(invalid="ignore"):
        apart = values - base
        return apart - TWO_PI * np.rint(apart / TWO_PI) if signal.wraps else apart
