"""Parameters and state of the control law, one record each.

Plain records, so that copying the state copies the law: for a replay, or to try what would happen.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import AUTOPILOT_COMMANDS, COMMANDS, SURFACES, S

# Places of ``command``.
(
    C_Q, C_P, C_BETA, C_THETA, C_PHI, C_ALTITUDE, C_PSI, C_SPEED, C_PRESSURE_ALTITUDE, C_EAS, C_GAMMA
) = range(len(COMMANDS))  # fmt: skip

# What evolves from frame to frame; the captured values change at engagement only.
DYNAMIC: Final = (
    *("elevator_integral", "aileron_integral", "rudder_integral", "throttle_integral"),
    *("altitude_reference", "altitude_rate", "altitude_integral", "altitude_estimate"),
    *("climb_rate", "acceleration_error"),
    *("airspeed", "schedule_pressure", "smooth_pitch_angle", "smooth_roll_angle", "smooth_heading"),  # filtered
    "lift_error",  # rad: angle of attack less what the load factor says of it
    "turn_error",  # sine of bank from the turn less that measured
    "path_error",  # rad: climb angle through the air less that of the pressure altitude
    "backup_alpha",  # rad, from the commanded one
    "backup_pitch_rate",
    "backup_elevator",  # rad, from the integral
)
CAPTURED: Final = ("pitch_angle", "roll_angle", "altitude", "heading", "held_airspeed")
STATE: Final = np.dtype(
    [
        *((name, "f8") for name in (*DYNAMIC, *CAPTURED)),
        ("measured", "f8", (S,)),  # the last finite value of each signal; NaN until there is one
        ("rate_bias", "f8", (3,)),  # what the models of pitch, roll and yaw rate lack, rad/s2
        ("deflection", "f8", (3,)),  # their surfaces behind the actuators' lag
        ("fade", "f8", (S,)),  # the jump of the last change of source, being taken out
        ("fade_left", "i8", (S,)),  # frames
        ("source", "u1", (S,)),  # frame.Source
        ("autopilot_command", "f8", (len(AUTOPILOT_COMMANDS),)),  # the last finite one, 0 until there is one
        ("command", "f8", (len(COMMANDS),)),
        ("surface", "f8", (len(SURFACES),)),
        ("started", "i8"),
        ("law", "i8"),  # AUTOPILOT or STICK
        ("ground", "i8"),  # weight on wheels is voted: integrators stand still, the outer loops hold
        ("approach", "i8"),  # gear down is voted: narrower limits
        ("backup", "i8"),  # whether the back-up law has the elevator
    ],
    align=True,
)


class ControlData(NamedTuple):
    """Data of the control law besides the row."""

    pressures: NDArray[np.float64]  # (P,) dynamic pressures of the gain schedule
    table: NDArray[np.float64]  # (P, G) gains there
    param: NDArray[Any]  # (1,) autopilot.PARAM
    state: NDArray[Any]  # (1,) STATE, in place
    gain: NDArray[np.float64]  # (G,) workspace: the gains of this frame
    fdi_param: NDArray[Any]  # of the fault-tolerant law (fdi/state.py)
    fdi: NDArray[Any]  # its state, in place
