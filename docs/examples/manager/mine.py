"""Two managers: copy this file beside your scenario and fly ``--set redundancy.manager=mine:Smoothed``."""

import numba
import numpy as np

from rig.core.units.angles import into_range, unwrap


class Smoothed:
    """Median of the channels in use; fails a channel whose smoothed distance from it exceeds the limit."""

    calibrate = "limit"  # what `rig benchmark` chooses
    limit = 1.0  # thresholds

    def __init__(self, params):
        # params: one record a signal (rig.computer.redundancy.manager_config.PARAMS): threshold, low, high, wraps ...
        self.low, self.high, self.wraps = (params[name].copy() for name in ("low", "high", "wraps"))
        self.threshold = params["threshold"][:, None]
        self.fitted = np.arange(4) < params["fitted"][:, None]
        self.failed = np.zeros((len(params), 4), bool)
        self.distance = np.zeros((len(params), 4))
        self.vote = np.full(len(params), np.nan)

    def step(self, bus, fcc, k):
        """Vote and monitor row k."""
        read, write = bus[k], fcc[k]  # fields: rig.frame.BUS and FCC
        channels = read["channels"]
        in_range = (self.low[:, None] <= channels) & (channels <= self.high[:, None])  # False for NaN
        usable = self.fitted & ~self.failed & (read["valid"] == 1) & in_range
        # An angle is no plain number: 359 deg and 1 deg are 2 deg apart.  unwrap puts them side by side.
        samples = unwrap(np.where(usable, channels, np.nan), self.vote, self.wraps)
        some = usable.any(axis=1)
        median = np.nanmedian(samples[some], axis=1)
        off = np.full_like(samples, np.inf)
        off[some] = np.where(usable[some], np.abs(samples[some] - median[:, None]), np.inf)
        self.vote[some] = into_range(median, self.low[some], self.high[some], self.wraps[some])
        self.distance += 0.1 * (np.minimum(off, 10 * self.threshold) - self.distance)
        self.failed |= self.fitted & (self.distance > self.limit * self.threshold)
        write["voted"][:] = np.where(np.isfinite(self.vote), self.vote, 0.0)
        write["state"][:] = np.where(self.failed, 2, np.where(self.fitted, 0, 3))
        write["level"][:] = (self.fitted & ~self.failed).sum(axis=1)


STATE = np.dtype([("vote", "f8")])


@numba.njit(cache=True)
def first_valid(bus, fcc, k, params, state):
    """Vote the first valid channel; hold the last vote if no channel is valid."""
    for s in range(len(params)):
        for c in range(params[s]["fitted"]):
            if bus[k]["valid"][s, c] != 0 and np.isfinite(bus[k]["channels"][s, c]):
                state[s]["vote"] = bus[k]["channels"][s, c]
                break
        fcc[k]["voted"][s] = state[s]["vote"]
        fcc[k]["level"][s] = params[s]["fitted"]
