"""Constant delays between instances: told, and taken off.

Vibration is coherent between instances, with another phase in each, and would be taken for a delay.  So delays are
estimated without what is faster than a few hertz, and one is accepted only if the slow motion, on which the instances
are compared, agrees better with it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.diagnose.findings import Convention, Findings
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.diagnose.smoothing import changes, smoothed, spread, without_hum
from rig.log.recordings.delays import delays
from rig.log.recordings.stamps import Floats

_LEAST_ROWS: Final = 400  # in which a delay can be estimated
_MOST_ROWS: Final = 100_000  # that are used
_SAMPLED_HZ: Final = 120.0
_FAST_S: Final = 0.1  # shorter than this is left out
_SLOW_S: Final = 0.5
_ALIKE: Final = 0.7  # correlation without the delay
_TOLD: Final = 0.6  # of a row
_TOLD_S: Final = 2e-3
_NEAR_ROWS: Final = 1.0  # of a delay without the strongest frequencies, or
_NEAR: Final = 0.3  # of it
_ALIKE_LEFT: Final = 0.4  # correlation then
_BETTER: Final = 0.85  # of the difference that is left without the delay


def take_off_delays(group: Group, x: Floats, found: Findings) -> bool:
    """Tell instances that are late, by the axis that moves most, and shift them in ``x`` (axes, C, n), without NaN.

    Return True if the delays of all instances could be measured.
    """
    rate_hz, n = group.rate_hz, x.shape[-1]
    step = max(1, round(rate_hz / _SAMPLED_HZ))
    if n // step < _LEAST_ROWS:
        return False
    used = x[..., : n - n % step].reshape(*x.shape[:-1], -1, step).mean(axis=-1)[..., :_MOST_ROWS]
    used_hz = rate_hz / step
    fast, slow, lag = (max(1, round(seconds * used_hz)) for seconds in (_FAST_S, _SLOW_S, 0.5))
    made = changes(smoothed(smoothed(used, fast), fast), lag)
    axis = int(np.argmax([min(spread(column) for column in own) for own in made]))
    late, tied, alike = delays(list(made[axis]))
    means = smoothed(smoothed(used, slow), slow)
    reference = int(np.argmin(np.where(tied, np.abs(late), np.inf)))
    steady = _without_hum_too(made[axis], late)
    at = np.arange(n, dtype=np.float64)
    accepted = (tied & (alike > _ALIKE)).tolist()
    for c, instance in enumerate(group.instances):
        seconds = float(late[c]) / used_hz
        if not accepted[c] or abs(late[c]) < _TOLD or abs(seconds) < _TOLD_S:
            continue
        if not steady[c] or not _agrees_better(means, c, reference, float(late[c]), lag):
            accepted[c] = False
            continue
        x[:, c] = [np.interp(at + late[c] * step, at, column) for column in x[:, c]]
        against = "the other" if len(group.instances) == 2 else "the others"
        text = f"{abs(seconds) * 1e3:.0f} ms {'behind' if seconds > 0 else 'ahead of'} {against}"
        found.conventions.append(Convention(group.name, instance, "delay", round(seconds, 4), text))
    return all(accepted)


def _without_hum_too(made: Floats, late: Floats) -> NDArray[np.bool_]:
    """Return (C,) True if what changes (C, n) has the same delay without its strongest frequencies: no hum."""
    if (np.abs(late) < _TOLD).all():
        return np.ones(len(late), np.bool_)
    again, tied, alike = delays(list(without_hum(made)))
    near = np.abs(again - late - np.median(again - late)) < np.maximum(_NEAR_ROWS, _NEAR * np.abs(late))
    return near & tied & (alike > _ALIKE_LEFT)


def _agrees_better(means: Floats, c: int, reference: int, late: float, lag: int) -> bool:
    """Return True if the slow motion (axes, C, n) of instance c agrees better with the reference without the delay."""
    at = np.arange(means.shape[-1], dtype=np.float64)
    shifted = np.array([np.interp(at + late, at, column) for column in means[:, c]])
    inside = slice(int(abs(late)) + 1, means.shape[-1] - int(abs(late)) - 1)
    before, after = (
        float(np.mean(changes(own[:, inside] - means[:, reference, inside], lag) ** 2))
        for own in (means[:, c], shifted)
    )
    return after < _BETTER**2 * before
