"""The lanes' clocks: when each samples, ahead of the plant's instant, and how they are kept together.

A lane measures how far the others whose messages arrive are ahead of it.  It moves by a share, ``sync_gain``, of the
fault-tolerant midpoint: the mean of the middle two of what it measured, its own 0 included; the middle one of three.
One clock that runs away has no part in it.  The last lane that is engaged, or in step with those, gives the plant's
instant: a lane that is a hair later than the plant would sample a whole frame earlier.
Source: Lundelius Welch and Lynch 1988, A new fault-tolerant algorithm for clock synchronization.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.computer.lanes.computers_table import Config
from rig.core.frame import COMPUTERS
from rig.core.kernels import kernel

_LANES: Final = len(COMPUTERS)
_IN_STEP: Final = 0.01  # frames
CLOCK: Final = np.dtype(
    [
        ("fitted", "i8"),
        ("gain", "f8"),  # 0: the clocks run free
        ("drift", "f8", (_LANES,)),  # frames a frame
        ("lead", "f8", (_LANES,)),  # frames ahead of the plant's instant, in [0, 1)
        ("next", "f8", (_LANES,)),  # workspace
        ("measured", "f8", (_LANES,)),  # workspace
    ],
    align=True,
)


class ClockData(NamedTuple):
    """The clocks, and the skew of the sensors without them."""

    clock: NDArray[Any]  # (1,) CLOCK, in place
    skew: NDArray[np.float64]  # (S, 4) frames


def clocks(config: Config, rate_hz: float, skew: NDArray[np.float64], seeds: SeedSequence) -> ClockData:
    """Return the clocks at the first frame; skew : (S, 4) frames, of the sensors."""
    clock = np.zeros(1, CLOCK)
    drift = np.random.default_rng(seeds).uniform(-1.0, 1.0, _LANES)
    clock["fitted"], clock["gain"] = config.count, config.sync_gain if config.synchronised else 0.0
    clock["drift"] = 1e-6 * config.clock_drift_ppm * drift
    clock["lead"][0, : config.count] = np.array(config.clock_offsets_s[: config.count]) * rate_hz
    return ClockData(clock, skew.copy())


@kernel
def sample_early(sensors, skew, lead):
    """Let each lane's sensors sample at the times of its clock.

    sensors : (S,) PARAMS of theirs;  skew : (S, 4) frames without the clocks;  lead : (4,) frames
    """
    for s in range(len(sensors)):
        skewed = sensors[s]["skew"]
        for i in range(len(lead)):
            skewed[i] = skew[s, i] + lead[i]


@kernel
def run_on(clock, silent, counted, drift):
    """Run the clocks on to the next frame; clock : CLOCK, in place.

    silent : (lanes, lanes) frames, receiver by sender, in which no message came: these are not measured
    counted : (lanes,) whose clocks count: those of engaged lanes;  drift : (lanes,) frames a frame, of faults
    """
    lead, after, measured, last = clock["lead"], clock["next"], clock["measured"], np.inf
    for i in range(clock["fitted"]):
        n = 0
        for j in range(clock["fitted"]):
            if silent[i, j] == 0 and (counted[j] or i == j):
                insert(measured, n, lead[j] - lead[i])
                n += 1
        midpoint = 0.5 * (measured[n // 2] + measured[(n - 1) // 2])
        after[i] = lead[i] + clock["gain"] * midpoint + (clock["drift"][i] + drift[i])
        if counted[i]:
            last = min(last, after[i])
    if last == np.inf:
        last = after[0]
    engaged = last
    for i in range(clock["fitted"]):
        if engaged - after[i] < _IN_STEP:
            last = min(last, after[i])
    for i in range(clock["fitted"]):
        ahead = after[i] - last
        lead[i] = ahead - np.floor(ahead)


@kernel
def insert(ordered, n, x):
    """Put x in its place among the first n of ``ordered``."""
    while n > 0 and ordered[n - 1] > x:
        ordered[n] = ordered[n - 1]
        n -= 1
    ordered[n] = x
