"""How far a sample may be from its reference.

A constant for each signal.  A reference of the dynamic pressure that knows the speed over ground only has a second
bound, and the less of the two counts: wind is its error, and the same wind is more pascals the faster the aircraft
flies.  With w the equivalent airspeed of the wind,

    d(q_bar) = d(rho0 v^2 / 2) = rho0 v w = sqrt(2 rho0 q_bar) w

Source: docs/references.md, 'Measured errors'.
"""

from __future__ import annotations

import math

from rig.kernels import kernel
from rig.units.constants import DENSITY_PRINTED


@kernel
def reference_threshold(reference, p):
    """Threshold of a reference [unit of the signal]; p : one config.PARAMS record.  NaN has the constant."""
    if p["reference_airspeed_m_s"] > 0.0 and reference > 0.0:
        of_wind = p["reference_airspeed_m_s"] * math.sqrt(2.0 * DENSITY_PRINTED * reference)
        return min(of_wind, p["reference_threshold"])
    return p["reference_threshold"]
