"""A body rate that is not measured: what is said of it, smoothed by what the aircraft must do.

A rate from attitudes or from a reference is noisy, and a filter that is slow enough for the surfaces costs
the loop its phase.  The designed model of the axis bridges it: an observer with an unknown constant,

    x' = K_i incidence + K_x x + K_s surface + b + 2 w (said - x)      b' = w^2 (said - x)

incidence is the angle of attack or of sideslip, surface the commanded one behind its actuator's lag.  The
estimate goes on from the last measurement; when nothing is said of the rate the model alone goes on.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.control import laws
from rig.computer.control.source import carry
from rig.frame import sig
from rig.kernels import kernel

# Pitch, roll and yaw rate are signals 0, 1 and 2, and so are the surfaces that move them.
_MODEL: Final = (laws.Q_ALPHA, laws.P_BETA, laws.R_BETA)  # the first of three gains of each axis
_VOTED: Final = 0


@kernel
def estimate(i, said, source, param, state, gain):
    """Make signal ``i``, a body rate, the estimate from what is ``said`` of it (NaN: nothing)."""
    s, c = state[0], param[0]
    measured, surface, bias, deflection = s["measured"], s["surface"], s["rate_bias"], s["deflection"]
    x, k = measured[i], _MODEL[i]
    if not math.isfinite(x):
        x = said if math.isfinite(said) else 0.0
    model = gain[k] * measured[sig.ALPHA if i == 0 else sig.BETA] + gain[k + 1] * x
    if s["source"][i] == _VOTED or s["started"] == 0:
        deflection[i] = surface[i]
        bias[i] = -model - gain[k + 2] * deflection[i]
    model += gain[k + 2] * deflection[i] + bias[i]
    deflection[i] += min(c["dt"] / c["lag_s"][i], 1.0) * (surface[i] - deflection[i])
    w = c["rate_bandwidth_rad_s"]
    if math.isfinite(said):
        bias[i] += c["dt"] * w * w * (said - x)
        model += 2.0 * w * (said - x)
    carry(i, x + c["dt"] * model, source, state)
