"""Design the limits of the slow-fault rules from healthy flights (docs/explanation/decisions.md).

slow    the series of the CUSUM is, in each frame, the largest allowance with which it isolates a channel; its tail
        gives ``slow_allowance``, for a limit in spreads of the residuals times frames
stale   the longest run of repeats times 3: if runs have a geometric law, data of N frames have to be N^2 times longer
        for one run of that length; the rule is off if a healthy channel stands still
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.slow_faults import NO_CHANNEL, begin_sums, watch_sums
from rig.computer.redundancy.state import new_state
from rig.core.frame import Pattern
from rig.core.kernels import long_kernel
from rig.core.runs import runs
from rig.core.threads import heed
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.pieces import parameters

Floats = NDArray[np.float64]
Rule = Literal["slow", "stale"]
RULES: Final[tuple[Rule, ...]] = ("slow", "stale")
OFF: Final[dict[Rule, dict[str, float | None]]] = {
    "slow": {"slow_allowance": None, "slow_limit": None},
    "stale": {"stale_frames": 0},
}
LIMITS: Final = (24.0, 60.0, 120.0)  # of the sums: spreads times frames
ALLOWANCES: Final = 2.0 ** np.linspace(-6.0, 2.0, 25)  # spreads
MARGIN: Final = 3
LEAST_FRAMES: Final = 10  # of ``stale_frames``
STILL_S: Final = 1.0  # repeats of a healthy channel from which there are none


def alarms(residuals: Floats, settings: RecordedSignal, rate_hz: float, allowances: Floats) -> Floats:
    """Return (n,) the largest of ``allowances`` with which the CUSUM isolates a channel in a frame, or 0.

    The CUSUM starts again after each isolation.
    residuals : (n, CHANNELS), NaN where a sample is not compared; settings : with the limit
    """
    heed()
    params = np.repeat(parameters(settings, residuals.shape[1], rate_hz), len(allowances))
    params["slow_allowance"] = allowances
    alarm = np.zeros(len(residuals))
    _sum_up(residuals, params, new_state(params), alarm)
    return alarm


def stale_frames(flights: Sequence[Floats], rate_hz: float) -> int:
    """Return the count of repeats for healthy flights (C, n); 0 if a channel repeats for STILL_S."""
    spans = [runs(column) for samples in flights for column in samples]
    longest = max((int((each[:, 1] - each[:, 0]).max()) - 1 for each in spans if len(each)), default=0)
    count = max(LEAST_FRAMES, MARGIN * longest)
    return count if longest < STILL_S * rate_hz else 0


@long_kernel
def _sum_up(residuals, params, state, out):
    """Write the alarms; the residuals stand in the place of the samples, of which the middle is 0."""
    for j in range(len(params)):
        p, st = params[j], state[j]
        x, order = st["x"], st["order"]
        st["pattern"] = Pattern.NORMAL
        for k in range(len(residuals)):
            n = 0
            for c in range(p["fitted"]):
                x[c] = residuals[k, c]
                if np.isfinite(x[c]):
                    order[n] = c
                    n += 1
            if watch_sums(0.0, n, p, st) != NO_CHANNEL:
                out[k] = max(out[k], p["slow_allowance"])
                begin_sums(st)
