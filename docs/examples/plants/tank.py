"""Ten lines that `rig search` can search: a tank that is filled and must not overflow."""

import numpy as np


def tank(inflow, drain, duration_s):
    """Fill a tank of 1 m2; inflow in m3/s, drain in m2."""
    times = np.arange(0.0, duration_s, 0.1)
    level = np.zeros(len(times))
    for k in range(1, len(times)):
        out = drain * np.sqrt(2.0 * 9.81 * max(level[k - 1], 0.0))
        level[k] = level[k - 1] + 0.1 * (inflow(times[k]) - out)
    return times, {"level": level}
