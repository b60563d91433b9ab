"""Constant delays between instances: told, and taken off."""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.bench.diagnose.findings import Convention, Findings
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.diagnose.smoothing import changes, spread
from rig.log.recordings.delays import delays
from rig.log.recordings.stamps import Floats

_LEAST_ROWS: Final = 400  # in which a delay can be estimated
_MOST_ROWS: Final = 100_000  # that are used
_SAMPLED_HZ: Final = 120.0
_ALIKE: Final = 0.7  # correlation without the delay
_TOLD: Final = 0.6  # of a row
_TOLD_S: Final = 2e-3


def take_off_delays(group: Group, x: Floats, found: Findings) -> bool:
    """Tell instances that are late, by the axis that moves most, and shift them in ``x`` (axes, C, n), without NaN.

    Return True if the delays of all instances could be measured.
    """
    rate_hz, n = group.rate_hz, x.shape[-1]
    step = max(1, round(rate_hz / _SAMPLED_HZ))
    if n // step < _LEAST_ROWS:
        return False
    used = x[..., : n - n % step].reshape(*x.shape[:-1], -1, step).mean(axis=-1)[..., :_MOST_ROWS]
    made = changes(used, max(1, round(0.5 * rate_hz / step)))
    axis = int(np.argmax([min(spread(column) for column in own) for own in made]))
    late, tied, alike = delays(list(made[axis]))
    at = np.arange(n, dtype=np.float64)
    for c, instance in enumerate(group.instances):
        seconds = float(late[c]) * step / rate_hz
        if not tied[c] or alike[c] < _ALIKE or abs(late[c]) < _TOLD or abs(seconds) < _TOLD_S:
            continue
        x[:, c] = [np.interp(at + late[c] * step, at, column) for column in x[:, c]]
        against = "the other" if len(group.instances) == 2 else "the others"
        text = f"{abs(seconds) * 1e3:.0f} ms {'behind' if seconds > 0 else 'ahead of'} {against}"
        found.conventions.append(Convention(group.name, instance, "delay", round(seconds, 4), text))
    return bool((tied & (alike > _ALIKE)).all())
