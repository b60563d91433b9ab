"""The last channel: nobody is left to compare it with, but its own monitor and its reference can dispute it.

Source: docs/redundancy.md, 'The last channel' (Zhang 2023 leaves it open).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.frame import Ilm, Resolver
from rig.kernels import kernel
from rig.units.angles import difference

# With 1.0 reference thresholds healthy last channels were failed in 11 of 384 flights, with 1.5 in none.
REFERENCE_MARGIN: Final = 1.5


@kernel
def check_last(ilm, reference, p, st):
    """Level 1: the last channel against its own monitor and its reference, as nobody is left to compare it with.

    While either speaks against it the reference votes if it is usable, else the last vote holds.
    """
    c = st["order"][0]
    sample = st["x"][c]
    usable = st["reference_usable"] and not np.isnan(reference)
    off = usable and abs(difference(sample, reference, p["wraps"])) > REFERENCE_MARGIN * st["reference_threshold"]
    if ilm[c] != Ilm.BAD and not off:
        return Resolver.NONE.value, sample
    st["alone"][c] = True
    instead = reference if usable else (st["vote"] if st["started"] else sample)
    return (Resolver.ILM.value if ilm[c] == Ilm.BAD else Resolver.REFERENCE.value), instead
