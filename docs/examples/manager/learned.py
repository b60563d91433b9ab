"""A learned monitor: logistic regression on four features of each channel's residual, weights in learned.json.

The evidence that a channel is faulty is the weighted sum of its features: its log odds but for a constant.

    rig fly --set redundancy.manager=learned:Learned
    rig benchmark docs/examples/benchmark.toml --managers learned:Learned --healthy HEALTHY --out DIR

train_learned.py makes the weights.  Copy this file and learned.json beside your scenario.
"""

import json
from pathlib import Path

import numpy as np

from rig.core.units.angles import into_range, unwrap

SHORT, LONG, PERSISTENCE = 100, 1000, 8  # frames


class Features:
    """Four features of n signals by 4 channels; residuals are in thresholds."""

    def __init__(self, n):
        self.last = np.zeros((PERSISTENCE, n, 4))
        self.beyond = np.zeros((n, 4), int)  # frames in a row beyond a threshold
        self.frames = np.zeros((n, 4))
        self.short, self.long, self.spread = (np.zeros((n, 4)) for _ in range(3))

    def update(self, residual):
        """Take in the residuals (n, 4) of a frame, NaN where there is none; return the features, (n, 4, 4).

        Means stand still for a residual beyond a threshold until it has lasted: a burst of 7 frames moves nothing.
        """
        here = np.isfinite(residual)
        r = np.where(here, residual, 0.0)
        self.beyond = np.where(np.abs(r) > 1.0, self.beyond + 1, 0)
        takes = here & ((self.beyond == 0) | (self.beyond >= PERSISTENCE))
        self.frames += takes
        clipped = np.clip(r, -1.0, 1.0)
        for mean, frames in ((self.short, SHORT), (self.long, LONG)):
            mean += np.where(takes, (clipped - mean) / np.clip(self.frames, 1, frames), 0.0)
        self.spread += np.where(takes, (np.abs(clipped - self.short) - self.spread) / SHORT, 0.0)
        self.last = np.roll(self.last, 1, axis=0)
        self.last[0] = r
        slow_faults = np.maximum(self.last.min(axis=0), -self.last.max(axis=0))  # on one side in all of the last frames
        features = (np.clip(slow_faults, 0.0, 3.0), np.abs(self.short - self.long), np.abs(self.short), self.spread)
        return np.stack(features, axis=-1)


class Learned:
    """Median of the channels in use; fails a channel whose evidence exceeds the limit for 8 frames."""

    calibrate = "limit"  # what a benchmark chooses
    limit = 12.0

    def __init__(self, params):
        self.low, self.high, self.wraps = (params[name].copy() for name in ("low", "high", "wraps"))
        self.threshold = params["threshold"][:, None].copy()
        self.fitted = np.arange(4) < params["fitted"][:, None]
        self.failed = np.zeros((len(params), 4), bool)
        self.above = np.zeros((len(params), 4), int)
        self.vote = np.full(len(params), np.nan)
        self.features = Features(len(params))
        self.weights = np.array(json.loads(Path(__file__).with_name("learned.json").read_text())["weights"])

    def step(self, bus, fcc, k):
        """Vote and monitor row k."""
        read, write = bus[k], fcc[k]
        channels = read["channels"]
        in_range = (self.low[:, None] <= channels) & (channels <= self.high[:, None])  # False for NaN
        usable = self.fitted & ~self.failed & (read["valid"] == 1) & in_range
        samples = unwrap(np.where(usable, channels, np.nan), self.vote, self.wraps)
        some = usable.any(axis=1)
        self.vote[some] = np.nanmedian(samples[some], axis=1)
        evidence = self.features.update((samples - self.vote[:, None]) / self.threshold) @ self.weights
        bad = self.fitted & ~self.failed & ((evidence > self.limit) | ~usable)
        self.above = np.where(bad, self.above + 1, 0)
        rows = np.arange(len(evidence))
        worst = np.where(self.above >= PERSISTENCE, np.where(usable, evidence, np.inf), -np.inf).argmax(axis=1)
        alone = usable.sum(axis=1) < 3  # of two, it is not known which
        fails = (self.above[rows, worst] >= PERSISTENCE) & ~(alone & usable[rows, worst])
        self.failed[rows[fails], worst[fails]] = True  # one a frame
        self.vote[some] = into_range(self.vote[some], self.low[some], self.high[some], self.wraps[some])
        write["voted"][:] = np.where(np.isfinite(self.vote), self.vote, 0.0)
        write["state"][:] = np.where(self.failed, 2, np.where(self.fitted, 0, 3))
        write["level"][:] = (self.fitted & ~self.failed).sum(axis=1)
