"""Statistics of a baseline manager over rows, frame by frame and signal by signal, and their isolations by level.

For a calibration: the statistics isolate no channel, so that one run shows the effect of every level.  A
level is one of the settings ``ManagerKind.settings.levels``: one, or one each for 4, 3 and 2 samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.bench.drive import step
from rig.computer.redundancy.managers import Manager
from rig.core.frame import CHANNELS, Nested
from rig.core.kernels import long_kernel


class Statistics(NamedTuple):
    """Statistics of n rows and S signals."""

    statistic: NDArray[np.float64]  # (n, S, 4), in the unit of ``limit``; a channel without a sample keeps its last
    alarm: NDArray[np.uint8]  # (n, S), 1 where a channel would be failed


def statistics(rows: Nested, baseline: str, params: NDArray[np.void]) -> Statistics:
    """Run a baseline manager over ``rows`` (n,), and write votes and states into them.

    baseline : of managers.BASELINES; params : (S,) of managers.with_settings
    """
    manager = Manager(baseline, params.copy(), watches=True)
    result = Statistics(np.zeros((len(rows), len(params), CHANNELS)), np.zeros((len(rows), len(params)), np.uint8))
    _watch(rows, manager.data, *result)
    return result


@long_kernel
def _watch(rows, manager, statistic, alarm):
    for k in range(len(rows)):
        step(rows[k], rows[k], k, None, None, None, manager, None)
        for s in range(len(manager.state)):
            state = manager.state[s]
            alarm[k, s] = state["alarm"]
            for c in range(statistic.shape[2]):
                statistic[k, s, c] = state["statistic"][c]
