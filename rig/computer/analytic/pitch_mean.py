"""The filter's mean apart from its covariance, so that a second one can go along with the same gains."""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.kernels import kernel

MEAN: Final = np.dtype([(name, "f8") for name in ("theta", "drift", "path", "scale", "rate")], align=True)


@kernel
def carry(dt, mean, rate, last, share, moved):
    """Theta of ``mean``, a STATE or a MEAN record, by its ``rate`` and the ``last`` one less drift and scale error."""
    mean["theta"] += 0.5 * dt * (rate + last) - share * mean["drift"] + moved * mean["scale"]


@kernel
def move(g, mean, innovation):
    """Move ``mean``, a STATE or a MEAN record, by the gain ``g`` (4,) times its ``innovation`` [rad]."""
    mean["theta"] += g[0] * innovation
    mean["drift"] += g[1] * innovation
    mean["path"] += g[2] * innovation
    mean["scale"] += g[3] * innovation
